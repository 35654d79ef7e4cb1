//! The driver's arm alone, equation (8), for who couples driver and vehicle himself: `plant` steps them together.
//!
//! Exact for a target angle on a straight line and for a wheel angle and a guidance torque that hold during the step.

use super::STEP_S;
use super::driver::{ArmGains, DriverParameters};

/// An arm at some torque.
#[derive(Debug, Clone)]
pub struct Arm {
    k_nms: f64,
    /// How it weighs vision against guidance from the next step on.
    pub gains: ArmGains,
    /// What is left of a torque after a step.
    decay: f64,
    /// Share of a ramp over the step that has come through at its end.
    ramp: f64,
    target_rad: f64,
    torque_nm: f64,
}

impl Arm {
    /// An arm at rest.
    pub fn new(driver: &DriverParameters, gains: ArmGains) -> Self {
        let decay = (-STEP_S / driver.t_nms).exp();
        Self {
            k_nms: driver.k_nms,
            gains,
            decay,
            ramp: 1.0 - (1.0 - decay) * driver.t_nms / STEP_S,
            target_rad: 0.0,
            torque_nm: 0.0,
        }
    }

    /// One step of 1 ms towards the target at its end; returns T_d there, N.m.
    pub fn step(&mut self, target_rad: f64, wheel_angle_rad: f64, guidance_torque_nm: f64) -> f64 {
        let per_target = self.gains.k_d + self.k_nms;
        let held = per_target * self.target_rad
            - self.k_nms * wheel_angle_rad
            - self.gains.k_hg * guidance_torque_nm;
        let ramped = per_target * (target_rad - self.target_rad);
        self.torque_nm = self.decay * self.torque_nm + (1.0 - self.decay) * held + self.ramp * ramped;
        self.target_rad = target_rad;
        self.torque_nm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Held inputs: the textbook's step response; a ramp of slope s: a first-order lag follows s*(t - tau + tau*exp(-t/tau)).
    #[test]
    fn steps_and_ramps_are_answered_as_the_textbook_says() {
        let driver = DriverParameters {
            t_nms: 0.1,
            k_nms: 1.5,
            ..DriverParameters::default()
        };
        let gains = ArmGains { k_d: 3.0, k_hg: 0.5 };
        let mut arm = Arm::new(&driver, gains);
        let mut torque = 0.0;
        for _ in 0..50 {
            torque = arm.step(0.0, 0.2, 0.4);
        }
        let expected = -(1.5 * 0.2 + 0.5 * 0.4) * (1.0 - (-0.5_f64).exp());
        assert!((torque - expected).abs() < 1e-12, "{torque} {expected}");
        let mut arm = Arm::new(&driver, gains);
        for k in 1..=200 {
            torque = arm.step(0.7 * f64::from(k) * STEP_S, 0.0, 0.0);
        }
        let expected = 4.5 * 0.7 * (0.2 - 0.1 + 0.1 * (-2.0_f64).exp());
        assert!((torque - expected).abs() < 1e-12, "{torque} {expected}");
    }
}
