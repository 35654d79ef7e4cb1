//! `host-sim adaptation FILE.toml`.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::adaptation::Adaptation;
use haptic_batch::compare::{Kinds, on_threads};
use haptic_report::document::write_file;
use haptic_report::studies::adaptation::report;

use super::results::ResultArguments;
use super::{BadInput, Outcome, progress};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Study file (TOML): laws, drivers whose K_hg follows trust, a road, a loss (docs/explanation/two-adaptations.md)
    #[arg(value_name = "FILE.toml")]
    file: PathBuf,
    /// Threads; default: one a core
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    threads: Option<u32>,
    #[command(flatten)]
    results: ResultArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let kinds = Kinds::default();
    let study = Adaptation::load(&arguments.file, &kinds)?;
    let output = arguments.results.begin("adaptation")?;
    let results = progress::over(study.drives(), "drives", |done| {
        on_threads(arguments.threads, || study.run(done))
    })??;
    if let Some(place) = output.place() {
        let series = results.to_csv();
        write_file(&place.join("loops.csv"), |file| file.write_all(series.as_bytes()))?;
    }
    let report = report(&results);
    output.show(&report, &report.stamp(&results), true)
}
