//! A map over speed and processing delay: where a driver keeps the lane, alone and with guidance, and how well.
//!
//! Two answers stand side by side. *Growth* is the largest real part of the closed loop's eigenvalues on a straight
//! (`haptic_sim::stability`): below zero an error dies down. *Peak* is the largest lateral error of a simulated drive with
//! the shipping ECU through the first curve of the paper's course, stretched with the speed.
//!
//! A scenario says who guides whom in which car: its law with its schedule, its driver but for the delay and the arm, its
//! vehicle and world. Speed, delay, arm and road are the map's.

use serde::Serialize;

use haptic_core::controller::params::Params;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::scenario::{Condition, DEFAULT_SPEED_KMH, Scenario};
use haptic_sim::simulation::Run;

use crate::Away;
use crate::engine::{StudyError, Watch, each, runs};
use crate::paper::stretched_curve;
use crate::record::{check_rigid, growth, peak_m};

/// Speeds of the map, km/h.
pub const SPEEDS_KMH: [f64; 12] = [
    20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0, 110.0, 120.0, 130.0,
];
/// Processing delays of the map, s.
pub const DELAYS_S: [f64; 5] = [0.1, 0.2, 0.3, 0.4, 0.5];
/// Shares of the guidance that a schedule may leave at a speed.
pub const SHARES: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
/// A place of the map.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Place {
    /// Speed, km/h.
    pub speed_kmh: f64,
    /// Processing delay, s.
    pub t_p: f64,
    /// Manual, then high, mid and low reliance.
    pub drives: Vec<Drive>,
}

/// A driver at a place.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Drive {
    /// How the driver drives.
    pub condition: Condition,
    /// Growth of the slowest motion, 1/s: below zero it dies down.
    pub growth_per_s: f64,
    /// Peak lateral error in the curve, m; `None` if the vehicle left the road.
    pub peak_m: Option<f64>,
    /// When the guidance was away in that drive.
    #[serde(flatten)]
    pub away: Away,
}

impl Drive {
    /// Whether an error dies down.
    pub fn is_stable(&self) -> bool {
        self.growth_per_s < 0.0
    }
}

impl Place {
    /// Guided drives that are unstable where the manual driver is stable.
    pub fn broken(&self) -> impl Iterator<Item = &Drive> {
        let manual = |drive: &&Drive| drive.condition == Condition::Manual;
        let stable = self.drives.iter().find(manual).is_some_and(Drive::is_stable);
        self.drives
            .iter()
            .filter(move |drive| stable && !drive.is_stable())
    }
}

/// What a share of the guidance would do at a speed, whatever the schedule is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Shares {
    /// Speed, km/h.
    pub speed_kmh: f64,
    /// For each of [`SHARES`]: the largest growth of all guided drives at delays with which the manual driver is stable,
    /// 1/s; `None` if there is no such delay.
    pub growth_per_s: [Option<f64>; SHARES.len()],
}

impl Shares {
    /// The largest share with which the least stable driver is as stable as any schedule makes one.
    pub fn best(&self) -> Option<f64> {
        let known = SHARES.into_iter().zip(self.growth_per_s);
        let known = known.filter_map(|(share, growth)| Some((share, growth?)));
        let least = known.clone().map(|(_, growth)| growth).reduce(f64::min)?;
        let alike = known.filter(|(_, growth)| *growth <= least + SAME_PER_S);
        alike.map(|(share, _)| share).reduce(f64::max)
    }
}

/// Growths that differ by less are alike, 1/s.
const SAME_PER_S: f64 = 0.01;

/// Computes and drives every place on all cores.
///
/// # Errors
/// A scenario that does not go with some place of the map.
pub fn map(base: &Scenario, watch: &Watch<'_>) -> Result<Vec<Place>, StudyError> {
    let places: Vec<(f64, f64)> = SPEEDS_KMH
        .iter()
        .flat_map(|kmh| DELAYS_S.map(|t_p| (*kmh, t_p)))
        .collect();
    let cases = places
        .iter()
        .flat_map(|place| Condition::ALL.map(|condition| (*place, condition)));
    let drives = runs(
        &cases.collect::<Vec<_>>(),
        base.seed(),
        watch,
        |((speed_kmh, t_p), condition)| at(base, *speed_kmh, *t_p, *condition),
        |_, scenario, run| Ok(driven(scenario, run)),
    )?;
    let of_places = places.iter().zip(drives.chunks(Condition::ALL.len()));
    let place = |((speed_kmh, t_p), drives): (&(f64, f64), &[Drive])| Place {
        speed_kmh: *speed_kmh,
        t_p: *t_p,
        drives: drives.to_vec(),
    };
    Ok(of_places.map(place).collect())
}

/// What any schedule could do, from the eigenvalues alone.
///
/// # Errors
/// A scenario that does not go with some place of the map.
pub fn shares(base: &Scenario) -> Result<Vec<Shares>, StudyError> {
    let row = |speed_kmh: f64| {
        let mut growth_per_s = [None; SHARES.len()];
        for t_p in DELAYS_S {
            let of = |condition| at(base, speed_kmh, t_p, condition);
            if growth(&of(Condition::Manual)?, None) >= 0.0 {
                continue;
            }
            for condition in [Condition::High, Condition::Mid, Condition::Low] {
                let scenario = of(condition)?;
                for (most, share) in growth_per_s.iter_mut().zip(SHARES) {
                    let law = Params {
                        k_1: scenario.guidance().controller.k_1 * share,
                        low_speed_share: 1.0,
                        high_speed_share: 1.0,
                        ..scenario.guidance().controller
                    };
                    let found = growth(&scenario, Some(&law));
                    *most = Some(most.map_or(found, |most: f64| most.max(found)));
                }
            }
        }
        Ok(Shares {
            speed_kmh,
            growth_per_s,
        })
    };
    each(&SPEEDS_KMH, &Watch::nobody(), |speed_kmh| row(*speed_kmh))
}

