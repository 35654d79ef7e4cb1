//! The actuator check against motors in f64: honest ones are never declared, and what is missing is told from what is too
//! much.

use haptic_core::quantity::Torque;
use haptic_core::safety::actuator::{Actuator, Motor};

/// A motor with a dead time in steps, a lag in ms, an error and a ripple.
struct Honest {
    dead: usize,
    lag_ms: f64,
    gain: f64,
    ripple_nm: f64,
}

/// Commands of 3 s: winding up, a driver who overrides at once, again and again, a change of sign, a probe.
fn command(ms: usize) -> f64 {
    let t = ms as f64 * 1e-3;
    let ramp = (4.0 * t).min(4.9);
    match ms {
        0..1400 => ramp,
        // Down within a step, and up at 4 N.m/s.
        1400..2000 => ((ms - 1400) % 150) as f64 * 4e-3,
        2000..2400 => -0.004 * (ms - 2000) as f64,
        _ => 0.2 * (2.5 * std::f64::consts::TAU * t).sin(),
    }
}

fn judged(motor: &Honest) -> Vec<Motor> {
    let mut actuator = Actuator::default();
    let mut delivered = 0.0;
    (0..3000_usize)
        .map(|ms| {
            let wanted = motor.gain * command(ms.saturating_sub(motor.dead));
            // Exactly what a first-order lag does with a constant in a step.
            delivered += (wanted - delivered) * (1.0 - (-1.0 / motor.lag_ms).exp());
            let ripple = motor.ripple_nm * (0.3 * ms as f64).sin();
            if ms % 2 == 0 {
                actuator.deliver(Torque::from_nm(delivered + ripple));
            }
            actuator.judge(Torque::from_nm(command(ms)))
        })
        .collect()
}

#[test]
fn an_honest_motor_is_never_declared() {
    for dead in [0, 2, 5, 8] {
        for lag_ms in [0.1, 2.0, 6.0, 12.0, 20.0] {
            for gain in [0.9, 1.0, 1.1] {
                let motor = Honest {
                    dead,
                    lag_ms,
                    gain,
                    ripple_nm: 0.02,
                };
                let first = judged(&motor).iter().position(|motor| *motor != Motor::Obeys);
                assert_eq!(first, None, "dead {dead} ms, lag {lag_ms} ms, gain {gain}");
            }
        }
    }
}

#[test]
fn what_is_missing_is_weak_and_what_is_too_much_astray() {
    let motor = |gain: f64| Honest {
        dead: 1,
        lag_ms: 2.0,
        gain,
        ripple_nm: 0.0,
    };
    for (gain, expected) in [
        (0.0, Motor::Weak),
        (0.5, Motor::Weak),
        (0.8, Motor::Weak),
        (1.3, Motor::Astray),
        (-1.0, Motor::Astray),
    ] {
        let first = judged(&motor(gain))
            .into_iter()
            .find(|motor| *motor != Motor::Obeys);
        assert_eq!(first, Some(expected), "gain {gain}");
    }
    // One that goes on while it is told to stop: what is there is what should not be.
    let mut actuator = Actuator::default();
    let told = |ms: usize| if ms < 500 { 2.0 } else { 0.0 };
    let first = (0..600).find(|ms| {
        actuator.deliver(Torque::from_nm(2.0));
        let judged = actuator.judge(Torque::from_nm(told(*ms)));
        // Before, it is ahead of a command that begins at 2 N.m.
        *ms >= 500 && judged == Motor::Astray
    });
    // 8 ms of dead time, 10 ms of patience; the band has 12.5 % of 2 N.m and 0.1 N.m, so its lag of 21 ms adds 4 ms.
    assert!(first.is_some_and(|ms| (518..=526).contains(&ms)), "{first:?}");
}

/// An honest motor that is told 1 N.m delivers 0.775 to 1.225. Ten steps of too much are tolerated, again and again
/// where something is missing between, or nothing wrong; and fifty of what is missing likewise.
#[test]
fn too_much_and_too_little_are_counted_in_a_row() {
    for sign in [1.0, -1.0] {
        for (most, long, short) in [
            (10, 1.24, 0.76),
            (50, 0.76, 1.24),
            (10, 1.24, 1.0),
            (50, 0.76, 1.0),
        ] {
            let mut actuator = Actuator::default();
            let mut judge = |delivered: f64| {
                actuator.deliver(Torque::from_nm(sign * delivered));
                actuator.judge(Torque::from_nm(sign))
            };
            for _ in 0..500 {
                let _ = judge(1.0);
            }
            for _ in 0..8 {
                for delivered in [long].repeat(most).into_iter().chain([short]) {
                    assert_eq!(judge(delivered), Motor::Obeys);
                }
            }
            assert!(
                [long]
                    .repeat(most)
                    .into_iter()
                    .all(|nm| judge(nm) == Motor::Obeys)
            );
            assert_ne!(judge(long), Motor::Obeys);
        }
    }
}

/// A motor that stays at 2 N.m when the command ends at once. For 8 ms it may, then the band goes back by 3/64 a step: it is too
/// much where 2*(61/64)^n and an eighth of it and 0.1 N.m are less, after 4 steps more; ten of those are tolerated.
#[test]
fn a_motor_that_stays_is_astray_after_dead_time_lag_and_patience() {
    for sign in [1.0, -1.0] {
        let mut actuator = Actuator::default();
        let mut judge = |commanded: f64| {
            actuator.deliver(Torque::from_nm(sign * 2.0));
            actuator.judge(Torque::from_nm(sign * commanded))
        };
        for _ in 0..500 {
            let _ = judge(2.0);
        }
        let steps = (1..).find(|n| 2.0 * f64::powi(61.0 / 64.0, *n) * 1.125 + 0.1 < 2.0);
        let first = (1..100).find(|_| judge(0.0) != Motor::Obeys);
        assert_eq!(first, steps.map(|steps| 8 + steps + 10));
    }
}
