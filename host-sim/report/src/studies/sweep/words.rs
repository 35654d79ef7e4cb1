//! Metrics in words, and the order of fields.

use haptic_analysis::metrics::{DEFINITIONS, Definition};
use haptic_batch::sweep::{Effect, Summary};

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

/// The varied fields, that which explains most of the metric that judges first.
pub(super) fn by_weight(summary: &Summary) -> Vec<&Effect> {
    let share = |effect: &Effect| {
        let of_judge = effect.shares.iter().find(|(metric, _)| *metric == summary.judge);
        of_judge.and_then(|(_, share)| *share).unwrap_or(0.0)
    };
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
