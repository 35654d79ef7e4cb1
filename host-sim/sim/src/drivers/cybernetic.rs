//! The cybernetic driver. Source: Saleh et al. 2011; Zhao, Chevrel, Claveau, Mars 2020; equations and parameters seen in the public
//! MATLAB of Y. Zhao's thesis.
//!
//! Vision: `d_target = P(s)*(K_p*th_far + (K_c/v)*(T_L*s + 1)/(T_I*s + 1)*th_near)`, `P(s) = (1 - tau_p*s/2)/(1 + tau_p*s/2)`.
//! Muscle: `T_N*dT/dt + T = (K_r*v + K_t)*d_target - K_t*d - K_hg*T_h`, d the wheel angle.
//!
//! Chosen here: the angles of sight are those of the points that a scenario's driver looks at, `th_near = e_y/(v*t_n)`, `th_far =
//! e_theta/2` (on an arc the line of sight turns by half of what the road does). The third input of the muscle, which that code leaves
//! open, is the guidance torque with a share K_hg. K_r is 1 there: it carries the aligning torque of that car, and 0.2 carries this one's.

use super::{AnyDriver, Kind, Make, angles_of_sight, of_scenario, walking};
use crate::kind::Parameter;
use crate::models::STEP_S;
use crate::parts::{Driver, DriverView};

#[derive(Debug, Clone)]
struct Cybernetic {
    look_ahead_s: [f64; 2],
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
}

pub(super) const KIND: Kind<dyn AnyDriver> = Kind {
    name: "cybernetic",
    source: "Saleh et al. 2011; Zhao et al. 2020",
    parameters: &[
        Parameter::published("k_p", 3.4, [0.0, 50.0]),
        Parameter::published("k_c_m_per_s", 15.0, [0.0, 200.0]),
        Parameter::published("t_i_s", 1.0, [0.01, 10.0]),
        Parameter::published("t_l_s", 3.0, [0.0, 10.0]),
        Parameter::published("tau_p_s", 0.04, [0.002, 1.0]),
        Parameter::ours("k_r_nm_s_per_m", 0.2, [0.0, 5.0]),
        Parameter::published("k_t_nm_per_rad", 12.0, [0.0, 50.0]),
        Parameter::published("t_n_s", 0.1, [0.01, 1.0]),
        Parameter::ours("k_hg", 0.0, [0.0, 1.0]),
    ],
    make: Make::Part(|scenario, v| {
        let driver = scenario.driver();
        of_scenario(
            scenario,
            Cybernetic {
                look_ahead_s: [driver.t_n.max(0.1), driver.t_f],
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
            },
        )
    }),
};
