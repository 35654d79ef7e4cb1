//! Wheel, bar, column, assist and vehicle, moved by the millisecond.
//!
//! Without assist and without friction, on linear tyres and at a speed that holds, a step is the matrix exponential of the
//! [linear form](crate::linear). Otherwise it is [`INNER_STEPS`] steps of the classical Runge-Kutta method: 0.2 ms, a
//! twentieth of the period of 250 Hz, beside 9 Hz of the wheel on its bar and some 50 Hz of the assist's loop at a standstill.
//! Torques of hands and guidance hold during a step, as does the noise of the sensor.

use haptic_sim::models::STEP_S;
use haptic_sim::models::nonlinear::{SingleTrack, SteeringColumn, Surroundings, WorldParameters};
use haptic_sim::models::plant::{Plant as Place, PlantState};
use haptic_sim::models::vehicle::VehicleParameters;
use haptic_sim::parts::{Acting, Motion, Vehicle};
use nalgebra::SMatrix;
use rand::SeedableRng;
use rand::rngs::Xoshiro256PlusPlus;
use rand_distr::{Distribution, StandardNormal};

use crate::assist::Assist;
use crate::parameters::{BarParameters, ColumnError, Inject};

/// Number of states.
pub const STATES: usize = 13;
/// Inputs: T_hand, T_h, what the sensor adds.
pub(crate) const INPUTS: usize = 3;
/// Runge-Kutta steps in a millisecond.
const INNER_STEPS: u32 = 5;

/// Lateral speed of the centre of gravity, m/s, and yaw rate.
pub(crate) const LATERAL: usize = 0;
pub(crate) const YAW_RATE: usize = 1;
/// phi_w, phi_w', and how far the wheel's friction has given.
pub(crate) const WHEEL: usize = 2;
pub(crate) const WHEEL_RATE: usize = 3;
pub(crate) const WHEEL_GIVE: usize = 4;
/// phi_c, phi_c', and how far the column's friction has given.
pub(crate) const COLUMN: usize = 5;
pub(crate) const COLUMN_RATE: usize = 6;
pub(crate) const COLUMN_GIVE: usize = 7;
/// The sensor behind its lag, and the lag of the compensator, N.m.
pub(crate) const SENSOR: usize = 8;
pub(crate) const LAG: usize = 9;
/// The motor's torque, and the part of it that is guidance, N.m.
pub(crate) const MOTOR: usize = 10;
pub(crate) const GUIDANCE: usize = 11;
/// psi.
pub(crate) const YAW: usize = 12;

pub(crate) type State = [f64; STATES];

/// What holds during a step, but for the speed, which changes linearly.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Held {
    pub(crate) hands_nm: f64,
    pub(crate) guidance_nm: f64,
    pub(crate) sensor_adds_nm: f64,
    pub(crate) v_m_per_s: f64,
    pub(crate) bank_rad: f64,
}

/// A car with a torsion bar, at some place.
#[derive(Debug, Clone)]
pub struct Plant {
    /// Its column.
    pub bar: BarParameters,
    /// Its assist.
    pub assist: Assist,
    vehicle: SingleTrack,
    mu: f64,
    upper: SteeringColumn,
    lower: SteeringColumn,
    place: Place,
    state: State,
    /// The exact step, where there is one, and the speed that it is for.
    exact: Option<(f64, Box<SMatrix<f64, STATES, { STATES + INPUTS }>>)>,
    noise: Xoshiro256PlusPlus,
    sensor_adds_nm: f64,
}

impl Plant {
    /// A car at the origin. Of the world tyres, grip and castor count; friction and motor are the column's.
    ///
    /// # Errors
    /// A column or a curve that cannot be.
    pub fn new(
        bar: BarParameters,
        assist: Assist,
        vehicle: &VehicleParameters,
        world: &WorldParameters,
        seed: u64,
    ) -> Result<Self, ColumnError> {
        bar.check(vehicle)?;
        if let Assist::Points(curve) = &assist {
            curve.check()?;
        }
        let body = |inertia, damping, friction_nm| SteeringColumn {
            inertia,
            damping,
            friction_nm,
            give_rad: bar.friction_give_rad,
        };
        let (j_w, b_w) = (bar.j_w_kg_m2, bar.b_w_nms_per_rad);
        Ok(Self {
            vehicle: SingleTrack::new(vehicle, world.tyres, world.castor_share),
            mu: world.mu,
            upper: body(j_w, b_w, bar.upper_friction_nm),
            lower: body(vehicle.j_s - j_w, vehicle.b_s - b_w, bar.lower_friction_nm),
            place: Place::default(),
            state: [0.0; STATES],
            exact: None,
            noise: Xoshiro256PlusPlus::seed_from_u64(seed),
            sensor_adds_nm: bar.sensor_offset_nm,
            bar,
            assist,
        })
    }

