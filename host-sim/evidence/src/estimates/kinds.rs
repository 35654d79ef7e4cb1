//! What may change in mid-drive: the driver, in several ways, or something that is no driver.

use haptic_analysis::identify::DriveLog;
use haptic_sim::Action;
use rand::RngExt;
use rand::rngs::Xoshiro256PlusPlus;

use super::changing::{Changed, DriverChanges, driven_changing};
use haptic_batch::StudyError;
use haptic_batch::experiment::{ExperimentPlan, scenario_of_drive};
use haptic_sim::participants::PublishedDriver;

/// What changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// Nothing.
    Constant,
    /// K_hg steps by so much, towards where there is room; 1 is from one end to the other.
    KHgSteps(f64),
    /// K_hg drifts by so much over 60 s.
    KHgDrifts(f64),
    /// K_d steps to 1.5 times its value, or to the 1.5th part.
    KDSteps,
    /// K_d drifts to 1.5 times its value, or to the 1.5th part, over 60 s.
    KDDrifts,
    /// t_p steps from 0.1 to 0.3 s.
    TPSteps,
    /// t_p drifts from 0.1 to 0.3 s over 60 s.
    TPDrifts,
    /// K_hg steps to and fro by 0.5, ten times.
    TenSteps,
    /// K_hg steps by 0.5 in the first or the last 5 s.
    AtAnEnd,
    /// K_hg steps by 0.5 while e_y and e_theta are missing for 10 s.
    WhileBlind,
    /// The host allows 0.4 of the guidance from some instant on.
    Authority,
    /// The scale of T_d drifts to 0.7 over 60 s.
    TorqueScale,
    /// The offset of T_d drifts by 0.1 N.m over 60 s.
    TorqueOffset,
    /// e_y drifts by 0.1 m over 60 s.
    LaneOffset,
}

/// The kinds of the population, with their names.
pub const KINDS: [(&str, Kind); 17] = [
    ("nothing", Kind::Constant),
    ("K_hg steps by 0.2", Kind::KHgSteps(0.2)),
    ("K_hg steps by 0.5", Kind::KHgSteps(0.5)),
    ("K_hg steps by 1", Kind::KHgSteps(1.0)),
    ("K_hg drifts by 0.2 in 60 s", Kind::KHgDrifts(0.2)),
    ("K_hg drifts by 0.5 in 60 s", Kind::KHgDrifts(0.5)),
    ("K_d steps by half", Kind::KDSteps),
    ("K_d drifts by half in 60 s", Kind::KDDrifts),
    ("t_p steps from 0.1 to 0.3 s", Kind::TPSteps),
    ("t_p drifts from 0.1 to 0.3 s in 60 s", Kind::TPDrifts),
    ("K_hg steps ten times by 0.5", Kind::TenSteps),
    ("K_hg steps by 0.5 within 5 s of an end", Kind::AtAnEnd),
    ("K_hg steps by 0.5 while the camera is blind", Kind::WhileBlind),
    ("the guidance is weighed 0.4", Kind::Authority),
    ("the scale of T_d drifts to 0.7", Kind::TorqueScale),
    ("T_d drifts by 0.1 N.m", Kind::TorqueOffset),
    (ASSUMED_NOT_TO, Kind::LaneOffset),
];

/// What no identification sees: it is among what every one of them lists as assumed.
pub(super) const ASSUMED_NOT_TO: &str = "e_y drifts by 0.1 m, which is assumed not to be";

/// Length of a drift, s.
const DRIFT_S: f64 = 60.0;
/// Length of the drives on the built-in course, s: instants lie 20 s and more from the ends.
const INSTANTS_S: [f64; 2] = [20.0, 180.0];
const END_S: f64 = 198.0;
/// How long the camera is blind, s.
const BLIND_S: f64 = 10.0;

/// A drive in which something changes.
#[derive(Debug, Clone)]
pub(super) struct Drawn {
    pub(super) first: PublishedDriver,
    pub(super) changes: Vec<DriverChanges>,
    kind: Kind,
    at_s: f64,
}

