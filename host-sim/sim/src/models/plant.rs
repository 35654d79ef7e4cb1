//! Vehicle, steering column and the driver's arm, stepped exactly: equations (1) to (6) and (8).
//!
//! At constant speed these are linear: `x' = A*x + B*u` with the states side-slip, yaw rate, wheel angle,
//! wheel rate, driver torque and yaw angle. A step of 1 ms is the matrix exponential of that system, computed
//! once (`Transition`), so it has no integration error at any step size. Between steps the guidance torque
//! and the remnant are held, as the actuator holds them; the target angle of the arm is a straight line,
//! since its delayed course is known one step ahead.
//!
//! The position is the only nonlinear part: `x' = v*cos(chi)`, `y' = v*sin(chi)` along the direction of
//! movement `chi = psi + beta`, by the midpoint rule. Its error stays below 1e-6 m over a course, because
//! `chi` turns by less than 1e-4 rad in a step.
//!
//! Not here: what the driver wants (`driver`), and any limit or dead zone.

use nalgebra::SMatrix;

use super::STEP_S;
use super::driver::{ArmGains, DriverParameters};
use super::vehicle::VehicleParameters;

/// Number of linear states.
pub const STATES: usize = 6;
/// States that drive others; the yaw angle drives none.
const COUPLED: usize = 5;
/// Inputs: target angle now, target angle one step ahead, guidance torque, remnant.
const INPUTS: usize = 4;
/// Columns of a transition: the coupled states, then the inputs.
pub const COLUMNS: usize = COUPLED + INPUTS;

/// Places of the states: beta, r, phi, phi', T_d, psi.
pub const BETA: usize = 0;
/// r.
pub const YAW_RATE: usize = 1;
/// phi.
pub const WHEEL: usize = 2;
/// phi'.
pub const WHEEL_RATE: usize = 3;
/// T_d.
pub const ARM: usize = 4;
/// psi.
pub const YAW: usize = 5;

/// What acts on the plant during one step.
#[derive(Debug, Clone, Copy, Default)]
pub struct PlantInput {
    /// phi_target at the start of the step, rad.
    pub target_now_rad: f64,
    /// phi_target at the end of the step, rad.
    pub target_next_rad: f64,
    /// T_h, N.m.
    pub guidance_torque_nm: f64,
    /// Part of the driver's torque that the model does not explain, N.m, added at the column.
    pub remnant_nm: f64,
}

/// One step of the linear part, for given parameters and arm gains.
#[derive(Debug, Clone)]
pub struct Transition {
    /// What each coupled state and each input adds to each state.
    pub columns: [[f64; STATES]; COLUMNS],
    /// Distance travelled in a step, m.
    pub distance_m: f64,
    gains: ArmGains,
}

/// What a plant is in, beside its place.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PlantState {
    /// beta, rad.
    pub sideslip_rad: f64,
    /// r, rad/s.
    pub yaw_rate_rad_s: f64,
    /// phi, rad.
    pub wheel_rad: f64,
    /// phi', rad/s.
    pub wheel_rate_rad_s: f64,
    /// T_d of equation (8), N.m.
    pub arm_nm: f64,
    /// psi, rad.
    pub yaw_rad: f64,
}

/// State of vehicle, column and arm. The default is straight driving at the origin.
#[derive(Debug, Clone)]
pub struct Plant {
    linear: [f64; STATES],
    position_m: [f64; 2],
    /// Unit vector along the direction of movement. Rotated step by step: a sine and a cosine each
    /// millisecond would cost as much as the whole linear part.
    direction: [f64; 2],
}