    /// The states: v_y, r; phi_w, phi_w', give; phi_c, phi_c', give; sensor, compensator; motor, its guidance; psi.
    pub fn state(&self) -> &[f64; STATES] {
        &self.state
    }

    /// phi_c, rad.
    pub fn column_angle_rad(&self) -> f64 {
        self.state[COLUMN]
    }

    /// T_tb, the torque that passes through the bar, N.m.
    pub fn bar_torque_nm(&self) -> f64 {
        self.bar_of(&self.state)
    }

    fn bar_of(&self, x: &State) -> f64 {
        self.bar.k_tb_nm_per_rad * (x[WHEEL] - x[COLUMN])
            + self.bar.b_tb_nms_per_rad * (x[WHEEL_RATE] - x[COLUMN_RATE])
    }

    /// What the bar's sensor says, N.m: its range, and steps of its resolution.
    pub fn sensor_torque_nm(&self) -> f64 {
        let steps = self.sensed(self.state[SENSOR], self.sensor_adds_nm) / self.bar.sensor_resolution_nm;
        steps.round() * self.bar.sensor_resolution_nm
    }

    /// A converter reads no more than its range.
    fn sensed(&self, torque_nm: f64, adds_nm: f64) -> f64 {
        let most = self.bar.sensor_range_nm;
        (torque_nm + adds_nm).clamp(-most, most)
    }

    /// Behind the compensator, N.m.
    pub(crate) fn compensated(&self, x: &State, adds_nm: f64) -> f64 {
        let lead = self.bar.lead_s / self.bar.lag_s;
        lead * self.sensed(x[SENSOR], adds_nm) + (1.0 - lead) * x[LAG]
    }

    /// What the motor is asked for, all and without guidance, N.m: no more than it has.
    fn demand(&self, x: &State, held: &Held) -> [f64; 2] {
        let most = self.bar.motor_limit_nm;
        let torque = self.compensated(x, held.sensor_adds_nm);
        let alone = self.assist.at(torque, held.v_m_per_s);
        let all = match self.bar.inject {
            Inject::Overlay => alone + held.guidance_nm,
            Inject::Offset => self.assist.at(torque + held.guidance_nm, held.v_m_per_s),
        };
        [all, alone].map(|nm| nm.clamp(-most, most))
    }

    /// T_h as hands that hold the wheel feel it at the bar's torque of now, N.m: of what the motor turns the column with, a column
    /// with an assist of slope g hands on 1/(1 + g).
    pub fn felt_nm(&self, v_m_per_s: f64) -> f64 {
        let torque = self.sensed(self.state[SENSOR], self.sensor_adds_nm);
        self.state[GUIDANCE] / (1.0 + self.assist.slope(torque, v_m_per_s))
    }

    /// The part of the motor's torque that is guidance, N.m.
    pub fn guidance_torque_nm(&self) -> f64 {
        self.state[GUIDANCE]
    }

    /// The derivatives of the states.
    pub(crate) fn rates(&self, x: &State, held: &Held) -> State {
        let bar = &self.bar;
        let torque_nm = self.bar_of(x);
        let around = Surroundings {
            mu: self.mu,
            bank_rad: held.bank_rad,
            force_n: 0.0,
            moment_nm: 0.0,
        };
        let response = self
            .vehicle
            .respond(held.v_m_per_s, [x[LATERAL], x[YAW_RATE]], x[COLUMN], &around);
        let upper = self
            .upper
            .respond(x[WHEEL_RATE], x[WHEEL_GIVE], held.hands_nm - torque_nm);
        let on_column = torque_nm + x[MOTOR] + response.aligning_nm;
        let lower = self.lower.respond(x[COLUMN_RATE], x[COLUMN_GIVE], on_column);
        let [all, alone] = self.demand(x, held);
        let twist_nm = bar.k_tb_nm_per_rad * (x[WHEEL] - x[COLUMN]);
        [
            response.rates[0],
            response.rates[1],
            x[WHEEL_RATE],
            upper[0],
            upper[1],
            x[COLUMN_RATE],
            lower[0],
            lower[1],
            (twist_nm - x[SENSOR]) / bar.sensor_lag_s,
            (self.sensed(x[SENSOR], held.sensor_adds_nm) - x[LAG]) / bar.lag_s,
            (all - x[MOTOR]) / bar.motor_lag_s,
            (all - alone - x[GUIDANCE]) / bar.motor_lag_s,
            x[YAW_RATE],
        ]
    }

