//! Plants of several runs in worlds that are not the paper's: [`RealPlant`] itself, one run after the other. Its sines and
//! arc tangents have no form for several runs at once that gives the same bits. All around it, the road and the ECU, is in
//! lanes.

use std::sync::Arc;

use haptic_core::actuator::{Actuator, Motor};
use haptic_core::quantity::Torque;

use super::ALIVE;
use super::counts::{ONE, bits, on_the_bus};
use crate::models::driver::ArmGains;
use crate::models::plant::{PlantInput, PlantState, STATES};
use crate::models::real::RealPlant;
use crate::models::road::{Centreline, Tracker};

/// Counts of a motor torque on the bus, of 2^-24 N.m.
const LARGEST_MOTOR: i32 = ((1 << 15) - 1) << 12;

/// The plants, of the runs that have one.
pub(super) struct Reals<const N: usize> {
    runs: [Option<Box<Real>>; N],
    is_any: bool,
}

struct Real {
    plant: RealPlant,
    v_m_per_s: f64,
    gains: ArmGains,
    /// Whether the road has banks, and how it lies where the run is.
    has_banks: bool,
    bank_rad: f64,
    /// The check of a motor that does not deliver what it is told at once.
    motor: Option<Actuator>,
}

/// What acts on every plant in a step.
pub(super) struct Acting<'a, const N: usize> {
    pub(super) target: &'a [f64; N],
    pub(super) next_target: &'a [f64; N],
    pub(super) torque_nm: &'a [f64; N],
    pub(super) remnant_nm: &'a [f64; N],
    pub(super) alive: &'a [u64; N],
}

impl<const N: usize> Reals<N> {
    pub(super) fn new() -> Self {
        Self {
            runs: [const { None }; N],
            is_any: false,
        }
    }

    /// A new run begins in a lane, with such a plant or without.
    pub(super) fn begin(
        &mut self,
        lane: usize,
        plant: Option<Box<RealPlant>>,
        v_m_per_s: f64,
        has_banks: bool,
    ) {
        self.runs[lane] = plant.map(|plant| {
            Box::new(Real {
                v_m_per_s,
                gains: ArmGains::MANUAL,
                has_banks,
                bank_rad: 0.0,
                motor: (!plant.motor_is_ideal()).then(Actuator::default),
                plant: *plant,
            })
        });
        self.is_any = self.runs.iter().any(Option::is_some);
    }

    pub(super) fn set_gains(&mut self, lane: usize, gains: ArmGains) {
        if let Some(run) = &mut self.runs[lane] {
            run.gains = gains;
        }
    }

    /// The centres of gravity were found on their roads.
    #[inline(always)]
    pub(super) fn locate(&mut self, roads: &[Arc<Centreline>; N], place: impl Fn(usize) -> Tracker) {
        if !self.is_any {
            return;
        }
        for (l, run) in self.runs.iter_mut().enumerate() {
            if let Some(run) = run.as_mut().filter(|run| run.has_banks) {
                run.bank_rad = roads[l].surface(&place(l)).bank_rad;
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
        for (l, run) in self.runs.iter_mut().enumerate() {
            let Some(Real {
                plant,
                motor: Some(motor),
                ..
            }) = run.as_deref_mut()
            else {
                continue;
            };
            let torque = |bits: i32| Torque::from_nm(f64::from(bits) * (1.0 / ONE));
            if is_heard {
                let sent = on_the_bus(bits(plant.motor_torque_nm()), 12);
                motor.deliver(torque(sent.min(LARGEST_MOTOR).max(-LARGEST_MOTOR)));
            }
            if motor.judge(torque(commanded[l])) != Motor::Obeys {
                suspect[l] |= matters[l];
            }
        }
    }

    /// These plants move on for a millisecond: their next states and how far they went take the place of what stands there.
    #[inline(always)]
    pub(super) fn step(
        &mut self,
        state: &[[f64; N]; STATES],
        acting: &Acting<N>,
        next: &mut [[f64; N]; STATES],
        distance_m: &mut [f64; N],
    ) {
        if !self.is_any {
            return;
        }
        for (l, run) in self.runs.iter_mut().enumerate() {
            let Some(run) = run.as_deref_mut().filter(|_| acting.alive[l] == ALIVE) else {
                continue;
            };
            let [
                sideslip_rad,
                yaw_rate_rad_s,
                wheel_rad,
                wheel_rate_rad_s,
                arm_nm,
                yaw_rad,
            ] = std::array::from_fn(|i| state[i][l]);
            let before = PlantState {
                sideslip_rad,
                yaw_rate_rad_s,
                wheel_rad,
                wheel_rate_rad_s,
                arm_nm,
                yaw_rad,
            };
            let input = PlantInput {
                target_now_rad: acting.target[l],
                target_next_rad: acting.next_target[l],
                guidance_torque_nm: acting.torque_nm[l],
                remnant_nm: acting.remnant_nm[l],
            };
            let speeds = [run.v_m_per_s; 2];
            let (after, way_m) = run.plant.next(&before, speeds, run.gains, &input, run.bank_rad);
            let after = [
                after.sideslip_rad,
                after.yaw_rate_rad_s,
                after.wheel_rad,
                after.wheel_rate_rad_s,
                after.arm_nm,
                after.yaw_rad,
            ];
            for (all, value) in next.iter_mut().zip(after) {
                all[l] = value;
            }
            distance_m[l] = way_m;
        }
    }
}
