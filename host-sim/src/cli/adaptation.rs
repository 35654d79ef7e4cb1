//! `host-sim adaptation FILE.toml`.

use haptic_batch::adaptation::Adaptation;
use haptic_batch::compare::Kinds;
use haptic_report::document::write_file;
use haptic_report::studies::adaptation::report;

use super::results::StudyFile;
use super::{BadInput, Outcome, progress};

/// Help of the file.
pub(super) const FILE: &str = "Study file (TOML): laws, drivers whose K_hg follows trust, a road, a loss (docs/explanation/two-adaptations.md)";

pub(super) fn run(arguments: &StudyFile) -> Result<Outcome, BadInput> {
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
