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
//! - [`Handover`]: the drives, and the worst and the median of what they cost.
//! - [`HandoverResults`]: what the study found, and what a row has to keep.

mod bend;
mod instants;
mod results;
#[cfg(test)]
mod tests;

pub use bend::{Bend, Side};
use instants::{instants, row};
pub use results::{Figure, HandoverResults, HandoverRow, MOST_BESIDE_DROP, Place};

use crate::Away;
use crate::engine::{Part, Plan, Study};
use crate::error::StudyError;
use crate::paper::DRIVERS_T_P;
use crate::record::peak_m;
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

/// How a driver goes through a bend.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Way {
    ByHand,
    /// With guidance that does not fail.
    Guided(Condition),
    Failed {
        condition: Condition,
        kind: FailureKind,
        at_s: f64,
        takes_over_after_s: f64,
    },
}

/// A drive of the study.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    driver: Driver,
    way: Way,
    /// Place of the road, of those for who drives by hand and for the others.
    road: [usize; 2],
}

/// The study: every bend to both sides with every driver, a failure at instants so far apart.
#[derive(Debug, Clone)]
pub struct Handover {
    every_s: f64,
    bends: Vec<Bend>,
    /// By bend and side: for who drives by hand, and for the others.
    roads: Vec<[Course; 2]>,
}

impl Handover {
    /// With instants so far apart.
    ///
    /// # Errors
    /// None of these roads meets one.
    pub fn new(every_s: f64) -> Result<Self, StudyError> {
        Self::of_bends(Bend::all(), every_s)
    }

    fn of_bends(bends: Vec<Bend>, every_s: f64) -> Result<Self, StudyError> {
        let sides = bends
            .iter()
            .flat_map(|bend| [Side::Left, Side::Right].map(|side| (bend, side)));
        let roads = sides.map(|(bend, side)| -> Result<[Course; 2], StudyError> {
            let [by_hand, guided] = BEHIND_S.map(|behind_s| bend.course(side, behind_s));
            Ok([by_hand?, guided?])
        });
        let roads = roads.collect::<Result<_, _>>()?;
        Ok(Self {
            every_s,
            bends,
            roads,
        })
    }

    /// A driver's ways through a bend: by hand; then each reliance without a failure, and with each failure.
    fn ways(&self, bend: Bend) -> Vec<Way> {
        let mut ways = vec![Way::ByHand];
        for condition in RELIANCES {
            ways.push(Way::Guided(condition));
            for at_s in bend.instants_s(self.every_s) {
                for takes_over_after_s in TAKES_OVER_S {
                    ways.extend(KINDS.map(|kind| Way::Failed {
                        condition,
                        kind,
                        at_s,
                        takes_over_after_s,
                    }));
                }
            }
        }
        ways
    }

    fn scenario(&self, drive: &Drive) -> Result<Scenario, StudyError> {
        let mut driver = DriverParameters {
            t_p: drive.driver.t_p,
            ..Default::default()
        };
        let (condition, kind, time_s) = match drive.way {
            Way::ByHand => (Condition::Manual, FailureKind::None, 0.0),
            Way::Guided(condition) => (condition, FailureKind::None, 0.0),
            Way::Failed {
                condition,
                kind,
                at_s,
                takes_over_after_s,
            } => {
                driver.takes_over_after_s = takes_over_after_s;
                (condition, kind, at_s)
            }
        };
        let [road, kind_of_road] = drive.road;
        let scenario = Scenario::builder()
            .course(self.roads[road][kind_of_road].clone())
            .speed_kmh(drive.driver.bend.speed_kmh)
            .condition(condition)
            .driver(driver)
            .failure(Failure {
                kind,
                time_s,
                duration_s: None,
            });
        Ok(scenario.build()?)
    }
}

impl Study for Handover {
    type Case = Drive;
    type Row = Peaks;
    type Results = HandoverResults;

    fn plan(&self) -> Result<Plan<Drive>, StudyError> {
        let mut cases = Vec::new();
        for (place, bend) in self.bends.iter().enumerate() {
            let ways = self.ways(*bend);
            for (of_side, side) in [Side::Left, Side::Right].into_iter().enumerate() {
                for t_p in DRIVERS_T_P {
                    cases.extend(ways.iter().map(|way| Drive {
                        driver: Driver {
                            bend: *bend,
                            side,
                            t_p,
                        },
                        way: *way,
                        road: [2 * place + of_side, usize::from(*way != Way::ByHand)],
                    }));
                }
            }
        }
        Ok(Plan::side_by_side(cases, Scenario::default().seed()))
    }

    fn drive(&self, part: &Part<'_, Drive, Peaks>) -> Result<Vec<Peaks>, StudyError> {
        part.side_by_side(
            |drive| self.scenario(drive),
            |drive, scenario, run| Ok(Peaks::new(drive.driver.bend, scenario, run)),
        )
    }

    fn summarise(&self, cases: Vec<Drive>, peaks: Vec<Peaks>) -> Result<HandoverResults, StudyError> {
        let instants = instants(&cases, &peaks);
        let rows = std::iter::once(None).chain(self.bends.iter().copied().map(Some));
        let rows = rows.flat_map(|bend| RELIANCES.map(|condition| (bend, condition)));
        let rows = rows.flat_map(|(bend, condition)| TAKES_OVER_S.map(|after_s| (bend, condition, after_s)));
        Ok(HandoverResults {
            every_s: self.every_s,
            rows: rows
                .map(|(bend, condition, after_s)| row(&instants, bend, condition, after_s))
                .collect(),
            most_beside_drop: MOST_BESIDE_DROP,
        })
    }
}

/// Peaks of a drive, m, and whether the ECU left by itself.
#[derive(Debug, Clone, Copy)]
pub struct Peaks {
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
