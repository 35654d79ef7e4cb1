//! Rows times seeds, on every core, and what came of them.

use rayon::prelude::*;
use serde::Serialize;

use super::deviation::{Deviation, MOST_EXCESS_M};
use super::drivers::{Drivers, Limits};
use super::table::{Class, FaultCase, Place};
use super::trial::{TrialOutcome, World};
use haptic_core::controller::params::LAWS;
use haptic_sim::share::wilson;

/// What a campaign showed.
#[derive(Debug, Clone, Serialize)]
pub struct Campaign {
    /// Runs of all rows.
    pub runs: u64,
    /// ECU cycles in which every rule was checked.
    pub cycles: u64,
    /// Row by row.
    pub rows: Vec<CaseResult>,
    /// Name of the world; `None` is the paper's.
    pub world: Option<&'static str>,
    /// Who drove.
    pub drivers: Drivers,
    /// Name of the guidance law on the ECU.
    pub law: &'static str,
    /// How far a fault may move their vehicle.
    pub limits: Limits,
    /// The first seed.
    pub first_seed: u64,
    /// Whether the column has a torsion bar, which the limits were not chosen for.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub has_bar: bool,
}

impl Campaign {
    pub(super) fn new(rows: Vec<CaseResult>) -> Self {
        Self {
            runs: rows.iter().map(|row| row.runs).sum(),
            cycles: rows.iter().map(|row| row.cycles).sum(),
            rows,
            world: None,
            drivers: Drivers::Paper,
            law: LAWS[0],
            limits: Drivers::Paper.limits(),
            first_seed: 1,
            has_bar: false,
        }
    }

    /// Every run that failed, by a rule or by where the vehicle went.
    pub fn failures(&self) -> impl Iterator<Item = &FailedTrial> {
        self.rows.iter().flat_map(|row| &row.failures)
    }

    /// Rows whose vehicles leave the lane more often than the drivers' limit allows.
    pub fn too_often(&self) -> impl Iterator<Item = &CaseResult> {
        self.rows.iter().filter(|row| row.leaves_too_often)
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
    /// Whether the row asks the ECU to leave.
    pub asks_to_leave: bool,
    /// Whether the row lets the ECU leave: it asks for it, or the ECU may notice that something is wrong.
    pub may_leave: bool,
    /// Runs in which the ECU noticed something: it reported a fault after the onset, or left.
    pub noticed: u64,
    /// Their share, from and to, 95 %.
    pub noticed_interval: [f64; 2],
    /// From the onset until then, ms: the median of those runs, and what 95 % of them keep.
    pub noticed_after_ms: [Option<u32>; 2],
    /// Largest deviation of the runs in which it noticed nothing, m.
    pub unnoticed_deviation_m: Option<f64>,
    /// Largest torque of these runs, N.m.
    pub unnoticed_torque_nm: Option<f64>,
    /// Runs in which the ECU left: a handover, a fade, a latched fault.
    pub left: u64,
    /// From the onset until it left, ms: the median of those runs and the longest.
    pub left_after_ms: Option<[u32; 2]>,
    /// Deviation from the fault-free run that 95 % of all runs keep, m.
    pub deviation_95_m: f64,
    /// Largest deviation from the fault-free run, m.
    pub deviation_m: f64,
    /// Largest deviation had the torque been dropped in the step in which the ECU left, m; of the runs in which it
    /// left.
    pub dropped_m: Option<f64>,
    /// Most that a run went further than that, m.
    pub excess_m: Option<f64>,
    /// Runs that went further than that by more than is allowed.
    pub beyond_drop: u64,
    /// Runs whose deviation is more than the drivers' limit allows.
    pub beyond_limit: u64,
    /// Largest distance from the vehicle whose torque is cut at the onset, m; of class C alone.
    pub pushed_m: Option<f64>,
    /// Runs in which the vehicle left its lane and the fault-free one did not.
    pub left_lane: u64,
    /// Their share, from and to, 95 %.
    pub left_lane_interval: [f64; 2],
    /// Whether the drivers' limits judge the row.
    pub is_limited: bool,
    /// Whether more of them leave it than the drivers' limit allows: the interval begins above it.
    pub leaves_too_often: bool,
    /// Runs in which it went more than a lane's width aside with the torque dropped as well, or was there without the fault
    /// too when the ECU left; these are not judged by it.
    pub off_road: u64,
    /// What failed, by seed.
    pub failures: Vec<FailedTrial>,
}

/// What a run fails by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum FailedBy {
    /// A rule of every cycle, or what the row asks of the ECU.
    Ecu,
    /// Where the vehicle went.
    Vehicle,
}

/// A run that failed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct FailedTrial {
    /// Its row.
    pub row: &'static str,
    /// Its seed.
    pub seed: u64,
    /// What it fails by.
    pub by: FailedBy,
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
    let again = world.arguments();
    let per_row = (seeds.end - seeds.start).max(1) as usize;
    let rows: Vec<CaseResult> = rows
        .iter()
        .zip(outcomes.chunks(per_row))
        .map(|(row, outcomes)| result(row, outcomes, world.drivers().limits(), &again))
        .collect();
    Campaign {
        world: world.kind().map(|kind| kind.name),
        drivers: world.drivers(),
        law: world.law(),
        limits: world.drivers().limits(),
        first_seed: seeds.start,
        has_bar: world.has_bar(),
        ..Campaign::new(rows)
    }
}

