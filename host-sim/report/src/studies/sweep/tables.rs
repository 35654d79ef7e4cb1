//! The tables of a sweep.

use super::words::{OWN_UNIT, by_weight, decimals, heading, label, lower, metric};
use crate::document::{Cell, Table};
use haptic_batch::sweep::{Distribution, Effect, Level, SobolIndex, Summary, Sweep, Worst};

/// A terminal shows so many of the fields that matter most, of distributions and of what is compared.
const SHOWN: usize = 2;

/// Distributions, shares of the variance, Sobol indices, levels, what is compared, the worst drives: in this order, some
/// empty.
pub(super) fn tables(sweep: &Sweep, summary: &Summary, file: &str) -> Vec<Table> {
    vec![
        distributions(summary),
        shares(summary),
        indices(summary),
        levels(summary, |_| true),
        compared(summary, usize::MAX),
        worst(sweep, summary, file),
    ]
}

/// What a terminal shows: of what matters only the metric that judges; levels where they differ, of distributions those of the
/// fields that matter most.
pub(super) fn short_tables(sweep: &Sweep, summary: &Summary, file: &str) -> Vec<Table> {
    let judge = summary.judge;
    let mut own = summary.clone();
    for effect in &mut own.effects {
        effect.shares.retain(|(name, _)| *name == judge);
    }
    own.sobol.retain(|index| index.metric == judge);
    own.distributions.retain(|of| of.metric == judge);
    let sliced = by_weight(summary).into_iter().filter(|effect| effect.sliced);
    let most: Vec<&str> = sliced.take(SHOWN).map(|effect| effect.field.as_str()).collect();
    vec![
        distributions(summary),
        shares(&own),
        indices(&own),
        levels(summary, |effect| {
            !effect.best.is_empty() && (!effect.sliced || most.contains(&effect.field.as_str()))
        }),
        compared(summary, SHOWN),
        worst(sweep, summary, file),
    ]
}

fn distributions(summary: &Summary) -> Table {
    let row = |of: &Distribution| {
        let digits = decimals(of.metric);
        let number = |value| Cell::number(value, digits);
        let mut cells = vec![Cell::Text(heading(of.metric)), Cell::count(of.count)];
        cells.extend([number(of.mean), number(of.sd), number(of.min)]);
        cells.extend(of.quantiles.iter().map(|(_, value)| number(Some(*value))));
        cells.resize(11, number(None));
        cells.push(number(of.max));
        cells
    };
    let columns = [
        "Metric", "Drives", "Mean", "SD", "Least", "5 %", "25 %", "50 %", "75 %", "95 %", "99 %", "Most",
    ];
    Table::new(
        "How the metrics are spread over the drives",
        columns,
        summary.distributions.iter().map(row),
    )
}

fn shares(summary: &Summary) -> Table {
    let labels = summary.distributions.iter().map(|of| label(of.metric));
    let columns = ["Field".into()].into_iter().chain(labels);
    let row = |effect: &Effect| {
        let shares = effect.shares.iter().map(|(_, value)| Cell::number(*value, 3));
        [Cell::text(&effect.field)].into_iter().chain(shares).collect()
    };
    Table::new(
        "Share of each metric's variance that a field explains by itself; 0 also where the drives are too few to show one",
        columns,
        summary.effects.iter().map(row),
    )
}

fn indices(summary: &Summary) -> Table {
    let row = |index: &SobolIndex| {
        [
            ("Metric", Cell::Text(label(index.metric))),
            ("Field", Cell::text(&index.field)),
            ("First order", Cell::number(index.first[0], 3)),
            ("SE", Cell::number(index.first[1], 3)),
            ("Total", Cell::number(index.total[0], 3)),
            ("SE ", Cell::number(index.total[1], 3)),
        ]
    };
    let caption = "Sobol indices: share of the variance by a field alone, and with all others";
    Table::of_rows(caption, summary.sobol.iter().map(row))
}

