//! Four design choices (FDCA) in the place of equation (9): `d_fb = SoHF*(k_y*e_y' + k_psi*e_theta')`,
//! `T_h = LoHA*(d_fb + d_ff - phi) + K*(LoHS*d_ff + d_fb)` (van Paassen, Boink, Abbink, Mulder 2017).
//!
//! `d_ff = (r + de_theta'/dt)/g` is the wheel angle that the path needs, g the rate of turn per wheel angle at this speed, r the
//! rate of turn; `K = c*v*g` is the aligning torque per wheel angle, c the one per lateral acceleration. So all of it is a law of
//! the form of (9), whose gains follow the speed, and two terms of the vehicle's own movement:
//!
//! `T_h = (K + LoHA)*d_fb + (LoHS*c*v + LoHA/g)*(r + de_theta'/dt) - LoHA*phi`
//!
//! The filter of the rates, errors between two samples and samples that come late are therefore those of [`Law`].
//!
//! Error: at most 1 mN.m from a float64 evaluation at speeds that guide (`core/tests/laws.rs` asserts it).

use fixed::types::{I8F24, I12F20, I40F24};

use super::{EgoMotion, LaneSample, Law, LawState};
use crate::quantity::{
    AnglePerLength, Instant, Micros, Radians, Ratio, Speed, Torque, TorquePerAcceleration, TorquePerAngle,
    TorquePerLength, TorquePerTurningRate, TurningRate, TurningRatePerAngle, product, rounded, saturate, signed_quotient,
};
use crate::safety::redundant::words;

words! {
    /// The choices; immutable once validated by `config`.
    pub struct Fdca {
        /// SoHF*k_y.
        pub(crate) k_y: AnglePerLength,
        /// SoHF*k_psi.
        pub(crate) k_psi: Ratio,
        /// LoHS*c, torque for the path.
        pub(crate) path: TorquePerAcceleration,
        /// LoHA.
        pub(crate) loha: TorquePerAngle,
        /// c.
        pub(crate) aligning: TorquePerAcceleration,
    }
}

words! {
    /// The gains at a speed, which is new a hundred times a second.
    pub struct Gains {
        /// (K + LoHA)*SoHF*k_y.
        e_y: TorquePerLength,
        /// (K + LoHA)*SoHF*k_psi.
        e_theta: TorquePerAngle,
        /// LoHS*c*v + LoHA/g.
        turning: TorquePerTurningRate,
        /// LoHA.
        wheel: TorquePerAngle,
    }
}

/// Largest gain on an error, more than those of (9), which has four terms; that on the rate of the yaw error ends where its format does.
/// The wide sum of [`Gains::demanded`] stays inside 64 bits: three times 2^61 and the wheel's 2^57. `config` refuses choices that need
/// more at a speed that guides.
const MOST: I40F24 = I40F24::const_from_int(64);

impl Fdca {
    /// The gains at a speed, where the vehicle turns so fast per wheel angle.
    #[must_use]
    pub fn gains(&self, speed: Speed, turning_gain: TurningRatePerAngle) -> Gains {
        let v = speed.fixed();
        let stiffness = product(
            saturate(product(self.aligning.fixed(), v)),
            turning_gain.fixed(),
        );
        let both = saturate(stiffness.saturating_add(self.loha.fixed().into()));
        let gain = |of: I8F24| saturate(product(both, of).min(MOST));
        // Only who wants authority pays for the division.
        let held = if self.loha == TorquePerAngle::ZERO {
            I8F24::ZERO
        } else {
            let dividend = i64::from(self.loha.bits()) << I8F24::FRAC_NBITS;
            let divisor = u32::try_from(turning_gain.bits()).unwrap_or(0);
            I8F24::from_bits(signed_quotient(dividend, divisor))
        };
        let path = product(self.path.fixed(), v).saturating_add(held.into());
        Gains {
            e_y: TorquePerLength::from_fixed(gain(self.k_y.fixed())),
            e_theta: TorquePerAngle::from_fixed(gain(self.k_psi.fixed())),
            turning: TorquePerTurningRate::from_fixed(saturate(path)),
            wheel: self.loha,
        }
    }
}

impl Gains {
    /// Before the first speed.
    pub(crate) const NONE: Self = Self {
        e_y: TorquePerLength::ZERO,
        e_theta: TorquePerAngle::ZERO,
        turning: TorquePerTurningRate::ZERO,
        wheel: TorquePerAngle::ZERO,
    };

    /// The torque demanded now, from the latest sample received, the rate of turn and the wheel angle; `law` has the filter of the
    /// rates.
    #[must_use]
    pub fn step(
        &self,
        law: &Law,
        state: &mut LawState,
        now: Instant,
        sample: LaneSample,
        motion: (TurningRate, Radians),
    ) -> Torque {
        if !state.is_latest(&sample) {
            law.update(state, sample);
        }
        self.demanded(state, now, None, motion)
    }

    /// The torque demanded now, from the sample taken last. Exact wide products of 20 and 24 fractional bits and one rounding, as
    /// those of [`Law`].
    #[inline(always)]
    pub(crate) fn demanded(
        &self,
        state: &LawState,
        now: Instant,
        ego: Option<&EgoMotion>,
        motion: (TurningRate, Radians),
    ) -> Torque {
        let age = now.since(state.last.at);
        match ego {
            None => self.torque(state, age, motion),
            Some(ego) => self.torque(&state.moved_with(age, ego), age, motion),
        }
    }

    #[inline(always)]
    fn torque(&self, state: &LawState, age: Micros, (turning, wheel): (TurningRate, Radians)) -> Torque {
        let [e_y, e_theta] = state.continued(age);
        let [turning, wheel] = [turning.fixed(), wheel.fixed()].map(I12F20::wrapping_from_num);
        let turns = state.e_theta_rate.saturating_add(turning);
        let sum = (self.e_y.fixed().wide_mul(e_y))
            .wrapping_add(self.e_theta.fixed().wide_mul(e_theta))
            .wrapping_add(self.turning.fixed().wide_mul(turns))
            .wrapping_sub(self.wheel.fixed().wide_mul(wheel));
        Torque::from_wide(rounded(sum))
    }
}
