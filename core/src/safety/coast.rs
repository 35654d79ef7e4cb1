//! How far the lane is trusted while its camera sees nothing, or another line.
//!
//! In Active a lane that is silent, invalid or elsewhere does not end guidance at once. The lane seen last goes on along what
//! was seen of the road ([`crate::safety::plausibility::Plausibility::extrapolated_lane`]), and the share of the law's torque that acts, the
//! *trust*, falls:
//!
//! | what comes | trust | for at most |
//! |---|---|---|
//! | no picture | falls by 0.5 a second | 1 s, of which half as much is forgiven while pictures agree |
//! | pictures of a line elsewhere | falls by 2 a second | 4 s; the new line is taken when there is no trust left and it is near |
//! | pictures that agree | rises by 1 a second | |
//!
//! What lasts longer is a loss, as outside Active. So a loss costs a second, in which the torque follows the road on the line
//! of a handover (docs/decisions/012).
//!
//! Not here: where the lane goes on to, and what a loss leads to ([`crate::controller`]).

use crate::law::LaneSample;
use crate::quantity::{Metres, Micros, Radians, Ratio, Torque, per_second};
use crate::safety::redundant::words;

/// A camera that sees nothing for longer is lost.
pub const MOST_BLIND: Micros = Micros::from_ms(1000);
/// A line that stays elsewhere for longer is no lane of this vehicle: a lane change by hand at 0.35 m/s comes near it sooner.
const MOST_APART: Micros = Micros::from_ms(4000);
/// Where a line is near enough to be taken: what a car of 1.9 m has beside it in a lane of 3.5 m.
const NEAR: Metres = Metres::from_m(0.8);
/// Where it is a line along the road: 0.1 rad at the far point of a bend of 2.5 m/s2, and as much for the vehicle.
const ALONG: Radians = Radians::from_rad(0.2);
/// Change of trust in a second without a picture: as a handover falls.
pub const BLIND_FALL: Ratio = Ratio::from_si(-0.5);
/// With pictures of a line elsewhere it is as fast as a fade of 2 N.m; and with pictures that agree.
const APART_FALL: Ratio = Ratio::from_si(-2.0);
const RISE: Ratio = Ratio::ONE;

/// What the lane that goes on asks for may move away from what the last picture asked for, in 2^-24 N.m per microsecond: not
/// quite 1 N.m/s, by which the monitor's band grows. A vehicle that is thrown aside must not end in its veto.
pub const AWAY_PER_US: Torque = Torque::from_bits(16);
/// The lane goes on by so much at a time.
pub const EXTRAPOLATION_PERIOD: Micros = Micros::from_ms(10);

/// Pictures come and agree.
const SEES: u32 = 0;
/// No picture comes.
const BLIND: u32 = 1;
/// Pictures come, of a line elsewhere.
const APART: u32 = 2;

words! {
    /// What is remembered of the pictures that did not come.
    pub(crate) struct Coast {
        /// Share of the law's torque.
        pub(crate) trust: Ratio,
        blind: Micros,
        /// Since the last picture that agreed, and what the law asked for then.
        lost: Micros,
        demanded: Torque,
        sight: u32,
    }
}

/// What a new picture shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PictureVerdict {
    /// The line, where it must be.
    Expected,
    /// The same, in the first picture after some without it.
    Returned,
    /// A line that is taken in its place.
    Adopted,
    /// A line elsewhere.
    Elsewhere,
}

impl Coast {
    /// Pictures come and agree.
    pub(crate) const NEW: Self = Self {
        trust: Ratio::ONE,
        blind: Micros::from_us(0),
        lost: Micros::from_us(0),
        demanded: Torque::ZERO,
        sight: SEES,
    };

    /// Whether there is nothing to make up for.
    #[inline(always)]
    pub(crate) fn is_idle(&self) -> bool {
        self.sight == SEES && self.trust == Ratio::ONE && self.blind.us() == 0
    }

    /// Whether the lane seen last goes on in place of pictures.
    pub(crate) const fn is_extrapolating(&self) -> bool {
        let is_short = self.lost.us() <= MOST_APART.us();
        is_short && (self.sees_other_line() || (self.sight == BLIND && self.blind.us() <= MOST_BLIND.us()))
    }

    /// Whether pictures show a line elsewhere.
    pub(crate) const fn sees_other_line(&self) -> bool {
        self.sight == APART
    }

    /// What may be asked for of what the lane that goes on asks for.
    pub(crate) fn limited(&self, demanded: Torque) -> Torque {
        if self.sight == SEES {
            return demanded;
        }
        let lost_us = self.lost.min(MOST_BLIND).us().cast_signed();
        let away = AWAY_PER_US.times(lost_us);
        demanded
            .max(self.demanded.minus(away))
            .min(self.demanded.plus(away))
    }

    /// No picture is in use; `asked` is what the law asks for now.
    pub(crate) fn picture_missing(&mut self, demanded: Torque) {
        self.demanded = if self.sight == SEES {
            demanded
        } else {
            self.demanded
        };
        self.sight = BLIND;
    }

    /// Takes a new picture, which agrees with the line as it went on or not. How that went on for longer than [`MOST_BLIND`] says
    /// nothing: 3 mrad/s of yaw rate are half a metre within 3 s.
    pub(crate) fn picture_arrived(
        &mut self,
        sample: &LaneSample,
        agrees: bool,
        demanded: Torque,
    ) -> PictureVerdict {
        if agrees && self.lost <= MOST_BLIND {
            let is_first = self.sight != SEES;
            self.sight = SEES;
            return if is_first {
                PictureVerdict::Returned
            } else {
                PictureVerdict::Expected
            };
        }
        let is_near = sample.e_y.abs() <= NEAR && sample.e_theta.abs() <= ALONG;
        if self.trust == Ratio::ZERO && is_near {
            *self = Self {
                trust: Ratio::ZERO,
                ..Self::NEW
            };
            return PictureVerdict::Adopted;
        }
        self.picture_missing(demanded);
        self.sight = APART;
        PictureVerdict::Elsewhere
    }

    /// Time passes.
    pub(crate) fn advance(&mut self, elapsed: Micros) {
        let (us, blind, lost) = (elapsed.us(), self.blind.us(), self.lost.us());
        let (per_s, blind, lost) = match self.sight {
            SEES => (RISE, blind.saturating_sub(us >> 1), 0),
            APART => (APART_FALL, blind, lost.saturating_add(us)),
            _ => (BLIND_FALL, blind.saturating_add(us), lost.saturating_add(us)),
        };
        (self.blind, self.lost) = (Micros::from_us(blind), Micros::from_us(lost));
        let change = Ratio::from_fixed(per_second(per_s.fixed(), elapsed));
        self.trust = self.trust.plus(change).max(Ratio::ZERO).min(Ratio::ONE);
    }
}
