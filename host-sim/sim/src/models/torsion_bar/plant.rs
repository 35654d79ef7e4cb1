//! Wheel, bar, column, assist and vehicle, moved by the millisecond.
//!
//! Without assist and without friction, on linear tyres and at a speed that holds, a step is the matrix exponential of the
//! [linear form](super::matrices). Otherwise it is [`INNER_STEPS`] steps of the classical Runge-Kutta method: 0.2 ms, a
//! twentieth of the period of 250 Hz, beside 9 Hz of the wheel on its bar and some 50 Hz of the assist's loop at a standstill.
//! Torques of hands and guidance hold during a step, as does the noise of the sensor.

use nalgebra::SMatrix;
use rand::SeedableRng;
use rand::rngs::Xoshiro256PlusPlus;
use rand_distr::{Distribution, StandardNormal};

use super::assist::Assist;
use super::exact::transition;
use super::parameters::{AngleSensor, AssistParameters, ColumnFault, ColumnParameters, Inject};
use crate::models::nonlinear::{RIPPLES, SingleTrack, SteeringColumn, Surroundings, Wind, WorldParameters};
use crate::models::plant::{Plant as Place, PlantState};
use crate::models::{STEP_S, step_of};
use crate::parts::{Acting, BarState, Motion, Vehicle};
use crate::scenario::Scenario;
use crate::seeds::Stream;

/// Number of states.
pub const STATES: usize = 13;
/// Inputs: T_hand, T_h, what the sensor adds.
pub const INPUTS: usize = 3;
/// Runge-Kutta steps in a millisecond.
const INNER_STEPS: u32 = 5;

/// Lateral speed of the centre of gravity, m/s.
pub const LATERAL: usize = 0;
/// r.
pub const YAW_RATE: usize = 1;
/// phi_w.
pub const WHEEL: usize = 2;
/// phi_w'.
pub const WHEEL_RATE: usize = 3;
/// How far the wheel's friction has given, rad.
pub const WHEEL_GIVE: usize = 4;
/// phi_c.
pub const COLUMN: usize = 5;
/// phi_c'.
pub const COLUMN_RATE: usize = 6;
/// How far the column's friction has given, rad.
pub const COLUMN_GIVE: usize = 7;
/// The sensor behind its lag, N.m.
pub const SENSOR: usize = 8;
/// The lag of the compensator, N.m.
pub const LAG: usize = 9;
/// The motor's torque, N.m.
pub const MOTOR: usize = 10;
/// The part of it that is guidance, N.m.
pub const GUIDANCE: usize = 11;
/// psi.
pub const YAW: usize = 12;

/// A value for each state.
pub type State = [f64; STATES];

/// What holds during a step, but for the speed, which changes linearly.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Held {
    pub(super) hands_nm: f64,
    pub(super) guidance_nm: f64,
    pub(super) sensor_adds_nm: f64,
    pub(super) v_m_per_s: f64,
    pub(super) bank_rad: f64,
    /// Side force and yaw moment of the wind, N and N.m.
    pub(super) wind: [f64; 2],
}

/// A car with a torsion bar, at some place.
#[derive(Debug, Clone)]
pub struct BarPlant {
    /// Its column.
    pub column: ColumnParameters,
    /// Its compensator and motor, and where guidance is brought in.
    pub motor: AssistParameters,
    /// What amplifies.
    pub assist: Assist,
    /// Torque on the column beside that of the tyres, from the next step on, N.m: what a bump kicks back.
    pub kick_nm: f64,
    vehicle: SingleTrack,
    world: WorldParameters,
    wind: Wind,
    upper: SteeringColumn,
    lower: SteeringColumn,
    place: Place,
    state: State,
    v_m_per_s: f64,
    /// The exact step, where there is one, and the speed that it is for.
    exact: Option<(f64, Box<SMatrix<f64, STATES, { STATES + INPUTS }>>)>,
    noise: Xoshiro256PlusPlus,
    sensor_adds_nm: f64,
    /// Steps until something fails; none if nothing will.
    fails_in: Option<u32>,
    /// What fails now.
    fault: ColumnFault,
    /// What a stuck sensor reads, N.m.
    stuck_nm: f64,
}

