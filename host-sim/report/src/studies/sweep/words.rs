//! Metrics in words.

use haptic_analysis::metrics::{DEFINITIONS, Definition};

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

/// Digits after the point.
pub(super) fn decimals(metric: &str) -> usize {
    match definition(metric).map(|d| d.unit) {
        Some("1/min") => 1,
        Some("s") => 2,
        _ => 4,
    }
}
