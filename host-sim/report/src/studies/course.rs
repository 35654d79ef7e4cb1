//! What is shown of a course: its plan, what lies along it, its samples.

use std::path::Path;

use super::curves;
use crate::document::{Block, Cell, Report, Section, Table, WriteError, write_file};
use crate::plot::{Axis, Figure, Series};
use haptic_batch::course::{Sample, Survey};
use haptic_batch::statistics::extent;
use haptic_log::table::TableWriter;
use haptic_sim::models::road::Course;

/// Width over height of a panel of a figure, so that a plan has one scale.
const PANEL_ASPECT: f64 = 4.2;

/// Columns and rows of the picture on a terminal; a character holds 2 by 4 dots.
const PICTURE: [usize; 2] = [72, 20];

/// Writes the samples (CSV).
///
/// # Errors
/// What could not be written.
pub fn write_samples(survey: &Survey, directory: &Path) -> Result<(), WriteError> {
    write_file(&directory.join("course.csv"), |f| {
        let names = "s_m,x_m,y_m,heading_rad,curvature_1pm,bank_rad,grade,width_m";
        let mut table = TableWriter::new(f, names.split(','))?;
        for s in &survey.samples {
            let place = [s.s_m, s.x_m, s.y_m, s.heading_rad];
            let lane = [s.curvature_1pm, s.bank_rad, s.grade, s.width_m];
            table.row(place.into_iter().chain(lane).map(|value| value.to_string()))?;
        }
        table.finish()
    })
}

/// Least and largest values along the lane's centre.
fn table(survey: &Survey) -> Table {
    /// Name, unit, digits, value.
    type Quantity = (&'static str, &'static str, usize, fn(&Sample) -> f64);
    let quantities: [Quantity; 4] = [
        ("Curvature, left positive", "1/m", 5, |s| s.curvature_1pm),
        ("Bank, positive: left edge higher", "rad", 4, |s| s.bank_rad),
        ("Grade, positive uphill", "", 4, |s| s.grade),
        ("Lane width", "m", 3, |s| s.width_m),
    ];
    let row = |(name, unit, decimals, of): (&str, &str, usize, fn(&Sample) -> f64)| {
        let [least, most] = extent(survey.samples.iter().map(of));
        [
            ("Along the lane's centre", Cell::text(name)),
            ("Least", Cell::number(least, decimals)),
            ("Most", Cell::number(most, decimals)),
            ("Unit", Cell::text(unit)),
        ]
    };
    Table::of_rows("", quantities.map(row))
}

fn plan(survey: &Survey) -> Figure {
    let points: Vec<(f64, f64)> = survey.samples.iter().map(|s| (s.x_m, s.y_m)).collect();
    let [left, right] = extent(points.iter().map(|p| p.0));
    let [low, high] = extent(points.iter().map(|p| p.1));
    let height = 1.1 * (high - low).max((right - left) / PANEL_ASPECT).max(1.0);
    let around = |axis: Axis, from: f64, to: f64, size: f64| {
        axis.within(0.5 * (from + to - size), 0.5 * (from + to + size))
    };
    let panel = around(Axis::new("y", "m"), low, high, height).panel([Series::line("", 1, points)]);
    around(Axis::new("x", "m"), left, right, height * PANEL_ASPECT).figure([panel])
}

fn along(survey: &Survey, course: &Course) -> Figure {
    let panel = |quantity: &str, unit: &str, value: fn(&Sample) -> f64| {
        let points = survey.samples.iter().map(|s| (s.s_m, value(s)));
        Axis::new(quantity, unit).panel([Series::line("", 1, points.collect())])
    };
    let panels = [
        panel("Curvature", "1/km", |s| 1e3 * s.curvature_1pm),
        panel("Bank, left up", "%", |s| 100.0 * s.bank_rad.tan()),
        panel("Grade", "%", |s| 100.0 * s.grade),
        panel("Lane width", "m", |s| s.width_m),
    ];
    Figure {
        bands: curves::bands(course),
        ..Axis::new("Distance along the lane's centre", "m").figure(panels)
    }
}

/// The document of a course.
pub fn report(survey: &Survey, course: &Course) -> Report {
    let facts = [("Length".to_owned(), format!("{:.2} m", survey.length_m))];
    let roads = survey.roads.iter().map(|road| {
        let direction = if road.along_s { "along" } else { "against" };
        let lane = format!("lane {}, driven {direction} its s", road.lane);
        (format!("Road {}", road.road), lane)
    });
    let along_road = "Along the road, in the direction of travel: left curves and banks that raise the left edge are positive.";
    let blocks = vec![
        Block::Table(Table::of_pairs(["What", "Value"], facts.into_iter().chain(roads))),
        Block::Table(table(survey)),
        Block::Text(picture(survey)).on_terminal(),
        Block::figure("plan", plan(survey), "Seen from above, in the frame of the file."),
        Block::figure("course", along(survey, course), along_road),
    ];
    let sections = vec![Section::new("The centre of the lane", blocks)];
    Report::new("A course", &survey.course, sections).with_notes(survey.notes.clone())
}

/// The plan in dots, with one scale for both axes; o marks the start.
fn picture(survey: &Survey) -> String {
    let [columns, rows] = PICTURE;
    let [left, right] = extent(survey.samples.iter().map(|s| s.x_m));
    let [low, high] = extent(survey.samples.iter().map(|s| s.y_m));
    // A dot is as wide as it is high where a character is twice as high as wide.
    let dots = [2 * columns - 1, 4 * rows - 1].map(|n| n as f64);
    let scale = ((right - left) / dots[0]).max((high - low) / dots[1]).max(1e-3);
    let used = (((high - low) / scale) as usize / 4 + 1).min(rows);
    let mut cells = vec![vec![0_u8; columns]; used];
    // Bits of a Braille character by row and column of its dots.
    const BITS: [[u8; 2]; 4] = [[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]];
    let place = |sample: &Sample| {
        let column = ((sample.x_m - left) / scale) as usize;
        let row = ((high - sample.y_m) / scale) as usize;
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
    text.push_str(&format!("(o: start; {:.0} m from left to right)\n", right - left));
    text
}
