//! A map over speed and processing delay: where a driver keeps the lane, alone and with guidance, and how well.
//!
//! Two answers stand side by side. *Growth* is the largest real part of the closed loop's eigenvalues on a straight
//! (`haptic_sim::stability`): below zero an error dies down. *Peak* is the largest lateral error of a simulated drive with
//! the shipping ECU through the first curve of the paper's course, stretched with the speed as in [`crate::handover`].

use rayon::prelude::*;
use serde::Serialize;

use haptic_sim::models::driver::DriverParameters;
use haptic_sim::scenario::{Condition, DEFAULT_SPEED_KMH, Scenario};
use haptic_sim::simulation::simulate;
use haptic_sim::stability::{Guided, growth_per_s};

use crate::handover::{peak_m, stretched_curve};

/// Speeds of the map, km/h.
pub const SPEEDS_KMH: [f64; 12] = [
    20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0, 110.0, 120.0, 130.0,
];
/// Processing delays of the map, s.
pub const DELAYS_S: [f64; 5] = [0.1, 0.2, 0.3, 0.4, 0.5];
/// Places of the map.
pub const PLACES: usize = SPEEDS_KMH.len() * DELAYS_S.len();

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

/// Computes and drives every place on all cores; `progress` is called after each.
///
/// # Errors
/// As [`haptic_sim::scenario::ScenarioBuilder::build`]; none of these scenarios meets one.
pub fn map(progress: impl Fn() + Sync) -> Result<Vec<Place>, String> {
    let places: Vec<(f64, f64)> = SPEEDS_KMH
        .iter()
        .flat_map(|kmh| DELAYS_S.map(|t_p| (*kmh, t_p)))
        .collect();
    places
        .into_par_iter()
        .map(|(speed_kmh, t_p)| {
            let drives = Condition::ALL.map(|condition| drive(speed_kmh, t_p, condition));
            progress();
            Ok(Place {
                speed_kmh,
                t_p,
                drives: drives.into_iter().collect::<Result<_, String>>()?,
            })
        })
        .collect()
}

fn drive(speed_kmh: f64, t_p: f64, condition: Condition) -> Result<Drive, String> {
    let scenario = Scenario::builder()
        .course(stretched_curve(speed_kmh / DEFAULT_SPEED_KMH)?)
        .speed_kmh(speed_kmh)
        .condition(condition)
        .driver(DriverParameters {
            t_p,
            ..DriverParameters::default()
        })
        .build()?;
    let guidance = scenario.guidance();
    let guided = Guided {
        law: &guidance.controller,
        t_n: guidance.t_n,
    };
    Ok(Drive {
        condition,
        growth_per_s: growth_per_s(
            scenario.speed_m_per_s(),
            scenario.vehicle(),
            scenario.driver(),
            scenario.gains(),
            (condition != Condition::Manual).then_some(guided),
        ),
        peak_m: peak_m(&simulate(&scenario), 0.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At 60 km/h the evaluation's table: the stretched curve is its first curve as it is. And what that table says of
    /// delays holds at the ends of the map.
    #[test]
    fn the_map_holds_the_evaluation() {
        for (t_p, condition, peak_m) in [
            (0.1, Condition::Manual, 0.1255),
            (0.1, Condition::High, 0.1255),
            (0.3, Condition::Mid, 0.1290),
            (0.5, Condition::Manual, 0.2228),
            (0.5, Condition::High, 0.1430),
        ] {
            let found = drive(60.0, t_p, condition).unwrap();
            assert!(
                (found.peak_m.unwrap() / peak_m - 1.0).abs() < 0.1,
                "{found:?}, not {peak_m}"
            );
            assert!(found.is_stable(), "{found:?}");
        }
        // At 100 km/h and above a manual driver with 0.5 s of delay is not stable.
        let quick = drive(120.0, 0.5, Condition::Manual).unwrap();
        assert!(!quick.is_stable(), "{quick:?}");
    }
}
