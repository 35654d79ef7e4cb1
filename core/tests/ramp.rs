//! The ways to zero against hand values: linear, never growing, started from what can be trusted.

use haptic_core::quantity::{Instant, Micros, Ratio, Torque, TorqueRate};
use haptic_core::safety::ramp::{HANDOVER, Ramp, TorqueHistory, handover_length, pace, smaller_of_same_sign};

/// The resolution of a torque, N.m.
const LSB: f64 = 1.0 / 16_777_216.0;

fn nm(torque: f64) -> Torque {
    Torque::from_nm(torque)
}

#[test]
fn a_handover_is_a_straight_line_of_two_seconds() {
    for start in [5.0, 0.47, LSB, 0.0, -LSB, -3.2] {
        let start = nm(start).nm();
        let mut ramp = Ramp::over(nm(start), HANDOVER);
        for k in 1..=2000 {
            assert!(!ramp.is_done(), "{k}");
            let torque = ramp.step(Micros::from_ms(1)).nm();
            let expected = start * f64::from(2000 - k) / 2000.0;
            // Cut toward zero.
            assert!(
                torque.abs() <= expected.abs() && (torque - expected).abs() < LSB,
                "{k}: {torque}"
            );
        }
        assert!(ramp.is_done());
        assert_eq!(ramp.step(Micros::from_ms(1)), Torque::ZERO);
        assert_eq!(ramp.step(Micros::from_us(u32::MAX)), Torque::ZERO);
    }
}

/// Trust falls by a half in a second, as a handover of 2 s; a second is left of it at least.
#[test]
fn a_handover_goes_on_where_trust_was() {
    for (trust, us) in [
        (1.0, 2_000_000),
        (0.75, 1_500_000),
        (0.5, 1_000_000),
        (0.2, 1_000_000),
        (0.0, 1_000_000),
    ] {
        assert_eq!(
            handover_length(Ratio::from_si(trust)),
            Micros::from_us(us),
            "{trust}"
        );
    }
}

#[test]
fn a_fade_falls_at_its_rate() {
    for (start, ms) in [(2.0, 500), (-2.0, 500), (0.4, 100), (0.004, 1), (5.0, 1250)] {
        let mut ramp = Ramp::at_rate(nm(start), TorqueRate::from_nm_per_s(4.0));
        let mut steps = 0;
        while !ramp.is_done() {
            let torque = ramp.step(Micros::from_ms(1)).nm();
            steps += 1;
            let expected = (start.abs() - 0.004 * f64::from(steps)).max(0.0) * start.signum();
            // A microsecond of rounding in the length.
            assert!(
                (torque - expected).abs() <= 4.1e-6,
                "{steps}: {torque}, not {expected}"
            );
        }
        // The length is rounded up to whole microseconds, so one step more than the exact time may be needed.
        assert!(steps == ms || steps == ms + 1, "{start}: {steps}");
    }
    let mut nothing = Ramp::at_rate(Torque::ZERO, TorqueRate::from_nm_per_s(4.0));
    assert_eq!(nothing.step(Micros::from_ms(1)), Torque::ZERO);
    assert!(nothing.is_done() && Ramp::NONE.is_done());
}

