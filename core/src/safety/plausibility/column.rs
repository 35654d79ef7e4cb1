//! Whether the torques on the steering column balance.
//!
//! Without inertia they obey `T_d + T_a + T_h = c_a*v*psi_dot + B_s*dphi/dt`. Not all of them are known exactly. The
//! power assist `T_a` acts in the direction of `T_d` and is at most [`ASSIST`] times as large; the aligning torque
//! `c_a*v*psi_dot` may be wrong by 30 % (trail, tyres, load); and there is friction. So the imbalance is an interval.
//! Its value nearest to zero is summed with a time constant of 1 s: the sum is the least momentum that is unaccounted
//! for, whatever assist, friction and aligning torque were. A short push by the hand that the column answers later
//! cancels in this sum. The inertia (0.11 kg.m2, 0.02 N.m.s at the speeds of a hand) is far below the margin. A
//! constant torque (a banked road, a pull to one side, the offset of the sensor) is estimated slowly, within bounds.

use fixed::types::{I0F32, I8F24};

use super::{Plausibility, PlausibilityState};
use crate::quantity::{
    AngularImpulse, Instant, Micros, Radians, Ratio, Torque, TurningRate, leak, per_second, product,
    product_within, saturate,
};
use crate::safety::redundant::words;
use crate::safety::yaw::BIAS_SHIFT;

/// The momentum that may be unaccounted for within a second.
pub const COLUMN_MARGIN: AngularImpulse = AngularImpulse::from_nm_s(0.6);
/// Driver torque and power assist together are at most this many times the driver torque.
pub const ASSIST: i32 = 5;
/// Friction of the column, and other torques whose direction is not known.
pub const FRICTION: Torque = Torque::from_nm(0.5);
/// Driver torque, aligning torque and the impulse of the damping between two checks are cut to these values; anything
/// larger is as implausible as they are. With these bounds, and a guidance of 5 N.m that its frame has room for, no
/// sum of the column check reaches 128, the end of an I8F24: 100 + 5 + 16.3 at most before the time, which at least
/// halves it, and 60.7 + 60 + 0.3 + 2.7 after.
const MOST_DRIVER: Torque = Torque::from_nm(20.0);
const MOST_ALIGNING: I8F24 = Torque::from_nm(16.0).fixed();
const MOST_DAMPED: I8F24 = AngularImpulse::from_nm_s(60.0).fixed();
/// The aligning torques by yaw rate and by wheel angle may differ by this much because of wind or bank.
pub const PUSHED: Torque = Torque::from_nm(0.3);
/// The share of the aligning torque that may be wrong: 77/256, 30 %.
pub const ALIGNING_ERROR: Ratio = Ratio::from_si(77.0 / 256.0);
const ALIGNING_SHARE: I0F32 = I0F32::from_bits(ALIGNING_ERROR.bits() << 8);
/// Inertia of column and wheel: 2^-3 kg.m2, a little more than the 0.11 of table 9.
const INERTIA_SHIFT: u32 = 3;
/// Bound of the long-run imbalance of the column: a bank of 5 %, or a pull to one side.
pub const COLUMN_BIAS: Torque = Torque::from_nm(0.5);

words! {
    /// The part that a Column message changes.
    pub(crate) struct ColumnState {
        pub(super) is_known: u32,
        pub(super) at: Instant,
        pub(super) wheel: Radians,
        /// The wheel's angle at the last check.
        pub(super) checked: Radians,
        pub(super) sum: AngularImpulse,
        /// The long-run imbalance of the torques, which is subtracted.
        pub(super) bias: Torque,
    }
}

impl ColumnState {
    pub(super) const NEW: Self = Self {
        is_known: 0,
        at: Instant::from_us(0),
        wheel: Radians::ZERO,
        checked: Radians::ZERO,
        sum: AngularImpulse::ZERO,
        bias: Torque::ZERO,
    };
}

impl PlausibilityState {
    /// The time since the column was last checked; zero if it never was.
    pub(crate) fn since_column(&self, now: Instant) -> Micros {
        if self.column.is_known != 0 {
            now.since(self.column.at)
        } else {
            Micros::from_us(0)
        }
    }

    /// Stores a wheel angle that arrived in this step and is checked in the next.
    pub(crate) fn set_wheel_angle(&mut self, wheel: Radians) {
        self.column.wheel = wheel;
    }