impl Transition {
    /// The exact step of `STEP_S` at a constant speed.
    pub fn new(
        v_m_per_s: f64,
        vehicle: &VehicleParameters,
        driver: &DriverParameters,
        gains: ArmGains,
    ) -> Self {
        let VehicleParameters {
            m,
            i,
            l_f,
            l_r,
            k_f,
            k_r,
            b_s,
            j_s,
            k_t,
            ..
        } = *vehicle;
        let v = v_m_per_s;
        let k_aln = vehicle.aligning_stiffness();
        let moment = l_f * k_f - l_r * k_r;
        // Rows and columns: the six states, then target angle, its slope, guidance torque, remnant. The target
        // angle integrates its slope, the others stay: held inputs are states that do not change.
        const TARGET: usize = STATES;
        const SLOPE: usize = STATES + 1;
        const GUIDANCE: usize = STATES + 2;
        const REMNANT: usize = STATES + 3;
        let mut a = SMatrix::<f64, { STATES + INPUTS }, { STATES + INPUTS }>::zeros();
        // (1)
        a[(BETA, BETA)] = -2.0 * (k_f + k_r) / (m * v);
        a[(BETA, YAW_RATE)] = -(m * v + 2.0 / v * moment) / (m * v);
        a[(BETA, WHEEL)] = 2.0 * k_f * k_t / (m * v);
        // (2)
        a[(YAW_RATE, BETA)] = -2.0 * moment / i;
        a[(YAW_RATE, YAW_RATE)] = -2.0 * (l_f * l_f * k_f + l_r * l_r * k_r) / (v * i);
        a[(YAW_RATE, WHEEL)] = 2.0 * l_f * k_f * k_t / i;
        // (5) with (3) and (6)
        a[(WHEEL, WHEEL_RATE)] = 1.0;
        a[(WHEEL_RATE, BETA)] = k_aln / j_s;
        a[(WHEEL_RATE, YAW_RATE)] = k_aln * l_f / v / j_s;
        a[(WHEEL_RATE, WHEEL)] = -k_aln * k_t / j_s;
        a[(WHEEL_RATE, WHEEL_RATE)] = -b_s / j_s;
        a[(WHEEL_RATE, ARM)] = 1.0 / j_s;
        a[(WHEEL_RATE, GUIDANCE)] = 1.0 / j_s;
        a[(WHEEL_RATE, REMNANT)] = 1.0 / j_s;
        // (8)
        a[(ARM, ARM)] = -1.0 / driver.t_nms;
        a[(ARM, WHEEL)] = -driver.k_nms / driver.t_nms;
        a[(ARM, TARGET)] = (gains.k_d + driver.k_nms) / driver.t_nms;
        a[(ARM, GUIDANCE)] = -gains.k_hg / driver.t_nms;
        a[(YAW, YAW_RATE)] = 1.0;
        a[(TARGET, SLOPE)] = 1.0;

        let phi = (a * STEP_S).exp();
        let column = |j: usize| std::array::from_fn(|row| phi[(row, j)]);
        let mut columns = [[0.0; STATES]; COLUMNS];
        for (j, slot) in columns.iter_mut().take(COUPLED).enumerate() {
            *slot = column(j);
        }
        let (from_target, from_slope): ([f64; STATES], [f64; STATES]) = (column(TARGET), column(SLOPE));
        for row in 0..STATES {
            let ahead = from_slope[row] / STEP_S;
            columns[COUPLED][row] = from_target[row] - ahead;
            columns[COUPLED + 1][row] = ahead;
        }
        columns[COUPLED + 2] = column(GUIDANCE);
        columns[COUPLED + 3] = column(REMNANT);
        Self {
            columns,
            distance_m: v * STEP_S,
            gains,
        }
    }

    /// The gains of the arm that it was made for.
    pub fn gains(&self) -> ArmGains {
        self.gains
    }
}

impl Default for Plant {
    fn default() -> Self {
        Self {
            linear: [0.0; STATES],
            position_m: [0.0; 2],
            direction: [1.0, 0.0],
        }
    }
}

impl Plant {
    /// Advances by one step.
    #[inline]
    pub fn step(&mut self, transition: &Transition, input: &PlantInput) {
        let before = self.direction_rad();
        let x = &self.linear;
        let factors = [
            x[BETA],
            x[YAW_RATE],
            x[WHEEL],
            x[WHEEL_RATE],
            x[ARM],
            input.target_now_rad,
            input.target_next_rad,
            input.guidance_torque_nm,
            input.remnant_nm,
        ];
        let mut next = [0.0; STATES];
        next[YAW] = x[YAW];
        for (column, factor) in transition.columns.iter().zip(factors) {
            for (sum, entry) in next.iter_mut().zip(column) {
                *sum += entry * factor;
            }
        }
        self.linear = next;
        self.advance(before, transition.distance_m);
    }

    /// The place after a step of some length, in which the direction of movement changed.
    #[inline]
    fn advance(&mut self, before: f64, distance_m: f64) {
        // The length is corrected before the turn, as that needs no angle: neither place nor direction waits for it.
        let direction = unit(self.direction);
        let half_turn = 0.5 * (self.direction_rad() - before);
        let (sin, cos) = sine_and_cosine(half_turn);
        let ([x_m, y_m], [x, y]) = (self.position_m, rotated(direction, (sin, cos)));
        self.position_m = [x_m + distance_m * x, y_m + distance_m * y];
        self.direction = rotated(direction, (2.0 * sin * cos, 1.0 - 2.0 * sin * sin));
    }

