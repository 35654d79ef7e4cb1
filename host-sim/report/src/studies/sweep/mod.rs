//! What a sweep shows: how the metrics are spread, which fields matter, the worst drives and how to drive them again.

mod figures;
mod tables;
mod words;

use std::path::Path;

use super::OutputError;
use super::files::{write_figure, write_report};
use crate::document::{Block, Cell, Provenance, Report, Section, Table, definitions_table, write_json};
use figures::{distribution, influence, responses};
use haptic_analysis::metrics::Definition;
use haptic_batch::Away;
use haptic_batch::sweep::{Driven, Point, Summary, Sweep};

pub use tables::{short_tables, tables};

/// Rows that a plan shows.
const FIRST_ROWS: u64 = 5;

/// Writes the figures (SVG, PNG), the summary (JSON) and a report (HTML). `file` is the sweep's, as its commands name it.
///
/// # Errors
/// What could not be written or drawn.
pub fn write(sweep: &Sweep, summary: &Summary, file: &str, directory: &Path) -> Result<(), OutputError> {
    let mut sections = Vec::new();
    // With each the number of tables that belong to it.
    let parts = [
        ("How the drives are spread", vec![distribution(summary)], 1),
        ("What matters most", influence(summary).into_iter().collect(), 2),
        ("Which value is best", responses(summary), 2),
    ];
    let mut tables = tables(sweep, summary, file).into_iter();
    for (heading, figures, own) in parts {
        let mut blocks = Vec::new();
        for (name, caption, figure) in figures {
            write_figure(directory, &name, &figure)?;
            blocks.push(Block::Figure {
                name: String::new(),
                figure,
                caption,
            });
        }
        let filled = tables.by_ref().take(own).filter(|table| !table.rows.is_empty());
        blocks.extend(filled.map(Block::Table));
        if !blocks.is_empty() {
            sections.push(Section::new(heading, blocks));
        }
    }
    let rest = tables
        .map(Block::Table)
        .chain([Block::Table(definitions_table())]);
    sections.push(Section::new(
        "The worst drives, and what the metrics mean",
        rest.collect(),
    ));
    write_json(&directory.join("summary.json"), summary)?;
    write_report(
        directory,
        &Report {
            title: "Sweep".into(),
            summary: headline(summary),
            sections,
            provenance: Provenance::of(Some(sweep.text().into())),
            ..Report::default()
        },
    )
}

/// How many drives, and how many of them are bad.
pub fn headline(summary: &Summary) -> String {
    let stopped = if summary.drives < summary.planned {
        format!(" of {} planned: stopped early, as [stop] asks", summary.planned)
    } else {
        String::new()
    };
    let mut text = format!(
        "{} drives{stopped}, design {}, {} diverged.",
        summary.drives, summary.design, summary.diverged
    );
    if let (Some(limit), Some(beyond)) = (summary.limit, summary.beyond) {
        let share = 100.0 * beyond as f64 / summary.drives.max(1) as f64;
        text.push_str(&format!(
            " {beyond} ({share:.2} %) are beyond {} = {limit} or diverged.",
            summary.judge
        ));
    }
    if summary.left_by_itself > 0 {
        let why = summary
            .left_why
            .iter()
            .map(|(why, count)| format!("{why} {count}"));
        text.push_str(&format!(
            " In {} the ECU ended guidance by itself ({}): what is said here of all drives holds these too.",
            summary.left_by_itself,
            why.collect::<Vec<_>>().join(", ")
        ));
    }
    text
}

/// What a sweep plans.
pub fn plan(sweep: &Sweep, width: Option<usize>) -> String {
    let columns = ["drive", "seed"]
        .into_iter()
        .chain(sweep.columns())
        .map(String::from);
    let rows = (0..sweep.drives().min(FIRST_ROWS)).map(|drive| {
        let point = sweep.point(drive);
        let own = [Cell::number(drive as f64, 0), Cell::Text(point.seed.to_string())];
        own.into_iter().chain(values(&point).map(Cell::Text)).collect()
    });
    let table = Table::new("", columns, rows);
    format!(
        "{} drives in {} chunks, design {}\n\n{}",
        sweep.drives(),
        sweep.chunks(),
        sweep.design(),
        table.to_text(width)
    )
}

fn values(point: &Point) -> impl Iterator<Item = String> {
    point
        .values
        .iter()
        .map(|value| value.as_str().map_or_else(|| value.to_string(), String::from))
}

/// One drive: what is varied, and what came of it.
pub fn drive_table(sweep: &Sweep, point: &Point, driven: &Driven) -> Table {
    let varied = sweep.columns().map(String::from).zip(values(point));
    let metric = |(definition, value): (&&Definition, &Option<f64>)| {
        (
            definition.name.to_string(),
            value.map_or("-".into(), |value| value.to_string()),
        )
    };
    let own = [
        ("drive".to_string(), point.drive.to_string()),
        ("seed".into(), point.seed.to_string()),
        ("diverged".into(), driven.diverged.to_string()),
        ("end_m".into(), driven.end_m.to_string()),
    ];
    let metrics = sweep.metrics().iter().zip(&driven.metrics).map(metric);
    let away = driven.away.texts();
    let away = away.map(|text| if text.is_empty() { "-".into() } else { text });
    let away = Away::NAMES.map(String::from).into_iter().zip(away);
    let all = own.into_iter().chain(away).chain(varied).chain(metrics);
    Table::of_pairs(["Field", "Value"], all)
}
