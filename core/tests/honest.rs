//! Honest senders: nothing that they do is too fast, and none is taken for two. A minute of each by default; the hour of each:
//!
//! ```text
//! HAPTIC_SECONDS=3600 cargo test --release -p haptic-core honest:: -- --nocapture
//! ```

use haptic_core::bus::messages::{Column, LanePreview, Message, Request, Vehicle};
use haptic_core::bus::{Frame, Reject};
use haptic_core::controller::config::Setup;
use haptic_core::ecu::{Boot, Ecu};
use haptic_core::quantity::Instant;
use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};
use std::collections::VecDeque;

/// What a sender's frames go through.
#[derive(Debug, Clone, Copy, Default)]
struct Way {
    /// Shortest and longest share of a period that a frame is early or late by.
    jitter: f64,
    /// Share of frames that begin a loss of one to three.
    lost: f64,
    /// How long nothing passes, ms, once a second; what waited comes at once.
    stall_ms: f64,
    /// The sender is silent for 200 ms every ten seconds, and counts from anywhere.
    restarts: bool,
    /// The sender's clock against the ECU's.
    clock: f64,
}

const WAYS: [Way; 6] = [
    Way {
        jitter: 0.3,
        lost: 0.0,
        stall_ms: 0.0,
        restarts: false,
        clock: 1.0,
    },
    Way {
        jitter: 0.3,
        lost: 0.01,
        stall_ms: 0.0,
        restarts: false,
        clock: 1.0,
    },
    Way {
        jitter: 0.0,
        lost: 0.0,
        stall_ms: 8.0,
        restarts: false,
        clock: 1.0,
    },
    Way {
        jitter: 0.1,
        lost: 0.001,
        stall_ms: 2.0,
        restarts: true,
        clock: 1.0,
    },
    Way {
        jitter: 0.3,
        lost: 0.0,
        stall_ms: 2.0,
        restarts: false,
        clock: 1.05,
    },
    Way {
        jitter: 0.3,
        lost: 0.0,
        stall_ms: 2.0,
        restarts: false,
        clock: 0.95,
    },
];

fn frame(id: u16, counter: u8) -> Frame {
    match id {
        LanePreview::ID => LanePreview {
            valid: true,
            ..LanePreview::default()
        }
        .encode(counter),
        Column::ID => Column::default().encode(counter),
        Vehicle::ID => Vehicle::default().encode(counter),
        _ => Request {
            engage: false,
            authority: haptic_core::quantity::Ratio::ZERO,
            probe: false,
        }
        .encode(counter),
    }
}

/// Every rejection of a sender's frames in so many seconds.
fn rejections(id: u16, period_us: f64, way: Way, seconds: u32, seed: u64) -> Vec<(f64, Reject)> {
    let mut rng = SmallRng::seed_from_u64(seed);
    // A wrap of the clock in the first minute.
    let instant = |us: f64| Instant::from_us((f64::from(u32::MAX) - 30e6 + us) as u64 as u32);
    let mut ecu = Ecu::new(Some(&Setup::PAPER), Boot::default(), instant(0.0));
    let (mut due_us, mut counter, mut lose) = (0.0, 0_u8, 0);
    let mut waiting: VecDeque<(f64, Frame)> = VecDeque::new();
    let mut rejected = Vec::new();
    let period_us = period_us / way.clock;
    for ms in 0..seconds * 1000 {
        let now_us = f64::from(ms) * 1e3;
        while due_us < now_us {
            let late_us = period_us * way.jitter * rng.random_range(-1.0..1.0);
            counter = counter.wrapping_add(1);
            if lose == 0 && rng.random_bool(way.lost) {
                lose = rng.random_range(1..4);
            }
            if lose > 0 {
                lose -= 1;
            } else {
                let after = waiting.back().map_or(0.0, |(at, _)| *at);
                waiting.push_back(((due_us + late_us).max(after), frame(id, counter)));
            }
            due_us += period_us;
        }
        let is_silent = way.restarts && ms % 10_000 < 200 && ms > 1000;
        if is_silent {
            waiting.clear();
            counter = rng.random();
        }
        let stalls = f64::from(ms % 1000) < way.stall_ms;
        while !stalls && waiting.front().is_some_and(|(at, _)| *at <= now_us) {
            let (_, frame) = waiting.pop_front().unwrap();
            let said = ecu.receive(&frame, instant(now_us));
            rejected.extend(said.err().map(|reason| (now_us * 1e-6, reason)));
        }
        ecu.step(instant(now_us));
    }
    rejected
}

#[test]
fn honest_senders_are_never_too_fast_and_never_two() {
    let seconds = std::env::var("HAPTIC_SECONDS").map_or(60, |text| text.parse().expect("seconds"));
    let senders: [(u16, &[f64]); 4] = [
        (
            LanePreview::ID,
            &[5e3, 1e6 / 120.0, 1e4, 1e6 / 60.0, 1e6 / 30.0, 1e6 / 15.0],
        ),
        (Column::ID, &[1e3, 2e3, 5e3, 1e4, 2e4]),
        (Vehicle::ID, &[5e3, 1e4, 2e4, 2.5e4]),
        (Request::ID, &[5e3, 1e4, 2e4, 2.5e4]),
    ];
    for (id, periods_us) in senders {
        for (period_us, (number, way)) in periods_us
            .iter()
            .flat_map(|p| WAYS.iter().enumerate().map(move |w| (p, w)))
        {
            let rejected = rejections(id, *period_us, *way, seconds, number as u64);
            let context = format!("{id:#x} every {period_us} us, {way:?}");
            let wrong = |(_, reason): &&(f64, Reject)| matches!(reason, Reject::TooFast | Reject::TwoSenders);
            assert_eq!(rejected.iter().find(wrong), None, "{context}");
            // Nothing at all but for a sender that was silent: two frames until it is trusted.
            let others = rejected
                .iter()
                .filter(|(_, reason)| *reason != Reject::NotTrusted)
                .count();
            if way.lost == 0.0 && !way.restarts {
                assert_eq!(
                    (others, rejected.len()),
                    (0, 2),
                    "{context}: {:?}",
                    &rejected[..rejected.len().min(9)]
                );
            }
        }
    }
}