    /// Its state.
    pub fn state(&self) -> PlantState {
        let x = &self.linear;
        PlantState {
            sideslip_rad: x[BETA],
            yaw_rate_rad_s: x[YAW_RATE],
            wheel_rad: x[WHEEL],
            wheel_rate_rad_s: x[WHEEL_RATE],
            arm_nm: x[ARM],
            yaw_rad: x[YAW],
        }
    }

    /// The state after a step that another model made, in which the vehicle went so far.
    pub fn set_state(&mut self, state: PlantState, distance_m: f64) {
        let before = self.direction_rad();
        let x = &mut self.linear;
        (x[BETA], x[YAW_RATE], x[WHEEL]) = (state.sideslip_rad, state.yaw_rate_rad_s, state.wheel_rad);
        (x[WHEEL_RATE], x[ARM], x[YAW]) = (state.wheel_rate_rad_s, state.arm_nm, state.yaw_rad);
        self.advance(before, distance_m);
    }

    /// Takes over an arm's torque, N.m.
    pub fn set_arm_nm(&mut self, arm_nm: f64) {
        self.linear[ARM] = arm_nm;
    }

    /// Position of the centre of gravity, m.
    pub fn position_m(&self) -> [f64; 2] {
        self.position_m
    }

    /// chi = psi + beta, direction of movement, rad, not wrapped.
    pub fn direction_rad(&self) -> f64 {
        self.linear[YAW] + self.linear[BETA]
    }

    /// The point `distance_m` ahead along the direction of movement, m.
    #[inline]
    pub fn ahead_m(&self, distance_m: f64) -> [f64; 2] {
        let ([x_m, y_m], [x, y]) = (self.position_m, self.direction);
        [x_m + distance_m * x, y_m + distance_m * y]
    }

    /// beta, rad.
    pub fn sideslip_rad(&self) -> f64 {
        self.linear[BETA]
    }

    /// r, rad/s.
    pub fn yaw_rate_rad_per_s(&self) -> f64 {
        self.linear[YAW_RATE]
    }

    /// phi, rad.
    pub fn wheel_angle_rad(&self) -> f64 {
        self.linear[WHEEL]
    }

    /// phi', rad/s.
    pub fn wheel_rate_rad_per_s(&self) -> f64 {
        self.linear[WHEEL_RATE]
    }

    /// T_d of equation (8), without the remnant, N.m.
    pub fn arm_torque_nm(&self) -> f64 {
        self.linear[ARM]
    }
}

/// Sine and cosine of a small angle.
#[inline]
fn sine_and_cosine(angle: f64) -> (f64, f64) {
    let square = angle * angle;
    // Fifth-order terms are below rounding for the 1e-4 rad of a step; a wild motion that is about to be
    // flagged as diverged may turn faster and gets the library's functions.
    if square < 1e-6 {
        (
            angle * (1.0 - square * (1.0 / 6.0)),
            1.0 - square * (0.5 - square * (1.0 / 24.0)),
        )
    } else {
        angle.sin_cos()
    }
}

/// `direction` turned by an angle of that sine and cosine.
#[inline(always)]
pub fn rotated([x, y]: [f64; 2], (sin, cos): (f64, f64)) -> [f64; 2] {
    [x * cos - y * sin, x * sin + y * cos]
}

