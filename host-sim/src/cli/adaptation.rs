//! `host-sim adaptation FILE.toml`.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::adaptation::Adaptation;
use haptic_batch::compare::Kinds;
use haptic_report::document::write_file;
use haptic_report::studies::adaptation::report;

use super::progress::Threads;
use super::results::ResultArguments;
use super::{BadInput, Outcome, progress};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Study file (TOML): laws, drivers whose K_hg follows trust, a road, a loss (docs/explanation/two-adaptations.md)
    #[arg(value_name = "FILE.toml")]
    file: PathBuf,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    results: ResultArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let kinds = Kinds::default();
    let study = Adaptation::load(&arguments.file, &kinds)?;
    let output = arguments.results.begin("adaptation")?;
    let results = progress::over(study.drives(), "drives", |done| {
        arguments.threads.run(|| study.run(done))
    })??;
    if let Some(place) = output.place() {
        let series = results.to_csv();
        write_file(&place.join("loops.csv"), |file| file.write_all(series.as_bytes()))?;
    }
    let report = report(&results);
    output.show(&report, &report.stamp(&results), true)
}
