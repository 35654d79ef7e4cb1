//! Plants of several runs in worlds that are not the paper's, to the same bits as [`NonlinearPlant`] moves each alone.
//!
//! Sums, products, quotients and roots are taken for all lanes at once, in that plant's order. Sines and arc tangents are
//! taken one by one, as the library has them, and only in lanes whose world needs them.

mod rates;

use std::sync::Arc;

use haptic_core::quantity::Torque;
use haptic_core::safety::actuator::{Actuator, Motor};

use super::counts::{ONE, bits, on_the_bus};
use super::lanes::lanes;
use super::rejected::Reason;
use super::{ALIVE, ARM, BETA, WHEEL, WHEEL_RATE, YAW, YAW_RATE};
use haptic_sim::models::STEP_S;
use haptic_sim::models::driver::ArmGains;
use haptic_sim::models::nonlinear::{GRAVITY_M_PER_S2, NonlinearPlant, STATES, Tyres};
use haptic_sim::models::plant;
use haptic_sim::models::road::{Centreline, Tracker};

/// Counts of a motor torque on the bus, of 2^-24 N.m.
const LARGEST_MOTOR: i32 = ((1 << 15) - 1) << 12;

/// In [`NonlinearPlant`]'s order.
type State<const N: usize> = [[f64; N]; STATES];

lanes! {
    /// The plants, of the runs that have one.
    pub(super) struct NonlinearVehicles {
        m: f64 = 1.0,
        i: f64 = 1.0,
        l_f: f64 = 1.0,
        l_r: f64 = 1.0,
        k_t: f64 = 1.0,
        lever: f64 = 1.0,
        castor_share: f64 = 1.0,
        inertia: f64 = 1.0,
        damping: f64 = 1.0,
        friction: f64 = 1.0,
        give: f64 = 1.0,
        /// The most that the power assist gives, at standstill, and the speed at which it is half of that.
        assist: f64 = 1.0,
        assist_speed: f64 = 1.0,
        lag: f64 = 1.0,
        /// The motor's torque over what it is told.
        gain: f64 = 1.0,
        ripple: f64 = 1.0,
        k_nms: f64 = 1.0,
        t_nms: f64 = 1.0,
        k_d: f64 = 1.0,
        k_hg: f64 = 1.0,
        /// By the bank, m/s2, and what the wind does in this step.
        gravity: f64 = 1.0,
        force: f64 = 1.0,
        moment: f64 = 1.0,
        deflection: f64 = 0.0,
        motor: f64 = 0.0,
        saturates: bool = false,
        has_banks: bool = false,
    } beside {
        /// Stiffness of each axle, and what it nears where tyres saturate.
        stiffness: [[f64; N]; 2] = [[1.0; N]; 2],
        most: [[f64; N]; 2] = [[1.0; N]; 2],
        /// The plants of the runs that have one: its wind, and the bank of its whole road.
        plants: [Option<Box<NonlinearPlant>>; N] = [const { None }; N],
        /// Core's check of a motor that does not deliver what it is told at once.
        motors: [Option<Actuator>; N] = [const { None }; N],
        is_any: bool = false,
    }
}

/// What acts on every plant in a step.
pub(super) struct Acting<'a, const N: usize> {
    pub(super) target: &'a [f64; N],
    pub(super) next_target: &'a [f64; N],
    pub(super) torque_nm: &'a [f64; N],
    /// At the start and at the end of the step, m/s.
    pub(super) speeds: [&'a [f64; N]; 2],
    pub(super) remnant_nm: &'a [f64; N],
    pub(super) alive: &'a [u64; N],
}

impl<const N: usize> NonlinearVehicles<N> {
    /// A new run begins in a lane, with such a plant or without.
    pub(super) fn begin(&mut self, lane: usize, plant: Option<Box<NonlinearPlant>>, has_banks: bool) {
        self.clear(lane);
        self.motors[lane] = None;
        if let Some(plant) = &plant {
            let (track, column, world, driver) = (&plant.vehicle, &plant.column, &plant.world, &plant.driver);
            let car = &track.vehicle;
            let ([front, rear], [front_most, rear_most]) = (&mut self.stiffness, &mut self.most);
            for (all, value) in [
                (&mut self.m, car.m),
                (&mut self.i, car.i),
                (&mut self.l_f, car.l_f),
                (&mut self.l_r, car.l_r),
                (front, 2.0 * car.k_f),
                (rear, 2.0 * car.k_r),
                (front_most, world.mu * track.load_n[0]),
                (rear_most, world.mu * track.load_n[1]),
                (&mut self.k_t, car.k_t),
                (&mut self.lever, track.lever),
                (&mut self.castor_share, track.castor_share),
                (&mut self.inertia, column.inertia),
                (&mut self.damping, column.damping),
                (&mut self.friction, column.friction_nm),
                (&mut self.give, column.give_rad),
                (&mut self.assist, world.assist_nm),
                (&mut self.assist_speed, world.assist_speed_m_per_s),
                (&mut self.lag, world.motor_lag_s),
                (&mut self.gain, 1.0 + world.motor_error),
                (&mut self.ripple, world.motor_ripple_nm),
                (&mut self.k_nms, driver.k_nms),
                (&mut self.t_nms, driver.t_nms),
                (&mut self.gravity, gravity(0.0, plant)),
            ] {
                all[lane] = value;
            }
            self.saturates[lane] = match track.tyres {
                Tyres::Linear => false,
                Tyres::Saturating => true,
            };
            self.has_banks[lane] = has_banks;
            let is_ideal = world.motor_lag_s == 0.0 && world.motor_error == 0.0;
            self.motors[lane] = (!is_ideal).then(Actuator::default);
        }
        self.plants[lane] = plant;
        self.is_any = self.plants.iter().any(Option::is_some);
    }

