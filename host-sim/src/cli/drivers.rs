//! `host-sim drivers LOG LOG...`: several drivers beside each other.

use std::path::PathBuf;

use clap::Args;
use haptic_analysis::identify::Options;
use haptic_batch::identify::compare_drivers;
use haptic_report::studies::drivers::report;

use super::recording::ReadingArguments;
use super::results::ResultArguments;
use super::{BadInput, Outcome, progress};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Recorded drives, one of each driver, as for identify. Two are compared; three or more are a population too
    #[arg(value_name = "LOG", num_args = 2.., required = true)]
    logs: Vec<PathBuf>,
    /// Drives without guidance: there is no K_hg
    #[arg(long)]
    manual: bool,
    /// Take a driver who changed in pieces, as identify --pieces: each is listed, and the longest one is compared
    #[arg(long)]
    pieces: bool,
    /// A known parameter, the same for all; as for identify
    #[arg(long, value_name = "NAME=VALUE")]
    fix: Vec<String>,
    /// The column has a power assist that is not in guidance_torque_nm: it turns the wheel with the driver, so that the torques on the
    /// column do not tell whether driver_torque_nm is recorded too small
    #[arg(long)]
    assisted: bool,
    /// Estimate what is otherwise taken as known; as for identify
    #[arg(long, value_name = "NAME[=LOW..HIGH]")]
    estimate: Vec<String>,
    #[command(flatten)]
    reading: ReadingArguments,
    #[command(flatten)]
    results: ResultArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let mut options = Options::given(arguments.manual, &arguments.fix)?;
    options.assisted = arguments.assisted;
    for what in &arguments.estimate {
        options.estimate(what)?;
    }
    arguments.reading.choose(&mut options)?;
    let mut logs = Vec::new();
    for path in &arguments.logs {
        let opened = arguments
            .reading
            .open(path, arguments.manual, &options.stretches, None);
        let (log, notes) = opened?;
        options.check(&log)?;
        for note in notes {
            eprintln!("note: {}: {note}", path.display());
        }
        logs.push((path.display().to_string(), log));
    }
    let output = arguments.results.begin("drivers")?;
    let found = progress::watched("drives", |watch| {
        compare_drivers(&logs, &options, arguments.pieces, watch)
    })?;
    output.show(&report(&found), &found, true)
}
