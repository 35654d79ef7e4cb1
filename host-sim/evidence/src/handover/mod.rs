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
mod instants;
mod results;
#[cfg(test)]
mod tests;

pub use bend::{Bend, Side};
use instants::{Instant, instants, row};
pub use results::{Figure, HandoverResults, HandoverRow, MOST_BESIDE_DROP, Place};

use haptic_batch::engine::{Watch, runs};
use haptic_batch::paper::DRIVERS_T_P;
use haptic_batch::{Away, StudyError, peak_m};
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::models::road::Course;
use haptic_sim::scenario::{Condition, Failure, FailureKind, Scenario};
use haptic_sim::simulation::Run;

/// Spacing of the instants, s.
pub const EVERY_S: f64 = 0.25;
/// Reliances of the guided drivers.
pub const RELIANCES: [Condition; 2] = [Condition::High, Condition::Mid];
/// When drivers take over after a failure, s; the paper's after 1 s.
pub const TAKES_OVER_S: [f64; 4] = [0.5, 1.0, 1.5, 2.0];
/// So long behind a failure the peak is looked for, s.
const AFTER_S: f64 = 8.0;
/// The straight behind the bend, s: for whoever drives by hand, and for the others.
const BEHIND_S: [f64; 2] = [24.0, 10.0];
/// An error below this has died down whatever it was before, m.
const SETTLED_M: f64 = 0.005;
/// What fails at an instant.
const KINDS: [FailureKind; 2] = [FailureKind::Input, FailureKind::Torque];

/// A driver in a bend to one side.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Driver {
    bend: Bend,
    side: Side,
    t_p: f64,
}

/// A drive of the study.
#[derive(Debug, Clone)]
struct Drive {
    driver: Driver,
    /// By hand, or how much the driver relies on the guidance.
    condition: Condition,
    failure: Failure,
    takes_over_after_s: f64,
    road: Course,
}

/// Drives every bend on all cores.
///
/// # Errors
/// As [`haptic_sim::scenario::ScenarioBuilder::build`], none of these scenarios meets one; a run that differs from the shipping
/// ECU's.
pub fn study(every_s: f64, watch: &Watch<'_>) -> Result<HandoverResults, StudyError> {
    let bends = Bend::all();
    let instants = instants_of(&bends, every_s, watch)?;
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

/// What came of every instant of some bends, for the drivers who are judged there.
fn instants_of(bends: &[Bend], every_s: f64, watch: &Watch<'_>) -> Result<Vec<Instant>, StudyError> {
    let drives = bends.iter().map(|bend| drives_of(*bend, every_s));
    let drives = drives.collect::<Result<Vec<_>, _>>()?.concat();
    let seed = Scenario::default().seed();
    let peaks = runs(&drives, seed, watch, scenario, |drive, scenario, run| {
        Ok(Peaks::new(drive.driver.bend, scenario, run))
    })?;
    Ok(instants(&drives, &peaks))
}

/// A bend's drives, driver by driver: by hand; then each reliance without a failure, and with each failure.
fn drives_of(bend: Bend, every_s: f64) -> Result<Vec<Drive>, StudyError> {
    let default_s = DriverParameters::default().takes_over_after_s;
    let mut drives = Vec::new();
    for side in [Side::Left, Side::Right] {
        let [by_hand, guided] = BEHIND_S.map(|behind_s| bend.course(side, behind_s));
        let (by_hand, guided) = (by_hand?, guided?);
        for t_p in DRIVERS_T_P {
            let drive = |road: &Course, condition, kind, time_s, takes_over_after_s| Drive {
                driver: Driver { bend, side, t_p },
                condition,
                failure: Failure {
                    kind,
                    time_s,
                    duration_s: None,
                },
                takes_over_after_s,
                road: road.clone(),
            };
            drives.push(drive(
                &by_hand,
                Condition::Manual,
                FailureKind::None,
                0.0,
                default_s,
            ));
            for condition in RELIANCES {
                drives.push(drive(&guided, condition, FailureKind::None, 0.0, default_s));
                for at_s in bend.instants_s(every_s) {
                    for after_s in TAKES_OVER_S {
                        drives.extend(KINDS.map(|kind| drive(&guided, condition, kind, at_s, after_s)));
                    }
                }
            }
        }
    }
    Ok(drives)
}

fn scenario(drive: &Drive) -> Result<Scenario, StudyError> {
    let driver = DriverParameters {
        t_p: drive.driver.t_p,
        takes_over_after_s: drive.takes_over_after_s,
        ..Default::default()
    };
    let scenario = Scenario::builder()
        .course(drive.road.clone())
        .speed_kmh(drive.driver.bend.speed_kmh)
        .condition(drive.condition)
        .driver(driver)
        .failure(drive.failure);
    Ok(scenario.build()?)
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
        let (ends_s, forever) = (bend.ends_s(), f64::INFINITY);
        let [whole_m, second_half_m] =
            [0.0, 0.5 * BEHIND_S[0]].map(|behind_s| peak_m(run, [ends_s + behind_s, forever]));
        let failed_at_s = scenario.failure().at_s();
        Self {
            peak_m: peak_m(
                run,
                failed_at_s.map_or([0.0, forever], |at_s| [at_s, at_s + AFTER_S]),
            ),
            settles: second_half_m < (0.9 * whole_m).max(SETTLED_M),
            left_by_itself: Away::new(scenario, &run.trace).is_by_itself(),
        }
    }
}
