//! `host-sim course FILE`.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::course::survey;
use haptic_batch::files::open_course;
use haptic_report::document::write_bytes;
use haptic_report::studies::course::{report, write_samples};

use super::results::ResultArguments;
use super::road::LaneArguments;
use super::{BadInput, Outcome};

const JSON: &str = "Print one JSON object: length_m, and samples every metre of the lane's centre in the direction of travel (s_m, x_m, \
                    y_m, heading_rad, curvature_1pm, bank_rad, grade, width_m). Curvature is positive in a left curve, bank_rad \
                    where the left edge is the higher one";

#[derive(Debug, Args)]
#[command(mut_arg("json", |json| json.help(JSON)))]
pub(super) struct Arguments {
    /// Course file: OpenDRIVE 1.4 to 1.8 (.xodr), TOML (see docs/files.md), or paper-course
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    lane: LaneArguments,
    #[command(flatten)]
    results: ResultArguments,
    /// Save the course as an OpenDRIVE file: one road whose lane -1 is the course
    #[arg(long, value_name = "FILE.xodr")]
    save: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let course = open_course(&arguments.file, &arguments.lane.choice())?;
    let survey = survey(&course);
    let output = arguments.results.begin("course")?.named("course.json");
    if let Some(place) = output.place() {
        write_samples(&survey, place)?;
    }
    if let Some(path) = &arguments.save {
        write_bytes(path, course.to_opendrive())?;
        eprintln!("Saved: {}", path.display());
    }
    output.show(&report(&survey, &course), &survey, true)
}
