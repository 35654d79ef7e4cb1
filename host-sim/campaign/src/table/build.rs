//! How a row of the table says what it asks for: a chain of words behind its injections.

use super::{CONTRADICTION_MS, Class, Expect, FaultCase, Place, PlaceOnRoad};
use crate::bytes::{ACTIVE, FADE, FAULT, HANDOVER, LOCKED};
use crate::injection::Start;
use crate::residual::Detectability;
use haptic_sim::models::nonlinear::WorldParameters;

const fn reaches(mode: u64) -> Expect {
    Expect::Reaches { mode, fading: false }
}

impl FaultCase {
    pub(super) const fn rejected(self) -> Self {
        Self {
            class: Class::R,
            expect: Expect::GoesOn { rejects: true },
            ..self
        }
    }

    /// Nothing to reject, nothing to react to: the last good value bridges it.
    pub(super) const fn bridged(self) -> Self {
        Self {
            class: Class::R,
            ..self
        }
    }

    pub(super) const fn fades(self, deadline_ms: u32) -> Self {
        Self {
            class: Class::A,
            expect: reaches(FADE),
            deadline_ms,
            ..self
        }
    }

    pub(super) const fn hands_over(self, deadline_ms: u32) -> Self {
        Self {
            class: Class::B,
            expect: reaches(HANDOVER),
            deadline_ms,
            ..self
        }
    }

    /// Once what arrives contradicts itself.
    pub(super) const fn contradicts(self) -> Self {
        Self {
            seen: Detectability::Contradiction,
            ..self.hands_over(CONTRADICTION_MS)
        }
    }

    pub(super) const fn may_hand_over(self) -> Self {
        Self {
            expect: Expect::MayHandOver,
            deadline_ms: CONTRADICTION_MS,
            seen: Detectability::Contradiction,
            ..self
        }
    }

    pub(super) const fn stops(self, deadline_ms: u32) -> Self {
        Self {
            class: Class::C,
            expect: reaches(FAULT),
            deadline_ms,
            ..self
        }
    }

    pub(super) const fn locks(self) -> Self {
        Self {
            class: Class::C,
            expect: reaches(LOCKED),
            deadline_ms: 20,
            torque_nm: 0.0,
            ..self
        }
    }

    pub(super) const fn yields(self, deadline_ms: u32) -> Self {
        Self {
            class: Class::D,
            expect: Expect::Yields,
            deadline_ms,
            ..self
        }
    }

    pub(super) const fn opposed(self) -> Self {
        Self {
            class: Class::D,
            ..self
        }
    }

    /// Whatever a handover is due to.
    pub(super) const fn may_hand_over_at_once(self) -> Self {
        Self {
            expect: Expect::MayHandOver,
            ..self
        }
    }

    pub(super) const fn hands_over_or_stops(self, deadline_ms: u32) -> Self {
        Self {
            expect: Expect::HandsOverOrStops,
            ..self.hands_over(deadline_ms)
        }
    }

    pub(super) const fn only_rules(self) -> Self {
        Self {
            expect: Expect::OnlyRules,
            ..self
        }
    }

    pub(super) const fn after_fade(self) -> Self {
        Self {
            expect: Expect::Reaches {
                mode: FAULT,
                fading: true,
            },
            ..self
        }
    }

    /// `reset` is the cause in the status frame: 1 watchdog, 2 processor fault, 3 panic, 4 stack, 5 brown-out.
    pub(super) const fn restarts(self, reset: u64, deadline_ms: u32) -> Self {
        Self {
            class: Class::C,
            expect: Expect::Restarts { reset },
            deadline_ms,
            ..self
        }
    }

    pub(super) const fn engages(self) -> Self {
        Self {
            expect: reaches(ACTIVE),
            deadline_ms: 12,
            ..self
        }
    }

    pub(super) const fn uncut(self) -> Self {
        Self {
            expect: Expect::Uncut,
            ..self
        }
    }

    pub(super) const fn seen(self, seen: Detectability) -> Self {
        Self { seen, ..self }
    }

    pub(super) const fn after_sample(self) -> Self {
        Self {
            after_sample: true,
            ..self
        }
    }

    pub(super) const fn torque(self, torque_nm: f64) -> Self {
        Self { torque_nm, ..self }
    }

    pub(super) const fn lasts(self, ms: u32) -> Self {
        Self {
            lasts_ms: Some(ms),
            ..self
        }
    }

    pub(super) const fn from(self, start: Start) -> Self {
        Self { start, ..self }
    }

    pub(super) const fn place(self, place: PlaceOnRoad) -> Self {
        Self {
            place_on_road: Some(place),
            ..self
        }
    }

    pub(super) const fn on(self, plant: fn(&mut WorldParameters)) -> Self {
        Self {
            plant: Some(plant),
            ..self
        }
    }

    /// Also run in QEMU.
    pub(super) const fn q(self) -> Self {
        Self {
            place: Place::Both,
            ..self
        }
    }

    /// Run in QEMU only.
    pub(super) const fn only_q(self) -> Self {
        Self {
            place: Place::Target,
            ..self
        }
    }
}
