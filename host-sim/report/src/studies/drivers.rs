//! Several drivers beside each other: what differs between two, and what a group is like.

use crate::document::{Block, Cell, Report, Section, Table};
use crate::plot::{Axis, Figure, Mark, Panel, Series};
use haptic_analysis::identify::{Difference, Population, value_and_error};
use haptic_batch::identify::Drivers;

/// Parameters that a torque record can carry.
const SHOWN: [&str; 5] = ["gain_1", "gain_2", "gain_3", "t_p", "k_hg"];

/// The document of the drivers.
pub fn report(found: &Drivers) -> Report {
    let caption = format!(
        "Each driver with the 95 % interval of that driver's own drive; the bands are the group's mean with its interval. Drives \
             too imprecise to name a value count with what they tell. {}",
        gaps(found)
    );
    let mut blocks = vec![Block::figure("drivers", figure(found), caption)];
    blocks.extend(tables(found).into_iter().map(Block::Table));
    Report {
        title: format!("{} drivers", found.drivers.len()),
        summary: "Every drive is a driver of its own. Of a drive in pieces each is listed, and the longest one is compared.".into(),
        sections: vec![Section::new("Drivers", blocks)],
        ..Report::default()
    }
}

fn number(value: Option<f64>) -> Cell {
    Cell::number(value, 4)
}

/// All that is found: each driver, the differences of two, the population of more.
fn tables(found: &Drivers) -> Vec<Table> {
    let mut out = vec![each(found)];
    if !found.differences.is_empty() {
        out.push(differences(&found.differences));
    }
    if !found.population.is_empty() {
        out.push(population(&found.population, &gaps(found)));
    }
    out
}

/// Who is missing where.
fn gaps(found: &Drivers) -> String {
    let of = |wanted: &str| {
        let missing = found.drivers.iter().enumerate().filter(|(_, (_, fit))| {
            let list = fit.parameters.list();
            list.iter()
                .any(|l| l.0 == wanted && value_and_error(l.2).is_none())
        });
        let numbers: Vec<String> = missing.map(|(i, _)| (i + 1).to_string()).collect();
        (!numbers.is_empty()).then(|| format!("{wanted} of {}", numbers.join(", ")))
    };
    let gaps: Vec<String> = SHOWN.iter().filter_map(|wanted| of(wanted)).collect();
    if gaps.is_empty() {
        return "No driver is missing.".into();
    }
    format!(
        "Missing, because a model is refuted or the search ended on a bound: {}.",
        gaps.join("; ")
    )
}

fn each(found: &Drivers) -> Table {
    let rows = found.drivers.iter().map(|(name, fit)| {
        let list = fit.parameters.list();
        let mut cells = vec![Cell::Text(name.clone())];
        for wanted in SHOWN {
            let p = list.iter().find(|l| l.0 == wanted).map(|l| l.2);
            cells.push(number(p.and_then(|p| p.estimate)));
            cells.push(number(p.and_then(|p| p.standard_error)));
        }
        let refuted = fit.refuted.first().map_or_else(String::new, |r| r.cause.clone());
        cells.push(Cell::Text(refuted));
        cells
    });
    let mut columns = vec!["Drive".to_owned()];
    for name in SHOWN {
        columns.extend([name.to_owned(), "+-".to_owned()]);
    }
    columns.push("Refuted".to_owned());
    Table::new("Each driver; a dash: not identified.", columns, rows)
}

fn differences(found: &[Difference]) -> Table {
    let row = |d: &Difference| {
        let [low, high] = d.interval_95;
        [
            ("", Cell::text(d.parameter)),
            ("Unit", Cell::text(d.unit)),
            ("Difference", number(Some(d.difference))),
            ("Standard error", number(Some(d.standard_error))),
            ("95 % from", number(Some(low))),
            ("to", number(Some(high))),
            ("p (Holm)", number(Some(d.p_holm))),
            (
                "Verdict",
                Cell::Text(if d.real { "they differ" } else { "not told apart" }.into()),
            ),
        ]
    };
    Table::of_rows(
        format!(
            "The first driver less the second. Each interval is that of its parameter alone; the verdict is on all {} together, at \
             5 % (Holm's method).",
            found.len()
        ),
        found.iter().map(row),
    )
}

fn population(found: &[Population], gaps: &str) -> Table {
    let row = |p: &Population| {
        [
            ("", Cell::text(p.parameter)),
            ("Unit", Cell::text(p.unit)),
            ("Drivers", Cell::number(p.drivers as f64, 0)),
            ("Mean", number(Some(p.mean))),
            ("95 % from", number(Some(p.mean_interval_95[0]))),
            ("to", number(Some(p.mean_interval_95[1]))),
            ("Spread", number(Some(p.spread))),
            ("95 % from", number(Some(p.spread_interval_95[0]))),
            ("to", number(Some(p.spread_interval_95[1]))),
        ]
    };
    Table::of_rows(
        format!("The group: its mean, and the standard deviation between drivers (random effects). {gaps}"),
        found.iter().map(row),
    )
}

fn figure(found: &Drivers) -> Figure {
    let count = found.drivers.len();
    let ends = [0.5, count as f64 + 0.5];
    let panels = SHOWN.iter().map(|&wanted| {
        let mut series = Vec::new();
        if let Some(p) = found.population.iter().find(|p| p.parameter == wanted) {
            series.push(Series::interval(
                "mean of the group, 95 %",
                5,
                &ends,
                &[p.mean_interval_95; 2],
            ));
        }
        let (mut points, mut intervals, mut unit) =
            ([const { Vec::new() }; 2], [const { Vec::new() }; 2], "-");
        for (i, (_, fit)) in found.drivers.iter().enumerate() {
            let list = fit.parameters.list();
            let named = list.iter().find(|l| l.0 == wanted);
            unit = named.map_or(unit, |l| l.1);
            let Some(p) = named.map(|l| l.2) else { continue };
            if let (Some((x, _)), Some(interval)) = (value_and_error(p), p.interval_95) {
                let place = usize::from(!p.identified);
                points[place].push(((i + 1) as f64, x));
                intervals[place].push(interval);
            }
        }
        let labels = ["own drive", "own drive, not identified"];
        for (place, (points, intervals)) in points.into_iter().zip(intervals).enumerate() {
            if !points.is_empty() {
                let mark = Mark::Whiskers(intervals);
                series.push(Series::with_mark(labels[place], [1, 3][place], mark, points));
            }
        }
        Panel::new("", Axis::new(wanted, unit), series)
    });
    Figure {
        x: Axis::counting("Driver, as the table lists them").within(ends[0], ends[1]),
        panels: panels.collect(),
        ..Figure::default()
    }
}
