//! How a row of the table says what it asks of the ECU: by methods in a chain behind its injections.

use super::{CONTRADICTION_MS, Class, Expect, FaultCase, LONG_AFTER_MS, Place, PlaceOnRoad};
use crate::bytes::{ACTIVE, FADE, FAULT, HANDOVER, LOCKED};
use crate::injection::Start;
use crate::residual::Detectability;
use haptic_core::controller::params::Params;
use haptic_sim::models::nonlinear::WorldParameters;

const fn reaches(mode: u64) -> Expect {
    Expect::Reaches { mode, fading: false }
}

/// Makes the methods, one a line: the fields that a method sets, and behind `on` the method that it applies first.
macro_rules! words {
    ($(
        $(#[$doc:meta])*
        $name:ident($($argument:ident: $of:ty),*) $(on $base:ident($($given:expr),*))?
            { $($field:ident: $value:expr),* };
    )*) => {
        impl FaultCase {
            $(
                $(#[$doc])*
                pub(super) const fn $name(self $(, $argument: $of)*) -> Self {
                    Self { $($field: $value,)* ..self $(.$base($($given),*))? }
                }
            )*
        }
    };
}

words! {
    rejected() { class: Class::R, expect: Expect::GoesOn { rejects: true } };
    /// Nothing to reject, nothing to react to: the last good value bridges it.
    bridged() { class: Class::R };
    fades(ms: u32) { class: Class::A, expect: reaches(FADE), deadline_ms: ms };
    hands_over(ms: u32) { class: Class::B, expect: reaches(HANDOVER), deadline_ms: ms };
    /// Once what arrives contradicts itself.
    contradicts() on hands_over(CONTRADICTION_MS) { seen: Detectability::Contradiction };
    may_hand_over() { expect: Expect::MayHandOver, deadline_ms: CONTRADICTION_MS, seen: Detectability::Contradiction };
    stops(ms: u32) { class: Class::C, expect: reaches(FAULT), deadline_ms: ms };
    locks() { class: Class::C, expect: reaches(LOCKED), deadline_ms: 20, torque_nm: 0.0 };
    yields(ms: u32) { class: Class::D, expect: Expect::Yields, deadline_ms: ms };
    opposed() { class: Class::D };
    /// Whatever a handover is due to.
    may_hand_over_at_once() { expect: Expect::MayHandOver };
    hands_over_or_stops(ms: u32) on hands_over(ms) { expect: Expect::HandsOverOrStops };
    only_rules() { expect: Expect::OnlyRules };
    after_fade() { expect: Expect::Reaches { mode: FAULT, fading: true } };
    /// `reset` is the cause in the status frame: 1 watchdog, 2 processor fault, 3 panic, 4 stack, 5 brown-out.
    restarts(reset: u64, ms: u32)
        { class: Class::C, expect: Expect::Restarts { reset }, deadline_ms: ms };
    engages() { expect: reaches(ACTIVE), deadline_ms: 12 };
    uncut() { expect: Expect::Uncut };
    seen(by: Detectability) { seen: by };
    after_sample() { after_sample: true };
    torque(nm: f64) { torque_nm: nm };
    lasts(ms: u32) { lasts_ms: Some(ms) };
    /// Little contradicts it: it takes who relies this far, of those who keep the lane and of the paper's, and the run shows where to.
    takes_along(keepers_m: f64, papers_m: f64) { lie_m: Some([keepers_m, papers_m]), after_ms: LONG_AFTER_MS };
    from(state: Start) { start: state };
    place(place: PlaceOnRoad) { place_on_road: Some(place) };
    on(plant: fn(&mut WorldParameters)) { plant: Some(plant) };
    /// From the start of the run on.
    told(wrong: fn(&mut Params)) { told: Some(wrong) };
    /// Also run in QEMU.
    q() { place: Place::Both };
    /// Run in QEMU only.
    only_q() { place: Place::Target };
}
