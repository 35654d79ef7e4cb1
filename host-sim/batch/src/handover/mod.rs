//! What a lost input costs when the ECU hands over, and what a sudden loss of torque costs: at every instant of a bend, to the
//! left and to the right, for drivers who take over sooner or later.
//!
//! A drive is a bend with its straights at one speed, with one driver. The input or the torque fails at an instant, and the
//! *peak* is the largest lateral error of the next eight seconds. The *ratio* is that over the larger of two peaks of the same
//! bend: without a failure, and by hand. *Beside the drop* is the peak of a handover over that of a drop at the same instant;
//! what stays below the larger of those two peaks counts as much as they do.
//!
//! A driver is *judged* on a bend where the driver could take over: by hand the largest error stays within the lane, and it dies
//! down on the straight behind the bend, 24 s long (in the second half at most 0.9 times that of the whole). Low reliance is
//! left out: this driver drives nearly as by hand.
//!
//! - [`Bend`]: the roads and their speeds.
//! - [`study`]: the drives, and the worst and the median of what they cost.
//! - [`HandoverResults`]: what the study found, and what a row has to keep.

mod bend;
mod results;
#[cfg(test)]
mod tests;

pub use bend::{Bend, Side};
pub(crate) use bend::{peak_m, stretched_curve};
pub use results::{Figure, HandoverResults, HandoverRow, MOST_BESIDE_DROP, Place};

use super::Away;
use super::evaluate::DRIVERS_T_P;
use super::vectorised::run_all;
use crate::error::StudyError;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::scenario::{Condition, Failure, FailureKind, Scenario};
use haptic_sim::simulation::{DIVERGED_M, Run};

/// Spacing of the instants, s.
pub const EVERY_S: f64 = 0.25;
/// Reliances of the guided drivers.
pub const RELIANCES: [Condition; 2] = [Condition::High, Condition::Mid];
/// When drivers take over after a failure, s; the paper's after 1 s.
pub const TAKES_OVER_S: [f64; 4] = [0.5, 1.0, 1.5, 2.0];
/// What is left of the lane beside a vehicle of 1.7 m in its middle, m.
const IN_LANE_M: f64 = 0.95;
/// So long behind a failure the peak is looked for, s.
const AFTER_S: f64 = 8.0;
/// The straight behind the bend, s: for whoever drives by hand, and for the others.
const BEHIND_S: [f64; 2] = [24.0, 10.0];
/// An error below this has died down whatever it was before, m.
const SETTLED_M: f64 = 0.005;

/// What came of one instant, for the two ways to fail.
#[derive(Debug, Clone)]
struct Instant {
    bend: Bend,
    condition: Condition,
    takes_over_after_s: f64,
    side: Side,
    t_p: f64,
    at_s: f64,
    /// The handover's peak and the drop's, and the larger of those without a failure and by hand, m.
    peaks_m: [f64; 3],
    left_by_itself: usize,
}

impl Instant {
    fn handover(&self) -> f64 {
        self.peaks_m[0] / self.peaks_m[2]
    }

    fn drop(&self) -> f64 {
        self.peaks_m[1] / self.peaks_m[2]
    }

    fn beside_drop(&self) -> f64 {
        let [handover, drop, usual] = self.peaks_m;
        handover.max(usual) / drop.max(usual)
    }

    fn place(&self) -> Place {
        Place {
            speed_kmh: self.bend.speed_kmh,
            radius_m: self.bend.radius_m,
            side: self.side,
            t_p: self.t_p,
            instant_s: self.at_s - self.bend.begins_s(),
            place: self.bend.place(self.at_s),
        }
    }
}

/// How many drives the study takes.
pub fn drives(every_s: f64) -> usize {
    let of_bend = |bend: &Bend| {
        let guided = 1 + bend.instants_s(every_s).count() * TAKES_OVER_S.len() * KINDS.len();
        2 * DRIVERS_T_P.len() * (1 + RELIANCES.len() * guided)
    };
    Bend::all().iter().map(of_bend).sum()
}

