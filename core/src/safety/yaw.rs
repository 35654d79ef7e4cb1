//! Whether the yaw rate is believed.
//!
//! The lane is judged by it ([`crate::safety::plausibility`]), so it is judged itself: no vehicle turns as fast, or changes its turning as
//! fast, as the first two bounds say; and where wheel angle and speed say that the vehicle goes by the bicycle model, what differs
//! from that model, but for a constant that is learnt slowly, is summed with a memory of 1 s. What fails is not believed until it
//! has agreed for a while, and guidance goes on without.

use fixed::types::I40F24;

use crate::quantity::{Micros, Radians, Speed, TurningRate, leak, per_second, product};
use crate::safety::redundant::words;

/// Largest honest change of the yaw rate between two messages: a swerve has 4 rad/s2, which is 0.1 rad/s in 25 ms.
pub const STEP: TurningRate = TurningRate::from_rad_per_s(0.15);
/// Largest honest product of speed and yaw rate, m/s2.
pub const MOST_SIDEWAYS: u32 = 12;
/// For so long a yaw rate beyond these is left out.
const PATIENCE: Micros = Micros::from_ms(100);
/// Where less than this is asked for by wheel angle and speed, m/s2, the bicycle model holds.
pub const ORDINARY_SIDEWAYS: u32 = 3;
/// What may be summed beside a quarter of the rates themselves: a gust of 1 kN makes 0.015 rad.
pub const MARGIN: Radians = Radians::from_rad(0.03);
/// What may differ in the long run: a bank of 8 % and 1.5 deg of the wheel.
pub const BIAS: TurningRate = TurningRate::from_rad_per_s(0.025);
/// What a check is wrong by in the long run is learnt within 2^4 s.
pub const BIAS_SHIFT: u32 = 4;
/// For so long it has to agree, within half of the margin, to be believed again.
const DISTRUST: Micros = Micros::from_ms(3000);

words! {
    /// What is remembered of the yaw rates that came.
    pub(crate) struct YawState {
        /// What they are more than wheel angle and speed say: in the long run, and summed.
        pub(crate) bias: TurningRate,
        pub(crate) sum: Radians,
        /// For how long impossible ones have been left out, and for how long none is believed.
        held: Micros,
        distrust: Micros,
    }
}

impl YawState {
    /// None came.
    pub(crate) const NEW: Self = Self {
        bias: TurningRate::ZERO,
        sum: Radians::ZERO,
        held: Micros::from_us(0),
        distrust: Micros::from_us(0),
    };

    /// None is believed for a while.
    pub(crate) fn distrust(&mut self) {
        self.distrust = DISTRUST;
    }

    /// Whether none is believed.
    pub(crate) fn is_distrusted(&self) -> bool {
        self.distrust.us() > 0
    }

    /// Whether wheel angle and speed say something else, by a quarter of the margin.
    pub(crate) fn is_suspect(&self) -> bool {
        self.sum.abs().fixed() > MARGIN.fixed().wrapping_shr(2)
    }

    /// The yaw rate to believe of one that comes so long after the last.
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

    /// Whether it agrees with wheel angle and speed, within half of the margin. Beyond the margin none is believed.
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
