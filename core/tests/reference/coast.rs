//! Guidance without a picture, as docs/explanation/behaviour.md has it.

use super::receivers::{Lane, Seen, follows};
use super::{Law, Reference, per_second};
use haptic_core::controller::inputs::Input;
use haptic_core::safety::faults::{Fault, FaultSet};

/// Pictures: they come, do not come, or are of another line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Sight {
    Sees,
    Blind,
    Apart,
}

#[derive(Debug, Clone)]
pub(super) struct Coast {
    pub(super) trust: f64,
    blind: i64,
    pub(super) lost: i64,
    pub(super) demanded: f64,
    pub(super) sight: Sight,
}

impl Coast {
    pub(super) const NEW: Self = Self {
        trust: 1.0,
        blind: 0,
        lost: 0,
        demanded: 0.0,
        sight: Sight::Sees,
    };

    pub(super) fn is_idle(&self) -> bool {
        self.sight == Sight::Sees && self.trust == 1.0 && self.blind == 0
    }

    pub(super) fn is_long_blind(&self) -> bool {
        self.sight == Sight::Blind && self.lost >= 200_000
    }

    pub(super) fn goes_on(&self) -> bool {
        let is_short = match self.sight {
            Sight::Sees => false,
            Sight::Blind => self.blind <= 1_000_000,
            Sight::Apart => true,
        };
        is_short && self.lost <= 4_000_000
    }
}

impl Reference {
    /// Active without a picture of the line: whether faults of the lane are bridged, and what is reported of the pictures.
    pub(super) fn go_on(
        &mut self,
        now: i64,
        elapsed: i64,
        seen: &Seen,
        lane: &mut Input<Lane>,
    ) -> (bool, FaultSet) {
        let Some(last) = self.law.last else {
            return (false, FaultSet::NONE);
        };
        let demanded = self.demanded(now, &last);
        let is_older = seen.lane.value().is_some_and(|picture| picture.at < last.at);
        let coast = &mut self.coast;
        match seen.lane {
            Input::Lost => {
                if coast.sight == Sight::Sees {
                    coast.demanded = demanded;
                }
                coast.sight = Sight::Blind;
            }
            Input::New(picture) if !is_older => {
                let expected = self
                    .checks
                    .extrapolated(&self.c, &self.history, &last, picture.at);
                let is_near = picture.e_y.abs() <= 0.8 && picture.e_theta.abs() <= 0.2;
                let moves = self.checks.other_follows(&self.c, &mut self.history);
                if coast.lost <= 1_000_000 && follows(&expected, &picture) {
                    // From where the line went on to until the picture is no rate.
                    if coast.sight != Sight::Sees {
                        self.law.last = Some(picture);
                        self.checks.forget_other();
                    }
                    coast.sight = Sight::Sees;
                } else if coast.trust == 0.0 && is_near && moves {
                    *coast = Coast {
                        trust: 0.0,
                        ..Coast::NEW
                    };
                    self.law = Law::default();
                    self.checks.adopt_other(&mut self.history);
                } else {
                    if coast.sight == Sight::Sees {
                        coast.demanded = demanded;
                    }
                    coast.sight = Sight::Apart;
                }
            }
            _ => {}
        }
        let per_s = match coast.sight {
            Sight::Sees => {
                (coast.blind, coast.lost) = ((coast.blind - elapsed / 2).max(0), 0);
                1.0
            }
            Sight::Blind => {
                (coast.blind, coast.lost) = (coast.blind + elapsed, coast.lost + elapsed);
                -0.5
            }
            Sight::Apart => {
                coast.lost += elapsed;
                -2.0
            }
        };
        let most = if self.checks.is_doubted() { 0.5 } else { 1.0 };
        coast.trust = (coast.trust + per_second(per_s, elapsed)).clamp(0.0, most);
        let mut reported = FaultSet::NONE;
        reported.insert_if(coast.sight == Sight::Apart, Fault::LaneStep);
        if !coast.goes_on() {
            return (false, reported);
        }
        reported.insert_if(is_older && coast.sight != Sight::Apart, Fault::LaneTimeout);
        let passed = now - self.times[0];
        *lane = if passed < 10_000 || is_older {
            Input::Held(last)
        } else {
            let at = last.at + passed;
            Input::New(self.checks.extrapolated(&self.c, &self.history, &last, at))
        };
        (true, reported)
    }
}
