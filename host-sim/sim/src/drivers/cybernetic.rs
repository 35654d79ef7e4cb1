//! The cybernetic driver. Source: Saleh et al. 2011; Zhao, Chevrel, Claveau, Mars 2020; equations and parameters seen in the public
//! MATLAB of Y. Zhao's thesis.
//!
//! Vision: `d_target = P(s)*(K_p*th_far + (K_c/v)*(T_L*s + 1)/(T_I*s + 1)*th_near)`, `P(s) = (1 - tau_p*s/2)/(1 + tau_p*s/2)`.
//! Muscle: `T_N*dT/dt + T = (K_r*v + K_t)*d_target - K_t*d - K_hg*T_h`, d the wheel angle.
//!
//! The kind `cybernetic_curvature` has the far angle of that code, 15 m times the previewed curvature, and its K_r of 1. Chosen here: the
//! curvature is that at the far point of a scenario's driver; `th_near = e_y/(v*t_n)` at the near one. The third input of the muscle, which
//! that code leaves open, is the guidance torque with a share K_hg.
//!
//! The kind `cybernetic` differs in what was chosen for this car: `th_far = e_theta/2` (on an arc the line of sight turns by half of what
//! the road does), and a K_r of 0.2, which carries this car's aligning torque.

use std::sync::Arc;

use super::{AnyDriver, Kind, Make, angles_of_sight, walking, with_remnant};
use crate::kind::{Origin, Parameter};
use crate::models::STEP_S;
use crate::models::road::Centreline;
use crate::parts::{Driver, DriverView};
use crate::scenario::{Scenario, ScenarioError};

/// What the far angle is made of.
#[derive(Debug, Clone)]
enum Far {
    /// The heading error at the far point.
    Heading,
    /// So many metres times the curvature there.
    Curvature(f64, Arc<Centreline>),
}

#[derive(Debug, Clone)]
struct Cybernetic {
    look_ahead_s: [f64; 2],
    far: Far,
    k_p: f64,
    k_c: f64,
    t_i: f64,
    t_l: f64,
    tau_p: f64,
    k_r: f64,
    k_t: f64,
    t_n: f64,
    k_hg: f64,
    /// States of the lag and of the delay, and the torque.
    state: [f64; 3],
}

impl Driver for Cybernetic {
    fn look_ahead_s(&self) -> [f64; 2] {
        self.look_ahead_s
    }

    fn step(&mut self, view: &DriverView) -> f64 {
        let [near, far] = angles_of_sight(view, self.look_ahead_s[0]);
        let far = match &self.far {
            Far::Heading => far,
            Far::Curvature(times_m, road) => times_m * road.at(view.points_m[1]).1,
        };
        let [lag, delay, torque] = &mut self.state;
        let (gain, lead) = (self.k_c / walking(view), self.t_l / self.t_i);
        let seen = self.k_p * far + gain * (lead * near + (1.0 - lead) * *lag);
        // P(s) = 2/(1 + tau_p*s/2) - 1.
        let target = 2.0 * *delay - seen;
        let wanted = (self.k_r * walking(view) + self.k_t) * target
            - self.k_t * view.wheel_angle_rad
            - self.k_hg * view.guidance_torque_nm;
        // Each first-order state exactly, for inputs that hold during the step.
        let toward = |state: &mut f64, input: f64, tau: f64| {
            *state += (1.0 - (-STEP_S / tau).exp()) * (input - *state)
        };
        toward(torque, wanted, self.t_n);
        toward(delay, seen, 0.5 * self.tau_p);
        toward(lag, near, self.t_i);
        *torque
    }

    fn k_hg(&self) -> Option<f64> {
        Some(self.k_hg)
    }
}

#[allow(clippy::unnecessary_wraps, reason = "the type of Make::Part")]
fn made(scenario: &Scenario, far: Far, v: &[f64]) -> Result<Box<dyn AnyDriver>, ScenarioError> {
    let driver = scenario.driver();
    let own = Cybernetic {
        look_ahead_s: [driver.t_n.max(0.1), driver.t_f],
        far,
        k_p: v[0],
        k_c: v[1],
        t_i: v[2],
        t_l: v[3],
        tau_p: v[4],
        k_r: v[5],
        k_t: v[6],
        t_n: v[7],
        k_hg: v[8],
        state: [0.0; 3],
    };
    Ok(with_remnant(scenario, own))
}

const K_R: Parameter = Parameter::published("k_r_nm_s_per_m", 1.0, [0.0, 5.0]);
const OWN_K_R: Parameter = Parameter::ours("k_r_nm_s_per_m", 0.2, [0.0, 5.0]);
const FAR: Parameter = Parameter::published("far_m", 15.0, [0.0, 200.0]);

/// Its parameters with a K_r, and those that only one of the kinds has.
const fn parameters<const N: usize>(k_r: Parameter, more: Parameter) -> [Parameter; N] {
    let mut all = [more; N];
    all[0] = Parameter::published("k_p", 3.4, [0.0, 50.0]);
    all[1] = Parameter::published("k_c_m_per_s", 15.0, [0.0, 200.0]);
    all[2] = Parameter::published("t_i_s", 1.0, [0.01, 10.0]);
    all[3] = Parameter::published("t_l_s", 3.0, [0.0, 10.0]);
    all[4] = Parameter::published("tau_p_s", 0.04, [0.002, 1.0]);
    all[5] = k_r;
    all[6] = Parameter::published("k_t_nm_per_rad", 12.0, [0.0, 50.0]);
    all[7] = Parameter::published("t_n_s", 0.1, [0.01, 1.0]);
    all[8] = Parameter::ours("k_hg", 0.0, [0.0, 1.0]);
    all
}

pub(super) const KIND: Kind<dyn AnyDriver> = Kind {
    name: "cybernetic",
    source: "Saleh et al. 2011; Zhao et al. 2020",
    origin: Origin::After,
    parameters: &parameters::<9>(OWN_K_R, OWN_K_R),
    make: Make::Part(|scenario, v| made(scenario, Far::Heading, v)),
};

pub(super) const CURVATURE: Kind<dyn AnyDriver> = Kind {
    name: "cybernetic_curvature",
    parameters: &parameters::<10>(K_R, FAR),
    make: Make::Part(|scenario, v| made(scenario, Far::Curvature(v[9], scenario.course().centreline()), v)),
    ..KIND
};