impl BarPlant {
    /// A scenario's car at the start of the course: the one that its tolerances draw.
    pub fn new(scenario: &Scenario) -> Self {
        let (car, values) = (scenario.car(), scenario.values());
        let (column, motor) = (values.column, values.assist.clone());
        let body = |inertia, damping, friction_nm| SteeringColumn {
            inertia,
            damping,
            friction_nm,
            give_rad: column.friction_give_rad,
        };
        let (vehicle, world) = (&car.vehicle, car.world);
        let (j_w, b_w) = (column.j_w_kg_m2, column.b_w_nms_per_rad);
        let noise = Stream::Bar.seed(scenario.seed());
        Self {
            vehicle: SingleTrack::new(vehicle, world.tyres, world.castor_share),
            wind: Wind::new(&world, Stream::World.seed(scenario.seed())),
            upper: body(j_w, b_w, column.upper_friction_nm),
            lower: body(vehicle.j_s - j_w, vehicle.b_s - b_w, column.lower_friction_nm),
            world,
            place: Place::default(),
            state: [0.0; STATES],
            v_m_per_s: scenario.speed_m_per_s(),
            exact: None,
            noise: Xoshiro256PlusPlus::seed_from_u64(noise),
            sensor_adds_nm: column.sensor_offset_nm,
            kick_nm: 0.0,
            fails_in: column.fault_at_s().map(step_of),
            fault: ColumnFault::None,
            stuck_nm: 0.0,
            assist: motor.curve.assist(),
            column,
            motor,
        }
    }

    /// The car with another assist.
    #[must_use]
    pub fn with_assist(self, assist: Assist) -> Self {
        Self { assist, ..self }
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
        let left = if self.fault == ColumnFault::BrokenBar {
            0.1
        } else {
            1.0
        };
        left * self.column.k_tb_nm_per_rad * (x[WHEEL] - x[COLUMN])
            + self.column.b_tb_nms_per_rad * (x[WHEEL_RATE] - x[COLUMN_RATE])
    }

    /// What the bar's sensor says, N.m: its range, and steps of its resolution.
    pub fn sensor_torque_nm(&self) -> f64 {
        let steps = self.sensed(self.state[SENSOR], self.sensor_adds_nm) / self.column.sensor_resolution_nm;
        steps.round() * self.column.sensor_resolution_nm
    }

    /// A converter reads no more than its range.
    fn sensed(&self, torque_nm: f64, adds_nm: f64) -> f64 {
        let most = self.column.sensor_range_nm;
        let reads_nm = match self.fault {
            ColumnFault::SensorStuck => self.stuck_nm,
            ColumnFault::SensorDoubled => 2.0 * torque_nm + adds_nm,
            _ => torque_nm + adds_nm,
        };
        reads_nm.clamp(-most, most)
    }

    /// Something of the column fails in the next step.
    pub fn fail(&mut self, fault: ColumnFault) {
        (self.column.fault, self.fails_in) = (fault, Some(0));
    }

    /// Lets time pass for what fails.
    fn age(&mut self) {
        match self.fails_in {
            None => {}
            Some(0) => {
                self.stuck_nm = self.sensed(self.state[SENSOR], self.sensor_adds_nm);
                (self.fails_in, self.fault) = (None, self.column.fault);
                if self.fault == ColumnFault::SensorOffset {
                    self.column.sensor_offset_nm += 1.0;
                    self.sensor_adds_nm += 1.0;
                }
            }
            Some(left) => self.fails_in = Some(left - 1),
        }
        if self.fault == ColumnFault::SensorDrift {
            self.column.sensor_offset_nm += 0.05 * STEP_S;
            self.sensor_adds_nm += 0.05 * STEP_S;
        }
    }

    /// Behind the compensator, N.m.
    pub fn compensated(&self, x: &State, adds_nm: f64) -> f64 {
        let lead = self.motor.lead_s / self.motor.lag_s;
        lead * self.sensed(x[SENSOR], adds_nm) + (1.0 - lead) * x[LAG]
    }

    /// What the motor is asked for, all and without guidance, N.m: no more than it has.
    fn demand(&self, x: &State, held: &Held) -> [f64; 2] {
        let most = self.motor.limit_nm;
        let torque = self.compensated(x, held.sensor_adds_nm);
        let curve = |torque_nm| match self.fault {
            ColumnFault::AssistLost => 0.0,
            ColumnFault::AssistRunaway => most,
            _ => self.assist.at(torque_nm, held.v_m_per_s),
        };
        let alone = curve(torque);
        let all = match self.motor.inject {
            Inject::Overlay => alone + held.guidance_nm,
            Inject::Offset => curve(torque + held.guidance_nm),
        };
        [all, alone].map(|nm| nm.clamp(-most, most))
    }

    /// The part of the motor's torque that is guidance, N.m.
    pub fn guidance_torque_nm(&self) -> f64 {
        self.state[GUIDANCE] * (1.0 + self.world.motor_error)
    }

    /// T_h as hands that hold the wheel feel it at the bar's torque of now, N.m: of what the motor turns the column with, a column
    /// with an assist of slope g hands on 1/(1 + g).
    pub fn felt_nm(&self) -> f64 {
        let torque = self.sensed(self.state[SENSOR], self.sensor_adds_nm);
        self.guidance_torque_nm() / (1.0 + self.assist.slope(torque, self.v_m_per_s))
    }

