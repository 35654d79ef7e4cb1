//! `host-sim run SCENARIO.toml`.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::run::{SingleRun, run as simulate};
use haptic_report::studies::run as files;
use haptic_sim::input::InputError;

use super::output::Output;
use super::road::CourseArguments;
use super::series::SeriesArgument;
use super::{BadInput, Outcome, print, print_json, print_notes, width};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Scenario file (TOML); every field has a default (docs/files.md lists them, examples/ has some)
    #[arg(value_name = "SCENARIO.toml")]
    scenario: PathBuf,
    #[command(flatten)]
    course: CourseArguments,
    /// Directory for a figure, the time series, the results and a report; default: no files
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// How the time series is written: as CSV, compressed, or not at all
    #[arg(long, value_enum, value_name = "FORMAT", requires = "out", default_value_t = SeriesArgument::Csv)]
    series: SeriesArgument,
    /// Also every frame of the bus, as `candump -L` writes it (bus.log, some 14 MB for paper-course); read it with
    /// `cantools decode core/haptic.dbc < bus.log`
    #[arg(long, requires = "out")]
    bus_log: bool,
    /// Print the results as one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let mut scenario = haptic_batch::files::load_scenario(&arguments.scenario)?;
    match arguments.course.open()? {
        Some(course) => scenario = scenario.to_builder().course(course).build()?,
        None => print_notes(scenario.course().notes()),
    }
    let output = arguments
        .out
        .as_deref()
        .map(|place| Output::begin(place, "run"))
        .transpose()?;
    let single = simulate(scenario, arguments.bus_log)
        .map_err(|e| InputError::new(arguments.scenario.display(), e))?;
    if let (Some(output), Some(directory)) = (output, &arguments.out) {
        output.finish(|place| files::write(&single, arguments.series.into(), place))?;
        eprintln!("Report: {}", directory.join("report.html").display());
    }
    if arguments.json {
        print_json(&files::stamped(&single))?;
    } else {
        print(&readable(&single))?;
    }
    print_notes(&single.results.notes);
    Ok(Outcome::Good)
}

fn readable(single: &SingleRun) -> String {
    let results = &single.results;
    let record = &results.record;
    let [from, to] = results.window_m;
    format!(
        "{}, {}, t_p {} s, {}, failure {}: {}\n{from} to {to} m of {:.0} m\n\n{}",
        results.course,
        single.scenario.speed(),
        record.t_p,
        record.condition,
        record.failure,
        files::how_it_ended(single),
        results.course_length_m,
        files::table(results).to_text(width()),
    )
}
