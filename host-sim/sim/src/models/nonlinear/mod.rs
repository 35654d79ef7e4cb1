//! The nonlinear world: vehicle, column and driver's arm as separate models, coupled by the torques on the column.
//!
//! [`SingleTrack`] gives an aligning torque for a wheel angle, [`SteeringColumn`] an angle for torques, the arm of equation (8) a
//! torque for an angle; the motor stands between what the guidance asks for and what acts. All are stepped together
//! by the classical Runge-Kutta method, 1 ms at a time. The linear plant of the paper stays in `plant`, exact and
//! fast; this one is used where a scenario asks for something that it cannot do, and agrees with it where slip is
//! small and everything else is off.
//!
//! Not here: what the sensors make of it (`disturbances`), which road is banked (`road`).

mod column;
mod parameters;
mod single_track;
mod wind;

pub use column::SteeringColumn;
pub use parameters::{FULL_ASSIST_AT_NM, Tyres, WorldParameters};
pub use single_track::{Response, SingleTrack, Surroundings, TRAIL_SHAPE};
pub use wind::Wind;

use super::STEP_S;
use super::driver::{ArmGains, DriverParameters};
use super::plant::{Plant, PlantInput, PlantState};
use super::vehicle::VehicleParameters;

/// Acceleration of gravity, m/s^2.
pub const GRAVITY_M_PER_S2: f64 = 9.81;
/// Ripples of the motor in a turn of the wheel.
pub const RIPPLES: f64 = 24.0;

/// Number of states.
pub const STATES: usize = 8;
/// Lateral velocity (m/s), yaw rate, wheel angle, wheel rate, friction's deflection (rad), arm's torque, motor's
/// torque, yaw angle.
type State = [f64; STATES];

/// Vehicle, column, arm and motor of a less than ideal world.
#[derive(Debug, Clone)]
pub struct NonlinearPlant {
    /// The vehicle.
    pub vehicle: SingleTrack,
    /// Its column.
    pub column: SteeringColumn,
    /// What the world is like.
    pub world: WorldParameters,
    /// Whose arm is on the wheel.
    pub driver: DriverParameters,
    /// The wind.
    pub wind: Wind,
    /// Deflection of the friction and the motor's torque; the rest is the plant's.
    deflection_rad: f64,
    motor_nm: f64,
}

/// What is held during a step.
struct Held {
    /// Speed at the start and at the end of the step.
    v_m_per_s: [f64; 2],
    gains: ArmGains,
    input: PlantInput,
    surroundings: Surroundings,
}

impl NonlinearPlant {
    /// A vehicle at rest in its lane. `seed` is of the world's stream.
    pub fn new(
        world: WorldParameters,
        vehicle: &VehicleParameters,
        driver: &DriverParameters,
        seed: u64,
    ) -> Self {
        Self {
            vehicle: SingleTrack::new(vehicle, world.tyres, world.castor_share),
            column: SteeringColumn::new(vehicle, &world),
            wind: Wind::new(&world, seed),
            driver: *driver,
            deflection_rad: 0.0,
            motor_nm: 0.0,
            world,
        }
    }

    /// Advances by one step on a road with a bank (rad, left edge higher: positive). The speed changes evenly from its
    /// start to its end; the lateral velocity has its own equation, and the side-slip angle follows from both.
    pub fn step(
        &mut self,
        plant: &mut Plant,
        v_m_per_s: [f64; 2],
        gains: ArmGains,
        input: PlantInput,
        bank_rad: f64,
    ) {
        let [force_n, moment_nm] = self.wind.step();
        let held = Held {
            v_m_per_s,
            gains,
            input,
            surroundings: Surroundings {
                mu: self.world.mu,
                bank_rad: bank_rad + self.world.bank_rad,
                force_n,
                moment_nm,
            },
        };
        let before = plant.state();
        let x = [
            v_m_per_s[0] * before.sideslip_rad.tan(),
            before.yaw_rate_rad_s,
            before.wheel_rad,
            before.wheel_rate_rad_s,
            self.deflection_rad,
            before.arm_nm,
            self.motor_nm,
            before.yaw_rad,
        ];
        let plus = |k: &State, h: f64| -> State { std::array::from_fn(|i| x[i] + h * k[i]) };
        let k1 = self.rates(&x, &held, 0.0);
        let k2 = self.rates(&plus(&k1, 0.5 * STEP_S), &held, 0.5);
        let k3 = self.rates(&plus(&k2, 0.5 * STEP_S), &held, 0.5);
        let k4 = self.rates(&plus(&k3, STEP_S), &held, 1.0);
        let sum: State = std::array::from_fn(|i| k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
        let next = plus(&sum, STEP_S / 6.0);
        self.deflection_rad = next[4];
        self.motor_nm = if self.world.motor_lag_s > 0.0 {
            next[6]
        } else {
            input.guidance_torque_nm
        };
        plant.set_state(
            PlantState {
                sideslip_rad: next[0].atan2(v_m_per_s[1]),
                yaw_rate_rad_s: next[1],
                wheel_rad: next[2],
                wheel_rate_rad_s: next[3],
                arm_nm: next[5],
                yaw_rad: next[7],
            },
            next[0].hypot(0.5 * (v_m_per_s[0] + v_m_per_s[1])) * STEP_S,
        );
    }

    /// The motor's torque as it measures it, N.m.
    pub fn motor_torque_nm(&self) -> f64 {
        self.motor_nm * (1.0 + self.world.motor_error)
    }

    fn rates(&self, x: &State, held: &Held, share: f64) -> State {
        let [
            lateral_m_per_s,
            yaw_rate,
            wheel,
            wheel_rate,
            deflection,
            arm,
            motor,
            _,
        ] = *x;
        let Held {
            v_m_per_s: [from, to],
            gains,
            input,
            ..
        } = held;
        let v_m_per_s = from + share * (to - from);
        let world = &self.world;
        let lagging = world.motor_lag_s > 0.0;
        let torque = if lagging { motor } else { input.guidance_torque_nm };
        let motor_rate = if lagging {
            (input.guidance_torque_nm - motor) / world.motor_lag_s
        } else {
            0.0
        };
        let ripple = if world.motor_ripple_nm == 0.0 {
            0.0
        } else {
            world.motor_ripple_nm * (RIPPLES * wheel).sin()
        };
        let acting = torque * (1.0 + world.motor_error) + ripple;

        let response =
            self.vehicle
                .respond(v_m_per_s, [lateral_m_per_s, yaw_rate], wheel, &held.surroundings);
        let hands = arm + input.remnant_nm;
        let assist = world.assist_nm(hands, v_m_per_s);
        let torque = hands + acting + assist + response.aligning_nm;
        let [wheel_acceleration, deflection_rate] = self.column.respond(wheel_rate, deflection, torque);

        let target = input.target_now_rad + share * (input.target_next_rad - input.target_now_rad);
        let driver = &self.driver;
        let arm_rate =
            (gains.k_d * target + driver.k_nms * (target - wheel) - gains.k_hg * acting - arm) / driver.t_nms;
        let [lateral_rate, yaw_acceleration] = response.rates;
        [
            lateral_rate,
            yaw_acceleration,
            wheel_rate,
            wheel_acceleration,
            deflection_rate,
            arm_rate,
            motor_rate,
            yaw_rate,
        ]
    }
}

#[cfg(test)]
mod tests;
