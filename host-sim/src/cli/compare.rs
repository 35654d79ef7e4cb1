//! `host-sim compare FILE.toml`.

use haptic_batch::compare::{Compare, Kinds};
use haptic_report::studies::compare::report;

use super::results::StudyFile;
use super::{BadInput, Outcome, progress};

/// Help of the file.
pub(super) const FILE: &str =
    "Comparison file (TOML): laws, drivers, roads, speeds, seeds, failures, tuning (docs/how-to/compare.md)";

pub(super) fn run(arguments: &StudyFile) -> Result<Outcome, BadInput> {
    let kinds = Kinds::default();
    let compare = Compare {
        level: arguments.level.level,
        ..Compare::load(&arguments.file, &kinds)?
    };
    let output = arguments.results.begin("compare")?;
    let results = progress::watched("drives", |watch| arguments.threads.run(|| compare.run(watch)))??;
    if let Some(place) = output.place() {
        results.write_tables(place)?;
    }
    output.show(&report(&results), &results, true)
}
