//! Guidance laws of others and of ours, in f64, for comparison: a law asks, the ECU decides
//! ([`OwnLaw`](crate::guidance::OwnLaw)). `docs/reference/laws-and-drivers.md` has every equation with its source.
//!
//! Signs are those of ISO 8855: a positive error asks for a positive torque, to the left.
//!
//! Not here: any limit of the ECU; the shipping law, which is in fixed point in `haptic-core`.

mod adapting;
mod band;
mod driver_limit;
mod fdca;
mod paper;
#[cfg(test)]
mod tests;

use crate::kind::{Kind, Make, Origin};
use crate::scenario::ScenarioError;

pub use driver_limit::{DriverLimit, Limits};
pub use paper::Gains;

/// What a law sees in a step of 1 ms: what the bus brought, the errors carried on at their rates between two pictures as the
/// shipping law does it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LawView {
    /// Number of the step.
    pub step: u32,
    /// e_y', m.
    pub e_y_m: f64,
    /// de_y'/dt, m/s.
    pub e_y_rate_m_per_s: f64,
    /// e_theta', rad.
    pub e_theta_rad: f64,
    /// de_theta'/dt, rad/s.
    pub e_theta_rate_rad_per_s: f64,
    /// T_d as its sensor has it, N.m.
    pub driver_torque_nm: f64,
    /// phi as its sensor has it, rad.
    pub wheel_angle_rad: f64,
    /// dphi/dt, rad/s, filtered as the rates of the errors.
    pub wheel_rate_rad_per_s: f64,
    /// The guidance torque of the last step, N.m.
    pub guidance_torque_nm: f64,
    /// Speed, m/s.
    pub speed_m_per_s: f64,
    /// Yaw rate, rad/s.
    pub yaw_rate_rad_per_s: f64,
    /// K_hg in the last telemetry, if the probe has told it.
    pub k_hg: Option<f64>,
}

/// A guidance law: what torque it asks for.
pub trait Law: CloneLaw + Send + Sync {
    /// The torque that it asks for in this step of 1 ms, N.m. Whatever it is, the ECU bounds it; NaN asks for nothing.
    fn ask(&mut self, view: &LawView) -> f64;

    /// K_1 in the last step, N.m, if the law is (9) with a gain of its own; nothing of the loop depends on it.
    fn k_1(&self) -> Option<f64> {
        None
    }
}

/// A copy of a law behind a pointer; every law that is `Clone` has it.
pub trait CloneLaw {
    /// The copy.
    fn boxed(&self) -> Box<dyn Law>;
}

impl<T: Law + Clone + 'static> CloneLaw for T {
    fn boxed(&self) -> Box<dyn Law> {
        Box::new(self.clone())
    }
}

impl Clone for Box<dyn Law> {
    fn clone(&self) -> Self {
        self.as_ref().boxed()
    }
}

impl Law for Box<dyn Law> {
    fn ask(&mut self, view: &LawView) -> f64 {
        self.as_mut().ask(view)
    }

    fn k_1(&self) -> Option<f64> {
        self.as_ref().k_1()
    }
}

/// No guidance: it asks for nothing.
#[derive(Debug, Clone, Copy)]
struct Nothing;

impl Law for Nothing {
    fn ask(&mut self, _: &LawView) -> f64 {
        0.0
    }
}

/// Every law here.
pub const LAWS: [Kind<dyn Law>; 11] = [
    Kind {
        name: "none",
        source: "no guidance",
        origin: Origin::Ours,
        parameters: &[],
        make: Make::Part(|_, _| boxed(Nothing)),
    },
    paper::KIND,
    fdca::KIND,
    fdca::BY_TIME,
    band::KIND,
    adapting::ACTIVITY,
    adapting::RUNNING_WIDE,
    adapting::BY_RELIANCE,
    adapting::COMPENSATING,
    adapting::LINEAR,
    driver_limit::KIND,
];

#[allow(clippy::unnecessary_wraps, reason = "the type of Make::Part")]
fn boxed(law: impl Law + 'static) -> Result<Box<dyn Law>, ScenarioError> {
    Ok(Box::new(law))
}

/// The weight of what is new in a first-order low-pass, a step at a time.
pub(crate) fn weight(time_constant_s: f64) -> f64 {
    1.0 - (-crate::models::STEP_S / time_constant_s).exp()
}