#[test]
fn the_lesser_of_two_torques() {
    for (a, b, expected) in [
        (1.0, 2.0, 1.0),
        (2.0, 1.0, 1.0),
        (-1.0, -2.0, -1.0),
        (-2.0, -1.0, -1.0),
        (1.0, -1.0, 0.0),
        (-1.0, 1.0, 0.0),
        (0.0, 1.0, 0.0),
        (1.0, 0.0, 0.0),
        (0.0, -1.0, 0.0),
        (-1.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
    ] {
        assert_eq!(smaller_of_same_sign(nm(a), nm(b)), nm(expected), "{a} {b}");
    }
}

/// Outputs of 1, 2, 3 .. mN.m, one per millisecond from just before the clock wraps; the last is `ms` mN.m.
fn rising(ms: u32) -> (TorqueHistory, Instant) {
    let start = Instant::from_us(u32::MAX - 20_000);
    let mut history = TorqueHistory::NEW;
    for k in 1..=ms {
        let now = start.after(Micros::from_ms(k));
        history.push(now, nm(f64::from(k) * 1e-3));
    }
    (history, start.after(Micros::from_ms(ms)))
}

#[test]
fn trusted_is_the_last_output_kept_before_the_suspect_time() {
    let (history, last) = rising(400);
    let now = last.after(Micros::from_ms(1));
    for suspect_ms in [0, 1, 7, 30, 100, 249, 250] {
        let got = history.trusted(now, Micros::from_ms(suspect_ms)).nm() * 1e3;
        // Before 401 - suspect ms, and by no more than the 5 ms between two kept ones.
        let newest = f64::from(400 - suspect_ms);
        assert!(
            got <= newest + 1e-3 && got > newest - 5.1,
            "{suspect_ms}: {got} mN.m"
        );
    }
    // From 300 ms on in steps of 40 ms; further back than anything kept, nothing is known.
    let (history, last) = rising(4000);
    for suspect_ms in [300, 1000, 1500, 2000, 2400] {
        let got = history.trusted(last, Micros::from_ms(suspect_ms)).nm() * 1e3;
        let newest = f64::from(4000 - suspect_ms);
        assert!(got < newest && got > newest - 40.1, "{suspect_ms}: {got} mN.m");
    }
    assert_eq!(history.trusted(last, Micros::from_ms(2600)), Torque::ZERO);
    // At 300 ms already, where the fine one would give a later output.
    let trusted = |ms| history.trusted(last, Micros::from_ms(ms));
    assert!(trusted(299) > trusted(310));
    assert_eq!(trusted(300), trusted(310));
}

#[test]
fn a_history_shorter_than_the_suspect_time_trusts_no_torque() {
    assert_eq!(
        TorqueHistory::NEW.trusted(Instant::from_us(77), Micros::from_ms(1)),
        Torque::ZERO
    );
    let (history, last) = rising(100);
    assert_eq!(history.trusted(last, Micros::from_ms(120)), Torque::ZERO);
    assert_eq!(
        history.handover_start(last, Micros::from_ms(120), nm(0.1)),
        Torque::ZERO
    );
}

#[test]
fn a_handover_starts_at_the_lesser_of_trusted_and_applied() {
    let (history, now) = rising(400);
    let trusted = history.trusted(now, Micros::from_ms(30));
    assert!((0.36..0.37).contains(&trusted.nm()), "{}", trusted.nm());
    let start = |applied: f64| history.handover_start(now, Micros::from_ms(30), nm(applied));
    assert_eq!(start(0.4), trusted);
    assert_eq!(start(0.1), nm(0.1));
    assert_eq!(start(-0.4), Torque::ZERO);
}

#[test]
fn a_handover_goes_three_times_as_fast_while_the_driver_pushes_against_it() {
    for (applied, driver, expected) in [
        // From 0.1 N.m on, to both sides.
        (1.0, -0.101, 3),
        (1.0, -0.1, 1),
        (-1.0, 0.101, 3),
        (-1.0, 0.1, 1),
        // However small the torque is, and however large the push.
        (LSB, -5.0, 3),
        (-LSB, 5.0, 3),
        // A driver who helps.
        (1.0, 0.101, 1),
        (-1.0, -0.101, 1),
        (1.0, 5.0, 1),
        (1.0, 0.0, 1),
        // Nothing to push against.
        (0.0, 5.0, 1),
        (0.0, -5.0, 1),
    ] {
        assert_eq!(
            pace(nm(applied), Some(nm(driver)), true),
            expected,
            "{applied} {driver}"
        );
    }
}

#[test]
fn a_handover_goes_twice_as_fast_without_a_driver_torque() {
    for applied in [-1.0, 0.0, 1.0] {
        assert_eq!(pace(nm(applied), None, true), 2);
    }
}

#[test]
fn a_handover_goes_four_times_as_fast_beside_a_driver_torque_that_nobody_believes() {
    for applied in [-1.0, 0.0, 1.0] {
        for driver in [None, Some(nm(-2.0)), Some(nm(0.0)), Some(nm(2.0))] {
            assert_eq!(pace(nm(applied), driver, false), 4);
        }
    }
}
