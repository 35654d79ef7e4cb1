//! The two-point driver with a bias. Source: Salvucci and Gray 2004; Mai, Julius, Mishra 2024 (abstract and opening): near point 0.37 s,
//! far point 0.9 s ahead; beside an automation humans steer by the same law with a bias.
//! `d(k) = d(k-1) + k_n*(phi_n(k) - phi_n(k-1)) + k_f*(phi_f(k) - phi_f(k-1)) + k_i*T_s*phi_n(k)`, the driver's target is `d + bias`.
//!
//! Chosen here: the angles of sight are `phi_n = e_y/(v*t_n)` and `phi_f = e_theta/2`; the gains are those of the paper's driver 1, as
//! angles of sight at 60 km/h; the arm is the paper's, (8).

use super::{AnyDriver, Kind, Make, angles_of_sight, with_remnant};
use crate::kind::{Origin, Parameter};
use crate::models::STEP_S;
use crate::models::arm::Arm;
use crate::models::driver::ArmGains;
use crate::parts::{Driver, DriverView};

#[derive(Debug, Clone)]
struct TwoPoint {
    look_ahead_s: [f64; 2],
    k_n: f64,
    k_f: f64,
    k_i: f64,
    bias_rad: f64,
    target_rad: f64,
    /// The near and the far angle of the last step.
    last_rad: [f64; 2],
    arm: Arm,
}

impl Driver for TwoPoint {
    fn look_ahead_s(&self) -> [f64; 2] {
        self.look_ahead_s
    }

    fn step(&mut self, view: &DriverView) -> f64 {
        let [near, far] = angles_of_sight(view, self.look_ahead_s[0]);
        let [near_before, far_before] = std::mem::replace(&mut self.last_rad, [near, far]);
        self.target_rad +=
            self.k_n * (near - near_before) + self.k_f * (far - far_before) + self.k_i * STEP_S * near;
        let target_rad = self.target_rad + self.bias_rad;
        self.arm
            .step(target_rad, view.wheel_angle_rad, view.guidance_torque_nm)
    }

    fn k_hg(&self) -> Option<f64> {
        Some(self.arm.gains.k_hg)
    }
}

pub(super) const KIND: Kind<dyn AnyDriver> = Kind {
    name: "two_point",
    source: "Salvucci and Gray 2004; Mai et al. 2024",
    origin: Origin::After,
    parameters: &[
        Parameter::published("t_near_s", 0.37, [0.05, 2.0]),
        Parameter::published("t_far_s", 0.9, [0.1, 5.0]),
        Parameter::ours("k_n", 0.5, [0.0, 50.0]),
        Parameter::ours("k_f", 7.4, [0.0, 100.0]),
        Parameter::ours("k_i_per_s", 0.25, [0.0, 50.0]),
        Parameter::ours("bias_rad", 0.0, [-0.5, 0.5]),
        Parameter::ours("k_d_nm_per_rad", 3.0, [0.0, 50.0]),
        Parameter::ours("k_hg", 0.5, [0.0, 10.0]),
    ],
    make: Make::Part(|scenario, v| {
        let driver = scenario.driver();
        Ok(with_remnant(
            scenario,
            TwoPoint {
                look_ahead_s: [v[0], v[1]],
                k_n: v[2],
                k_f: v[3],
                k_i: v[4],
                bias_rad: v[5],
                target_rad: 0.0,
                last_rad: [0.0; 2],
                arm: Arm::new(
                    driver,
                    ArmGains {
                        k_d: v[6],
                        k_hg: v[7],
                    },
                ),
            },
        ))
    }),
};
