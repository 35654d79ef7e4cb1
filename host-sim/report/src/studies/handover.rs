//! What the handover study shows: a table and a figure.

use super::ended;
use crate::document::{Block, Cell, Report, Section, Table};
use crate::plot::{Axis, Figure, Panel, Series};
use haptic_batch::evaluate::DRIVERS_T_P;
use haptic_batch::handover::{HandoverResults, HandoverRow, SPEEDS_KMH};
use haptic_sim::scenario::Condition;

/// Why a line ends: a driver who is not stable alone is not judged.
const UNSTABLE: &str = "ends: unstable by hand";

/// The study's document.
pub fn report(results: &HandoverResults) -> Report {
    let caption = format!(
        "Peak after a handed-over loss of input and after a sudden loss of torque, as a ratio. Judged are high and mid \
         reliance where the manual driver is stable: {} at most.",
        results.most
    );
    let judgement = format!(
        "Largest handover ratio of a judged row: {:.2} (at most {}).",
        results.largest_judged_ratio, results.most
    );
    let blocks = vec![
        Block::figure("handover", figure(results), caption),
        Block::Table(table(results)),
        Block::Text(judgement),
    ];
    let summary = "Peak lateral error in the first curve of paper-course, stretched to the speed (0.93 m/s2), failure in the \
                   arc. Ratio: over the larger of the no-failure and the manual peak.";
    let sections = vec![Section::new("Handover beside sudden loss", blocks)];
    Report::new("What a lost input costs", summary, sections)
}

/// Every row of the study.
fn table(results: &HandoverResults) -> Table {
    let row = |row: &HandoverRow| {
        let verdict = match (row.manual_stable, row.is_judged(), row.is_broken()) {
            (false, ..) => "manual driver unstable",
            (true, false, _) => "not judged",
            (true, true, true) if row.left_by_itself > 0 => "GUIDANCE ENDED",
            (true, true, true) => "TOO MUCH",
            (true, true, false) => "holds",
        };
        [
            ("Speed (km/h)", Cell::number(row.speed_kmh, 0)),
            ("t_p (s)", Cell::number(row.t_p, 1)),
            ("Reliance", Cell::Text(row.condition.to_string())),
            ("Verdict", Cell::text(verdict)),
            ("Handover ratio", Cell::number(row.handover_ratio, 2)),
            ("Sudden loss ratio", Cell::number(row.loss_ratio, 2)),
            ("Manual (m)", Cell::number(row.manual_m, 3)),
            ("No failure (m)", Cell::number(row.nominal_m, 3)),
            ("Handover (m)", Cell::number(row.handover_m, 3)),
            ("Sudden loss (m)", Cell::number(row.loss_m, 3)),
        ]
    };
    Table::of_rows("", results.rows.iter().map(row))
}

/// A panel for each driver that is judged: ratios over the speed.
fn figure(results: &HandoverResults) -> Figure {
    let conditions = [(Condition::High, 1), (Condition::Mid, 2)];
    let (slowest, fastest) = (SPEEDS_KMH[0], SPEEDS_KMH[SPEEDS_KMH.len() - 1]);
    let panel = |t_p: f64| {
        let most = vec![(slowest, results.most), (fastest, results.most)];
        let mut series = vec![Series::line("most that is allowed", 0, most)];
        for (condition, style) in conditions {
            let points = |ratio: fn(&HandoverRow) -> Option<f64>| {
                let value = |r: &HandoverRow| if r.is_judged() { ratio(r) } else { None };
                let rows = results
                    .rows
                    .iter()
                    .filter(|r| r.t_p == t_p && r.condition == condition);
                rows.map(|r| (r.speed_kmh, value(r).unwrap_or(f64::NAN)))
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
        let title = format!("Driver with t_p {t_p} s");
        Panel::new(title, Axis::new("Ratio", "-"), series)
    };
    let x = Axis::new("Speed", "km/h").within(slowest - 2.0, fastest + 2.0);
    Figure {
        same_y: true,
        ..x.figure(DRIVERS_T_P.map(panel))
    }
}