    /// Forgets the column, which was lost.
    pub fn forget_column(&mut self) {
        (self.column.is_known, self.column.sum) = (0, AngularImpulse::ZERO);
    }
}

impl Plausibility {
    /// Takes driver torque, wheel angle and the guidance torque applied; `false` when they cannot belong
    /// together. A function of its own, so that its many words do not push a step's out of the registers.
    #[must_use]
    #[inline(never)]
    pub fn column(
        &self,
        state: &mut PlausibilityState,
        now: Instant,
        driver: Torque,
        wheel: Radians,
        applied: Torque,
    ) -> bool {
        let moved = wheel.minus(state.column.checked).fixed();
        let dt = now.since(state.column.at);
        if state.column.is_known != 0 {
            // Steady-state aligning torque: c_a * v * chi_dot.
            let aligning_at = |turning: TurningRate| {
                let lateral = saturate(product(state.motion.speed.fixed(), turning.fixed()));
                product_within(lateral, self.aligning_gain.fixed(), MOST_ALIGNING)
            };
            let aligning = aligning_at(state.turning());
            // A yaw rate that contradicts both pictures and wheel angle may be wrong by its whole value.
            let pushed = if state.lane.is_alive != 0 && state.motion.yaw.is_suspect() {
                MOST_ALIGNING
            } else {
                PUSHED.fixed()
            };
            let by_wheel = aligning_at(state.turning_by_wheel())
                .max(aligning.wrapping_sub(pushed))
                .min(aligning.wrapping_add(pushed));
            let applied = applied.fixed();
            // From here on: the range of driver torque and power assist together.
            let driver = driver.within(MOST_DRIVER).fixed();
            let assisted = driver.wrapping_mul_int(ASSIST);
            let least = applied
                .wrapping_add(driver.min(assisted))
                .wrapping_sub(aligning.max(by_wheel));
            let most = applied
                .wrapping_add(driver.max(assisted))
                .wrapping_sub(aligning.min(by_wheel));
            let damped = product_within(moved, self.column_damping.fixed(), MOST_DAMPED);
            // Torques are multiplied by dt, because the movement of the wheel is that within dt.
            let impulse = |torque: I8F24| per_second(torque, dt);
            let (least, most) = (
                impulse(least).wrapping_sub(damped),
                impulse(most).wrapping_sub(damped),
            );
            let learnt = impulse(state.column.bias.fixed());
            let lacking = nearest_to_zero(least, most).wrapping_sub(learnt);
            let bias = (state.column.bias.fixed()).wrapping_add(lacking.wrapping_shr(BIAS_SHIFT));
            state.column.bias = Torque::from_fixed(bias).within(COLUMN_BIAS);
            let tolerance =
                I8F24::wrapping_from_num(aligning.max(aligning.wrapping_neg()).wide_mul(ALIGNING_SHARE));
            let tolerance = impulse(tolerance.wrapping_add(FRICTION.fixed()));
            // The tolerance is that of the sum: the part that is not needed between two pushes may explain a part of
            // the earlier one.
            let sum = state.column.sum.fixed();
            let (least, most) = (
                leak(sum, lacking.wrapping_sub(tolerance), dt),
                leak(sum, lacking.wrapping_add(tolerance), dt),
            );
            state.column.sum = AngularImpulse::from_fixed(nearest_to_zero(least, most));
        }
        (state.column.is_known, state.column.at) = (1, now);
        (state.column.wheel, state.column.checked) = (wheel, wheel);
        let sum = state.column.sum;
        let above = sum.abs().fixed().wrapping_sub(COLUMN_MARGIN.fixed());
        // Inertia times angle over time is the momentum of the wheel, counted in the direction of the sum.
        let along = if sum < AngularImpulse::ZERO {
            I8F24::ZERO.saturating_sub(moved)
        } else {
            moved
        };
        above <= I8F24::ZERO || per_second(above, dt) <= along.wrapping_shr(INERTIA_SHIFT)
    }
}

/// The value of an interval that is nearest to zero; zero itself if the interval contains it.
fn nearest_to_zero(least: I8F24, most: I8F24) -> I8F24 {
    least.max(I8F24::ZERO).wrapping_add(most.min(I8F24::ZERO))
}
