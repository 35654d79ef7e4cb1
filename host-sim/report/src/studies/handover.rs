//! What the handover study shows: a table, a figure, and the files with both.

use std::path::Path;

use super::files::{write_figure, write_report};
use super::{OutputError, ended};
use crate::document::{Block, Cell, Provenance, Report, Section, Stamped, Table, write_json};
use crate::plot::{Axis, Figure, Panel, Series};
use haptic_batch::evaluate::DRIVERS_T_P;
use haptic_batch::handover::{HandoverResults, HandoverRow, SPEEDS_KMH};
use haptic_sim::scenario::Condition;

/// What of the study a page or a terminal says before the table.
pub const SUMMARY: &str = "Peak lateral error in the first curve of paper-course, stretched to the speed (0.93 m/s2), \
                           failure in the arc. Ratio: over the larger of the no-failure and the manual peak.";

/// Why a line ends: a driver who is not stable alone is not judged.
const UNSTABLE: &str = "ends: unstable by hand";

/// Writes the figure (SVG, PNG), the results (JSON) and a report (HTML).
///
/// # Errors
/// What could not be written or drawn.
pub fn write(results: &HandoverResults, directory: &Path) -> Result<(), OutputError> {
    let figure = figure(results);
    write_figure(directory, "handover", &figure)?;
    write_json(&directory.join("results.json"), &stamped(results))?;
    let blocks = vec![
        Block::Figure {
            figure,
            caption: format!(
                "Peak after a handed-over loss of input and after a sudden loss of torque, as a ratio. Judged are high \
                 and mid reliance where the manual driver is stable: {} at most.",
                results.most
            ),
        },
        Block::Text(judgement(results)),
        Block::Table(table(results)),
    ];
    write_report(
        directory,
        &Report {
            title: "What a lost input costs".into(),
            summary: SUMMARY.into(),
            sections: vec![Section {
                heading: "Handover beside sudden loss".into(),
                blocks,
            }],
            provenance: Some(Provenance::of(None)),
        },
    )
}

/// The results as JSON holds them.
pub fn stamped(results: &HandoverResults) -> Stamped<'_, HandoverResults> {
    Provenance::of(None).stamp(results)
}

/// The sentence that says whether the bound is kept.
pub fn judgement(results: &HandoverResults) -> String {
    format!(
        "Largest handover ratio of a judged row: {:.2} (at most {}).",
        results.largest_judged_ratio, results.most
    )
}

/// Every row of the study.
pub fn table(results: &HandoverResults) -> Table {
    let row = |row: &HandoverRow| {
        let verdict = match (row.manual_stable, row.is_judged(), row.is_broken()) {
            (false, ..) => "manual driver unstable",
            (true, false, _) => "not judged",
            (true, true, true) if row.left_by_itself > 0 => "GUIDANCE ENDED",
            (true, true, true) => "TOO MUCH",
            (true, true, false) => "holds",
        };
        let peaks = [row.manual_m, row.nominal_m, row.handover_m, row.loss_m];
        let ratios = [row.handover_ratio, row.loss_ratio];
        let mut cells = vec![
            Cell::number(row.speed_kmh, 0),
            Cell::number(row.t_p, 1),
            Cell::Text(row.condition.to_string()),
            Cell::Text(verdict.into()),
        ];
        cells.extend(ratios.map(|value| Cell::Number { value, decimals: 2 }));
        cells.extend(peaks.map(|value| Cell::Number { value, decimals: 3 }));
        cells
    };
    Table {
        caption: String::new(),
        columns: [
            "Speed (km/h)",
            "t_p (s)",
            "Reliance",
            "Verdict",
            "Handover ratio",
            "Sudden loss ratio",
            "Manual (m)",
            "No failure (m)",
            "Handover (m)",
            "Sudden loss (m)",
        ]
        .map(String::from)
        .to_vec(),
        rows: results.rows.iter().map(row).collect(),
    }
}

/// A panel for each driver that is judged: ratios over the speed.
fn figure(results: &HandoverResults) -> Figure {
    let conditions = [(Condition::High, 1), (Condition::Mid, 2)];
    let panel = |t_p: f64| {
        let mut series = vec![Series::line(
            "most that is allowed",
            0,
            vec![
                (SPEEDS_KMH[0], results.most),
                (SPEEDS_KMH[SPEEDS_KMH.len() - 1], results.most),
            ],
        )];
        for (condition, style) in conditions {
            let rows = || {
                results
                    .rows
                    .iter()
                    .filter(move |r| r.t_p == t_p && r.condition == condition)
            };
            let points = |ratio: fn(&HandoverRow) -> Option<f64>| {
                let value = move |r: &HandoverRow| if r.is_judged() { ratio(r) } else { None };
                rows()
                    .map(move |r| (r.speed_kmh, value(r).unwrap_or(f64::NAN)))
                    .collect::<Vec<_>>()
            };
            for (what, style, points) in [
                ("handover", style, points(|r| r.handover_ratio)),
                ("sudden loss", style + 2, points(|r| r.loss_ratio)),
            ] {
                let to_the_end = points.last().is_some_and(|p| p.1.is_finite());
                let line = Series::dots(&format!("{what}, {condition} reliance"), style, points).joined();
                series.extend(ended(line, (!to_the_end).then_some(UNSTABLE)));
            }
        }
        Panel {
            title: format!("Driver with t_p {t_p} s"),
            y: Axis::of("Ratio", "-"),
            series,
        }
    };
    Figure {
        x: Axis::of("Speed", "km/h").within(SPEEDS_KMH[0] - 2.0, SPEEDS_KMH[SPEEDS_KMH.len() - 1] + 2.0),
        same_y: true,
        panels: DRIVERS_T_P.map(panel).to_vec(),
        ..Figure::default()
    }
}
