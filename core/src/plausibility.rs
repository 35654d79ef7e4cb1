//! Whether the inputs can be true together: what a CRC cannot see.
//!
//! **Lane.** Between two samples the near-point error must move as the vehicle does:
//! `de_y'/dt = v*e_theta' - L_f*chi_dot` (`L_f = v*t'_f`; `chi_dot`, the rate of the direction of movement,
//! from wheel angle and speed by the steady-state bicycle model). The change predicted and the change seen
//! are both summed with a memory of 1 s; the preview is declared implausible when the prediction exceeds
//! what was seen, in the prediction's direction, by the margin. So a frozen, flipped or too small error is
//! found when it must have moved; an error that moves *more* than predicted (gust, noise, a camera's scale)
//! is a valid extreme and meets the envelope only. A yaw error that is frozen or flipped predicts a movement
//! that does not come, and is found the same way.
//!
//! **Column.** Torque in equals torque out: `T_d + T_h = c_a(v)*phi + B_s*dphi/dt`, summed with the same
//! memory; the inertia (0.11 kg.m2 at hand speeds: 0.02 N.m.s) is far inside the margin. A torque sensor
//! that is stuck high or has its sign flipped is found by the momentum that does not show in the wheel.
//!
//! **Steps.** A sample that jumps further than a vehicle can is rejected like a bad frame; if the jump
//! persists, the input goes stale and is a fault.
//!
//! Honest driving, the participants of the paper's tables 5 and 6 and lane changes of 1 m/s at 40 to
//! 120 km/h stay below the margins (`tests/plausibility.rs` prints by how much).

use crate::law::LaneSample;
use crate::quantity::{
    AngularImpulse, CurvaturePerAngle, FRAC_BITS, Instant, Metres, Micros, Radians, Seconds, Speed,
    StabilityFactor, Torque, TorquePerAcceleration, TorquePerTurningRate, TurningRatePerAngle,
    per_second_times, product, saturate,
};
use crate::redundant::words;

words! {
    /// The vehicle as the checks know it; immutable once validated by [`crate::params`].
    pub struct Plausibility {
        /// K_t/l: front wheel angle per wheel angle, over the wheelbase.
        pub(crate) curvature_gain: CurvaturePerAngle,
        /// Stability factor A of the steady-state bicycle, in 2^-24 s2/m2.
        pub(crate) stability_factor: StabilityFactor,
        /// Aligning torque on the column per lateral acceleration, N.m per m/s2.
        pub(crate) aligning_gain: TorquePerAcceleration,
        /// B_s, N.m.s/rad.
        pub(crate) column_damping: TorquePerTurningRate,
        /// t'_f, s.
        pub(crate) far_time: Seconds,
        /// Margin of the lane check, m.
        pub(crate) lane_margin: Metres,
        /// Margin of the column check, N.m.s.
        pub(crate) column_margin: AngularImpulse,
    }
}

words! {
    /// Sums and last samples.
    pub struct PlausibilityState {
        speed: Speed,
        wheel: Radians,
        /// Rate of the direction of movement per wheel angle at this speed, 1/s.
        turning_gain: TurningRatePerAngle,
        has_lane: u32,
        lane: LaneSample,
        lane_predicted: Metres,
        lane_seen: Metres,
        has_column: u32,
        column_at: Instant,
        column_sum: AngularImpulse,
    }
}

impl PlausibilityState {
    /// Nothing heard yet.
    pub const NEW: Self = Self {
        speed: Speed::ZERO,
        wheel: Radians::ZERO,
        turning_gain: TurningRatePerAngle::ZERO,
        has_lane: 0,
        lane: LaneSample {
            e_y: Metres::ZERO,
            e_theta: Radians::ZERO,
            at: Instant::from_us(0),
        },
        lane_predicted: Metres::ZERO,
        lane_seen: Metres::ZERO,
        has_column: 0,
        column_at: Instant::from_us(0),
        column_sum: AngularImpulse::ZERO,
    };

    /// chi_dot, the rate of the direction of movement, 2^-24 rad/s.
    fn turning(&self) -> i32 {
        saturate(product(self.turning_gain.bits(), self.wheel.bits()))
    }

    /// The movement predicted, and what of it was not seen, positive in its direction. 2^-24 m.
    fn missing(&self) -> (i64, i64) {
        let predicted = i64::from(self.lane_predicted.bits());
        let missing = predicted.saturating_sub(i64::from(self.lane_seen.bits()));
        let missing = if predicted.is_negative() {
            missing.saturating_neg()
        } else {
            missing
        };
        (predicted, missing)
    }

    /// The lane was lost: what comes next has no past.
    pub fn forget_lane(&mut self) {
        (self.has_lane, self.lane_predicted, self.lane_seen) = (0, Metres::ZERO, Metres::ZERO);
    }

    /// The column was lost.
    pub fn forget_column(&mut self) {
        (self.has_column, self.column_sum) = (0, AngularImpulse::ZERO);
    }
}

