//! `host-sim drivers LOG LOG...`: several drivers beside each other.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::identify::compare_drivers;
use haptic_report::studies::drivers::report;

use super::recording::{FitArguments, ReadingArguments};
use super::results::{LevelArgument, ResultArguments};
use super::{BadInput, Outcome, progress};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Recorded drives, one of each driver, as for identify. Two are compared; three or more are a population too
    #[arg(value_name = "LOG", num_args = 2.., required = true)]
    logs: Vec<PathBuf>,
    /// Take a driver who changed in pieces, as identify --pieces: each is listed, and the longest one is compared
    #[arg(long)]
    pieces: bool,
    #[command(flatten)]
    fit: FitArguments,
    #[command(flatten)]
    reading: ReadingArguments,
    #[command(flatten)]
    level: LevelArgument,
    #[command(flatten)]
    results: ResultArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let options = arguments.fit.options(&arguments.reading)?;
    let mut logs = Vec::new();
    for path in &arguments.logs {
        let opened = arguments
            .reading
            .open(path, options.manual, &options.stretches, None);
        let (log, notes) = opened?;
        options.check(&log)?;
        for note in notes {
            eprintln!("note: {}: {note}", path.display());
        }
        logs.push((path.display().to_string(), log));
    }
    let output = arguments.results.begin("drivers")?;
    let found = progress::watched("drives", |watch| {
        compare_drivers(&logs, &options, arguments.pieces, arguments.level.level, watch)
    })?;
    output.show(&report(&found), &found, true)
}
