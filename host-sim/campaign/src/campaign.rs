//! Rows times seeds, on every core, and what came of them.

use rayon::prelude::*;
use serde::Serialize;

use super::table::{Class, FaultCase, Place};
use super::trial::{TrialOutcome, World};

/// What a campaign showed.
#[derive(Debug, Clone, Serialize)]
pub struct Campaign {
    /// Runs of all rows.
    pub runs: u64,
    /// ECU cycles in which every rule was checked.
    pub cycles: u64,
    /// Row by row.
    pub rows: Vec<CaseResult>,
}

impl Campaign {
    pub(super) fn of(rows: Vec<CaseResult>) -> Self {
        Self {
            runs: rows.iter().map(|row| row.runs).sum(),
            cycles: rows.iter().map(|row| row.cycles).sum(),
            rows,
        }
    }

    /// Every run that failed.
    pub fn failures(&self) -> impl Iterator<Item = &FailedTrial> {
        self.rows.iter().flat_map(|row| &row.failures)
    }
}

/// What a row's runs showed.
#[derive(Debug, Clone, Serialize)]
pub struct CaseResult {
    /// The row.
    pub name: &'static str,
    /// Its class.
    pub class: Class,
    /// Where it runs.
    pub place: Place,
    /// Runs, one a seed.
    pub runs: u64,
    /// Runs in which the fault could be seen.
    pub seen: u64,
    /// ECU cycles in which every rule was checked.
    pub cycles: u64,
    /// The latest a reaction may come, ms; `None` where none is asked for.
    pub deadline_ms: Option<u32>,
    /// The latest that one came, ms.
    pub worst_reaction_ms: Option<u32>,
    /// Largest torque allowed, N.m.
    pub torque_bound_nm: f64,
    /// Largest torque seen, N.m.
    pub peak_torque_nm: f64,
    /// What failed, by seed.
    pub failures: Vec<FailedTrial>,
}

/// A run that failed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct FailedTrial {
    /// Its row.
    pub row: &'static str,
    /// Its seed.
    pub seed: u64,
    /// The cycle, ms after the start of the run.
    pub cycle: u32,
    /// What was wrong.
    pub what: String,
    /// The command that runs it again.
    pub replay: String,
}

/// Runs each row with `seeds`; `done` is called after every run.
pub fn run(
    world: &World,
    rows: &[&'static FaultCase],
    seeds: std::ops::Range<u64>,
    done: impl Fn() + Sync,
) -> Campaign {
    let trials: Vec<(&'static FaultCase, u64)> = rows
        .iter()
        .flat_map(|row| seeds.clone().map(|seed| (*row, seed)))
        .collect();
    let outcomes: Vec<TrialOutcome> = trials
        .par_iter()
        .map(|(row, seed)| {
            let outcome = world.run(row, *seed);
            done();
            outcome
        })
        .collect();
    let per_row = (seeds.end - seeds.start).max(1) as usize;
    let rows: Vec<CaseResult> = rows
        .iter()
        .zip(outcomes.chunks(per_row))
        .map(|(row, outcomes)| result(row, outcomes, ""))
        .collect();
    Campaign::of(rows)
}

/// What a row's runs showed; `again` is what its command needs beside row and seed.
pub(super) fn result(row: &'static FaultCase, outcomes: &[TrialOutcome], again: &str) -> CaseResult {
    let failures = outcomes.iter().filter_map(|outcome| {
        let violation = outcome.failure.as_ref()?;
        Some(FailedTrial {
            row: row.name,
            seed: outcome.seed,
            cycle: violation.step,
            what: violation.what.clone(),
            replay: format!(
                "host-sim faults --rows {} --seed {}{again}",
                row.name, outcome.seed
            ),
        })
    });
    CaseResult {
        name: row.name,
        class: row.class,
        place: row.place,
        runs: outcomes.len() as u64,
        seen: outcomes.iter().filter(|o| o.seen).count() as u64,
        cycles: outcomes.iter().map(|o| o.cycles).sum(),
        deadline_ms: row.deadline_ms(),
        worst_reaction_ms: outcomes.iter().filter_map(|o| o.reaction_ms).max(),
        torque_bound_nm: row.torque_nm,
        peak_torque_nm: outcomes.iter().map(|o| o.peak_nm).fold(0.0, f64::max),
        failures: failures.collect(),
    }
}