/// Drives every bend on all cores; `progress` is called after each drive.
///
/// # Errors
/// As [`haptic_sim::scenario::ScenarioBuilder::build`], none of these scenarios meets one; a run that differs from the shipping
/// ECU's.
pub fn study(every_s: f64, progress: impl Fn() + Sync) -> Result<HandoverResults, StudyError> {
    let bends = Bend::all();
    let of_bends = bends.iter().map(|bend| instants_of(*bend, every_s, &progress));
    let instants = of_bends.collect::<Result<Vec<_>, _>>()?.concat();
    let rows = std::iter::once(None).chain(bends.iter().copied().map(Some));
    let rows = rows.flat_map(|bend| RELIANCES.map(|condition| (bend, condition)));
    let rows = rows.flat_map(|(bend, condition)| TAKES_OVER_S.map(|after_s| (bend, condition, after_s)));
    Ok(HandoverResults {
        every_s,
        rows: rows
            .map(|(bend, condition, after_s)| row(&instants, bend, condition, after_s))
            .collect(),
        most_beside_drop: MOST_BESIDE_DROP,
    })
}

/// What fails at an instant.
const KINDS: [FailureKind; 2] = [FailureKind::Input, FailureKind::Torque];

/// A bend's scenarios for one driver to one side: by hand; then each reliance without a failure, and with each failure.
fn scenarios_of(bend: Bend, side: Side, t_p: f64, every_s: f64) -> Result<Vec<Scenario>, StudyError> {
    let [by_hand, guided] = BEHIND_S.map(|behind_s| bend.course(side, behind_s));
    let (by_hand, guided) = (by_hand?, guided?);
    let build = |condition, kind, time_s, takes_over_after_s| {
        let is_manual = condition == Condition::Manual;
        let driver = DriverParameters {
            t_p,
            takes_over_after_s,
            ..Default::default()
        };
        let scenario = Scenario::builder()
            .course(if is_manual {
                by_hand.clone()
            } else {
                guided.clone()
            })
            .speed_kmh(bend.speed_kmh)
            .condition(condition)
            .driver(driver)
            .failure(Failure {
                kind,
                time_s,
                duration_s: None,
            });
        Ok::<_, StudyError>(scenario.build()?)
    };
    let default_s = DriverParameters::default().takes_over_after_s;
    let mut scenarios = vec![build(Condition::Manual, FailureKind::None, 0.0, default_s)?];
    for condition in RELIANCES {
        scenarios.push(build(condition, FailureKind::None, 0.0, default_s)?);
        for at_s in bend.instants_s(every_s) {
            for takes_over_after_s in TAKES_OVER_S {
                for kind in KINDS {
                    scenarios.push(build(condition, kind, at_s, takes_over_after_s)?);
                }
            }
        }
    }
    Ok(scenarios)
}

/// Peaks of a drive, m, and whether the ECU left by itself.
#[derive(Debug, Clone, Copy)]
struct Peaks {
    /// From the failure on; without one of the whole drive.
    peak_m: f64,
    /// Whether it dies down on the straight behind the bend.
    settles: bool,
    left_by_itself: bool,
}

impl Peaks {
    fn new(bend: Bend, scenario: &Scenario, run: &Run) -> Self {
        let most_m = |from_s: f64, to_s: f64| {
            let samples = run.trace.samples.iter();
            let errors_m = samples
                .filter(|s| (from_s..=to_s).contains(&s.time_s))
                .map(|s| s.lateral_error_m.abs());
            if run.diverged() {
                DIVERGED_M
            } else {
                errors_m.fold(0.0, f64::max)
            }
        };
        let (ends_s, forever) = (bend.ends_s(), f64::INFINITY);
        let [whole_m, second_half_m] =
            [0.0, 0.5 * BEHIND_S[0]].map(|behind_s| most_m(ends_s + behind_s, forever));
        Self {
            peak_m: scenario
                .failure()
                .at_s()
                .map_or_else(|| most_m(0.0, forever), |at_s| most_m(at_s, at_s + AFTER_S)),
            settles: second_half_m < (0.9 * whole_m).max(SETTLED_M),
            left_by_itself: Away::new(scenario, &run.trace).is_by_itself(),
        }
    }
}