/// What a row's runs showed; `again` is what its command needs beside row and seed.
pub(super) fn result(
    row: &'static FaultCase,
    outcomes: &[TrialOutcome],
    limits: Limits,
    again: &str,
) -> CaseResult {
    let failed = |outcome: &TrialOutcome, by, cycle, what| FailedTrial {
        row: row.name,
        seed: outcome.seed,
        by,
        cycle,
        what,
        replay: format!(
            "cargo xtask faults --rows {} --seed {}{again}",
            row.name, outcome.seed
        ),
    };
    let limits = row.limits(limits);
    let failures = outcomes.iter().filter_map(|outcome| match &outcome.failure {
        Some(violation) => Some(failed(
            outcome,
            FailedBy::Ecu,
            violation.step,
            violation.what.clone(),
        )),
        None => {
            let at_ms = outcome.onset_ms + outcome.left_after_ms.unwrap_or_default();
            let what = too_far(row, &outcome.deviation);
            let what = what.or_else(|| beyond(row, &outcome.deviation, limits))?;
            Some(failed(outcome, FailedBy::Vehicle, at_ms, what))
        }
    });
    let count = |of: &dyn Fn(&TrialOutcome) -> bool| outcomes.iter().filter(|o| of(o)).count() as u64;
    let most = |of: fn(&TrialOutcome) -> Option<f64>| outcomes.iter().filter_map(of).reduce(f64::max);
    let sorted_ms = |of: fn(&TrialOutcome) -> Option<u32>| {
        let mut times: Vec<u32> = outcomes.iter().filter_map(of).collect();
        times.sort_unstable();
        times
    };
    let left_after_ms = sorted_ms(|o| o.left_after_ms);
    let noticed_after_ms = sorted_ms(|o| o.noticed_after_ms);
    let mut deviations_m: Vec<f64> = outcomes.iter().map(|o| o.deviation.faulted_m).collect();
    deviations_m.sort_unstable_by(f64::total_cmp);
    let share = |count: usize| wilson(count as f64 / outcomes.len() as f64, outcomes.len() as f64);
    let left_lane = outcomes.iter().filter(|o| o.deviation.leaves_lane).count();
    CaseResult {
        name: row.name,
        class: row.class,
        place: row.place,
        runs: outcomes.len() as u64,
        seen: count(&|o| o.seen),
        cycles: outcomes.iter().map(|o| o.cycles).sum(),
        deadline_ms: row.deadline_ms(),
        worst_reaction_ms: outcomes.iter().filter_map(|o| o.reaction_ms).max(),
        torque_bound_nm: row.torque_nm,
        peak_torque_nm: outcomes.iter().map(|o| o.peak_nm).fold(0.0, f64::max),
        asks_to_leave: row.asks_to_leave(),
        may_leave: row.may_leave(),
        noticed: noticed_after_ms.len() as u64,
        noticed_interval: share(noticed_after_ms.len()),
        noticed_after_ms: [50, 95].map(|percent| quantile(&noticed_after_ms, percent)),
        unnoticed_deviation_m: most(|o| unnoticed(o).map(|o| o.deviation.faulted_m)),
        unnoticed_torque_nm: most(|o| unnoticed(o).map(|o| o.peak_nm)),
        left: left_after_ms.len() as u64,
        left_after_ms: left_after_ms
            .last()
            .map(|last| [left_after_ms[left_after_ms.len() / 2], *last]),
        deviation_95_m: quantile(&deviations_m, 95).unwrap_or_default(),
        deviation_m: most(|o| Some(o.deviation.faulted_m)).unwrap_or_default(),
        dropped_m: most(|o| o.deviation.dropped_m),
        excess_m: most(|o| o.deviation.excess_m()),
        beyond_drop: count(&|o| too_far(row, &o.deviation).is_some()),
        beyond_limit: count(&|o| beyond(row, &o.deviation, limits).is_some()),
        pushed_m: most(|o| o.deviation.pushed_m),
        left_lane: left_lane as u64,
        left_lane_interval: share(left_lane),
        is_limited: row.is_limited(),
        leaves_too_often: row.is_limited() && limits.left_lane.is_some_and(|most| share(left_lane)[0] > most),
        off_road: count(&|o| o.deviation.is_off_road()),
        failures: failures.collect(),
    }
}

/// A run in which the ECU noticed nothing.
fn unnoticed(outcome: &TrialOutcome) -> Option<&TrialOutcome> {
    outcome.noticed_after_ms.is_none().then_some(outcome)
}

/// What so many percent of sorted values do not exceed; `None` of nothing.
fn quantile<T: Copy>(sorted: &[T], percent: usize) -> Option<T> {
    let rank = (sorted.len() * percent).div_ceil(100);
    sorted.get(rank.saturating_sub(1)).copied()
}

/// What is wrong with a deviation by itself.
fn beyond(row: &FaultCase, deviation: &Deviation, limits: Limits) -> Option<String> {
    if !row.is_limited() {
        return None;
    }
    let pushed = deviation.pushed_m.zip(limits.pushed_m);
    if let Some((pushed_m, most_m)) = pushed.filter(|(pushed_m, most_m)| pushed_m > most_m) {
        return Some(format!(
            "a false torque pushed the vehicle {pushed_m:.2} m aside, {most_m:.2} m are allowed with these drivers"
        ));
    }
    (deviation.faulted_m > limits.deviation_m && !deviation.is_off_road()).then(|| {
        format!(
            "the vehicle went {:.2} m aside, {:.2} m are allowed with these drivers",
            deviation.faulted_m, limits.deviation_m
        )
    })
}

/// What is wrong with where a vehicle went, if anything is.
fn too_far(row: &FaultCase, deviation: &Deviation) -> Option<String> {
    let (excess_m, dropped_m) = (deviation.excess_m()?, deviation.dropped_m?);
    (row.obeys() && excess_m > MOST_EXCESS_M && !deviation.is_off_road()).then(|| {
        format!(
            "the vehicle went {:.2} m aside, {dropped_m:.2} m had the torque been dropped",
            deviation.faulted_m
        )
    })
}

#[cfg(test)]
mod tests;
