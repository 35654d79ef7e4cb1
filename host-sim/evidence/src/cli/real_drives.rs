//! `cargo xtask real-drives DIR`: recordings of real people.

use std::path::PathBuf;

use crate::reports::real_drives::report;
use clap::Args;
use haptic_analysis::identify::Options;
use haptic_evidence::real_drives::{Understood, real_drives};

use host_sim::cli::recording::ReadingArguments;
use host_sim::cli::results::ResultArguments;
use host_sim::cli::{BadInput, Outcome, progress};

#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Directory with recordings that a built-in layout of identify --layout describes, in any depth
    #[arg(value_name = "DIR")]
    directory: PathBuf,
    #[command(flatten)]
    reading: ReadingArguments,
    #[command(flatten)]
    results: ResultArguments,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let output = arguments.results.begin("real-drives")?;
    let mut options = Options::default();
    arguments.reading.choose(&mut options)?;
    let how = Understood {
        layout: arguments.reading.layout()?,
        maps: arguments.reading.maps()?,
        stretches: options.stretches,
        bridge_s: options.bridge_s,
    };
    let found = progress::watched("recordings", |watch| {
        real_drives(&arguments.directory, &how, watch)
    })?;
    output.show(&report(&found), &found, true)
}
