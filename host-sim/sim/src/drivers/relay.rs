//! The relay driver. Source: the cognitive driver of T. Ersal's group, seen in its Simulink file: where `sign(d_h - d) != sign(T_a)` and
//! `abs(d_h - d) > 0.00075`, `T = -T_a + 12.5*(d_h - d)`, else 0, at most 4 N.m. In the words of (8), K_hg jumps between 1 and full
//! yielding.
//!
//! Chosen here: d is the wheel angle, T_a the guidance torque felt, and d_h the target angle of (7) with driver 1's weights.

use super::{AnyDriver, Kind, Make, with_remnant};
use crate::kind::{Origin, Parameter};
use crate::models::driver::{DriverParameters, Vision};
use crate::parts::{Driver, DriverView};

#[derive(Debug, Clone)]
struct Relay {
    look_ahead_s: [f64; 2],
    vision: Vision,
    threshold_rad: f64,
    stiffness: f64,
    limit_nm: f64,
}

impl Driver for Relay {
    fn look_ahead_s(&self) -> [f64; 2] {
        self.look_ahead_s
    }

    fn step(&mut self, view: &DriverView) -> f64 {
        let target_rad = self.vision.step(view.lane.e_y_m, view.lane.e_theta_rad);
        let missing_rad = target_rad - view.wheel_angle_rad;
        let helps = missing_rad * view.guidance_torque_nm > 0.0;
        if helps || missing_rad.abs() <= self.threshold_rad {
            return 0.0;
        }
        let wanted_nm = self.stiffness * missing_rad - view.guidance_torque_nm;
        wanted_nm.clamp(-self.limit_nm, self.limit_nm)
    }
}

pub(super) const KIND: Kind<dyn AnyDriver> = Kind {
    name: "relay",
    source: "Ersal's cognitive driver (Simulink)",
    origin: Origin::After,
    parameters: &[
        Parameter::published("threshold_rad", 0.000_75, [0.0, 0.1]),
        Parameter::published("stiffness_nm_per_rad", 12.5, [0.0, 50.0]),
        Parameter::published("limit_nm", 4.0, [0.1, 20.0]),
        Parameter::ours("t_p_s", 0.1, [0.001, 2.0]),
    ],
    make: Make::Part(|scenario, v| {
        let driver = DriverParameters {
            t_p: v[3],
            ..*scenario.driver()
        };
        Ok(with_remnant(
            scenario,
            Relay {
                look_ahead_s: [driver.t_n, driver.t_f],
                vision: Vision::new(&driver),
                threshold_rad: v[0],
                stiffness: v[1],
                limit_nm: v[2],
            },
        ))
    }),
};
