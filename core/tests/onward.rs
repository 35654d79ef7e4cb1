//! Where the lane goes on to without a picture, and what is known of how the vehicle turned, against the kinematics in f64.

use haptic_core::controller::config::Config;
use haptic_core::lane::LaneSample;
use haptic_core::quantity::{Instant, Metres, Micros, Radians, Speed, TurningRate};
use haptic_core::safety::motion_history::MotionHistory;
use haptic_core::safety::plausibility::PlausibilityState;

/// t'_n and t'_f, s.
const NEAR_S: f64 = 0.3;
const FAR_S: f64 = 0.7;
/// Shortly before the microsecond clock wraps.
const START: Instant = Instant::from_us(u32::MAX - 400_000);

fn after(s: f64) -> Instant {
    START.after(Micros::from_us((s * 1e6 + 0.5) as u32))
}

/// A vehicle that turns at a rate along a line whose direction at the far point turns at another, seen every 8 ms for so many
/// seconds: what the lane is 10 to 400 ms later. The near point moves by speed times the direction that the line has there,
/// less what the vehicle turns it aside. That direction was the far point's 0.4 s before; where that was not seen yet, the
/// line bends as the vehicle turns, and has the far point's direction less what it turns until there.
#[test]
fn the_lane_goes_on_as_line_and_vehicle_turn() {
    let checks = Config::PAPER.plausibility;
    for (v, turn, bend, direction) in [
        (16.7, 0.0, 0.0, 0.02),
        (16.7, 0.1, 0.1, 0.07),
        (16.7, -0.1, -0.1, -0.07),
        (33.0, 0.06, 0.0, 0.0),
        (33.0, -0.06, 0.0, 0.0),
        (10.0, 0.0, 0.2, -0.05),
        (10.0, 0.0, -0.2, 0.05),
        (25.0, -0.08, 0.05, 0.03),
    ] {
        for seen_s in [0.2, 0.6] {
            let (mut state, mut motion) = (PlausibilityState::NEW, MotionHistory::new());
            let measured = TurningRate::from_rad_per_s(turn);
            checks.motion(&mut state, Speed::from_m_per_s(v), Some(measured));
            // The far point's direction from the vehicle's.
            let e_theta = |t: f64| direction + (bend - turn) * t;
            let mut last = LaneSample::default();
            for ms in 0..=(seen_s * 1e3) as u32 {
                let t = f64::from(ms) * 1e-3;
                if ms % 10 == 0 {
                    motion.record_turning_rate(after(t), measured);
                }
                if ms % 8 == 0 {
                    last = LaneSample {
                        e_y: Metres::from_m(0.4),
                        e_theta: Radians::from_rad(e_theta(t)),
                        at: after(t),
                    };
                    motion.record_line(after(t), after(t), last.e_theta);
                }
            }
            let seen_until = f64::from((seen_s * 1e3) as u32 / 8 * 8) * 1e-3;
            for (later, stops) in [
                (0.01, false),
                (0.1, false),
                (0.4, false),
                (0.1, true),
                (0.4, true),
            ] {
                let t = seen_until + later;
                // It may turn no more from the last picture on.
                let (mut state, mut motion) = (state, motion.clone());
                let turn_since = if stops { 0.0 } else { turn };
                let measured = TurningRate::from_rad_per_s(turn_since);
                checks.motion(&mut state, Speed::from_m_per_s(v), Some(measured));
                motion.record_turning_rate(after(seen_until + 1e-6), measured);
                let lane = checks.extrapolated_lane(&state, &motion, after(t), &last, after(t));
                let between = FAR_S - NEAR_S;
                let rate = if seen_until >= between {
                    // The heading of then is so much less.
                    let near = e_theta(seen_until - between) - turn * between;
                    v * near - NEAR_S * v * turn
                } else {
                    v * e_theta(seen_until) - FAR_S * v * turn_since
                };
                let (e_y, e_theta) = (
                    0.4 + rate * later,
                    e_theta(seen_until) + (bend - turn_since) * later,
                );
                let context =
                    format!("{v} {turn} {bend} {direction}, seen {seen_s} s, {later} s later: {lane:?}");
                assert!((lane.e_y.m() - e_y).abs() < 2e-3, "{e_y} m: {context}");
                assert!(
                    (lane.e_theta.rad() - e_theta).abs() < 5e-4,
                    "{e_theta} rad: {context}"
                );
                assert_eq!(lane.at, after(t));
            }
        }
    }
}

/// The ring of 32 rates holds the last 62 ms of messages every 2 ms. A vehicle that has turned until 40 ms ago is known
/// to have turned then, and is taken to have turned as fast before.
#[test]
fn what_is_longer_ago_than_is_remembered_was_as_the_oldest_that_is() {
    for rate in [0.1, -0.1] {
        let mut motion = MotionHistory::new();
        for ms in (0..=1000).step_by(2) {
            let rate = if ms < 960 { rate } else { 0.0 };
            motion.record_turning_rate(after(f64::from(ms) * 1e-3), TurningRate::from_rad_per_s(rate));
        }
        for ago in [0.02, 0.05, 0.06, 0.1, 0.3, 0.5] {
            let (turned, before) = motion.turned(after(1.0), after(1.0 - ago));
            let (share, then) = (turned.rad() / rate, before.rad_per_s() / rate);
            assert!(
                (share - f64::max(ago - 0.04, 0.0)).abs() < 1e-4,
                "{ago} s ago, {rate} rad/s: turned for {share} s"
            );
            // Over the 50 ms before; 30 of them at 20 ms ago.
            let expected = if ago < 0.04 { 0.6 } else { 1.0 };
            assert!(
                (then - expected).abs() < 1e-3,
                "{ago} s ago: {then} of {rate} rad/s"
            );
        }
    }
}

/// A straight line whose direction is read with 1 mrad of noise to either side: over the 0.3 s that its bend is taken over these
/// are 2 mrad, and as much again in each further 0.3 s.
#[test]
fn noise_of_a_direction_is_no_bend() {
    let mut motion = MotionHistory::new();
    motion.record_turning_rate(after(0.0), TurningRate::ZERO);
    for k in 0..60_u32 {
        let t = f64::from(k) * 0.02;
        let noise = if k.is_multiple_of(2) { 1e-3 } else { -1e-3 };
        motion.record_line(after(t), after(t), Radians::from_rad(noise));
        let change = motion.direction_change(after(t), after(t), after(t + 0.3));
        assert!(k < 15 || change.rad().abs() < 2.1e-3, "{change:?}");
    }
}
