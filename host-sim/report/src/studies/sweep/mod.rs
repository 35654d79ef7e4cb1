//! What a sweep shows: how the metrics are spread, which fields matter, the worst drives and how to drive them again.

mod figures;
mod tables;
mod words;

use crate::document::{Block, Cell, Provenance, Report, Section, Table, definitions_table};
use figures::{distribution, influence, responses};
use haptic_batch::Away;
use haptic_batch::sweep::{DesignPoint, Driven, Summary, Sweep};
use haptic_metrics::Definition;

use tables::{short_tables, tables};

/// Rows that a plan shows.
const FIRST_ROWS: u64 = 5;

/// The document of a sweep; a terminal shows what matters most. `file` is the sweep's, as its commands name it.
pub fn report(sweep: &Sweep, summary: &Summary, file: &str) -> Report {
    // With each the number of tables that belong to it.
    let parts = [
        ("How the drives are spread", vec![distribution(summary)], 1),
        ("What matters most", influence(summary).into_iter().collect(), 2),
        ("Which value is best", responses(summary), 2),
        ("The worst drives, and what the metrics mean", Vec::new(), 1),
    ];
    let mut tables = tables(sweep, summary, file)
        .into_iter()
        .zip(short_tables(sweep, summary, file));
    let sections = parts.map(|(heading, figures, own)| {
        let figures = figures.into_iter();
        let figures = figures.map(|(name, caption, figure)| Block::figure(name, figure, caption));
        let own = tables.by_ref().take(own);
        let own = own.flat_map(|(all, most)| [Block::Table(all).on_page(), Block::Table(most).on_terminal()]);
        Section::new(heading, figures.chain(own).collect())
    });
    let mut sections = sections.to_vec();
    if let Some(last) = sections.last_mut() {
        last.blocks.push(Block::Table(definitions_table()).on_page());
    }
    Report {
        provenance: Provenance::new(Some(sweep.text().into())),
        ..Report::new("Sweep", headline(sweep, summary), sections)
    }
}

/// How many drives, and how many of them are bad.
fn headline(sweep: &Sweep, summary: &Summary) -> String {
    let stopped = if summary.drives < summary.planned {
        format!(" of {} planned: stopped early, as [stop] asks", summary.planned)
    } else {
        String::new()
    };
    let mut text = format!(
        "{} drives{stopped}{}, {} diverged.",
        summary.drives,
        design(sweep),
        summary.diverged
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

/// How samples are drawn; nothing where every value meets every other.
fn design(sweep: &Sweep) -> String {
    if sweep.samples() > 1 {
        format!(", design {}", sweep.design())
    } else {
        String::new()
    }
}

/// What a sweep plans.
pub fn plan(sweep: &Sweep) -> Report {
    let columns = ["drive", "seed"].into_iter().chain(sweep.columns());
    let rows = (0..sweep.drives().min(FIRST_ROWS)).map(|drive| {
        let point = sweep.point(drive);
        let own = [Cell::number(drive as f64, 0), Cell::Text(point.seed.to_string())];
        own.into_iter().chain(values(&point).map(Cell::Text)).collect()
    });
    let table = Table::new("", columns, rows);
    let (drives, chunks, design) = (sweep.drives(), sweep.chunks(), design(sweep));
    let summary = format!("{drives} drives in {chunks} chunks{design}");
    Report::new("", summary, vec![Section::of_table("", table)])
}

fn values(point: &DesignPoint) -> impl Iterator<Item = String> {
    point
        .values
        .iter()
        .map(|value| value.as_str().map_or_else(|| value.to_string(), String::from))
}

/// One drive: what is varied, and what came of it.
pub fn drive_table(sweep: &Sweep, point: &DesignPoint, driven: &Driven) -> Table {
    let varied = sweep.columns().map(String::from).zip(values(point));
    let metric = |(definition, value): (&&Definition, &Option<f64>)| {
        let value = value.map_or("-".into(), |value| value.to_string());
        (definition.name.to_string(), value)
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