/// What came of every instant of a bend, for the drivers who are judged there.
fn instants_of(bend: Bend, every_s: f64, progress: &(impl Fn() + Sync)) -> Result<Vec<Instant>, StudyError> {
    let of_sides = [Side::Left, Side::Right].map(|side| DRIVERS_T_P.map(|t_p| (side, t_p)));
    let drivers = of_sides.concat();
    let scenarios = drivers
        .iter()
        .map(|(side, t_p)| scenarios_of(bend, *side, *t_p, every_s))
        .collect::<Result<Vec<_>, _>>()?
        .concat();
    let peaks = run_all(&scenarios, scenarios[0].seed(), |number, run| {
        progress();
        Ok(Peaks::new(bend, &scenarios[number], run))
    })?;
    let each = peaks.len() / drivers.len();
    let of_drivers = drivers.iter().zip(peaks.chunks(each));
    Ok(of_drivers
        .flat_map(|((side, t_p), peaks)| instants_of_driver(bend, *side, *t_p, every_s, peaks))
        .collect())
}

/// From the drives as [`scenarios_of`] has them.
fn instants_of_driver(bend: Bend, side: Side, t_p: f64, every_s: f64, peaks: &[Peaks]) -> Vec<Instant> {
    let (by_hand, guided) = (peaks[0], &peaks[1..]);
    if !by_hand.settles || by_hand.peak_m > IN_LANE_M {
        return Vec::new();
    }
    let of_reliances = RELIANCES
        .into_iter()
        .zip(guided.chunks(guided.len() / RELIANCES.len()));
    let mut found = Vec::new();
    for (condition, peaks) in of_reliances {
        let (nominal, failed) = (peaks[0], peaks[1..].chunks(KINDS.len()));
        let at = bend
            .instants_s(every_s)
            .flat_map(|at_s| TAKES_OVER_S.map(|after_s| (at_s, after_s)));
        for ((at_s, takes_over_after_s), failed) in at.zip(failed) {
            let drives = [nominal, failed[0], failed[1]];
            found.push(Instant {
                bend,
                condition,
                takes_over_after_s,
                side,
                t_p,
                at_s,
                peaks_m: [
                    failed[0].peak_m,
                    failed[1].peak_m,
                    nominal.peak_m.max(by_hand.peak_m),
                ],
                left_by_itself: drives.iter().filter(|drive| drive.left_by_itself).count(),
            });
        }
    }
    found
}

fn row(all: &[Instant], bend: Option<Bend>, condition: Condition, takes_over_after_s: f64) -> HandoverRow {
    let is_here = |instant: &Instant| bend.map_or(!instant.bend.is_papers, |bend| bend == instant.bend);
    let is_asked = |instant: &&Instant| {
        is_here(instant) && instant.condition == condition && instant.takes_over_after_s == takes_over_after_s
    };
    let instants: Vec<&Instant> = all.iter().filter(is_asked).collect();
    HandoverRow {
        bend,
        condition,
        takes_over_after_s,
        instants: instants.len(),
        handover: figure(&instants, 0, Instant::handover),
        drop: figure(&instants, 1, Instant::drop),
        beside_drop: figure(&instants, 0, Instant::beside_drop),
        left_by_itself: instants.iter().map(|instant| instant.left_by_itself).sum(),
    }
}

/// A figure of the drives whose peaks are in this place of an instant's.
fn figure(instants: &[&Instant], peak: usize, of: impl Fn(&Instant) -> f64) -> Option<Figure> {
    let mut values: Vec<f64> = instants.iter().map(|instant| of(instant)).collect();
    values.sort_by(f64::total_cmp);
    let worst = instants.iter().max_by(|a, b| of(a).total_cmp(&of(b)))?;
    Some(Figure {
        worst: of(worst),
        worst_peak_m: worst.peaks_m[peak],
        median: values[values.len() / 2],
        at: worst.place(),
    })
}