/// The metric that judges along each field; which level is best is said where one is told apart from another.
fn levels(summary: &Summary, shown: impl Fn(&Effect) -> bool) -> Table {
    let (name, unit) = metric(summary.judge);
    let mean = format!("Mean {} ({unit})", lower(&name));
    let from = format!("{} % from", summary.level);
    let digits = decimals(summary.judge);
    let row = |effect: &Effect, level: &Level| {
        let drives = &level.drives;
        let unit = effect.unit.as_deref().unwrap_or(OWN_UNIT);
        let verdict = match effect.best.contains(&level.label) {
            true if effect.best.len() > 1 => "among the best",
            true => "best",
            false => "",
        };
        let mut cells = vec![
            ("Field", Cell::text(&effect.field)),
            ("Value", Cell::text(&level.label)),
            ("Unit", Cell::text(unit)),
            ("Verdict", Cell::text(verdict)),
            ("Drives", Cell::count(drives.count)),
            ("Diverged", Cell::count(drives.diverged)),
        ];
        let mut known = |name, value: Option<f64>, interval: Option<[f64; 2]>, decimals| {
            let [low, high] = Cell::ends(interval, decimals);
            cells.extend([
                (name, Cell::number(value, decimals)),
                (from.as_str(), low),
                ("to", high),
            ]);
        };
        known(mean.as_str(), drives.mean, drives.interval, digits);
        if summary.limit.is_some() {
            let percent = |share: f64| 100.0 * share;
            let interval = drives.beyond_interval.map(|ends| ends.map(percent));
            known("Bad (%)", drives.beyond.map(percent), interval, 2);
        }
        cells
    };
    let effects = by_weight(summary);
    let rows = effects.iter().filter(|effect| shown(effect));
    let rows = rows.flat_map(|effect| effect.levels.iter().map(move |level| row(effect, level)));
    let alike = effects.iter().filter(|e| e.best.is_empty());
    let alike: Vec<&str> = alike.map(|e| e.field.as_str()).collect();
    let alike = match alike[..] {
        [] => String::new(),
        _ => format!("; nothing is told apart along {}", alike.join(", ")),
    };
    let caption = format!("By value of each field (of a distribution: by sixteenths){alike}");
    Table::of_rows(caption, rows)
}

/// What the values of one field do along the others, those that matter most first.
fn compared(summary: &Summary, most: usize) -> Table {
    let compare = summary.compare.as_deref().unwrap_or_default();
    let mut effects = by_weight(summary);
    effects.retain(|effect| effect.levels.iter().any(|level| !level.compared.is_empty()));
    let labels: Vec<String> = effects.first().map_or_else(Vec::new, |effect| {
        let most = effect.levels.iter().max_by_key(|level| level.compared.len());
        most.map_or_else(Vec::new, |level| {
            level.compared.iter().map(|own| own.label.clone()).collect()
        })
    });
    let (what, unit, digits) = match summary.limit {
        Some(_) => ("Bad drives".into(), " (%)", 2),
        None => (
            format!("Mean {}", label(summary.judge)),
            "",
            decimals(summary.judge),
        ),
    };
    let row = |effect: &Effect, level: &Level| {
        let value = |label: &String| {
            let own = level.compared.iter().find(|own| own.label == *label);
            let value = own.and_then(|own| own.drives.beyond.map(|share| 100.0 * share).or(own.drives.mean));
            (format!("{label}{unit}"), Cell::number(value, digits))
        };
        let head = [
            ("Field".into(), Cell::text(&effect.field)),
            ("Value".into(), Cell::text(&level.label)),
            ("Drives".into(), Cell::count(level.drives.count)),
        ];
        head.into_iter()
            .chain(labels.iter().map(value))
            .collect::<Vec<_>>()
    };
    let effects = effects.iter().take(most);
    let rows = effects.flat_map(|effect| effect.levels.iter().map(move |level| row(effect, level)));
    Table::of_rows(format!("{what} by {compare}, along the other fields"), rows)
}

fn worst(sweep: &Sweep, summary: &Summary, file: &str) -> Table {
    let judge = heading(summary.judge);
    let row = |drive: &Worst| {
        let value = |(name, value): (_, &String)| (name, Cell::Text(short(value)));
        let ended = if drive.diverged { "diverged" } else { "at its end" };
        let left = drive.away.when_and_why().filter(|_| drive.away.is_by_itself());
        let ended = left.map_or(ended.into(), |left| format!("{ended}; guidance ended {left}"));
        let again = format!("host-sim sweep {file} --replay {}", drive.drive);
        let mut cells = vec![("Drive", Cell::count(drive.drive))];
        cells.extend(sweep.columns().zip(&drive.values).map(value));
        cells.extend([
            (judge.as_str(), Cell::number(drive.value, decimals(summary.judge))),
            ("Ended", Cell::Text(ended)),
            ("Again", Cell::Text(again)),
        ]);
        cells
    };
    let caption = format!("The worst drives by {}", label(summary.judge));
    Table::of_rows(caption, summary.worst.iter().map(row))
}

/// Six digits tell drives apart.
fn short(value: &str) -> String {
    match value.parse::<f64>() {
        Ok(number) if value.len() > 8 => format!("{number:.6}"),
        _ => value.into(),
    }
}
