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

use fixed::types::{I8F24, I40F24};

use super::{EgoMotion, LaneSample, Law, LawState};
use crate::quantity::{
    AnglePerLength, Instant, Radians, Ratio, Speed, Torque, TorquePerAcceleration, TorquePerAngle,
    TorquePerLength, TorquePerSpeed, TorquePerTurningRate, TurningRate, TurningRatePerAngle, product,
    saturate, signed_quotient,
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

/// How the vehicle moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Car {
    /// v.
    pub speed: Speed,
    /// g.
    pub turning_gain: TurningRatePerAngle,
    /// r.
    pub turning: TurningRate,
    /// phi.
    pub wheel: Radians,
}

/// Largest gain on an error, more than those of (9), which has four terms; that on the rate of the yaw error ends where its format does.
/// The wide sum of [`Law`] stays inside 64 bits: three times 2^61. `config` refuses choices that need more at a speed that guides.
const MOST: I40F24 = I40F24::const_from_int(64);

impl Fdca {
    /// None, for another law.
    pub(crate) const NONE: Self = Self {
        k_y: AnglePerLength::ZERO,
        k_psi: Ratio::ZERO,
        path: TorquePerAcceleration::ZERO,
        loha: TorquePerAngle::ZERO,
        aligning: TorquePerAcceleration::ZERO,
    };

    /// The torque that the law demands now, from the latest sample received; `law` has the filter of the rates.
    #[must_use]
    pub fn step(
        &self,
        law: &Law,
        state: &mut LawState,
        now: Instant,
        sample: LaneSample,
        car: &Car,
    ) -> Torque {
        if !state.is_latest(&sample) {
            law.update(state, sample);
        }
        self.demanded(law, state, now, None, car)
    }

    /// The torque demanded now, from the sample taken last; `law` has the filter of the rates.
    #[inline(never)]
    pub(crate) fn demanded(
        &self,
        law: &Law,
        state: &LawState,
        now: Instant,
        ego: Option<&EgoMotion>,
        car: &Car,
    ) -> Torque {
        let gains = self.at(law.tau, car);
        let lane = gains.demanded(state, now, ego);
        let path = product(gains.e_theta_rate.fixed(), car.turning.fixed());
        let held = product(self.loha.fixed(), car.wheel.fixed());
        Torque::from_wide(
            I40F24::from(lane.fixed())
                .saturating_add(path)
                .saturating_sub(held),
        )
    }

    /// The gains at a speed.
    fn at(&self, tau: u32, car: &Car) -> Law {
        let v = car.speed.fixed();
        let stiffness = product(
            saturate(product(self.aligning.fixed(), v)),
            car.turning_gain.fixed(),
        );
        let both = saturate(stiffness.saturating_add(self.loha.fixed().into()));
        let gain = |of: I8F24| saturate(product(both, of).min(MOST));
        let turning_gain = u32::try_from(car.turning_gain.bits()).unwrap_or(0);
        // Only who wants authority pays for the division.
        let held = if self.loha == TorquePerAngle::ZERO {
            I8F24::ZERO
        } else {
            let dividend = i64::from(self.loha.bits()) << I8F24::FRAC_NBITS;
            I8F24::from_bits(signed_quotient(dividend, turning_gain))
        };
        let path = product(self.path.fixed(), v).saturating_add(held.into());
        Law {
            e_y: TorquePerLength::from_fixed(gain(self.k_y.fixed())),
            e_y_rate: TorquePerSpeed::ZERO,
            e_theta: TorquePerAngle::from_fixed(gain(self.k_psi.fixed())),
            e_theta_rate: TorquePerTurningRate::from_fixed(saturate(path)),
            tau,
        }
    }
}