    /// Whether the exact step holds: nothing bends, but what the sensor and the motor cut off, which no assist means for the first.
    fn is_linear(&self, acting: &Acting) -> bool {
        self.assist == Assist::None
            && self.upper.friction_nm == 0.0
            && self.lower.friction_nm == 0.0
            && self.vehicle.tyres == haptic_sim::models::nonlinear::Tyres::Linear
            && acting.speed_m_per_s[0] == acting.speed_m_per_s[1]
            && acting.bank_rad == 0.0
    }

    fn step_exactly(&mut self, held: &Held) {
        let v = held.v_m_per_s;
        if self.exact.as_ref().is_none_or(|(of, _)| *of != v) {
            self.exact = Some((v, Box::new(crate::linear::transition(self, v))));
        }
        let Some((_, step)) = &self.exact else { return };
        let most = self.bar.motor_limit_nm;
        let inputs = [
            held.hands_nm,
            held.guidance_nm.clamp(-most, most),
            held.sensor_adds_nm,
        ];
        let from: Vec<f64> = self.state.iter().copied().chain(inputs).collect();
        self.state = std::array::from_fn(|row| (0..STATES + INPUTS).map(|j| step[(row, j)] * from[j]).sum());
    }

    fn step_by_runge_kutta(&mut self, held: Held, [from, to]: [f64; 2]) {
        let h = STEP_S / f64::from(INNER_STEPS);
        for inner in 0..INNER_STEPS {
            let at = |part: f64| Held {
                v_m_per_s: from + (to - from) * (f64::from(inner) + part) / f64::from(INNER_STEPS),
                ..held
            };
            let x = self.state;
            let plus = |k: &State, h: f64| -> State { std::array::from_fn(|j| x[j] + h * k[j]) };
            let k1 = self.rates(&x, &at(0.0));
            let k2 = self.rates(&plus(&k1, 0.5 * h), &at(0.5));
            let k3 = self.rates(&plus(&k2, 0.5 * h), &at(0.5));
            let k4 = self.rates(&plus(&k3, h), &at(1.0));
            let sum: State = std::array::from_fn(|j| k1[j] + 2.0 * (k2[j] + k3[j]) + k4[j]);
            self.state = plus(&sum, h / 6.0);
        }
    }
}

impl Vehicle for Plant {
    fn step(&mut self, acting: &Acting) -> f64 {
        let [from, to] = acting.speed_m_per_s;
        let held = Held {
            hands_nm: acting.driver_torque_nm,
            guidance_nm: acting.guidance_torque_nm,
            sensor_adds_nm: self.sensor_adds_nm,
            v_m_per_s: from,
            bank_rad: acting.bank_rad,
        };
        if self.is_linear(acting) {
            self.step_exactly(&held);
        } else {
            self.step_by_runge_kutta(held, acting.speed_m_per_s);
        }
        let x = &self.state;
        let state = PlantState {
            sideslip_rad: x[LATERAL].atan2(to),
            yaw_rate_rad_s: x[YAW_RATE],
            wheel_rad: x[WHEEL],
            wheel_rate_rad_s: x[WHEEL_RATE],
            arm_nm: 0.0,
            yaw_rad: x[YAW],
        };
        self.place
            .set_state(state, x[LATERAL].hypot(0.5 * (from + to)) * STEP_S);
        if self.bar.sensor_noise_nm > 0.0 {
            let white: f64 = StandardNormal.sample(&mut self.noise);
            self.sensor_adds_nm = self.bar.sensor_offset_nm + self.bar.sensor_noise_nm * white;
        }
        self.state[GUIDANCE]
    }

    /// Its wheel is the one that the hands hold.
    fn motion(&self) -> Motion {
        Motion {
            position_m: self.place.position_m(),
            direction_rad: self.place.direction_rad(),
            sideslip_rad: self.place.sideslip_rad(),
            yaw_rate_rad_per_s: self.state[YAW_RATE],
            wheel_angle_rad: self.state[WHEEL],
            wheel_rate_rad_per_s: self.state[WHEEL_RATE],
        }
    }

    fn ahead_m(&self, distance_m: f64) -> [f64; 2] {
        self.place.ahead_m(distance_m)
    }
}

impl Plant {
    /// A copy at rest without friction, noise and offset, with another assist.
    pub(crate) fn frictionless(&self, assist: Assist) -> Self {
        let mut other = self.clone();
        other.bar = self.bar.linear();
        (other.upper.friction_nm, other.lower.friction_nm) = (0.0, 0.0);
        other.assist = assist;
        other
    }
}
