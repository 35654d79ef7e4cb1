//! `host-sim real-drives DIR`: recordings of real people.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::real_drives::real_drives;
use haptic_report::studies::real_drives::report;

use super::results::ResultArguments;
use super::{BadInput, Outcome};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Directory with recordings that a built-in layout of identify --layout describes, in any depth
    #[arg(value_name = "DIR")]
    directory: PathBuf,
    #[command(flatten)]
    results: ResultArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let output = arguments.results.begin("real-drives")?;
    let found = real_drives(&arguments.directory)?;
    output.show(&report(&found), &found, true)
}
