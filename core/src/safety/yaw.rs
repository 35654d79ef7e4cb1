//! Checks whether the yaw rate can be trusted.
//!
//! The lane is checked against the yaw rate ([`crate::safety::plausibility`]), so the yaw rate is checked first. Two
//! bounds hold for any vehicle: on the change between two messages, and on the lateral acceleration. A third check
//! compares it with the bicycle model, where wheel angle and speed ask for so little that the model holds: the
//! difference, less a constant that is learnt slowly, is summed with a time constant of 1 s. A yaw rate that fails is
//! not used until it has agreed with the model for 3 s; guidance goes on without it.

use fixed::types::I40F24;

use crate::quantity::{Micros, Radians, Speed, TurningRate, leak, per_second, product};
use crate::safety::redundant::words;

/// Largest change of the yaw rate between two messages that is accepted: a swerve has 4 rad/s2, which is 0.1 rad/s in
/// 25 ms.
pub const STEP: TurningRate = TurningRate::from_rad_per_s(0.15);
/// Largest product of speed and yaw rate (lateral acceleration) that is accepted, m/s2.
pub const MOST_SIDEWAYS: u32 = 12;
/// How long a yaw rate beyond these two bounds is replaced by the last accepted one; then it is distrusted.
const PATIENCE: Micros = Micros::from_ms(100);
/// The bicycle model holds where wheel angle and speed give a smaller lateral acceleration than this, m/s2.
pub const ORDINARY_SIDEWAYS: u32 = 3;
/// Margin of the summed difference, to which a quarter of the larger rate is added. A gust of 1 kN makes 0.015 rad.
pub const MARGIN: Radians = Radians::from_rad(0.03);
/// Bound of the long-run difference: a bank of 8 % and a wheel offset of 1.5 deg.
pub const BIAS: TurningRate = TurningRate::from_rad_per_s(0.025);
/// The long-run error of a check is learnt with a time constant of 2^4 s. The checks of lane and column use the same.
pub const BIAS_SHIFT: u32 = 4;
/// How long a distrusted yaw rate has to agree with the model, within half of the margin, before it is used again.
const DISTRUST: Micros = Micros::from_ms(3000);

words! {
    /// What the check remembers of earlier yaw rates.
    pub(crate) struct YawState {
        /// The difference between the measured yaw rate and the model's: its long-run value, and the sum of the rest.
        pub(crate) bias: TurningRate,
        pub(crate) sum: Radians,
        /// For how long impossible yaw rates have been replaced; and how much longer the yaw rate is distrusted.
        held: Micros,
        distrust: Micros,
    }
}

impl YawState {
    /// No yaw rate has arrived.
    pub(crate) const NEW: Self = Self {
        bias: TurningRate::ZERO,
        sum: Radians::ZERO,
        held: Micros::from_us(0),
        distrust: Micros::from_us(0),
    };

    /// Distrusts the yaw rate until it has agreed for [`DISTRUST`].
    pub(crate) fn distrust(&mut self) {
        self.distrust = DISTRUST;
    }

    /// Whether the yaw rate is distrusted.
    pub(crate) fn is_distrusted(&self) -> bool {
        self.distrust.us() > 0
    }

    /// Whether the summed difference from the model is above a quarter of the margin.
    pub(crate) fn is_suspect(&self) -> bool {
        self.sum.abs().fixed() > MARGIN.fixed().wrapping_shr(2)
    }

    /// The yaw rate to use when `measured` arrives `passed` after the last message: itself, the last accepted one, or
    /// none.
    pub(crate) fn judge(
        &mut self,
        measured: TurningRate,
        last: Option<TurningRate>,
        by_wheel: TurningRate,
        speed: Speed,
        passed: Micros,
    ) -> Option<TurningRate> {
        let sideways = |rate: TurningRate, most: u32| {
            product(speed.fixed(), rate.fixed()).wrapping_abs() <= I40F24::wrapping_from_num(most)
        };
        let stepped = last.is_some_and(|last| !last.is_near(measured, STEP));
        if stepped || !sideways(measured, MOST_SIDEWAYS) {
            self.held = Micros::from_us(self.held.us().saturating_add(passed.us()));
            if last.is_some() && self.held <= PATIENCE {
                return last;
            }
            self.distrust();
            return None;
        }
        self.held = Micros::from_us(0);
        if sideways(by_wheel, ORDINARY_SIDEWAYS) && self.agrees(measured, by_wheel, passed) {
            self.distrust = Micros::from_us(self.distrust.us().saturating_sub(passed.us()));
        }
        (!self.is_distrusted()).then_some(measured)
    }

    /// Whether the measured yaw rate agrees with the model's within half of the margin. Beyond the whole margin it is
    /// distrusted.
    fn agrees(&mut self, measured: TurningRate, by_wheel: TurningRate, passed: Micros) -> bool {
        let differs = measured.minus(by_wheel).minus(self.bias).fixed();
        let sum = leak(self.sum.fixed(), per_second(differs, passed), passed);
        self.sum = Radians::from_fixed(sum);
        let learnt = per_second(differs.wrapping_shr(BIAS_SHIFT), passed);
        self.bias = self.bias.plus(TurningRate::from_fixed(learnt)).within(BIAS);
        let larger = measured.abs().max(by_wheel.abs());
        let (used, margin) = (
            self.sum.abs().fixed(),
            MARGIN.fixed().saturating_add(larger.fixed().wrapping_shr(2)),
        );
        if used > margin {
            self.distrust();
        }
        used <= margin.wrapping_shr(1)
    }
}
