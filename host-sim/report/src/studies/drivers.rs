//! Several drivers beside each other: what differs between two, and what a group is like.

use std::collections::BTreeSet;
use std::path::Path;

use super::place;
use crate::document::{Block, Cell, Report, Section, Table};
use crate::plot::{Axis, Figure, Series};
use haptic_analysis::identify::Identification;
use haptic_batch::identify::Drivers;
use haptic_batch::several::{Difference, Population, value_and_error};

/// Parameters that a torque record can carry.
const SHOWN: [&str; 5] = ["gain_1", "gain_2", "gain_3", "t_p", "k_hg"];

/// The document of the drivers.
pub fn report(found: &Drivers) -> Report {
    let caption = format!(
        "Each driver with the {} % interval of that driver's own drive; the dashed lines are the ends of the interval of the group's mean. Drives \
             too imprecise to name a value count with what they tell. {}",
        found.level,
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
        out.push(population(found));
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
    let from = format!("{} % from", found.level);
    let row = |d: &Difference| {
        let [low, high] = Cell::ends(d.interval.ends, 4);
        let verdict = if d.real { "they differ" } else { "not told apart" };
        [
            ("", Cell::text(d.parameter)),
            ("Unit", Cell::text(d.unit)),
            ("Difference", number(d.difference)),
            ("Standard error", number(d.standard_error)),
            (&*from, low),
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

fn population(found: &Drivers) -> Table {
    let (from, gaps) = (format!("{} % from", found.level), gaps(found));
    let row = |p: &Population| {
        let [low, high] = Cell::ends(p.mean_interval.ends, 4);
        let [least, most] = Cell::ends(p.spread_interval.ends, 4);
        [
            ("", Cell::text(p.parameter)),
            ("Unit", Cell::text(p.unit)),
            ("Drivers", Cell::count(p.drivers)),
            ("Mean", number(p.mean)),
            (&*from, low),
            ("to", high),
            ("Spread", number(p.spread)),
            (&*from, least),
            ("to", most),
        ]
    };
    Table::of_rows(
        format!("The group: its mean, and the standard deviation between drivers (random effects). {gaps}"),
        found.population.iter().map(row),
    )
}

/// The drives' names without their folders and endings, if these still tell them apart.
fn names(found: &Drivers) -> Vec<String> {
    let short = |(name, _): &(String, _)| {
        let stem = Path::new(name).file_stem();
        stem.map_or(name.clone(), |stem| stem.to_string_lossy().into_owned())
    };
    let short: Vec<String> = found.drivers.iter().map(short).collect();
    if short.iter().collect::<BTreeSet<_>>().len() == short.len() {
        return short;
    }
    found.drivers.iter().map(|(name, _)| name.clone()).collect()
}

fn figure(found: &Drivers) -> Figure {
    let names = names(found);
    let ends = [0.5, names.len() as f64 + 0.5];
    let panels = SHOWN.iter().map(|&wanted| {
        let mut series = Vec::new();
        if let Some(p) = found.population.iter().find(|p| p.parameter == wanted) {
            let label = format!("mean of the group: its {} % interval", found.level);
            for (label, at) in [&*label, ""].into_iter().zip(p.mean_interval.ends) {
                series.push(Series::line(label, 2, ends.map(|row| (row, at)).to_vec()));
            }
        }
        let of = |fit: &Identification| {
            fit.parameters
                .list()
                .into_iter()
                .find(|l| l.0 == wanted)
                .map(|l| (l.1, *l.2))
        };
        let known = |identified: bool| {
            found.drivers.iter().enumerate().filter_map(move |(i, (_, fit))| {
                let (_, p) = of(fit).filter(|(_, p)| p.identified == identified)?;
                Some((
                    (place(i), value_and_error(&p)?.0),
                    p.interval(found.level.normal())?,
                ))
            })
        };
        for (label, style, identified) in [("own drive", 1, true), ("own drive, not identified", 3, false)] {
            let own = Series::whiskers(label, style, known(identified));
            if !own.points.is_empty() {
                series.push(own);
            }
        }
        let unit = found.drivers.iter().find_map(|(_, fit)| Some(of(fit)?.0));
        Axis::new(wanted, unit.unwrap_or("-")).panel(series)
    });
    let panels: Vec<_> = panels.collect();
    Figure::of_rows(names, panels)
}
