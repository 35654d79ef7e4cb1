//! The speed and the yaw rate by which lane and column are judged.
//!
//! The yaw rate is the measured one while it is trusted ([`crate::safety::yaw`]), and otherwise that of the steady-state
//! bicycle model at this speed and wheel angle, plus the long-run difference between the two.

use fixed::types::I40F24;

use super::steps::{SPEEDS_PATIENCE, speeds_agree};
use super::{Plausibility, PlausibilityState};
use crate::quantity::{
    Micros, Speed, TurningRate, TurningRatePerAngle, product, product_of_three, signed_quotient,
};
use crate::safety::redundant::words;
use crate::safety::yaw::YawState;

words! {
    /// The part that a Vehicle message changes.
    pub(crate) struct MotionState {
        pub(super) speed: Speed,
        /// Yaw rate per wheel angle at this speed by the bicycle model, 1/s.
        pub(super) turning_gain: TurningRatePerAngle,
        /// The measured yaw rate, if there is one.
        pub(super) yaw_rate: TurningRate,
        pub(super) has_yaw_rate: u32,
        pub(crate) yaw: YawState,
        /// For how long the two speeds have disagreed.
        pub(super) apart: Micros,
    }
}

impl MotionState {
    pub(super) const NEW: Self = Self {
        speed: Speed::ZERO,
        turning_gain: TurningRatePerAngle::ZERO,
        yaw_rate: TurningRate::ZERO,
        has_yaw_rate: 0,
        yaw: YawState::NEW,
        apart: Micros::from_us(0),
    };
}

impl PlausibilityState {
    /// The yaw rate: the measured one, or else that of the bicycle model plus the long-run difference between the
    /// two.
    #[must_use]
    pub fn turning(&self) -> TurningRate {
        if self.motion.has_yaw_rate != 0 {
            self.motion.yaw_rate
        } else {
            self.turning_by_wheel().plus(self.motion.yaw.bias)
        }
    }

    /// The yaw rate to use, if any, when `measured` arrives `passed` after the last one.
    pub(crate) fn accepted_yaw_rate(&mut self, measured: TurningRate, passed: Micros) -> Option<TurningRate> {
        let by_wheel = self.turning_by_wheel();
        let m = &mut self.motion;
        let last = (m.has_yaw_rate != 0).then_some(m.yaw_rate);
        m.yaw.judge(measured, last, by_wheel, m.speed, passed)
    }

    /// Distrusts the yaw rate, because the lane moves as wheel angle and speed predict and the yaw rate does not.
    pub(crate) fn distrust_yaw_rate(&mut self) {
        self.motion.yaw.distrust();
        self.motion.has_yaw_rate = 0;
    }

    /// The yaw rate by wheel angle and speed alone, without wind or bank.
    pub(super) fn turning_by_wheel(&self) -> TurningRate {
        TurningRate::from_wide(product(
            self.motion.turning_gain.fixed(),
            self.column.wheel.fixed(),
        ))
    }

    /// The speed in use.
    #[must_use]
    pub const fn speed(&self) -> Speed {
        self.motion.speed
    }

    /// Compares two speeds that arrive `passed` after the last ones. Returns whether they agree, and whether they
    /// have agreed at some time within `SPEEDS_PATIENCE`.
    #[must_use]
    pub fn speeds_agree(&mut self, [a, b]: [Speed; 2], passed: Micros) -> (bool, bool) {
        let agree = speeds_agree(a, b);
        let apart = if agree {
            0
        } else {
            self.motion.apart.us().saturating_add(passed.us())
        };
        self.motion.apart = Micros::from_us(apart);
        (agree, apart <= SPEEDS_PATIENCE.us())
    }
}

impl Plausibility {
    /// Takes the speed in use and the trusted yaw rate. It returns nothing, as neither is checked here. The yaw rate
    /// per wheel angle at this speed, `chi_dot/phi = v*K_t / (l*(1 + A*v^2))`, is the steady state of the bicycle
    /// model.
    pub fn motion(&self, state: &mut PlausibilityState, speed: Speed, yaw_rate: Option<TurningRate>) {
        let is_known = speed == state.motion.speed;
        state.motion.has_yaw_rate = u32::from(yaw_rate.is_some());
        state.motion.yaw_rate = yaw_rate.unwrap_or(TurningRate::ZERO);
        state.motion.speed = speed;
        if is_known {
            return;
        }
        let v = speed.fixed();
        let slip = product_of_three(product(v, v), self.stability_factor.fixed());
        // At most 82, which it reaches at 90 m/s with the largest stability factor.
        let divisor = u32::try_from(slip.saturating_add(I40F24::ONE).to_bits()).unwrap_or(0);
        let gain = self.curvature_gain.fixed().wide_mul(v).to_bits();
        state.motion.turning_gain = TurningRatePerAngle::from_bits(signed_quotient(gain, divisor));
    }
}
