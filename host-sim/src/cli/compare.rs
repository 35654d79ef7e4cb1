//! `host-sim compare FILE.toml`.

use haptic_batch::compare::{Compare, Kinds};
use haptic_report::document::write_bytes;
use haptic_report::studies::compare::report;

use super::results::StudyFile;
use super::{BadInput, Outcome, progress};

/// Help of the file.
pub(super) const FILE: &str =
    "Comparison file (TOML): laws, drivers, roads, speeds, seeds, failures, tuning (docs/how-to/compare.md)";

pub(super) fn run(arguments: &StudyFile) -> Result<Outcome, BadInput> {
    let kinds = Kinds::default();
    let compare = Compare::load(&arguments.file, &kinds)?;
    let output = arguments.results.begin("compare")?;
    let results = progress::over(compare.drives(), "drives", |done| {
        arguments.threads.run(|| compare.run(done))
    })??;
    if let Some(place) = output.place() {
        write_bytes(&place.join("drives.csv"), results.to_csv())?;
        results.write_parquet(std::fs::File::create(place.join("drives.parquet"))?)?;
    }
    output.show(&report(&results), &results, true)
}
