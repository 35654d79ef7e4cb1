//! Equation (9) in float64: the lane errors every millisecond at full
//! resolution, rates by backward difference, limited to +-5 N.m. A reference for tests, never shipped.

use super::{Actuation, Guidance, LaneErrors, Observation};
use crate::models::STEP_S;
use haptic_core::controller::params::Params;

/// The reference controller.
#[derive(Debug, Clone)]
pub struct FloatLaw {
    gains: Params,
    last: Option<LaneErrors>,
}

impl FloatLaw {
    /// The law with the gains and the absolute limit of `gains`; its filter corner is not used.
    pub fn new(gains: Params) -> Self {
        Self { gains, last: None }
    }
}

impl Guidance for FloatLaw {
    fn looks_at_road(&self, _step: u32) -> bool {
        true
    }

    fn step(&mut self, observation: &Observation) -> Actuation {
        let Some(now) = observation.lane else {
            return Actuation::default();
        };
        let before = self.last.replace(now).unwrap_or(now);
        let Params {
            k_1,
            a_1,
            a_2,
            a_3,
            a_4,
            torque_limit_nm: limit,
            ..
        } = self.gains;
        let e_y_rate = (now.e_y_m - before.e_y_m) / STEP_S;
        let e_theta_rate = (now.e_theta_rad - before.e_theta_rad) / STEP_S;
        let wanted = k_1 * (a_1 * now.e_y_m + a_2 * e_y_rate + a_3 * now.e_theta_rad + a_4 * e_theta_rate);
        Actuation {
            torque_nm: wanted.clamp(-limit, limit),
            limited: wanted.abs() > limit,
        }
    }
}