    /// Where it is, with an arm's torque beside it.
    pub(crate) fn place(&self, arm_nm: f64) -> Place {
        let mut place = self.place.clone();
        place.set_arm_nm(arm_nm);
        place
    }

    /// The derivatives of the states.
    pub(super) fn rates(&self, x: &State, held: &Held) -> State {
        let (column, motor) = (&self.column, &self.motor);
        let torque_nm = self.bar_of(x);
        let [force_n, moment_nm] = held.wind;
        let around = Surroundings {
            mu: self.world.mu,
            bank_rad: held.bank_rad,
            force_n,
            moment_nm,
        };
        let response = self
            .vehicle
            .respond(held.v_m_per_s, [x[LATERAL], x[YAW_RATE]], x[COLUMN], &around);
        let upper = self
            .upper
            .respond(x[WHEEL_RATE], x[WHEEL_GIVE], held.hands_nm - torque_nm);
        let ripple = self.world.motor_ripple_nm * (RIPPLES * x[COLUMN]).sin();
        let acting = x[MOTOR] * (1.0 + self.world.motor_error) + ripple;
        let on_column = torque_nm + acting + response.aligning_nm + self.kick_nm;
        let lower = self.lower.respond(x[COLUMN_RATE], x[COLUMN_GIVE], on_column);
        let [all, alone] = self.demand(x, held);
        let twist_nm = column.k_tb_nm_per_rad * (x[WHEEL] - x[COLUMN]);
        [
            response.rates[0],
            response.rates[1],
            x[WHEEL_RATE],
            upper[0],
            upper[1],
            x[COLUMN_RATE],
            lower[0],
            lower[1],
            (twist_nm - x[SENSOR]) / column.sensor_lag_s,
            (self.sensed(x[SENSOR], held.sensor_adds_nm) - x[LAG]) / motor.lag_s,
            (all - x[MOTOR]) / motor.motor_lag_s,
            (all - alone - x[GUIDANCE]) / motor.motor_lag_s,
            x[YAW_RATE],
        ]
    }

    /// Whether the exact step holds: nothing bends, but what the sensor and the motor cut off, which no assist means for the first.
    fn is_linear(&self, acting: &Acting) -> bool {
        self.assist == Assist::None
            && self.fault == ColumnFault::None
            && self.upper.friction_nm == 0.0
            && self.lower.friction_nm == 0.0
            && self.world.is_ideal()
            && self.kick_nm == 0.0
            && acting.speed_m_per_s[0] == acting.speed_m_per_s[1]
            && acting.bank_rad == 0.0
    }

    fn step_exactly(&mut self, held: &Held) {
        let v = held.v_m_per_s;
        if self.exact.as_ref().is_none_or(|(of, _)| *of != v) {
            self.exact = Some((v, Box::new(transition(self, v))));
        }
        let Some((_, step)) = &self.exact else { return };
        let most = self.motor.limit_nm;
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

impl Vehicle for BarPlant {
    fn step(&mut self, acting: &Acting) -> f64 {
        self.age();
        let [from, to] = acting.speed_m_per_s;
        let held = Held {
            hands_nm: acting.driver_torque_nm,
            guidance_nm: acting.guidance_torque_nm,
            sensor_adds_nm: self.sensor_adds_nm,
            v_m_per_s: from,
            bank_rad: acting.bank_rad + self.world.bank_rad,
            wind: self.wind.step(),
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
        self.v_m_per_s = to;
        if self.column.sensor_noise_nm > 0.0 {
            let white: f64 = StandardNormal.sample(&mut self.noise);
            self.sensor_adds_nm = self.column.sensor_offset_nm + self.column.sensor_noise_nm * white;
        }
        match self.motor.inject {
            Inject::Overlay => self.guidance_torque_nm(),
            // What the curve makes of an offset nobody measures apart: an actuator tells the offset that it took.
            Inject::Offset => acting.guidance_torque_nm,
        }
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

    fn bar(&self) -> Option<BarState> {
        let x = &self.state;
        Some(BarState {
            sensor_nm: self.sensor_torque_nm(),
            torque_nm: self.bar_torque_nm(),
            assist_nm: (x[MOTOR] - x[GUIDANCE]) * (1.0 + self.world.motor_error),
            felt_nm: self.felt_nm(),
            told_angle_rad: match self.column.angle {
                AngleSensor::Wheel => x[WHEEL],
                AngleSensor::Column => x[COLUMN],
            },
        })
    }
}

impl BarPlant {
    /// A copy at rest without friction, noise and offset, with another assist: one whose linear form is exact.
    #[must_use]
    pub fn frictionless(&self, assist: Assist) -> Self {
        let mut other = self.clone().with_assist(assist);
        other.column = self.column.linear();
        (other.upper.friction_nm, other.lower.friction_nm) = (0.0, 0.0);
        other
    }
}
