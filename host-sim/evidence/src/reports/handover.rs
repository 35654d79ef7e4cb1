//! What the handover study shows: tables and a figure.

use haptic_evidence::handover::{
    Bend, Figure as Found, HandoverResults, HandoverRow, RELIANCES, TAKES_OVER_S,
};
use haptic_report::document::{Block, Cell, Report, Section, Table};
use haptic_report::plot::{Axis, Figure, Panel, Series};

/// The study's document.
pub(crate) fn report(results: &HandoverResults) -> Report {
    let (papers, bends) = (of(results, true), of(results, false));
    let caption = "Largest peak of any instant, as a ratio, over the time after which the driver takes over.";
    let summary = format!(
        "Peak lateral error after a lost input, which the ECU hands over, and after a sudden loss of torque, at instants every {} s \
         from 2 s before a bend to 2 s behind it, to both sides, delays 0.1 to 0.5 s. Ratio: over the larger of the peaks without \
         a failure and by hand in the same bend. Beside the drop: over the peak of the drop at the same instant, where both count \
         as that larger peak at least. Left out are drivers who by hand leave the lane or do not settle.",
        results.every_s
    );
    let each = results.rows.iter().filter(|row| row.bend.is_some());
    let sections = vec![
        Section::new(
            "The worst over all bends",
            vec![
                Block::figure("handover", figure(&papers, &bends), caption),
                Block::Table(table(&bends)),
                Block::Text(judgement(results)),
            ],
        ),
        Section::of_table("The first curve of paper-course (300 m, 60 km/h)", table(&papers)),
        Section::new(
            "Each bend",
            vec![Block::Table(Table::of_rows("", each.map(bend_row))).on_page()],
        ),
    ];
    Report::new("What a lost input costs", summary, sections)
}

/// The rows of the paper's curve, or those of all others together.
fn of(results: &HandoverResults, is_papers: bool) -> Vec<&HandoverRow> {
    let is_it = |bend: Option<Bend>| bend.map_or(!is_papers, |bend| is_papers && bend.is_papers);
    results.rows.iter().filter(|row| is_it(row.bend)).collect()
}

/// Who keeps the bound, and who is not judged.
fn judgement(results: &HandoverResults) -> String {
    let broken = results.rows.iter().filter(|row| row.is_broken()).count();
    let left: usize = results.rows.iter().map(|row| row.left_by_itself).sum();
    let verdict = match (broken, left) {
        (0, _) => "holds".into(),
        (_, 0) => format!("BROKEN in {broken} rows"),
        _ => format!("BROKEN in {broken} rows, with {left} drives in which the ECU ended guidance by itself"),
    };
    let judged = TAKES_OVER_S.iter().find(|after_s| {
        results
            .rows
            .iter()
            .any(|row| row.takes_over_after_s == **after_s && row.is_judged())
    });
    format!(
        "At no instant more than {} times a drop, for drivers who take over after {} s or later: {verdict}. (1.05 was aimed at, and \
         is missed: docs/decisions/001.) Who takes over sooner is shown, not judged.",
        results.most_beside_drop,
        judged.copied().unwrap_or(f64::INFINITY)
    )
}

fn worst(found: &Option<Found>) -> Option<f64> {
    found.as_ref().map(|found| found.worst)
}

fn peak_m(found: &Option<Found>) -> Cell {
    Cell::number(found.as_ref().map(|found| found.worst_peak_m), 2)
}

fn median(found: &Option<Found>) -> Option<f64> {
    found.as_ref().map(|found| found.median)
}

/// Where a figure was worst; with the bend, where it is not the row's.
fn place(found: &Option<Found>, with_bend: bool) -> Cell {
    let text = found.as_ref().map(|Found { at, .. }| {
        let bend = if with_bend {
            format!("{} km/h, {} m, ", at.speed_kmh, at.radius_m)
        } else {
            String::new()
        };
        format!("{bend}{}, t_p {} s, {}", at.side, at.t_p, at.place)
    });
    Cell::text(text.unwrap_or_else(|| "nobody is judged".into()))
}

fn row(row: &HandoverRow) -> [(&'static str, Cell); 11] {
    let with_bend = row.bend.is_none();
    [
        ("Reliance", Cell::Text(row.condition.to_string())),
        ("Takes over (s)", Cell::number(row.takes_over_after_s, 1)),
        ("Handover worst", Cell::number(worst(&row.handover), 2)),
        ("its peak (m)", peak_m(&row.handover)),
        ("median", Cell::number(median(&row.handover), 2)),
        ("Worst at", place(&row.handover, with_bend)),
        ("Drop worst", Cell::number(worst(&row.drop), 2)),
        ("its peak (m)", peak_m(&row.drop)),
        ("median", Cell::number(median(&row.drop), 2)),
        ("Beside the drop", Cell::number(worst(&row.beside_drop), 2)),
        ("Most at", place(&row.beside_drop, with_bend)),
    ]
}

fn table(rows: &[&HandoverRow]) -> Table {
    Table::of_rows("", rows.iter().map(|found| row(found)))
}

fn bend_row(found: &HandoverRow) -> Vec<(&'static str, Cell)> {
    let bend = |of: fn(&Bend) -> f64| Cell::number(found.bend.as_ref().map(of), 0);
    let acceleration = found.bend.map(|bend| bend.lateral_m_per_s2());
    let mut cells = vec![
        ("Speed (km/h)", bend(|bend| bend.speed_kmh)),
        ("Radius (m)", bend(|bend| bend.radius_m)),
        ("Acceleration (m/s2)", Cell::number(acceleration, 2)),
    ];
    cells.extend(row(found));
    cells
}

/// A panel for each reliance: worst ratios over the taking-over time.
fn figure(papers: &[&HandoverRow], bends: &[&HandoverRow]) -> Figure {
    let x = Axis::new("Driver takes over after", "s").within(0.0, 2.5);
    let panels = RELIANCES.map(|condition| {
        let line = |label, style, rows: &[&HandoverRow], of: fn(&HandoverRow) -> Option<f64>| {
            let rows = rows.iter().filter(|row| row.condition == condition);
            let points = rows.map(|row| (row.takes_over_after_s, of(row).unwrap_or(f64::NAN)));
            Series::dots(label, style, points.collect()).joined()
        };
        let series = [
            line("handover", 1, bends, |row| worst(&row.handover)),
            line("sudden loss", 3, bends, |row| worst(&row.drop)),
            line("handover, paper's curve", 2, papers, |row| worst(&row.handover)),
            line("sudden loss, paper's curve", 4, papers, |row| worst(&row.drop)),
        ];
        let title = format!("{condition} reliance");
        Panel::new(title, Axis::new("Worst ratio", "-"), series)
    });
    Figure {
        same_y: true,
        ..x.figure(panels)
    }
}