/// Largest honest change of the near-point error between two samples: 0.3 m, twenty times what 40 m/s and a
/// yaw error of 0.1 rad give in 8.3 ms.
const LANE_STEP: Metres = Metres::from_m(0.3);
/// Likewise for the yaw error: 0.1 rad in 8.3 ms would be 12 rad/s.
const YAW_STEP: Radians = Radians::from_rad(0.1);
/// Largest honest change of a speed between two messages: 1 m/s in 10 ms is 10 g.
const SPEED_STEP: Speed = Speed::from_m_per_s(1.0);
/// Two sources that differ by this much are not both right.
const SPEED_SPREAD: Speed = Speed::from_m_per_s(2.0);

/// Whether a new lane sample is no further from the last than a vehicle can move.
#[must_use]
pub fn lane_step_is_possible(last: &LaneSample, new: &LaneSample) -> bool {
    last.e_y.bits().abs_diff(new.e_y.bits()) <= LANE_STEP.bits().unsigned_abs()
        && last.e_theta.bits().abs_diff(new.e_theta.bits()) <= YAW_STEP.bits().unsigned_abs()
}

/// Whether a speed follows from the last one.
#[must_use]
pub fn speed_step_is_possible(last: Speed, new: Speed) -> bool {
    last.bits().abs_diff(new.bits()) <= SPEED_STEP.bits().unsigned_abs()
}

/// Whether two sources of speed agree: less than 2 m/s apart.
#[must_use]
pub fn speeds_agree(a: Speed, b: Speed) -> bool {
    a.bits().abs_diff(b.bits()) < SPEED_SPREAD.bits().unsigned_abs()
}

impl Plausibility {
    /// Takes the speed in use; returns nothing, for it has no counterpart but its second source. How fast the
    /// vehicle turns at this speed, `chi_dot/phi = v*K_t / (l*(1 + A*v^2))`, is the steady state of the bicycle
    /// model.
    pub fn speed(&self, state: &mut PlausibilityState, speed: Speed) {
        state.speed = speed;
        let v = speed.bits();
        let slip = (i64::from(self.stability_factor.bits()).saturating_mul(product(v, v))) >> FRAC_BITS;
        let divisor = slip.saturating_add(1 << FRAC_BITS);
        let gain = (i64::from(self.curvature_gain.bits()).saturating_mul(i64::from(v))).checked_div(divisor);
        state.turning_gain = TurningRatePerAngle::from_wide(gain.unwrap_or(0));
    }

    /// Takes driver torque, wheel angle and the guidance torque applied; `false` when they cannot belong
    /// together.
    #[must_use]
    pub fn column(
        &self,
        state: &mut PlausibilityState,
        now: Instant,
        driver: Torque,
        wheel: Radians,
        applied: Torque,
    ) -> bool {
        let moved = i64::from(wheel.bits()).saturating_sub(i64::from(state.wheel.bits()));
        let dt = now.since(state.column_at);
        if state.has_column != 0 {
            // Steady-state aligning torque: c_a * v * chi_dot.
            let lateral = product(state.speed.bits(), state.turning());
            let aligning = i64::from(self.aligning_gain.bits()).saturating_mul(lateral) >> FRAC_BITS;
            let torque = i64::from(driver.bits())
                .saturating_add(i64::from(applied.bits()))
                .saturating_sub(aligning);
            let damped = i64::from(self.column_damping.bits()).saturating_mul(moved) >> FRAC_BITS;
            let change = per_second_times(torque, dt).saturating_sub(damped);
            state.column_sum = AngularImpulse::from_wide(leak(state.column_sum.bits(), change, dt));
        }
        (state.has_column, state.column_at, state.wheel) = (1, now, wheel);
        i64::from(state.column_sum.bits()).abs() <= i64::from(self.column_margin.bits())
    }

    /// Takes a new lane sample; `false` when its error did not move as it must have.
    #[must_use]
    pub fn lane(&self, state: &mut PlausibilityState, sample: LaneSample) -> bool {
        let dt = sample.at.since(state.lane.at);
        if state.has_lane != 0 && dt.us() != 0 {
            let heading = product(state.speed.bits(), state.lane.e_theta.bits());
            let far = product(self.far_time.bits(), state.speed.bits());
            let turned = (far.saturating_mul(i64::from(state.turning()))) >> FRAC_BITS;
            let predicted = per_second_times(heading.saturating_sub(turned), dt);
            let seen = i64::from(sample.e_y.bits()).saturating_sub(i64::from(state.lane.e_y.bits()));
            state.lane_predicted = Metres::from_wide(leak(state.lane_predicted.bits(), predicted, dt));
            state.lane_seen = Metres::from_wide(leak(state.lane_seen.bits(), seen, dt));
        }
        (state.has_lane, state.lane) = (1, sample);
        let (predicted, missing) = state.missing();
        let margin = i64::from(self.lane_margin.bits());
        // Half the margin has to be predicted: a movement that nothing predicts is no proof of a fault.
        missing <= margin || predicted.abs() <= margin >> 1
    }

    /// How much of the margins is used up: lane (m), column (N.m.s).
    #[must_use]
    pub fn used(state: &PlausibilityState) -> (Metres, AngularImpulse) {
        (Metres::from_wide(state.missing().1), state.column_sum)
    }
}

/// A leaking sum in 2^-24: `sum + change - sum*dt/(1 s)`.
fn leak(sum: i32, change: i64, dt: Micros) -> i64 {
    let sum = i64::from(sum);
    let kept = sum.saturating_sub(per_second_times(sum, dt));
    kept.saturating_add(change)
}