/// The scenario at a place of the map.
fn at(base: &Scenario, speed_kmh: f64, t_p: f64, condition: Condition) -> Result<Scenario, StudyError> {
    if base.changes_speed() {
        return Err(
            "speed: a map over speeds has one at each place, and none that changes; leave [speed] out".into(),
        );
    }
    check_rigid(base)?;
    let law = base.guidance().controller.law;
    if law != 0.0 {
        return Err(format!("guidance.law = {law}: a map is of the paper's law, 0").into());
    }
    let scenario = base
        .to_builder()
        .course(stretched_curve(speed_kmh / DEFAULT_SPEED_KMH)?)
        .speed_kmh(speed_kmh)
        .condition(condition)
        .driver(DriverParameters {
            t_p,
            ..*base.driver()
        })
        .build()?;
    Ok(scenario)
}

fn driven(scenario: &Scenario, run: &Run) -> Drive {
    let law = &scenario.guidance().controller;
    let condition = scenario.condition();
    Drive {
        condition,
        growth_per_s: growth(scenario, (condition != Condition::Manual).then_some(law)),
        peak_m: (!run.diverged()).then(|| peak_m(run, [0.0, f64::INFINITY])),
        away: Away::new(scenario, &run.trace),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptic_sim::scenario::{GuidanceParameters, Speed};

    /// At 60 km/h the evaluation's table: the stretched curve is its first curve as it is. And what that table says of
    /// delays holds at the ends of the map.
    #[test]
    fn the_map_holds_the_evaluation() {
        let drive = |kmh, t_p, condition| {
            let scenario = at(&Scenario::default(), kmh, t_p, condition).unwrap();
            driven(&scenario, &haptic_sim::simulation::simulate(&scenario))
        };
        for (t_p, condition, peak_m) in [
            (0.1, Condition::Manual, 0.1255),
            (0.1, Condition::High, 0.1255),
            (0.3, Condition::Mid, 0.1290),
            (0.5, Condition::Manual, 0.2228),
            (0.5, Condition::High, 0.1430),
        ] {
            let found = drive(60.0, t_p, condition);
            assert!(
                (found.peak_m.unwrap() / peak_m - 1.0).abs() < 0.1,
                "{found:?}, not {peak_m}"
            );
            assert!(found.is_stable(), "{found:?}");
        }
        // At 100 km/h and above a manual driver with 0.5 s of delay is not stable.
        let quick = drive(120.0, 0.5, Condition::Manual);
        assert!(!quick.is_stable(), "{quick:?}");
    }

    /// The recommended schedule is the default, all of the torque at every speed: wherever the manual driver is stable,
    /// every guided one is, and at 80 km/h and above each more of the guidance makes the least stable driver more so.
    #[test]
    fn all_of_the_torque_at_every_speed_keeps_stable_whom_manual_driving_does() {
        let base = Scenario::default();
        let mut judged = 0;
        for kmh in SPEEDS_KMH {
            for t_p in DELAYS_S {
                let growth = |condition| {
                    let scenario = at(&base, kmh, t_p, condition).unwrap();
                    let law = &scenario.guidance().controller;
                    growth(&scenario, (condition != Condition::Manual).then_some(law))
                };
                if growth(Condition::Manual) >= 0.0 {
                    continue;
                }
                judged += 1;
                for condition in [Condition::High, Condition::Mid, Condition::Low] {
                    assert!(growth(condition) < 0.0, "{kmh} km/h, t_p {t_p}, {condition}");
                }
            }
        }
        // Unstable by hand: one at 90 km/h, and more the faster (the map's table).
        assert!((40..60).contains(&judged), "{judged}");
        for row in shares(&base).unwrap() {
            assert_eq!(row.best(), Some(1.0), "{row:?}");
        }
    }

    #[test]
    fn a_speed_that_changes_has_no_place_on_the_map() {
        let speed = Speed::by_time_kmh(vec![0.0, 10.0], &[60.0, 50.0]);
        let scenario = Scenario::builder().speed(speed).build().unwrap();
        for error in [
            map(&scenario, &Watch::nobody()).unwrap_err(),
            shares(&scenario).unwrap_err(),
        ]
        .map(|e| e.to_string())
        {
            assert!(error.starts_with("speed: a map over speeds"), "{error}");
        }
    }

    /// A user's schedule and gains are those that are judged: a stiff law by position alone takes damping away, and less
    /// where the schedule leaves less of it.
    #[test]
    fn a_scenario_brings_its_own_law() {
        let law = Params {
            a_3: 0.0,
            a_4: 0.0,
            k_1: 4.0,
            ..Params::PAPER
        };
        let with = |high_speed_share| {
            let guidance = GuidanceParameters {
                controller: Params {
                    high_speed_share,
                    ..law
                },
                ..GuidanceParameters::default()
            };
            let scenario = Scenario::builder().guidance(guidance).build().unwrap();
            let scenario = at(&scenario, 120.0, 0.1, Condition::High).unwrap();
            growth(&scenario, Some(&scenario.guidance().controller))
        };
        let (whole, none) = (with(1.0), with(0.0));
        assert!(none < whole - 0.05, "{whole} {none}");
    }
}