    pub(super) fn set_gains(&mut self, lane: usize, gains: ArmGains) {
        (self.k_d[lane], self.k_hg[lane]) = (gains.k_d, gains.k_hg);
    }

    /// The centres of gravity were found on their roads.
    #[inline(always)]
    pub(super) fn locate(&mut self, roads: &[Arc<Centreline>; N], place: impl Fn(usize) -> Tracker) {
        if !self.is_any {
            return;
        }
        for (l, plant) in self.plants.iter().enumerate() {
            if let Some(plant) = plant.as_ref().filter(|_| self.has_banks[l]) {
                self.gravity[l] = gravity(roads[l].surface(&place(l)).bank_rad, plant);
            }
        }
    }

    /// The motors answer the commands of the step before: what is measured of them is heard in every second step.
    #[inline(always)]
    pub(super) fn judge(
        &mut self,
        is_heard: bool,
        commanded: &[i32; N],
        matters: &[i32; N],
        suspect: &mut [i32; N],
    ) {
        if !self.is_any {
            return;
        }
        let torque = |bits: i32| Torque::from_nm(f64::from(bits) * (1.0 / ONE));
        for (l, motor) in self.motors.iter_mut().enumerate() {
            let Some(motor) = motor else { continue };
            if is_heard {
                let sent = on_the_bus(bits(self.motor[l] * self.gain[l]), 12);
                motor.deliver(torque(sent.min(LARGEST_MOTOR).max(-LARGEST_MOTOR)));
            }
            if motor.judge(torque(commanded[l])) != Motor::Obeys {
                suspect[l] |= matters[l] & Reason::Motor.bit();
            }
        }
    }

    /// These plants move on for a millisecond: their next states, and how far they went, take the place of what stands
    /// there.
    #[inline(always)]
    pub(super) fn step(
        &mut self,
        state: &[[f64; N]; plant::STATES],
        acting: &Acting<N>,
        next: &mut [[f64; N]; plant::STATES],
        distance_m: &mut [f64; N],
    ) {
        if !self.is_any {
            return;
        }
        let mut moves = [false; N];
        let mut lateral = [0.0; N];
        for (l, plant) in self.plants.iter_mut().enumerate() {
            let Some(plant) = plant.as_mut().filter(|_| acting.alive[l] == ALIVE) else {
                continue;
            };
            moves[l] = true;
            [self.force[l], self.moment[l]] = plant.wind.step();
            lateral[l] = acting.speeds[0][l] * state[BETA][l].tan();
        }
        let x = [
            lateral,
            state[YAW_RATE],
            state[WHEEL],
            state[WHEEL_RATE],
            self.deflection,
            state[ARM],
            self.motor,
            state[YAW],
        ];
        let k1 = self.rates(&x, 0.0, acting, &moves);
        let k2 = self.rates(&plus(&x, &k1, 0.5 * STEP_S), 0.5, acting, &moves);
        let k3 = self.rates(&plus(&x, &k2, 0.5 * STEP_S), 0.5, acting, &moves);
        let k4 = self.rates(&plus(&x, &k3, STEP_S), 1.0, acting, &moves);
        let mut sum = [[0.0; N]; STATES];
        for (i, sum) in sum.iter_mut().enumerate() {
            for l in 0..N {
                sum[l] = k1[i][l] + 2.0 * (k2[i][l] + k3[i][l]) + k4[i][l];
            }
        }
        let [lateral, yaw_rate, wheel, wheel_rate, deflection, arm, motor, yaw] =
            plus(&x, &sum, STEP_S / 6.0);
        self.deflection = deflection;
        for l in 0..N {
            let lags = self.lag[l] > 0.0;
            self.motor[l] = if lags { motor[l] } else { acting.torque_nm[l] };
        }
        for l in 0..N {
            if !moves[l] {
                continue;
            }
            let (from, to) = (acting.speeds[0][l], acting.speeds[1][l]);
            next[BETA][l] = lateral[l].atan2(to);
            distance_m[l] = lateral[l].hypot(0.5 * (from + to)) * STEP_S;
            for (place, after) in [
                (YAW_RATE, &yaw_rate),
                (WHEEL, &wheel),
                (WHEEL_RATE, &wheel_rate),
                (ARM, &arm),
                (YAW, &yaw),
            ] {
                next[place][l] = after[l];
            }
        }
    }
}

/// Acceleration across on a road with a bank, m/s2.
fn gravity(bank_rad: f64, plant: &NonlinearPlant) -> f64 {
    -GRAVITY_M_PER_S2 * (bank_rad + plant.world.bank_rad).sin()
}

#[inline(always)]
fn plus<const N: usize>(x: &State<N>, k: &State<N>, h: f64) -> State<N> {
    let mut sum = [[0.0; N]; STATES];
    for (i, sum) in sum.iter_mut().enumerate() {
        for l in 0..N {
            sum[l] = x[i][l] + h * k[i][l];
        }
    }
    sum
}
