//! `host-sim compare FILE.toml`.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::compare::{Compare, Kinds};
use haptic_report::document::write_file;
use haptic_report::studies::compare::report;

use super::progress::Threads;
use super::results::ResultArguments;
use super::{BadInput, Outcome, progress};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Comparison file (TOML): laws, drivers, roads, speeds, seeds, failures, tuning (docs/how-to/compare.md)
    #[arg(value_name = "FILE.toml")]
    file: PathBuf,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    results: ResultArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let kinds = Kinds::default();
    let compare = Compare::load(&arguments.file, &kinds)?;
    let output = arguments.results.begin("compare")?;
    let results = progress::over(compare.drives(), "drives", |done| {
        arguments.threads.run(|| compare.run(done))
    })??;
    if let Some(place) = output.place() {
        let table = results.to_csv();
        write_file(&place.join("drives.csv"), |file| file.write_all(table.as_bytes()))?;
        results.write_parquet(std::fs::File::create(place.join("drives.parquet"))?)?;
    }
    let report = report(&results);
    output.show(&report, &report.stamp(&results), true)
}
