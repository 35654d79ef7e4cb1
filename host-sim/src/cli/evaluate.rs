//! `host-sim evaluate`, which `host-sim` alone is too.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use haptic_batch::check_window;
use haptic_batch::evaluate::evaluate;
use haptic_batch::files::load_scenario;
use haptic_metrics::Window;
use haptic_report::studies::evaluation::{report, write_series};
use haptic_sim::input::in_range;
use haptic_sim::scenario::{Failure, SPEED_KMH, Scenario, Sensors};

use super::results::{DEFAULT_OUT, ResultArguments};
use super::road::CourseArguments;
use super::series::SeriesArgument;
use super::{BadInput, Outcome, progress};

#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.default_value("out").help(DEFAULT_OUT)))]
pub(super) struct Arguments {
    /// What the runs have beside delay, condition (with its gains) and kind of failure, which the evaluation varies: a scenario
    /// file; default: the paper's
    #[arg(long, value_name = "SCENARIO.toml")]
    scenario: Option<PathBuf>,
    /// The vehicle: a scenario file whose [vehicle] says what it is; default: that of --scenario, else that of table 9
    #[arg(long, value_name = "FILE.toml")]
    vehicle: Option<PathBuf>,
    #[command(flatten)]
    course: CourseArguments,
    /// Speed, km/h (20 to 250); default: that of --scenario, else 60
    #[arg(long, value_name = "KMH")]
    speed: Option<f64>,
    /// When the guidance fails in the runs with failure, s after the start; default: 70
    #[arg(long, value_name = "S")]
    failure_time: Option<f64>,
    /// Stretch of road to measure, m; default: 1080 1740 on paper-course, else the whole course
    #[arg(long, num_args = 2, value_names = ["FROM", "TO"])]
    window: Option<Vec<f64>>,
    /// What the controller sees: full resolution every millisecond, or the paper's sensors over the bus; default: that of
    /// --scenario, else the paper's
    #[arg(long, value_enum)]
    sensors: Option<SensorsArgument>,
    #[command(flatten)]
    results: ResultArguments,
    /// Also every sample of the 30 runs, in the directory's runs/: 172 MB as CSV, a fifth of it compressed
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = SeriesArgument::None)]
    series: SeriesArgument,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum SensorsArgument {
    Exact,
    Paper,
}

/// What all runs have in common.
fn base(arguments: &Arguments) -> Result<Scenario, BadInput> {
    let mut base = match &arguments.scenario {
        Some(path) => load_scenario(path)?.to_builder(),
        None => Scenario::builder(),
    };
    if let Some(path) = &arguments.vehicle {
        base = base.vehicle(*load_scenario(path)?.vehicle());
    }
    if let Some(course) = arguments.course.open()? {
        base = base.course(course);
    }
    if let Some(speed_kmh) = arguments.speed {
        in_range("--speed", speed_kmh, SPEED_KMH, "km/h")?;
        base = base.speed_kmh(speed_kmh);
    }
    if let Some(sensors) = arguments.sensors {
        base = base.sensors(match sensors {
            SensorsArgument::Exact => Sensors::Exact,
            SensorsArgument::Paper => Sensors::Paper,
        });
    }
    Ok(base.build()?)
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let mut base = base(arguments)?;
    // On a course too short for the default, the results say so.
    if let Some(time_s) = arguments.failure_time {
        base.check_time("--failure-time", time_s)?;
        let failure = Failure {
            time_s,
            ..base.failure()
        };
        base = base.to_builder().failure(failure).build()?;
    }
    let window = match arguments.window.as_deref() {
        Some(&[from_m, to_m]) => Some(Window { from_m, to_m }),
        _ => None,
    };
    if let Some(window) = window {
        check_window(window, &base).map_err(|e| format!("--{e}"))?;
    }
    let output = arguments.results.begin("evaluate")?;
    let evaluation = progress::watched("runs", |watch| evaluate(&base, window, watch))?;
    if let Some(place) = output.place() {
        write_series(&evaluation, arguments.series.into(), place)?;
    }
    let results = &evaluation.results;
    output.show(&report(&evaluation), results, results.all_claims_hold())
}
