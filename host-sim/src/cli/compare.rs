//! `host-sim compare FILE.toml`.

use clap::Args;
use haptic_batch::compare::{Compare, Kinds};
use haptic_report::document::write_file;
use haptic_report::studies::compare::report;

use super::results::StudyFile;
use super::{BadInput, Outcome, progress};

const FILE: &str =
    "Comparison file (TOML): laws, drivers, roads, speeds, seeds, failures, tuning (docs/how-to/compare.md)";

#[derive(Debug, Args)]
#[command(mut_arg("file", |file| file.help(FILE)))]
pub(super) struct Arguments {
    #[command(flatten)]
    study: StudyFile,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let kinds = Kinds::default();
    let compare = Compare::load(&arguments.study.file, &kinds)?;
    let output = arguments.study.results.begin("compare")?;
    let results = progress::over(compare.drives(), "drives", |done| {
        arguments.study.threads.run(|| compare.run(done))
    })??;
    if let Some(place) = output.place() {
        let table = results.to_csv();
        write_file(&place.join("drives.csv"), |file| file.write_all(table.as_bytes()))?;
        results.write_parquet(std::fs::File::create(place.join("drives.parquet"))?)?;
    }
    let report = report(&results);
    output.show(&report, &report.stamp(&results), true)
}
