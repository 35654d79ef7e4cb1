//! Figures held by a file, so that a change of size or cost shows in a diff and is meant.
//!
//! A figure may differ from the file's by its tolerance, up or down: less is a reason to bless it too, or the
//! next growth passes unseen.

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};

use crate::tool;

/// One figure.
pub(crate) struct Figure {
    pub(crate) name: String,
    pub(crate) unit: &'static str,
    pub(crate) value: u64,
    /// Allowed difference, percent of the file's value. Compiler and dependencies are pinned: what is left is
    /// what the machine that counts brings along.
    pub(crate) tolerance_percent: u64,
}

pub(crate) fn figure(name: &str, unit: &'static str, value: u64, tolerance_percent: u64) -> Figure {
    Figure {
        name: name.to_owned(),
        unit,
        value,
        tolerance_percent,
    }
}

fn path() -> PathBuf {
    tool::root().join("xtask/golden.json")
}

fn read() -> Result<BTreeMap<String, u64>> {
    let text = std::fs::read_to_string(path()).context("xtask/golden.json")?;
    serde_json::from_str(&text).context("xtask/golden.json")
}

/// Prints the figures beside the file's; writes them into the file if `bless`.
///
/// # Errors
/// A figure is away from the file's by more than its tolerance, or not in it.
pub(crate) fn check(figures: &[Figure], bless: bool) -> Result<()> {
    if bless {
        // Others' figures stay.
        let mut values = read()?;
        values.extend(figures.iter().map(|f| (f.name.clone(), f.value)));
        std::fs::write(path(), serde_json::to_string_pretty(&values)? + "\n")?;
    }
    let golden = read()?;
    println!("{:<44}{:>12}{:>12}  tolerance", "figure", "now", "golden");
    let mut away = Vec::new();
    for figure in figures {
        let held = golden.get(&figure.name).copied();
        let shown = held.map_or("none".to_owned(), |value| value.to_string());
        println!(
            "{:<44}{:>12}{shown:>12}  {} %",
            format!("{}, {}", figure.name, figure.unit),
            figure.value,
            figure.tolerance_percent
        );
        if held.is_none_or(|held| !is_near(figure.value, held, figure.tolerance_percent)) {
            away.push(figure.name.as_str());
        }
    }
    if !away.is_empty() {
        bail!(
            "{} changed; if that is meant, repeat the command with --bless",
            away.join(", ")
        );
    }
    Ok(())
}

fn is_near(value: u64, golden: u64, percent: u64) -> bool {
    value.abs_diff(golden) * 100 <= golden * percent
}

#[cfg(test)]
mod tests {
    use super::is_near;

    #[test]
    fn the_tolerance_counts_both_ways_and_includes_its_end() {
        assert!(is_near(980, 1000, 2) && is_near(1020, 1000, 2));
        assert!(!is_near(979, 1000, 2) && !is_near(1021, 1000, 2));
        assert!(is_near(0, 0, 2) && !is_near(1, 0, 2));
    }
}
