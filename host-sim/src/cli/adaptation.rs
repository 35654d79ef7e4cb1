//! `host-sim adaptation FILE.toml`.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::adaptation::Adaptation;
use haptic_batch::compare::Kinds;
use haptic_report::document::write_bytes;
use haptic_report::studies::adaptation::report;

use super::results::DrivenArguments;
use super::{BadInput, Outcome, progress};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Study file (TOML): laws, drivers whose K_hg follows trust, a road, a loss (docs/explanation/two-adaptations.md)
    #[arg(value_name = "FILE.toml")]
    file: PathBuf,
    #[command(flatten)]
    driven: DrivenArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let kinds = Kinds::default();
    let mut study = Adaptation::load(&arguments.file, &kinds)?;
    study.level = arguments.driven.level.level;
    let output = arguments.driven.results.begin("adaptation")?;
    let results = progress::timed("drives", |watch| {
        arguments.driven.threads.run(|| study.run(watch))
    })??;
    if let Some(place) = output.place() {
        write_bytes(&place.join("loops.csv"), results.to_csv())?;
    }
    output.show(&report(&results), &results, true)
}
