//! `cargo xtask eps`.

use clap::Args;
use haptic_evidence::availability::eps::{LIMITS, Row, study};
use haptic_report::document::{Block, Cell, Report, Section, Table};
use haptic_sim::input::in_range;
use serde_json::json;

use host_sim::cli::results::ResultArguments;
use host_sim::cli::{BadInput, Outcome, progress};

#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Hours on each road of each world, in drives of five minutes
    #[arg(long, value_name = "H", default_value_t = 0.25)]
    hours: f64,
    /// Root of all random numbers
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(0..=1_000_000_000))]
    seed: u64,
    #[command(flatten)]
    results: ResultArguments,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    in_range("--hours", arguments.hours, 0.05..=1000.0, "h")?;
    let output = arguments.results.begin("eps")?;
    let rows = progress::watched("drives of five minutes", |watch| {
        study(arguments.hours, arguments.seed, watch)
    })?;
    let row = |row: &Row| {
        [
            ("World", Cell::text(row.world)),
            ("Limit", Cell::text(row.limit)),
            ("Level (N.m)", Cell::number(row.level_nm, 2)),
            ("Most (N.m)", Cell::number(row.most_nm, 3)),
            ("Faults", Cell::count(row.faults.count)),
            ("Per hour", Cell::number(row.faults.per_hour, 3)),
            ("At most", Cell::number(row.faults.upper, 3)),
        ]
    };
    let caption = "Nothing is wrong in any drive, and nobody overrides. At most: with 95 % confidence";
    let table = Block::Table(Table::of_rows(caption, rows.iter().map(row)));
    let sources = LIMITS.map(|limit| format!("{}: {}", limit.0, limit.1));
    let summary = format!("Who found the limits: {}.", sources.join("; "));
    let sections = vec![Section::new("", vec![table])];
    let report = Report::new("An EPS that faults on its own", summary, sections);
    output.show(&report, &json!({ "rows": rows }), true)
}
