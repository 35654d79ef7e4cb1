//! `host-sim experiment`.

use clap::Args;
use haptic_batch::experiment::experiment;
use haptic_report::studies::experiment::{report, write_logs};

use super::participants::Drives;
use super::results::{DEFAULT_OUT, LevelArgument, ResultArguments};
use super::{BadInput, Outcome, progress};

#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.default_value("out/experiment").help(DEFAULT_OUT)))]
pub(super) struct Arguments {
    #[command(flatten)]
    drives: Drives,
    /// Write the recorded drives too, a CSV file each, into the directory's logs/
    #[arg(long)]
    logs: bool,
    #[command(flatten)]
    level: LevelArgument,
    #[command(flatten)]
    results: ResultArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let plan = arguments.drives.plan()?;
    let output = arguments.results.begin("experiment")?;
    let mut result = progress::watched("drives", |watch| experiment(&plan, watch))?;
    result.hold_at(arguments.level.level);
    if let Some(place) = output.place().filter(|_| arguments.logs) {
        write_logs(&result, &place.join("logs"))?;
    }
    output.show(&report(&result), &result, true)
}
