//! Drivers as scenarios: the published ones, guided and logged, and those that were identified; and what is compared of the two.

use std::collections::BTreeMap;

use haptic_analysis::identify::{Identification, Muscle, Parameter, Parameters, TABLE_4, Truth};
use haptic_sim::models::STEP_S;
use haptic_sim::models::driver::{ArmGains, DriverParameters};
use haptic_sim::models::road::Course;
use haptic_sim::participants::PublishedDriver;
use haptic_sim::scenario::{Condition, GuidanceParameters, Scenario, ScenarioError};
use serde::Serialize;

use crate::engine::StudyError;
use crate::paper::REMNANT_GUIDED_NM;
use crate::statistics::Confidence;

/// Intervals by key; none where the data put no bound on a parameter, or contradict the model.
pub type Intervals = BTreeMap<&'static str, Option<[f64; 2]>>;

/// The intervals of an identification at a level; empty at 95 %, as those stand beside each parameter.
pub(crate) fn intervals(found: &Identification, level: Confidence) -> Intervals {
    let list = found.parameters.list().into_iter();
    let list = list.filter(|_| !level.is_usual());
    list.map(|(name, _, p)| (name, p.interval(level.normal())))
        .collect()
}

/// A probe of the controller's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Probe {
    /// N.m.
    pub amplitude_nm: f64,
    /// Hz.
    pub frequency_hz: f64,
}

impl Probe {
    /// The guidance with this probe.
    pub(crate) fn guidance(self) -> GuidanceParameters {
        let mut guidance = GuidanceParameters {
            probe: true,
            ..GuidanceParameters::default()
        };
        guidance.controller.probe_amplitude_nm = self.amplitude_nm;
        guidance.controller.probe_frequency_hz = self.frequency_hz;
        guidance
    }

    /// Whether the controller takes it.
    pub fn is_accepted(self) -> bool {
        let scenario = Scenario::builder()
            .condition(Condition::Custom)
            .guidance(self.guidance());
        scenario.build().is_ok()
    }
}

/// What a published driver and the remnant of the guided drives are, for the information bound.
pub fn truth_of(driver: &PublishedDriver) -> Truth {
    let sum = driver.k_d + Muscle::default().k_nms;
    Truth {
        gain: [sum * driver.a_1, sum * driver.a_2, sum * driver.a_3],
        k_hg: driver.k_hg.unwrap_or(0.0),
        t_p_s: driver.t_p,
        remnant_sd_nm: REMNANT_GUIDED_NM,
        remnant_corner_hz: driver.parameters().remnant_corner_hz,
        // The torque sensor's rounding to 0.005 N.m.
        sensor_sd_nm: 0.005 / 12.0_f64.sqrt(),
    }
}

/// A guided drive of a published driver with the remnant and the paper's sensors, on any course (the built-in one if none).
///
/// # Errors
/// A course that is too short; a probe that the controller refuses.
pub(crate) fn guided_drive(
    driver: &PublishedDriver,
    course: Option<&Course>,
    probe: Option<Probe>,
    seed: u64,
) -> Result<Scenario, StudyError> {
    let mut scenario = Scenario::builder()
        .driver(DriverParameters {
            remnant_sd_nm: REMNANT_GUIDED_NM,
            ..driver.parameters()
        })
        .condition(Condition::Custom)
        .gains(driver.gains())
        .guidance(probe.map_or_else(GuidanceParameters::default, Probe::guidance))
        .seed(seed);
    if let Some(course) = course {
        scenario = scenario.course(course.clone());
    }
    Ok(scenario.build()?)
}

/// `scenario` with the driver identified in place of its own, without remnant. Where K_d and a_i are not told
/// apart, table 4's K_d splits the gains: the torque does not depend on the split. A parameter that is not
/// identified has its place on the ridge that the search ended on.
pub(crate) fn identified_driver(
    scenario: &Scenario,
    found: &Identification,
    muscle: Muscle,
) -> Result<Scenario, ScenarioError> {
    let p = &found.parameters;
    let k_d = p.k_d.optimum.unwrap_or(TABLE_4[4].0);
    let sum = k_d + muscle.k_nms;
    let a = [&p.gain_1, &p.gain_2, &p.gain_3].map(|gain| gain.optimum.unwrap_or(0.0) / sum);
    let driver = DriverParameters {
        a_1: a[0],
        a_2: a[1],
        a_3: a[2],
        t_p: p.t_p.optimum.unwrap_or(0.0).max(STEP_S),
        t_nms: muscle.t_nms_s,
        k_nms: muscle.k_nms,
        remnant_sd_nm: 0.0,
        ..*scenario.driver()
    };
    let manual = scenario.condition() == Condition::Manual;
    let k_hg = if manual {
        0.0
    } else {
        p.k_hg.optimum.unwrap_or(0.0)
    };
    scenario
        .to_builder()
        .driver(driver)
        .gains(ArmGains { k_d, k_hg })
        .build()
}

/// What is compared with the truth: the parameters that a torque record can carry.
pub const COMPARED: usize = 5;

/// A parameter's key, what was found, and the truth.
pub type Compared = (&'static str, Parameter, f64);

/// Every parameter that is compared.
pub fn compared(truth: &PublishedDriver, found: &Parameters) -> [Compared; COMPARED] {
    let sum = truth.k_d + Muscle::default().k_nms;
    [
        ("gain_1", found.gain_1, sum * truth.a_1),
        ("gain_2", found.gain_2, sum * truth.a_2),
        ("gain_3", found.gain_3, sum * truth.a_3),
        ("t_p", found.t_p, truth.t_p),
        ("k_hg", found.k_hg, truth.k_hg.unwrap_or(0.0)),
    ]
}
