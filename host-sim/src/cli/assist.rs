//! `host-sim assist` and `host-sim driver-torque`: a torsion bar, with power assist.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::StudyError;
use haptic_batch::engine::Study;
use haptic_column::study::{ColumnFile, assist, hands, reading, sensors};
use haptic_report::studies::torsion_bar::{assist_report, hands_report, reading_report, sensors_report};
use haptic_sim::Scenario;
use haptic_sim::input::in_range;

use super::progress::Threads;
use super::results::{LevelArgument, ResultArguments};
use super::{BadInput, Outcome, in_file};

/// Which column.
#[derive(Debug, Args)]
struct ColumnArgument {
    /// Column and assist (TOML): `[column]` and `[assist]` (docs/explanation/torsion-bar.md); default: usual practice
    #[arg(value_name = "COLUMN.toml")]
    file: Option<PathBuf>,
}

impl ColumnArgument {
    fn load(&self) -> Result<ColumnFile, BadInput> {
        let Some(path) = &self.file else {
            return Ok(ColumnFile::default());
        };
        let text = std::fs::read_to_string(path).map_err(in_file(path))?;
        ColumnFile::from_toml(&text).map_err(in_file(path))
    }
}

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    column: ColumnArgument,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    results: ResultArguments,
}

#[derive(Debug, Args)]
pub(super) struct SensorArguments {
    #[command(flatten)]
    column: ColumnArgument,
    /// In its place: how soon a wheel that nobody holds is known, told from a light touch, a resting and a steering hand; each drive
    /// lasts so many hours, 0.5 if none are given (some 5 minutes of a processor)
    #[arg(long, value_name = "HOURS", num_args = 0..=1, default_missing_value = "0.5")]
    hands: Option<f64>,
    /// In its place: what the ECU reads of K_hg through the bar, of drivers whose K_hg is known (144 drives)
    #[arg(long, conflicts_with = "hands")]
    reading: bool,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    level: LevelArgument,
    #[command(flatten)]
    results: ResultArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let study = assist::Study {
        file: arguments.column.load()?,
    };
    let output = arguments.results.begin("assist")?;
    let results = driven(&study, "drivers", &arguments.threads)?;
    output.show(&assist_report(&results), &results, true)
}

/// What a study finds, on so many threads.
fn driven<S: Study<Results: Send>>(study: &S, unit: &str, threads: &Threads) -> Result<S::Results, BadInput> {
    Ok(threads.watched(unit, |watch| study.run(watch))??)
}

/// The ECU's last reading of K_hg.
fn read(scenario: Scenario) -> Result<reading::Reading, StudyError> {
    let read = haptic_batch::run::run(scenario, false)?.results.k_hg;
    Ok(read.map(|read| [read.k_hg, read.deviation]))
}

pub(super) fn sensors(arguments: &SensorArguments) -> Result<Outcome, BadInput> {
    let file = arguments.column.load()?;
    let output = arguments.results.begin("driver-torque")?;
    if let Some(hours) = arguments.hands {
        in_range("--hands", hours, 0.05..=100.0, "h")?;
        let level = arguments.level.level;
        let results = driven(&hands::Study { file, hours, level }, "drives", &arguments.threads)?;
        return output.show(&hands_report(&results), &results, true);
    }
    if arguments.reading {
        let results = driven(&reading::Study { file, read }, "drives", &arguments.threads)?;
        return output.show(&reading_report(&results), &results, true);
    }
    let results = sensors::run(&file)?;
    output.show(&sensors_report(&results), &results, true)
}
