//! The tables of a sweep.

use super::words::{OWN_UNIT, by_weight, decimals, heading, label, lower, metric};
use crate::document::{Cell, Table};
use haptic_batch::sweep::{Effect, Summary, Sweep};

/// Of distributions and of what is compared a terminal shows the fields that matter most.
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
    let own = Summary {
        effects: summary
            .effects
            .iter()
            .cloned()
            .map(|effect| of_metric(effect, judge))
            .collect(),
        sobol: summary
            .sobol
            .iter()
            .filter(|index| index.metric == judge)
            .cloned()
            .collect(),
        distributions: summary
            .distributions
            .iter()
            .filter(|of| of.metric == judge)
            .cloned()
            .collect(),
        ..summary.clone()
    };
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

fn of_metric(mut effect: Effect, metric: &str) -> Effect {
    effect.shares.retain(|(name, _)| *name == metric);
    effect
}

fn distributions(summary: &Summary) -> Table {
    let row = |of: &haptic_batch::sweep::Distribution| {
        let digits = decimals(of.metric);
        let number = |value| Cell::number(value, digits);
        let mut cells = vec![Cell::Text(heading(of.metric)), Cell::number(of.count as f64, 0)];
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
    let mut columns = vec!["Field".to_string()];
    columns.extend(summary.distributions.iter().map(|of| label(of.metric)));
    let row = |effect: &Effect| {
        let shares = effect.shares.iter().map(|(_, value)| Cell::number(*value, 3));
        [Cell::Text(effect.field.clone())]
            .into_iter()
            .chain(shares)
            .collect()
    };
    Table::new(
        "Share of each metric's variance that a field explains by itself; 0 also where the drives are too few to show one",
        columns,
        summary.effects.iter().map(row),
    )
}

fn indices(summary: &Summary) -> Table {
    let number = |value| Cell::number(value, 3);
    let row = |index: &haptic_batch::sweep::SobolIndex| {
        let [first, total] = [index.first, index.total];
        let mut cells = vec![Cell::Text(label(index.metric)), Cell::Text(index.field.clone())];
        cells.extend([first[0], first[1], total[0], total[1]].map(number));
        cells
    };
    Table::new(
        "Sobol indices: share of the variance by a field alone, and with all others",
        ["Metric", "Field", "First order", "SE", "Total", "SE "],
        summary.sobol.iter().map(row),
    )
}

/// The metric that judges along each field; which level is best is said where one is told apart from another.
fn levels(summary: &Summary, shown: impl Fn(&Effect) -> bool) -> Table {
    let (name, unit) = metric(summary.judge);
    let mut columns = ["Field", "Value", "Unit", "Verdict", "Drives", "Diverged"]
        .map(String::from)
        .to_vec();
    columns.extend([
        format!("Mean {} ({unit})", lower(&name)),
        "95 % from".into(),
        "to".into(),
    ]);
    if summary.limit.is_some() {
        columns.extend(["Bad (%)", "95 % from", "to"].map(String::from));
    }
    let digits = decimals(summary.judge);
    let row = |effect: &Effect, level: &haptic_batch::sweep::Level| {
        let drives = &level.drives;
        let unit = effect.unit.as_deref().unwrap_or(OWN_UNIT);
        let verdict = match effect.best.contains(&level.label) {
            true if effect.best.len() > 1 => "among the best",
            true => "best",
            false => "",
        };
        let mut cells = [&effect.field, &level.label, unit, verdict]
            .map(Cell::text)
            .to_vec();
        cells.extend([drives.count, drives.diverged].map(|count| Cell::number(count as f64, 0)));
        let mut known = |value: Option<f64>, interval: Option<[f64; 2]>, decimals| {
            let ends = interval.map_or([None; 2], |ends| ends.map(Some));
            cells.extend([value, ends[0], ends[1]].map(|value| Cell::number(value, decimals)));
        };
        known(drives.mean, drives.interval, digits);
        if summary.limit.is_some() {
            let percent = |share: f64| 100.0 * share;
            known(
                drives.beyond.map(percent),
                drives.beyond_interval.map(|ends| ends.map(percent)),
                2,
            );
        }
        cells
    };
    let effects = by_weight(summary);
    let rows = effects.iter().filter(|effect| shown(effect));
    let rows = rows.flat_map(|effect| effect.levels.iter().map(move |level| row(effect, level)));
    let alike: Vec<&str> = effects
        .iter()
        .filter(|e| e.best.is_empty())
        .map(|e| e.field.as_str())
        .collect();
    let alike = match alike[..] {
        [] => String::new(),
        _ => format!("; nothing is told apart along {}", alike.join(", ")),
    };
    Table::new(
        format!("By value of each field (of a distribution: by sixteenths){alike}"),
        columns,
        rows,
    )
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
    let [what, unit] = match summary.limit {
        Some(_) => ["Bad drives".to_string(), " (%)".into()],
        None => [format!("Mean {}", label(summary.judge)), String::new()],
    };
    let digits = if summary.limit.is_some() {
        2
    } else {
        decimals(summary.judge)
    };
    let row = |effect: &Effect, level: &haptic_batch::sweep::Level| {
        let value = |label: &String| {
            let own = level.compared.iter().find(|own| own.label == *label);
            let value = own.and_then(|own| own.drives.beyond.map(|share| 100.0 * share).or(own.drives.mean));
            Cell::number(value, digits)
        };
        let mut cells = vec![
            Cell::Text(effect.field.clone()),
            Cell::Text(level.label.clone()),
            Cell::number(level.drives.count as f64, 0),
        ];
        cells.extend(labels.iter().map(value));
        cells
    };
    let rows = effects
        .iter()
        .take(most)
        .flat_map(|effect| effect.levels.iter().map(move |level| row(effect, level)));
    let mut columns: Vec<String> = ["Field", "Value", "Drives"].map(String::from).to_vec();
    columns.extend(labels.iter().map(|own| format!("{own}{unit}")));
    Table::new(
        format!("{what} by {compare}, along the other fields"),
        columns,
        rows,
    )
}

fn worst(sweep: &Sweep, summary: &Summary, file: &str) -> Table {
    let mut columns = vec!["Drive".to_string()];
    columns.extend(sweep.columns().map(String::from));
    columns.extend([heading(summary.judge), "Ended".into(), "Again".into()]);
    let row = |drive: &haptic_batch::sweep::Worst| {
        let mut cells = vec![Cell::number(drive.drive as f64, 0)];
        cells.extend(drive.values.iter().map(|value| Cell::Text(short(value))));
        cells.push(Cell::number(drive.value, decimals(summary.judge)));
        let ended = if drive.diverged { "diverged" } else { "at its end" };
        let left = drive.away.when_and_why().filter(|_| drive.away.is_by_itself());
        cells.push(Cell::Text(
            left.map_or(ended.into(), |left| format!("{ended}; guidance ended {left}")),
        ));
        cells.push(Cell::Text(format!(
            "host-sim sweep {file} --replay {}",
            drive.drive
        )));
        cells
    };
    Table::new(
        format!("The worst drives by {}", label(summary.judge)),
        columns,
        summary.worst.iter().map(row),
    )
}

/// Six digits tell drives apart.
fn short(value: &str) -> String {
    match value.parse::<f64>() {
        Ok(number) if value.len() > 8 => format!("{number:.6}"),
        _ => value.into(),
    }
}
