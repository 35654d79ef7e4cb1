//! The trust in the lane while the camera sees nothing, or sees another line.
//!
//! In Active a lane that is silent, invalid, or suddenly at another place does not end guidance at once. The last
//! lane is extrapolated along the part of the road that was seen
//! ([`crate::safety::plausibility::Plausibility::extrapolated_lane`]), and the *trust*, which is the share of the
//! law's torque that acts, falls:
//!
//! | what comes | trust | for at most |
//! |---|---|---|
//! | no picture; a warning after 0.2 s | falls by 0.5 a second | 1 s, of which half as much is forgiven while pictures agree |
//! | pictures of a line elsewhere, with a warning | falls by 2 a second | 4 s; the new line is taken when there is no trust left, it is near, and it has moved as the vehicle does |
//! | pictures that agree | rises by 1 a second, to a half only while a line that was taken has shown no movement | |
//!
//! If it lasts longer, the input is lost, as outside Active. So a loss is declared a second later than outside
//! Active; meanwhile the torque follows the road and falls as fast as in a handover (docs/decisions/012).
//!
//! Not here: how the lane is extrapolated, and what a loss leads to ([`crate::controller`]).

use crate::lane::LaneSample;
use crate::quantity::{Metres, Micros, Radians, Ratio, Torque, per_second};
use crate::safety::redundant::words;

/// After this time without a picture the lane is lost.
pub const MOST_BLIND: Micros = Micros::from_ms(1000);
/// After this time without a picture the driver is warned: a tenth of the torque is gone, and most blinks are over.
const WARN_BLIND: Micros = Micros::from_ms(200);
/// After this time with pictures of a line elsewhere the lane is lost. A lane change by hand at 0.35 m/s comes near
/// the new line sooner.
const MOST_APART: Micros = Micros::from_ms(4000);
/// Lateral error below which a new line is adopted: the free space beside a car of 1.9 m in a lane of 3.5 m.
const NEAR: Metres = Metres::from_m(0.8);
/// Yaw error below which a new line is adopted: 0.1 rad at the far point of a bend of 2.5 m/s2, and as much for the
/// vehicle's own direction.
const ALONG: Radians = Radians::from_rad(0.2);
/// Change of trust per second without a picture: as fast as in a handover.
pub const BLIND_FALL: Ratio = Ratio::from_si(-0.5);
/// Change of trust per second with pictures of a line elsewhere, as fast as a torque of 2 N.m fades; and with
/// pictures that agree.
const APART_FALL: Ratio = Ratio::from_si(-2.0);
const RISE: Ratio = Ratio::ONE;

/// Most trust in a line that was adopted, until it has moved as the vehicle does.
const BELIEVED: Ratio = Ratio::from_si(0.5);

/// The torque for the extrapolated lane may depart from the torque for the last picture at this rate, in 2^-24 N.m
/// per microsecond. It is slightly less than 1 N.m/s, the rate at which the monitor's band grows, so that the monitor
/// does not refuse the torque where a gust moves the vehicle.
pub const AWAY_PER_US: Torque = Torque::from_bits(16);
/// The lane is extrapolated once in this time.
pub const EXTRAPOLATION_PERIOD: Micros = Micros::from_ms(10);

/// What the camera sees.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sight {
    /// Pictures come and agree.
    Sees = 0,
    /// No picture comes.
    Blind = 1,
    /// Pictures come, of a line elsewhere.
    Apart = 2,
}

impl Sight {
    #[expect(clippy::as_conversions, reason = "a code is its discriminant")]
    const fn code(self) -> u32 {
        self as u32
    }

    /// No code but that of a variant is ever stored; the copies have been compared.
    const fn of_code(code: u32) -> Self {
        match code {
            0 => Self::Sees,
            2 => Self::Apart,
            _ => Self::Blind,
        }
    }
}

words! {
    /// What is remembered while pictures are missing.
    pub(crate) struct Coast {
        /// Share of the law's torque.
        pub(crate) trust: Ratio,
        blind: Micros,
        /// Time since the last picture that agreed, and the law's torque at that time.
        lost: Micros,
        demanded: Torque,
        /// A [`Sight`]'s code: memory that is kept twice holds words.
        sight_code: u32,
    }
}

/// How a new picture compares with the line that was followed and with the vehicle's way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Compared {
    /// Its line is where the one that was followed was extrapolated to.
    Agrees,
    /// It shows another line, which has moved as the vehicle does.
    OtherLineFollows,
    /// It shows another line, of which nobody knows that.
    OtherLine,
}

