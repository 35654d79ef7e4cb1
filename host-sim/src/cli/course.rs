//! `host-sim course FILE`.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::course::{Sample, Survey, survey};
use haptic_batch::files::open_course;
use haptic_report::document::write_file;
use haptic_report::studies::course as files;

use super::output::Output;
use super::road::LaneArguments;
use super::{BadInput, Outcome, print, print_json, print_notes, width};

/// Columns and rows of the picture in the terminal; a character holds 2 by 4 dots.
const PICTURE: [usize; 2] = [72, 20];

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Course file: OpenDRIVE 1.4 to 1.8 (.xodr), TOML (see docs/files.md), or paper-course
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    lane: LaneArguments,
    /// Print one JSON object: length_m, and samples every metre of the lane's centre in the direction of travel
    /// (s_m, x_m, y_m, heading_rad, curvature_1pm, bank_rad, grade, width_m). Curvature is positive in a left curve,
    /// bank_rad where the left edge is the higher one
    #[arg(long)]
    json: bool,
    /// Directory for figures, samples (CSV, JSON) and a report; default: no files
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Save the course as an OpenDRIVE file: one road whose lane -1 is the course
    #[arg(long, value_name = "FILE.xodr")]
    save: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let course = open_course(&arguments.file, &arguments.lane.choice())?;
    let survey = survey(&course);
    if let Some(directory) = &arguments.out {
        Output::begin(directory, "course")?.finish(|place| files::write(&survey, &course, place))?;
        eprintln!("Report: {}", directory.join("report.html").display());
    }
    if let Some(path) = &arguments.save {
        let text = course.to_opendrive();
        write_file(path, |file| file.write_all(text.as_bytes()))?;
        eprintln!("Saved: {}", path.display());
    }
    if arguments.json {
        print_json(&files::stamped(&survey))?;
    } else {
        print(&readable(&survey))?;
    }
    print_notes(&survey.notes);
    Ok(Outcome::Good)
}

fn readable(survey: &Survey) -> String {
    let mut text = format!("{}: {:.2} m", survey.course, survey.length_m);
    for road in &survey.roads {
        let direction = if road.along_s { "along" } else { "against" };
        text.push_str(&format!(
            "\nroad {}, lane {}, driven {direction} its s",
            road.road, road.lane
        ));
    }
    format!(
        "{text}\n\n{}\n{}",
        files::table(survey).to_text(width()),
        picture(survey)
    )
}

/// The plan in dots, with one scale for both axes; o marks the start.
fn picture(survey: &Survey) -> String {
    let [columns, rows] = PICTURE;
    let (mut x, mut y) = (
        [f64::INFINITY, f64::NEG_INFINITY],
        [f64::INFINITY, f64::NEG_INFINITY],
    );
    for sample in &survey.samples {
        x = [x[0].min(sample.x_m), x[1].max(sample.x_m)];
        y = [y[0].min(sample.y_m), y[1].max(sample.y_m)];
    }
    let dots = [2 * columns - 1, 4 * rows - 1].map(|n| n as f64);
    // A dot is as wide as it is high where a character is twice as high as wide.
    let scale = ((x[1] - x[0]) / dots[0]).max((y[1] - y[0]) / dots[1]).max(1e-3);
    let used = (((y[1] - y[0]) / scale) as usize / 4 + 1).min(rows);
    let mut cells = vec![vec![0_u8; columns]; used];
    // Bits of a Braille character by row and column of its dots.
    const BITS: [[u8; 2]; 4] = [[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]];
    let place = |sample: &Sample| {
        let column = ((sample.x_m - x[0]) / scale) as usize;
        let row = ((y[1] - sample.y_m) / scale) as usize;
        [column.min(2 * columns - 1), row.min(4 * used - 1)]
    };
    for sample in &survey.samples {
        let [column, row] = place(sample);
        cells[row / 4][column / 2] |= BITS[row % 4][column % 2];
    }
    let start = survey.samples.first().map(place);
    let mut text = String::new();
    for (row, line) in cells.iter().enumerate() {
        let glyph = |(column, bits): (usize, &u8)| match (start, bits) {
            (Some([c, r]), _) if c / 2 == column && r / 4 == row => 'o',
            (_, 0) => ' ',
            (_, bits) => char::from_u32(0x2800 + u32::from(*bits)).unwrap_or('.'),
        };
        let drawn: String = line.iter().enumerate().map(glyph).collect();
        text.push_str(drawn.trim_end());
        text.push('\n');
    }
    text.push_str(&format!("(o: start; {:.0} m from left to right)\n", x[1] - x[0]));
    text
}
