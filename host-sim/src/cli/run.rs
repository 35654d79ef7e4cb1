//! `host-sim run SCENARIO.toml`.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::run::run as simulate;
use haptic_report::studies::run::{report, write_series};
use haptic_sim::input::InputError;

use super::results::ResultArguments;
use super::road::CourseArguments;
use super::series::SeriesArgument;
use super::{BadInput, Outcome, print_notes};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Scenario file (TOML); every field has a default (examples/every-field.toml lists them)
    #[arg(value_name = "SCENARIO.toml")]
    scenario: PathBuf,
    #[command(flatten)]
    course: CourseArguments,
    /// How the time series is written: as CSV, compressed, or not at all
    #[arg(long, value_enum, value_name = "FORMAT", requires = "out", default_value_t = SeriesArgument::Csv)]
    series: SeriesArgument,
    /// Also every frame of the bus, as `candump -L` writes it (bus.log, some 14 MB for paper-course); read it with
    /// `cantools decode core/haptic.dbc < bus.log`
    #[arg(long, requires = "out")]
    bus_log: bool,
    #[command(flatten)]
    results: ResultArguments,
}

/// Faster than cars are driven, m/s.
const FAST_M_PER_S: f64 = 50.0;

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let mut scenario = haptic_batch::files::load_scenario(&arguments.scenario)?;
    match arguments.course.open()? {
        Some(course) => scenario = scenario.to_builder().course(course).build()?,
        None => print_notes(scenario.course().notes()),
    }
    let fastest = scenario.speed().fastest_m_per_s();
    if fastest > FAST_M_PER_S {
        let kmh = 3.6 * fastest;
        eprintln!("note: the speed goes up to {fastest:.1} m/s, which is {kmh:.0} km/h: is it in km/h?");
    }
    let output = arguments.results.begin("run")?;
    let single = simulate(scenario, arguments.bus_log)
        .map_err(|e| InputError::new(arguments.scenario.display(), e))?;
    if let Some(place) = output.place() {
        write_series(&single, arguments.series.into(), place)?;
    }
    output.show(&report(&single), &single.results, true)
}
