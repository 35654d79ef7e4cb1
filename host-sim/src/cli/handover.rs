//! `host-sim handover`.

use clap::Args;
use haptic_batch::handover::{HandoverRow, ROWS, study};
use haptic_report::studies::handover::report;

use super::results::ResultArguments;
use super::{BadInput, Outcome, progress};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    results: ResultArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let output = arguments.results.begin("handover")?;
    let results = progress::over(ROWS as u64, "rows", |done| study(done))?;
    let holds = !results.rows.iter().any(HandoverRow::is_broken);
    output.show(&report(&results), &results, holds)
}