impl Kind {
    /// A drive of this kind, with the instant and the direction by chance.
    pub(super) fn drawn(self, driver: &PublishedDriver, random: &mut Xoshiro256PlusPlus) -> Drawn {
        let mut first = *driver;
        let slow = matches!(
            self,
            Self::KHgDrifts(_)
                | Self::KDDrifts
                | Self::TPDrifts
                | Self::TorqueScale
                | Self::TorqueOffset
                | Self::LaneOffset
        );
        let over_s = if slow { DRIFT_S } else { 0.0 };
        let [from_s, to_s] = INSTANTS_S;
        let mut at_s = random.random_range(from_s..to_s - over_s);
        let up = random.random_range(0..2) == 1;
        if self == Self::AtAnEnd {
            at_s = if up { END_S - 5.0 } else { 2.0 } + random.random_range(0.0..3.0);
        }
        let k_hg = driver.k_hg.unwrap_or(0.0);
        let away = |by: f64| {
            if k_hg < by || (up && k_hg + by <= 1.0) {
                k_hg + by
            } else {
                k_hg - by
            }
        };
        let mut goes = Vec::new();
        match self {
            Self::KHgSteps(1.0) => {
                first.k_hg = Some(f64::from(!up));
                goes.push((Changed::KHg, f64::from(up)));
            }
            Self::KHgSteps(by) | Self::KHgDrifts(by) => goes.push((Changed::KHg, away(by).clamp(0.0, 1.0))),
            Self::AtAnEnd | Self::WhileBlind => goes.push((Changed::KHg, away(0.5).clamp(0.0, 1.0))),
            Self::KDSteps | Self::KDDrifts => {
                goes.push((Changed::KD, driver.k_d * if up { 1.5 } else { 1.0 / 1.5 }));
            }
            Self::TPSteps | Self::TPDrifts => {
                first.t_p = 0.1;
                goes.push((Changed::TP, 0.3));
            }
            Self::TenSteps => {
                let other = away(0.5).clamp(0.0, 1.0);
                goes.extend((0..10).map(|i| (Changed::KHg, if i % 2 == 0 { other } else { k_hg })));
                // Ten steps 18 s apart: the last is 18 s before the end.
                at_s = 18.0;
            }
            Self::Constant | Self::Authority | Self::TorqueScale | Self::TorqueOffset | Self::LaneOffset => {}
        }
        let later = |(i, (what, to)): (usize, (Changed, f64))| DriverChanges {
            what,
            to,
            at_s: at_s + 18.0 * i as f64,
            over_s,
        };
        Drawn {
            first,
            changes: goes.into_iter().enumerate().map(later).collect(),
            kind: self,
            at_s,
        }
    }
}

impl Drawn {
    /// Its log, of a participant of `plan`.
    ///
    /// # Errors
    /// A driver that no scenario takes.
    pub(super) fn log(&self, plan: &ExperimentPlan, number: u32) -> Result<DriveLog, StudyError> {
        let scenario = scenario_of_drive(plan, number, &self.first, self.first.parameters())?;
        let host = |time_s: f64| Action {
            authority: (self.kind == Kind::Authority && time_s >= self.at_s).then_some(0.4),
            ..Action::default()
        };
        let mut log = driven_changing(&scenario, &self.first, &self.changes, host)?;
        let share: Vec<f64> = (0..log.len())
            .map(|k| ((log.time_s(k) - self.at_s) / DRIFT_S).clamp(0.0, 1.0))
            .collect();
        let both = |u: &mut Vec<f64>, f: &dyn Fn(f64, f64) -> f64| {
            for (x, s) in u.iter_mut().zip(&share) {
                *x = f(*x, *s);
            }
        };
        match self.kind {
            Kind::TorqueScale => both(&mut log.driver_torque_nm, &|x, s| x * (1.0 - 0.3 * s)),
            Kind::TorqueOffset => both(&mut log.driver_torque_nm, &|x, s| x + 0.1 * s),
            Kind::LaneOffset => both(&mut log.e_y_m, &|x, s| x + 0.1 * s),
            Kind::WhileBlind => {
                for k in 0..log.len() {
                    if (log.time_s(k) - self.at_s).abs() < 0.5 * BLIND_S {
                        (log.e_y_m[k], log.e_theta_rad[k]) = (f64::NAN, f64::NAN);
                    }
                }
            }
            _ => {}
        }
        Ok(log)
    }
}
