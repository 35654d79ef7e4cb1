//! `host-sim evaluate`, which `host-sim` alone is too.

use clap::{Args, ValueEnum};
use haptic_batch::check_window;
use haptic_batch::evaluate::evaluate;
use haptic_metrics::Window;
use haptic_report::studies::evaluation::{report, write_series};
use haptic_sim::input::in_range;
use haptic_sim::models::road::Course;
use haptic_sim::scenario::{DEFAULT_SPEED_KMH, Failure, SPEED_KMH, Scenario, Sensors};

use super::results::{DEFAULT_OUT, ResultArguments};
use super::road::CourseArguments;
use super::series::SeriesArgument;
use super::{BadInput, Outcome, progress};

#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.default_value("out").help(DEFAULT_OUT)))]
pub(super) struct Arguments {
    #[command(flatten)]
    course: CourseArguments,
    /// Speed, km/h (20 to 250)
    #[arg(long, value_name = "KMH", default_value_t = DEFAULT_SPEED_KMH)]
    speed: f64,
    /// When the guidance fails in the runs with failure, s after the start; default: 70
    #[arg(long, value_name = "S")]
    failure_time: Option<f64>,
    /// Stretch of road to measure, m; default: 1080 1740 on paper-course, else the whole course
    #[arg(long, num_args = 2, value_names = ["FROM", "TO"])]
    window: Option<Vec<f64>>,
    /// What the controller sees: full resolution every millisecond, or the paper's sensors over the bus
    #[arg(long, value_enum, default_value_t = SensorsArgument::Paper)]
    sensors: SensorsArgument,
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

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    in_range("--speed", arguments.speed, SPEED_KMH, "km/h")?;
    let course = arguments.course.open()?.unwrap_or_else(Course::paper);
    let sensors = match arguments.sensors {
        SensorsArgument::Exact => Sensors::Exact,
        SensorsArgument::Paper => Sensors::Paper,
    };
    let scenario = Scenario::builder().course(course).speed_kmh(arguments.speed);
    let mut base = scenario.sensors(sensors).build()?;
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
