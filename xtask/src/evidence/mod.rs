//! Figures that documents show. `docs/evidence.toml` lists *measurements*, each with its command and with a rule, fixed before,
//! of when it ends; and *tables*, each with the document that shows it.
//!
//! A measurement is kept in `docs/evidence/NAME.jsonl` with its commit, and the tables are written from what is kept, so
//! that nobody pastes a figure by hand. It is *stale* once the code that it judges differs from its commit's.

mod document;
mod kept;
mod list;
mod measure;
mod stale;
mod tables;

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use clap::Args;

use crate::tool::{self, Usage};
use kept::Kept;
use list::{List, Seeds};
use stale::State;

/// How a person starts a measurement's program.
const PROGRAM: &str = "cargo xtask";
/// The list.
const LIST: &str = "docs/evidence.toml";
/// The mode without a measurement.
const RENDER: &str = "cargo xtask evidence --write";

/// What to do with the figures.
#[derive(Args)]
pub(crate) struct Options {
    /// Measurements to make, by name. One that is interrupted leaves everything as it was, and goes on from its parts
    #[arg(value_name = "NAME")]
    names: Vec<String>,
    /// Every measurement that is stale or missing, those with held-out seeds last
    #[arg(long, conflicts_with = "names")]
    all: bool,
    /// Seeds in place of the rule's; the documents say both
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    seeds: Option<u64>,
    /// Hours on each road in place of the rule's; the documents say both
    #[arg(long, value_name = "H")]
    hours: Option<f64>,
    /// Why held-out seeds are used once more: with other code, or more or fewer of them. The documents say it
    #[arg(long, value_name = "WHY")]
    again: Option<String>,
    /// See whether today's code gives the same in the first twentieth of the runs, to nine digits, and keep the figures if it
    /// does. PROGRAM is the one of their commit: target/release/evidence of a checkout of it
    #[arg(long, value_name = "PROGRAM", conflicts_with_all = ["seeds", "hours", "again"])]
    same: Option<PathBuf>,
    /// List the measurements that are older than the code that they judge, or missing: exit code 1 if there is one
    #[arg(long, conflicts_with_all = ["names", "all", "check", "write"])]
    stale: bool,
    /// Exit code 1 if a table in a document is not what was measured
    #[arg(long, conflicts_with_all = ["names", "all", "write"])]
    check: bool,
    /// Write every table anew from what is kept, and measure nothing
    #[arg(long, conflicts_with_all = ["names", "all"])]
    write: bool,
}

/// Does what is asked for.
pub(crate) fn run(options: &Options) -> Result<()> {
    if options.check {
        return check();
    }
    if options.stale {
        return stale();
    }
    let list = List::read()?;
    if options.write {
        return document::write(&list, &all_kept(&list)?);
    }
    let asked = measure::Asked {
        seeds: options.seeds,
        hours: options.hours,
        again: options.again.as_deref(),
    };
    let names = match options.all {
        true => &stale_or_missing(&list)?,
        false => &options.names,
    };
    if names.is_empty() && !options.all {
        let is_given = [
            options.seeds.is_some(),
            options.hours.is_some(),
            options.again.is_some(),
            options.same.is_some(),
        ];
        if is_given.contains(&true) {
            let message = "--seeds, --hours, --again and --same are of a measurement: NAME, or --all";
            return Err(Usage(message.into()).into());
        }
        return print(&list, |_| true);
    }
    for name in names {
        if !list.measurement.contains_key(name) {
            let names: Vec<&str> = list.measurement.keys().map(String::as_str).collect();
            return Err(Usage(format!("{name}: {LIST} has {}", names.join(", "))).into());
        }
    }
    match &options.same {
        Some(then) => measure::same(&list, names, then),
        None => measure::all(&list, names, &asked),
    }
}

/// Holds the documents' tables to what is kept.
pub(crate) fn check() -> Result<()> {
    let list = List::read()?;
    let wrong = document::differing(&list, &all_kept(&list)?)?;
    for what in &wrong {
        eprintln!("{what}");
    }
    ensure!(
        wrong.is_empty(),
        "{} tables are not what was measured: {RENDER}",
        wrong.len()
    );
    println!("{} tables are what was measured", list.table.len());
    Ok(())
}

/// Lists what is older than the code that it judges.
pub(crate) fn stale() -> Result<()> {
    let list = List::read()?;
    print(&list, |state| !state.is_fresh())?;
    let old = stale_or_missing(&list)?.len();
    let all = list.measurement.len();
    ensure!(
        old == 0,
        "{old} of {all} measurements are stale or missing: cargo xtask evidence --all"
    );
    println!("no figure is older than the code that it judges");
    Ok(())
}

/// Names of measurements to make, those that use up held-out seeds last.
fn stale_or_missing(list: &List) -> Result<Vec<String>> {
    let kept = all_kept(list)?;
    let mut old = Vec::new();
    for (name, measurement) in &list.measurement {
        if !stale::state(measurement, kept.get(name))?.is_fresh() {
            old.push((measurement.seeds == Seeds::HeldOut, name.clone()));
        }
    }
    old.sort();
    Ok(old.into_iter().map(|(_, name)| name).collect())
}

/// A line for each measurement whose state is to be shown.
fn print(list: &List, is_shown: impl Fn(&State) -> bool) -> Result<()> {
    let kept = all_kept(list)?;
    for (name, measurement) in &list.measurement {
        let state = stale::state(measurement, kept.get(name))?;
        if is_shown(&state) {
            println!("{name:<22} {:<12} {state}", measurement.rule.to_string());
        }
    }
    Ok(())
}

/// What is kept of every measurement that was made.
fn all_kept(list: &List) -> Result<BTreeMap<String, Kept>> {
    let made = list.measurement.keys().filter(|name| kept_in(name).exists());
    made.map(|name| Ok((name.clone(), Kept::read(&kept_in(name))?)))
        .collect()
}

/// The file of a measurement.
fn kept_in(name: &str) -> PathBuf {
    tool::root()
        .join("docs/evidence")
        .join(name)
        .with_extension("jsonl")
}

/// Writes a file as a whole or not at all.
fn replace(path: &std::path::Path, text: &str) -> Result<()> {
    let beside = path.with_extension("new");
    let written = std::fs::write(&beside, text).and_then(|()| std::fs::rename(&beside, path));
    written.with_context(|| path.display().to_string())
}
