//! A limit against the driver, around any law: the rule that opendbc checks (MIT, `opendbc/safety/lateral.h`, `driver_limit_check`).
//! A torque T after the last one L, with the largest T_d+ and the least T_d- of the driver's recent torques, is allowed from
//! `max(min(L, 0) - up, min(L + down, min(-MAX + (-ALLOWANCE + T_d-)*FACTOR, 0)))` to
//! `min(max(L, 0) + up, max(L - down, max(MAX + (ALLOWANCE + T_d+)*FACTOR, 0)))`, and within MAX. There a torque outside is refused;
//! chosen here: it becomes the nearest that is allowed.
//!
//! Defaults are those of Volkswagen's MQB in that repository: 50 commands a second, 0.01 N.m a count, six samples of the driver, of which
//! its torque sensor sends 100 a second.

use super::{Kind, Law, LawView, Make};
use crate::kind::{Origin, Parameter};
use crate::models::step_of;

/// The numbers of the rule, in any unit of torque.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Largest torque.
    pub max: f64,
    /// Largest growth from one command to the next.
    pub up: f64,
    /// Largest fall.
    pub down: f64,
    /// Opposing driver torque that costs nothing.
    pub allowance: f64,
    /// What each unit beyond it costs.
    pub factor: f64,
}

impl Limits {
    /// The least and the largest torque allowed after `last`, for the least and the largest recent torque of the driver.
    pub fn allowed(&self, last: f64, driver: [f64; 2]) -> [f64; 2] {
        let Self {
            max,
            up,
            down,
            allowance,
            factor,
        } = *self;
        let highest = (max + (allowance + driver[1]) * factor).max(0.0);
        let lowest = (-max + (-allowance + driver[0]) * factor).min(0.0);
        let high = (last.max(0.0) + up).min((last - down).max(highest));
        let low = (last.min(0.0) - up).max((last + down).min(lowest));
        [low.max(-max), high.min(max)]
    }
}

/// Steps from one command to the next.
const COMMAND_STEPS: u32 = 20;
/// Samples of the driver that count.
const SAMPLES: usize = 6;

/// A law under the rule.
#[derive(Clone)]
pub struct DriverLimit {
    law: Box<dyn Law>,
    limits: Limits,
    /// Steps from one sample of the driver to the next.
    sample_steps: u32,
    last_nm: f64,
    driver_nm: [f64; SAMPLES],
}

impl DriverLimit {
    /// Around a law, with limits in N.m, for a driver whose torque is sampled so often.
    pub fn new(law: Box<dyn Law>, limits: Limits, samples_per_s: f64) -> Self {
        Self {
            law,
            limits,
            // One step at least.
            sample_steps: step_of(1.0 / samples_per_s).max(1),
            last_nm: 0.0,
            driver_nm: [0.0; SAMPLES],
        }
    }
}

impl Law for DriverLimit {
    fn ask(&mut self, view: &LawView) -> f64 {
        let asked_nm = self.law.ask(view);
        if view.step.is_multiple_of(self.sample_steps) {
            self.driver_nm.rotate_right(1);
            self.driver_nm[0] = view.driver_torque_nm;
        }
        if view.step.is_multiple_of(COMMAND_STEPS) {
            let least = self.driver_nm.into_iter().fold(f64::INFINITY, f64::min);
            let largest = self.driver_nm.into_iter().fold(f64::NEG_INFINITY, f64::max);
            let [low, high] = self.limits.allowed(self.last_nm, [least, largest]);
            // A law that asks for no number asks for nothing.
            let number_nm = if asked_nm.is_nan() { 0.0 } else { asked_nm };
            self.last_nm = number_nm.max(low).min(high);
        }
        self.last_nm
    }
}

pub(super) const KIND: Kind<dyn Law> = Kind {
    name: "driver_limit",
    source: "opendbc, driver_limit_check",
    origin: Origin::After,
    parameters: &[
        Parameter::published("max_nm", 3.0, [0.0, 10.0]),
        Parameter::published("up_nm", 0.04, [0.0, 10.0]),
        Parameter::published("down_nm", 0.1, [0.0, 10.0]),
        Parameter::published("allowance_nm", 0.8, [0.0, 10.0]),
        Parameter::published("factor", 3.0, [0.0, 100.0]),
        Parameter::published("samples_per_s", 100.0, [1.0, 1000.0]),
    ],
    make: Make::Around(|_, v, law| {
        let limits = Limits {
            max: v[0],
            up: v[1],
            down: v[2],
            allowance: v[3],
            factor: v[4],
        };
        Box::new(DriverLimit::new(law, limits, v[5]))
    }),
};