/// A vector that rounding has left almost of unit length, at unit length: its length would drift otherwise.
#[inline(always)]
pub fn unit([x, y]: [f64; 2]) -> [f64; 2] {
    let scale = 1.5 - 0.5 * (x * x + y * y);
    [x * scale, y * scale]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::runge_kutta;

    const V: f64 = 60.0 / 3.6;

    /// Equations (1) to (8) as printed, solved for the derivatives one by one.
    fn derivatives(x: &[f64; 8], target: f64, t_h: f64, remnant: f64, gains: ArmGains) -> [f64; 8] {
        let p = VehicleParameters::default();
        let [beta, r, phi, phi_dot, t_d, psi, ..] = *x;
        let delta = p.k_t * phi;
        let beta_dot = (2.0 * p.k_f * delta
            - 2.0 * (p.k_f + p.k_r) * beta
            - (p.m * V + 2.0 / V * (p.l_f * p.k_f - p.l_r * p.k_r)) * r)
            / (p.m * V);
        let r_dot = (2.0 * p.l_f * p.k_f * delta
            - 2.0 * (p.l_f * p.k_f - p.l_r * p.k_r) * beta
            - 2.0 * (p.l_f.powi(2) * p.k_f + p.l_r.powi(2) * p.k_r) / V * r)
            / p.i;
        let k_aln = 2.0 * p.e_t * p.k_f * p.k_t / (1.0 + 2.0 * p.e_t * p.k_f / p.k_s);
        let t_a = k_aln * (beta + p.l_f * r / V - delta);
        let phi_ddot = (t_d + remnant + t_h + t_a - p.b_s * phi_dot) / p.j_s;
        let t_d_dot = (gains.k_d * target + 1.0 * (target - phi) - gains.k_hg * t_h - t_d) / 0.1;
        let chi = psi + beta;
        [
            beta_dot,
            r_dot,
            phi_dot,
            phi_ddot,
            t_d_dot,
            r,
            V * chi.cos(),
            V * chi.sin(),
        ]
    }

    #[test]
    fn a_step_is_as_exact_as_a_fine_runge_kutta() {
        let gains = ArmGains { k_d: 3.0, k_hg: 0.5 };
        let transition = Transition::new(
            V,
            &VehicleParameters::default(),
            &DriverParameters::default(),
            gains,
        );
        let target = |t: f64| 0.8 * (2.0 * t).sin() + 0.3 * (7.0 * t).cos() - 0.3;
        let held = |k: u32| 1.5 * (f64::from(k / 100) * 1.7).sin();
        let mut plant = Plant::default();
        let mut x = [0.0; 8];
        for k in 0..10_000_u32 {
            let t = f64::from(k) * STEP_S;
            let (t_h, remnant) = (held(k), 0.3 * held(k + 777));
            let (now, next) = (target(t), target(t + STEP_S));
            let input = PlantInput {
                target_now_rad: now,
                target_next_rad: next,
                guidance_torque_nm: t_h,
                remnant_nm: remnant,
            };
            plant.step(&transition, &input);
            let h = STEP_S / 10.0;
            for i in 0..10_u32 {
                x = runge_kutta(&x, h, |x, part| {
                    let target = now + (next - now) * (f64::from(i) + part) / 10.0;
                    derivatives(x, target, t_h, remnant, gains)
                });
            }
        }
        assert!(x[7].abs() > 1.0 && x[2].abs() > 0.01, "the oracle moved: {x:?}");
        for (state, (exact, oracle)) in plant.linear.iter().zip(&x).enumerate() {
            assert!(
                (exact - oracle).abs() < 1e-6,
                "state {state}: {exact} against {oracle}"
            );
        }
        let [x_m, y_m] = plant.position_m;
        assert!((x_m - x[6]).abs() < 1e-5 && (y_m - x[7]).abs() < 1e-5);
        let [cos, sin] = plant.direction;
        assert!((sin.atan2(cos) - plant.direction_rad()).abs() < 1e-12);
    }

    #[test]
    fn a_held_wheel_turns_the_vehicle_as_the_textbook_says() {
        // Abe, Vehicle Handling Dynamics, steady state: r = v*delta / (L*(1 + A*v^2)),
        // A = -m/(2*L^2) * (l_f*K_f - l_r*K_r)/(K_f*K_r); table 9 at 60 km/h: A = 0.0017529, so that
        // r/delta = 16.667/(2.635*1.48691) = 4.2539 1/s.
        let gains = ArmGains { k_d: 4.0, k_hg: 0.0 };
        let transition = Transition::new(
            V,
            &VehicleParameters::default(),
            &DriverParameters::default(),
            gains,
        );
        let mut plant = Plant::default();
        let input = PlantInput {
            target_now_rad: 0.5,
            target_next_rad: 0.5,
            ..Default::default()
        };
        for _ in 0..20_000 {
            plant.step(&transition, &input);
        }
        let ratio = plant.yaw_rate_rad_per_s() / (plant.wheel_angle_rad() / 17.0);
        let a = 1100.0 / (2.0 * 2.635 * 2.635) * (1.635 * 117_000.0 - 53_300.0) / (53_300.0 * 117_000.0);
        let textbook = V / (2.635 * (1.0 + a * V * V));
        assert!((ratio - textbook).abs() < 1e-9, "{ratio} against {textbook}");
        assert!(plant.yaw_rate_rad_per_s() > 0.01, "a positive angle turns left");
    }
}
