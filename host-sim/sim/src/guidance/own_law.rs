//! A law of one's own behind the shipping ECU: probe, envelope, mode machine and monitor are the product's; only (9) is replaced.
//!
//! The monitor's rule that the torque follows (9) within a band is about (9) alone: its band is as wide as the absolute limit here,
//! its other rules are the product's.

use std::f64::consts::TAU;

use haptic_core::bus::Frame;
use haptic_core::controller::config::Setup;
use haptic_core::quantity::Torque;

use super::{Actuation, Guidance, LaneErrors, Observation, OverBus, Status};
use crate::laws::{Law, LawView};
use crate::models::{STEP_S, sensors};
use crate::scenario::Scenario;

/// Pictures further apart than this share no rate, as in the shipping law, s.
const GAP_S: f64 = 0.1;

/// The shipping ECU with another law.
#[derive(Clone)]
pub struct OwnLaw<L = Box<dyn Law>> {
    law: L,
    bus: OverBus,
    /// The rates of the errors and of the wheel angle.
    rates: [Rate; 3],
    demanded_nm: f64,
}

impl<L: Law> OwnLaw<L> {
    /// A law behind a scenario's ECU.
    pub fn new(scenario: &Scenario, law: L) -> Self {
        let setup = Setup {
            monitor: scenario.setup().monitor.with_another_law(),
            ..*scenario.setup()
        };
        let tau_s = 1.0 / (TAU * scenario.controller_params().rate_corner_hz);
        Self {
            law,
            bus: OverBus::new(&setup),
            rates: [Rate::new(tau_s); 3],
            demanded_nm: 0.0,
        }
    }

    /// What the law asked for in the last step, N.m.
    pub fn demanded_nm(&self) -> f64 {
        self.demanded_nm
    }

    /// The law.
    pub fn law(&self) -> &L {
        &self.law
    }

    fn view(&mut self, seen: &Observation) -> LawView {
        let time_s = f64::from(seen.step) * STEP_S;
        let wheel_angle_rad = sensors::wheel_angle_rad(seen.wheel_angle_rad);
        let [e_y, e_theta, wheel] = &mut self.rates;
        if let Some(LaneErrors { e_y_m, e_theta_rad }) = seen.lane {
            let true_s = time_s - f64::from(seen.lane_age_ms) * STEP_S;
            e_y.take(e_y_m, true_s);
            e_theta.take(e_theta_rad, true_s);
        }
        wheel.take(wheel_angle_rad, time_s);
        LawView {
            step: seen.step,
            e_y_m: e_y.at(time_s),
            e_y_rate_m_per_s: e_y.rate,
            e_theta_rad: e_theta.at(time_s),
            e_theta_rate_rad_per_s: e_theta.rate,
            driver_torque_nm: sensors::torque_nm(seen.driver_torque_nm),
            wheel_angle_rad,
            wheel_rate_rad_per_s: wheel.rate,
            guidance_torque_nm: seen.motor_torque_nm,
            speed_m_per_s: seen.speed_m_per_s,
            yaw_rate_rad_per_s: seen.yaw_rate_rad_per_s.unwrap_or(0.0),
            k_hg: self
                .bus
                .status()
                .and_then(|status| status.k_hg)
                .map(|[k_hg, _]| k_hg),
        }
    }
}

impl<L: Law> Guidance for OwnLaw<L> {
    fn looks_at_road(&self, step: u32) -> bool {
        self.bus.looks_at_road(step)
    }

    fn step(&mut self, observation: &Observation) -> Actuation {
        let view = self.view(observation);
        self.demanded_nm = self.law.ask(&view);
        // Saturates; NaN is zero.
        let demanded = Torque::from_nm(self.demanded_nm);
        self.bus
            .exchange(observation, |ecu, now| ecu.step_with_law(now, demanded))
    }

    fn status(&self) -> Option<Status> {
        self.bus.status()
    }

    fn frames_in(&self) -> &[Frame] {
        self.bus.frames_in()
    }

    fn frames_out(&self) -> &[Frame] {
        self.bus.frames_out()
    }
}

/// The filtered rate of samples, `rate = (tau*rate + difference)/(tau + time between)`, as the shipping law has it.
#[derive(Debug, Clone, Copy)]
struct Rate {
    tau_s: f64,
    last: Option<(f64, f64)>,
    rate: f64,
}

impl Rate {
    fn new(tau_s: f64) -> Self {
        Self {
            tau_s,
            last: None,
            rate: 0.0,
        }
    }

    fn take(&mut self, value: f64, time_s: f64) {
        let last = self.last.replace((value, time_s));
        self.rate = match last {
            Some((before, at_s)) if time_s - at_s <= GAP_S => {
                (self.tau_s * self.rate + value - before) / (self.tau_s + time_s - at_s)
            }
            _ => 0.0,
        };
    }

    /// The last sample, carried on at its rate.
    fn at(&self, time_s: f64) -> f64 {
        self.last
            .map_or(0.0, |(value, at_s)| value + self.rate * (time_s - at_s))
    }
}
