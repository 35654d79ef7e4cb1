//! `host-sim compare FILE.toml`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use haptic_batch::compare::{Compare, Kinds};
use haptic_report::document::definitions_table;
use haptic_report::studies::compare::{driver_kinds, law_kinds, report};

use super::results::DrivenArguments;
use super::{BadInput, Outcome, print, progress};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Comparison file (TOML): laws, drivers, roads, speeds, seeds, failures, tuning (docs/how-to/compare.md)
    #[arg(value_name = "FILE.toml", required_unless_present = "list")]
    file: Option<PathBuf>,
    #[command(flatten)]
    driven: DrivenArguments,
    /// Print what a file may name, as Markdown, and drive nothing
    #[arg(long, value_enum, value_name = "WHAT", conflicts_with_all = ["file", "out", "json"])]
    list: Option<Named>,
}

/// What a file of a study names.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Named {
    /// Laws: source, parameters with default and range, what tuning varies
    Laws,
    /// Drivers and habits, likewise
    Drivers,
    /// Metrics of every study: unit, definition, source
    Metrics,
}

impl Named {
    fn table(self) -> haptic_report::document::Table {
        match self {
            Self::Laws => law_kinds(),
            Self::Drivers => driver_kinds(),
            Self::Metrics => definitions_table(),
        }
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    if let Some(named) = arguments.list {
        print(&named.table().to_markdown())?;
        return Ok(Outcome::Good);
    }
    let file = arguments.file.as_deref();
    let file = file.ok_or_else(|| BadInput("FILE.toml is missing".into()))?;
    let kinds = Kinds::default();
    let compare = Compare {
        level: arguments.driven.level.level,
        ..Compare::load(file, &kinds)?
    };
    let output = arguments.driven.results.begin("compare")?;
    let results = progress::timed("drives", |watch| {
        arguments.driven.threads.run(|| compare.run(watch))
    })??;
    if let Some(place) = output.place() {
        results.write_tables(place)?;
    }
    output.show(&report(&results), &results, true)
}
