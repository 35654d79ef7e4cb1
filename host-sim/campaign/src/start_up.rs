//! How the ECU of a row starts up: its parameters, the memory that they lie in, and what it remembers of resets.

use haptic_core::controller::params::Params;
use haptic_core::ecu::Boot;
use haptic_core::quantity::Instant;
use haptic_core::service::stored::{BYTES, Set, load, save};
use haptic_lockstep::StartState;
use rand::RngExt;
use rand::rngs::Xoshiro256PlusPlus;

use super::injection::Start;
use haptic_sim::scenario::Scenario;

/// The parameters and the start of a row's ECU.
pub(super) fn start_up(
    start: Start,
    scenario: &Scenario,
    now: Instant,
    rng: &mut Xoshiro256PlusPlus,
) -> (Params, haptic_lockstep::Start) {
    let params = match start {
        Start::Absurd => absurd(),
        _ => scenario.controller_params(),
    };
    let boot = |recent_resets| Boot {
        recent_resets,
        ..Boot::default()
    };
    let state = match start {
        Start::Engaged | Start::Absurd | Start::HeadingWraps => StartState::Engaged,
        Start::Boot => StartState::Boot(boot(0)),
        Start::NoParameters | Start::HalfWritten if finds_previous(start, rng) => StartState::Boot(boot(0)),
        Start::NoParameters | Start::HalfWritten => StartState::WithoutParameters(boot(0)),
        Start::ThirdReset => StartState::Boot(boot(3)),
    };
    (params, haptic_lockstep::Start { state, at: now })
}

/// Whether the row begins with the ECU in Active.
pub(super) fn is_engaged(start: Start) -> bool {
    matches!(start, Start::Engaged | Start::Absurd | Start::HeadingWraps)
}

/// Every parameter of the law and the envelope at the end of its range that does most, and the monitor with them.
fn absurd() -> Params {
    Params {
        k_1: 4.0,
        a_1: 0.8,
        a_2: 0.01,
        a_3: 8.0,
        a_4: 0.2,
        rate_corner_hz: 60.0,
        least_speed_m_per_s: 0.5,
        ..Params::PAPER
    }
}

/// Whether a boot finds the set in use before in the memory of the parameters.
fn finds_previous(start: Start, rng: &mut Xoshiro256PlusPlus) -> bool {
    let set = |params| Set {
        params,
        vehicle: None,
    };
    let previous = set(Params::PAPER);
    let other = set(Params {
        torque_limit_nm: 3.0,
        ..Params::PAPER
    });
    let [mut older, mut newer] = [save(&other, 1, 0), save(&previous, 2, 0)];
    if start == Start::HalfWritten {
        // The older copy makes way for the third set.
        let written = rng.random_range(0..BYTES);
        older[..written].copy_from_slice(&save(&other, 3, 0)[..written]);
    } else {
        for copy in [&mut older, &mut newer] {
            copy[rng.random_range(0..BYTES)] ^= 1 << rng.random_range(0..8);
        }
    }
    load([&older, &newer], 0).is_some_and(|found| found.set == previous)
}
