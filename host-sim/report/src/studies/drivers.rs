//! Several drivers beside each other: what differs between two, and what a group is like.

use super::place;
use crate::document::{Block, Cell, Report, Section, Table};
use crate::plot::{Axis, Figure, Mark, Series};
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
    let title = format!("{} drivers", found.drivers.len());
    let summary = "Every drive is a driver of its own. Of a drive in pieces each is listed, and the longest one is compared.";
    Report::new(title, summary, vec![Section::new("Drivers", blocks)])
}

fn number(value: impl Into<Option<f64>>) -> Cell {
    Cell::number(value, 4)
}

/// All that is found: each driver, the differences of two, the population of more.
fn tables(found: &Drivers) -> Vec<Table> {
    let mut out = vec![each(found)];
    if !found.differences.is_empty() {
        out.push(differences(found));
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
            let mut list = fit.parameters.list().into_iter();
            list.any(|l| l.0 == wanted && value_and_error(l.2).is_none())
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
        let mut cells = vec![("Drive", Cell::text(name))];
        for wanted in SHOWN {
            let p = list.iter().find(|l| l.0 == wanted).map(|l| l.2);
            cells.push((wanted, number(p.and_then(|p| p.estimate))));
            cells.push(("+-", number(p.and_then(|p| p.standard_error))));
        }
        let refuted = fit.refuted.first().map_or("", |r| &r.cause);
        cells.push(("Refuted", Cell::text(refuted)));
        cells
    });
    Table::of_rows("Each driver; a dash: not identified.", rows)
}

fn differences(found: &Drivers) -> Table {
    let who = match &found.compared[..] {
        [first, second] if found.drivers.len() > 2 => {
            format!("{first} less {second}: the only two that are compared.")
        }
        _ => "The first driver less the second.".into(),
    };
    let row = |d: &Difference| {
        let [low, high] = Cell::ends(d.interval_95, 4);
        let verdict = if d.real { "they differ" } else { "not told apart" };
        [
            ("", Cell::text(d.parameter)),
            ("Unit", Cell::text(d.unit)),
            ("Difference", number(d.difference)),
            ("Standard error", number(d.standard_error)),
            ("95 % from", low),
            ("to", high),
            ("p (Holm)", number(d.p_holm)),
            ("Verdict", Cell::text(verdict)),
        ]
    };
    Table::of_rows(
        format!(
            "{who} Each interval is that of its parameter alone; the verdict is on all {} together, at \
             5 % (Holm's method).",
            found.differences.len()
        ),
        found.differences.iter().map(row),
    )
}

fn population(found: &[Population], gaps: &str) -> Table {
    let row = |p: &Population| {
        [
            ("", Cell::text(p.parameter)),
            ("Unit", Cell::text(p.unit)),
            ("Drivers", Cell::count(p.drivers)),
            ("Mean", number(p.mean)),
            ("95 % from", number(p.mean_interval_95[0])),
            ("to", number(p.mean_interval_95[1])),
            ("Spread", number(p.spread)),
            ("95 % from", number(p.spread_interval_95[0])),
            ("to", number(p.spread_interval_95[1])),
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
            let interval = [p.mean_interval_95; 2];
            series.push(Series::interval("mean of the group, 95 %", 5, &ends, &interval));
        }
        let (mut points, mut intervals, mut unit) =
            ([const { Vec::new() }; 2], [const { Vec::new() }; 2], "-");
        for (i, (_, fit)) in found.drivers.iter().enumerate() {
            let list = fit.parameters.list();
            let named = list.iter().find(|l| l.0 == wanted);
            unit = named.map_or(unit, |l| l.1);
            let Some(p) = named.map(|l| l.2) else { continue };
            if let (Some((x, _)), Some(interval)) = (value_and_error(p), p.interval_95) {
                let kind = usize::from(!p.identified);
                points[kind].push((place(i), x));
                intervals[kind].push(interval);
            }
        }
        let labels = ["own drive", "own drive, not identified"];
        for (kind, (points, intervals)) in points.into_iter().zip(intervals).enumerate() {
            if !points.is_empty() {
                let mark = Mark::Whiskers(intervals);
                series.push(Series::with_mark(labels[kind], [1, 3][kind], mark, points));
            }
        }
        Axis::new(wanted, unit).panel(series)
    });
    let x = Axis::counting("Driver, as the table lists them").within(ends[0], ends[1]);
    x.figure(panels)
}
