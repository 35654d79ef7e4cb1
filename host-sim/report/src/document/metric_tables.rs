//! Metrics as tables: the values of several runs, and what they mean.

use super::{Cell, Table};
use haptic_metrics::{DEFINITIONS, Definition, Metrics};

/// One row per run: what tells the runs apart (`keys`), then the metrics that `shown` picks.
pub fn metrics_table(
    caption: &str,
    keys: &[&str],
    runs: &[(Vec<Cell>, Metrics)],
    shown: impl Fn(&Definition) -> bool,
) -> Table {
    let shown: Vec<_> = DEFINITIONS.iter().filter(|d| shown(d)).collect();
    let row = |(key, metrics): &(Vec<Cell>, Metrics)| {
        let values = shown
            .iter()
            .map(|d| Cell::number((d.value)(metrics), decimals(d.unit)));
        key.iter().cloned().chain(values).collect()
    };
    let keys = keys.iter().map(|k| k.to_string());
    Table::new(
        caption,
        keys.chain(shown.iter().map(|d| heading(d))),
        runs.iter().map(row),
    )
}

/// What every metric means, in which unit, and where it comes from.
pub fn definitions_table() -> Table {
    let row = |d: &Definition| [d.label, d.name, d.unit, d.definition, d.source];
    Table::of_texts(
        "e: lateral error; T_d: driver's torque; T_h: guidance torque; v: speed; r: yaw rate.",
        ["Metric", "Name in JSON", "Unit", "Definition", "Source"],
        DEFINITIONS.iter().map(row),
    )
}

fn heading(definition: &Definition) -> String {
    match definition.unit {
        "1" => definition.label.into(),
        unit => format!("{} ({unit})", definition.label),
    }
}

/// Enough digits to see what matters: 0.1 mm, 1 mN.m, 10 ms.
fn decimals(unit: &str) -> usize {
    match unit {
        "m" | "rad" => 4,
        "s" => 2,
        "1/min" => 1,
        _ => 3,
    }
}
