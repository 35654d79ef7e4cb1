//! Metrics in words, and the order of fields.

use haptic_batch::sweep::{Effect, Summary};
use haptic_metrics::{DEFINITIONS, Definition};

fn definition(metric: &str) -> Option<&'static Definition> {
    DEFINITIONS.iter().find(|d| d.name == metric)
}

pub(super) fn label(metric: &str) -> String {
    definition(metric).map_or(metric, |d| d.label).into()
}

pub(super) fn heading(metric: &str) -> String {
    match definition(metric) {
        Some(d) if d.unit != "1" => format!("{} ({})", d.label, d.unit),
        _ => label(metric),
    }
}

/// Label and unit, `-` if that is 1.
pub(super) fn metric(metric: &str) -> (String, &'static str) {
    let unit = definition(metric).map_or("-", |d| d.unit);
    (label(metric), if unit == "1" { "-" } else { unit })
}

/// A label that stands behind other words: abbreviations keep their capitals.
pub(super) fn lower(name: &str) -> String {
    let mut letters = name.chars();
    match (letters.next(), letters.clone().next()) {
        (Some(first), Some(second)) if second.is_lowercase() => {
            format!("{}{}", first.to_lowercase(), letters.as_str())
        }
        _ => name.into(),
    }
}

/// What stands for the unit of a field that has a name or a factor of the sweep's own.
pub(super) const OWN_UNIT: &str = "as in the sweep";

/// How much of a metric's variance a field explains by itself.
pub(super) fn share(effect: &Effect, metric: &str) -> Option<f64> {
    effect.shares.iter().find(|(name, _)| *name == metric)?.1
}

/// The varied fields, that which explains most of the metric that judges first.
pub(super) fn by_weight(summary: &Summary) -> Vec<&Effect> {
    let share = |effect: &Effect| share(effect, summary.judge).unwrap_or(0.0);
    let mut effects: Vec<&Effect> = summary.effects.iter().collect();
    effects.sort_by(|a, b| share(b).total_cmp(&share(a)));
    effects
}

/// Digits after the point.
pub(super) fn decimals(metric: &str) -> usize {
    match definition(metric).map(|d| d.unit) {
        Some("1/min") => 1,
        Some("s") => 2,
        _ => 4,
    }
}