/// What a new picture shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PictureVerdict {
    /// The line is where it was extrapolated to.
    Expected,
    /// The line is where it was extrapolated to, in the first picture after some without it.
    Returned,
    /// Another line, which is adopted in its place.
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
        sight_code: Sight::Sees.code(),
    };

    const fn sight(&self) -> Sight {
        Sight::of_code(self.sight_code)
    }

    /// Whether pictures come and agree, trust is complete, and no earlier gap counts any more.
    #[inline(always)]
    pub(crate) fn is_idle(&self) -> bool {
        self.sight() == Sight::Sees && self.trust == Ratio::ONE && self.blind.us() == 0
    }

    /// Whether the extrapolated lane is used in place of pictures.
    pub(crate) const fn is_extrapolating(&self) -> bool {
        let is_short = self.lost.us() <= MOST_APART.us();
        is_short
            && match self.sight() {
                Sight::Sees => false,
                Sight::Blind => self.blind.us() <= MOST_BLIND.us(),
                Sight::Apart => true,
            }
    }

    /// Whether pictures show a line elsewhere.
    pub(crate) const fn sees_other_line(&self) -> bool {
        matches!(self.sight(), Sight::Apart)
    }

    /// Whether no picture has come for so long that the driver has to know.
    pub(crate) fn is_long_blind(&self) -> bool {
        self.sight() == Sight::Blind && self.lost >= WARN_BLIND
    }

    /// The law's torque for the extrapolated lane, limited by [`AWAY_PER_US`].
    pub(crate) fn limited(&self, demanded: Torque) -> Torque {
        if self.sight() == Sight::Sees {
            return demanded;
        }
        let lost_us = self.lost.min(MOST_BLIND).us().cast_signed();
        let away = AWAY_PER_US.times(lost_us);
        demanded
            .max(self.demanded.minus(away))
            .min(self.demanded.plus(away))
    }

    /// Notes that no picture is usable; `demanded` is the law's torque in this step.
    pub(crate) fn picture_missing(&mut self, demanded: Torque) {
        self.demanded = if self.sight() == Sight::Sees {
            demanded
        } else {
            self.demanded
        };
        self.sight_code = Sight::Blind.code();
    }

    /// Whether a picture may agree with the extrapolated line. Over more than [`MOST_BLIND`] the extrapolation is no evidence: an
    /// error of 3 mrad/s in the yaw rate moves it by half a metre in 3 s.
    pub(crate) fn may_agree(&self) -> bool {
        self.lost <= MOST_BLIND
    }

    /// Takes a new picture.
    pub(crate) fn picture_arrived(
        &mut self,
        sample: &LaneSample,
        compared: Compared,
        demanded: Torque,
    ) -> PictureVerdict {
        if compared == Compared::Agrees {
            let is_first = self.sight() != Sight::Sees;
            self.sight_code = Sight::Sees.code();
            return if is_first {
                PictureVerdict::Returned
            } else {
                PictureVerdict::Expected
            };
        }
        let is_near = sample.e_y.abs() <= NEAR && sample.e_theta.abs() <= ALONG;
        if self.trust == Ratio::ZERO && is_near && compared == Compared::OtherLineFollows {
            *self = Self {
                trust: Ratio::ZERO,
                ..Self::NEW
            };
            return PictureVerdict::Adopted;
        }
        self.picture_missing(demanded);
        self.sight_code = Sight::Apart.code();
        PictureVerdict::Elsewhere
    }

    /// Advances the times and the trust by `elapsed`.
    pub(crate) fn advance(&mut self, elapsed: Micros, is_line_doubted: bool) {
        let (us, blind, lost) = (elapsed.us(), self.blind.us(), self.lost.us());
        let (per_s, blind, lost) = match self.sight() {
            Sight::Sees => (RISE, blind.saturating_sub(us >> 1), 0),
            Sight::Apart => (APART_FALL, blind, lost.saturating_add(us)),
            Sight::Blind => (BLIND_FALL, blind.saturating_add(us), lost.saturating_add(us)),
        };
        (self.blind, self.lost) = (Micros::from_us(blind), Micros::from_us(lost));
        let change = Ratio::from_fixed(per_second(per_s.fixed(), elapsed));
        let most = if is_line_doubted { BELIEVED } else { Ratio::ONE };
        self.trust = self.trust.plus(change).max(Ratio::ZERO).min(most);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 16 counts of 2^-24 N.m in each of a million microseconds: 0.954 N.m, however much longer it lasts.
    #[test]
    fn the_torque_departs_from_the_last_pictures_by_what_a_second_allows() {
        for (lost_ms, most_nm) in [(500, 0.4768), (1000, 0.9537), (1300, 0.9537), (4000, 0.9537)] {
            for sign in [1.0, -1.0] {
                let coast = Coast {
                    sight_code: Sight::Apart.code(),
                    lost: Micros::from_ms(lost_ms),
                    demanded: Torque::from_nm(0.2 * sign),
                    ..Coast::NEW
                };
                for away in [1.0, -1.0] {
                    let limited = coast.limited(Torque::from_nm(5.0 * away)).nm();
                    let expected = 0.2 * sign + away * most_nm;
                    assert!(
                        (limited - expected).abs() < 1e-3,
                        "{lost_ms}: {limited}, not {expected}"
                    );
                }
            }
        }
    }

    /// An extrapolation of a second is the longest that a picture may agree with, whatever pictures came meanwhile.
    #[test]
    fn a_line_that_went_on_for_a_second_is_evidence_and_for_longer_is_none() {
        for sight in [Sight::Blind, Sight::Apart] {
            for (lost_us, may_agree) in [(999_999, true), (1_000_000, true), (1_000_001, false)] {
                let mut coast = Coast {
                    sight_code: sight.code(),
                    lost: Micros::from_us(lost_us),
                    ..Coast::NEW
                };
                assert_eq!(coast.may_agree(), may_agree, "{lost_us}");
                // Trust is whole, so that another line is not adopted, however it moves.
                for (compared, verdict) in [
                    (Compared::OtherLine, PictureVerdict::Elsewhere),
                    (Compared::OtherLineFollows, PictureVerdict::Elsewhere),
                    (Compared::Agrees, PictureVerdict::Returned),
                    (Compared::Agrees, PictureVerdict::Expected),
                ] {
                    let arrived = coast.picture_arrived(&LaneSample::default(), compared, Torque::ZERO);
                    assert_eq!(arrived, verdict, "{lost_us} {compared:?}");
                }
            }
        }
    }
}
