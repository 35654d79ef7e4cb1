//! Four design choices (FDCA) in the place of equation (9) (van Paassen, Boink, Abbink, Mulder 2017), with LoHA = 0:
//! `T_h = K*(LoHS*d_ff + d_fb)`, `d_fb = SoHF*(k_y*e_y' + k_psi*e_theta')`.
//!
//! `d_ff = (r + de_theta'/dt)/g` is the wheel angle that the path needs, g the rate of turn per wheel angle at this speed, r the
//! rate of turn; `K = c*v*g` is the aligning torque per wheel angle, c the one per lateral acceleration. So it is
//!
//! `T_h = c*v*(g*d_fb + LoHS*(r + de_theta'/dt))`,
//!
//! the aligning torque of the lateral acceleration that the path asks for, without a division. SoHF is a factor of k_y and k_psi
//! here. Filter of the rates, errors between two samples and samples that come late are those of [`Law`].
//!
//! Error: at most 0.2 mN.m from a float64 evaluation with the vehicle of the paper (`core/tests/laws.rs` asserts it).

use fixed::types::extra::U20;
use fixed::types::{I8F24, I12F20};

use super::{EgoMotion, Law, LawState};
use crate::quantity::{
    AnglePerLength, Instant, Ratio, Speed, Torque, TorquePerAcceleration, TorquePerAngle, TorquePerLength,
    TorquePerSpeed, TorquePerTurningRate, TurningRate, TurningRatePerAngle, product, rounded, saturate,
};

/// What the parameters choose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Choices {
    /// SoHF*k_y.
    pub(crate) k_y: AnglePerLength,
    /// SoHF*k_psi.
    pub(crate) k_psi: Ratio,
    /// LoHS.
    pub(crate) lohs: Ratio,
}

/// What the law needs to know of the vehicle.
#[derive(Debug, Clone, Copy)]
pub struct Car {
    /// v.
    pub speed: Speed,
    /// g.
    pub turning_gain: TurningRatePerAngle,
    /// r.
    pub turning: TurningRate,
    /// c.
    pub aligning: TorquePerAcceleration,
}

impl Law {
    /// A law whose words are those of FDCA: each more would be compared with its copy in every step of (9) too.
    pub(crate) const fn of_choices(choices: Choices, tau: u32) -> Self {
        Self {
            e_y: TorquePerLength::from_bits(choices.k_y.bits()),
            e_y_rate: TorquePerSpeed::MIN,
            e_theta: TorquePerAngle::from_bits(choices.k_psi.bits()),
            e_theta_rate: TorquePerTurningRate::from_bits(choices.lohs.bits()),
            tau,
        }
    }

    /// Whether the words are those of FDCA.
    #[inline(always)]
    pub(crate) fn is_fdca(&self) -> bool {
        self.e_y_rate < TorquePerSpeed::ZERO
    }
}

impl Choices {
    /// Of a law that is FDCA.
    #[must_use]
    pub const fn of(law: &Law) -> Self {
        Self {
            k_y: AnglePerLength::from_bits(law.e_y.bits()),
            k_psi: Ratio::from_bits(law.e_theta.bits()),
            lohs: Ratio::from_bits(law.e_theta_rate.bits()),
        }
    }

    /// The torque demanded now, from the sample that the law took last.
    #[must_use]
    pub fn demanded(&self, state: &LawState, now: Instant, ego: Option<&EgoMotion>, car: &Car) -> Torque {
        let age = now.since(state.last.at);
        let late;
        let state = if let Some(ego) = ego {
            late = state.moved_with(age, ego);
            &late
        } else {
            state
        };
        let [e_y, e_theta] = state.continued(age);
        // Choices of 50 at most and errors of 2^11 make 2^60 each, a rate of turn per angle of 9 and LoHS of 2 no more.
        let back = (self.k_y.fixed().wide_mul(e_y)).wrapping_add(self.k_psi.fixed().wide_mul(e_theta));
        let back: I12F20 = saturate(rounded::<_, U20>(back));
        let path = I12F20::wrapping_from_num(car.turning.fixed()).saturating_add(state.e_theta_rate);
        let turn = (car.turning_gain.fixed().wide_mul(back)).wrapping_add(self.lohs.fixed().wide_mul(path));
        let turn: I8F24 = saturate(rounded(turn));
        let sideways = saturate(product(car.speed.fixed(), turn));
        Torque::from_wide(product(car.aligning.fixed(), sideways))
    }
}
