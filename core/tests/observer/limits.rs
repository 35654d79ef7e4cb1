//! Every limit on both sides and from both sides, extremes, and what is refused.

use haptic_core::controller::config::{Config, hands_lag_s};
use haptic_core::controller::params::Params;
use haptic_core::observer::{Sensor, State};
use haptic_core::quantity::{Micros, Radians, Torque};
use haptic_core::safety::hands::{ACTS, FELT, HELD, HandsState};
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};

use super::{AT_COLUMN, AT_WHEEL, observer};

/// The smallest step of torque and angle, N.m and rad.
const BIT: f64 = 1.0 / 16_777_216.0;

/// A jump begins anew with the wheel at rest, so that the hands are what the bar says; a smaller one is taken for a turn.
#[test]
fn a_jump_of_the_angle_begins_anew_and_a_smaller_one_does_not() {
    for side in [1.0, -1.0] {
        for (jump, is_anew) in [(0.999, false), (1.001, true)] {
            let observer = observer(&AT_WHEEL);
            let mut state = State::NEW;
            let mut step = |angle: f64| {
                let bar = Torque::from_nm(side * 0.5);
                observer
                    .step(&mut state, bar, Some(Radians::from_rad(angle)))
                    .nm()
            };
            assert_eq!(step(0.0), side * 0.5);
            let after = step(side * jump);
            assert_eq!(after == side * 0.5, is_anew, "{side} {jump} {after}");
        }
    }
}

/// A wheel at rest without a torque is predicted where it was, so that a step of the angle is the whole error.
#[test]
fn a_step_of_exactly_one_radian_is_no_jump() {
    for side in [1.0, -1.0] {
        for (step_rad, is_anew) in [(1.0, false), (1.0 + BIT, true)] {
            let (observer, mut state) = (observer(&AT_WHEEL), State::NEW);
            let _ = observer.step(&mut state, Torque::ZERO, Some(Radians::ZERO));
            let angle = Radians::from_rad(side * step_rad);
            let hands = observer.step(&mut state, Torque::ZERO, Some(angle));
            assert_eq!(hands == Torque::ZERO, is_anew, "{side} {step_rad} {hands:?}");
        }
    }
}

/// A torque that may be wrong by so much is a hand beyond it: once as a change, and once beside no change.
#[test]
fn what_a_torque_may_be_wrong_by_is_no_hand() {
    let (unsure, bit) = (Torque::from_nm(0.2), Torque::from_nm(BIT));
    for side in [1.0, -1.0] {
        let signed = |torque: Torque| if side < 0.0 { torque.opposite() } else { torque };
        for (from, most) in [(Torque::ZERO, FELT.plus(unsure)), (HELD, HELD.plus(unsure))] {
            for (torque, left_ms) in [(most, 500), (most.plus(bit), 0)] {
                let mut state = HandsState::NEW;
                state.update(signed(from), Torque::ZERO);
                state.add_guided_time(ACTS, Micros::from_ms(500));
                state.update(signed(torque), unsure);
                assert_eq!(state.time_hands_off(), Micros::from_ms(left_ms), "{torque:?}");
            }
        }
    }
}

/// Three lags of 1/60 s, and half of what is beyond the millisecond of a sample every 8 ms.
#[test]
fn the_lag_counts_how_old_a_sample_is() {
    for (column_period_s, expected_s) in [(0.001, 0.05), (0.008, 0.0535)] {
        let of = Params {
            observer_bandwidth_rad_per_s: 60.0,
            column_period_s,
            ..AT_COLUMN
        };
        let lag_s = hands_lag_s(&of);
        assert!((lag_s - expected_s).abs() < 1e-9, "{lag_s}");
    }
}

/// The bar as the only known torque, before the first sample, up to the most that hands can do.
#[test]
fn hands_are_held_within_what_they_can_do() {
    for side in [1.0, -1.0] {
        for (bar_nm, expected_nm) in [(19.99, 19.99), (20.01, 20.0)] {
            let mut state = State::NEW;
            let hands = observer(&AT_WHEEL).step(&mut state, Torque::from_nm(side * bar_nm), None);
            assert!((hands.nm() - side * expected_nm).abs() < 1e-6, "{hands:?}");
        }
    }
}

/// An angle that leaps by 0.9 rad asks for 34 N.m beside the bar; what is beyond 20 N.m is not kept for the sample that leaps back. The steps of
/// the filter are done here in f64, with 0.1 rad for each sample.
#[test]
fn what_is_beyond_the_hands_is_not_kept() {
    let (kept, period_s, inertia) = ((-0.1_f64).exp(), 1e-3, 0.044);
    let [to_angle, to_rate] = [
        1.0 - kept.powi(3),
        1.5 * (1.0 - kept).powi(2) * (1.0 + kept) / period_s,
    ];
    let to_torque = inertia * (1.0 - kept).powi(3) / (period_s * period_s);
    assert!(0.9 * to_torque > 34.0);
    let rate = 0.9 * to_rate;
    let predicted = 0.9 * to_angle + period_s * (rate + 0.5 * 20.0 * period_s / inertia);
    let expected = 20.0 + to_torque * (-0.3 - predicted);
    for side in [1.0, -1.0] {
        let (observer, mut state) = (observer(&AT_WHEEL), State::NEW);
        let told = [0.0, 0.9, -0.3].map(|angle| {
            let angle = Radians::from_rad(side * angle);
            observer.step(&mut state, Torque::ZERO, Some(angle)).nm()
        });
        assert_eq!(told[..2], [0.0, side * 20.0]);
        assert!((side * told[2] - expected).abs() < 1e-3, "{told:?} {expected}");
    }
}

/// A free fall of the wheel: 10 N.m at 0.044 kg.m2 reach 100 rad/s in 440 ms, with no sample that says otherwise. Where it is
/// predicted shows the rate: a sample there changes nothing, and one that is 0.1 rad further is worth 3.8 N.m.
#[test]
fn the_rate_is_held_where_no_wheel_turns() {
    for side in [1.0, -1.0] {
        for (ms, at_rad) in [(440, 22.05), (600, 38.068)] {
            let (observer, mut state) = (observer(&AT_WHEEL), State::NEW);
            let _ = observer.step(&mut state, Torque::from_nm(side * 10.0), Some(Radians::ZERO));
            // The hands' torque stays what the bar's was; a bar of 0 leaves all of it to the wheel, but half in the first step.
            for _ in 0..ms {
                let told = observer.step(&mut state, Torque::ZERO, None);
                assert_eq!(told.nm(), side * 10.0);
            }
            let there = Radians::from_rad(side * at_rad);
            let told = side * observer.step(&mut state, Torque::ZERO, Some(there)).nm();
            assert!((told - 10.0).abs() < 0.05, "{ms}: {told}");
        }
    }
}

/// Overflow checks are on in this build: nothing wraps, whatever comes, and the estimate keeps within its limits.
#[test]
fn no_reading_makes_it_wrap() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(45);
    let extremes = [
        f64::MIN,
        -128.0,
        -20.0,
        -1.0,
        -1e-7,
        0.0,
        1e-7,
        1.0,
        20.0,
        127.9,
        f64::MAX,
    ];
    let heavy = Params {
        wheel_inertia_kg_m2: 0.5,
        bar_stiffness_nm_per_rad: 5.0,
        observer_bandwidth_rad_per_s: 400.0,
        ..AT_COLUMN
    };
    let light = Params {
        wheel_inertia_kg_m2: 0.005,
        wheel_damping_nm_s: 5.0,
        wheel_friction_nm: 5.0,
        torque_sensor: 2.0,
        ..heavy
    };
    let slow = Params {
        wheel_inertia_kg_m2: 0.005,
        column_period_s: 0.02,
        observer_bandwidth_rad_per_s: 5.0,
        ..AT_COLUMN
    };
    for mut of in [heavy, light, slow] {
        of.vehicle.column_damping_nm_s = 5.0;
        let (observer, mut state) = (observer(&of), State::NEW);
        for _ in 0..200_000 {
            let [bar, angle] = [(); 2].map(|()| match random.random_range(0..3) {
                0 => extremes[random.random_range(0..extremes.len())],
                1 => random.random_range(-128.0..128.0),
                _ => random.random_range(-1.0..1.0),
            });
            let angle = random.random_bool(0.7).then(|| Radians::from_rad(angle));
            let hands = observer.step(&mut state, Torque::from_nm(bar), angle);
            assert!(hands.nm().abs() <= 20.0);
        }
    }
}

#[test]
fn a_sensor_that_cannot_be_is_refused_by_name_value_and_range() {
    let refused = |of: &Params| {
        Config::new(of)
            .map(|_| ())
            .map_err(|error| error.to_string())
            .err()
    };
    for (sensor, says) in [
        (0.5, "torque_sensor = 0.5 is not a whole number from 0 to 2"),
        (3.0, "torque_sensor = 3 is not a whole number from 0 to 2"),
        (-1.0, "torque_sensor = -1 is not a whole number from 0 to 2"),
        (f64::NAN, "torque_sensor = NaN is not a whole number from 0 to 2"),
    ] {
        let of = Params {
            torque_sensor: sensor,
            ..Params::PAPER
        };
        assert_eq!(refused(&of).as_deref(), Some(says));
    }
    // 125 rad/s at 8 ms; B_w of B_s.
    let [samples, lower] =
        [(125.0, 0.008), (125.1, 0.008)].map(|(observer_bandwidth_rad_per_s, column_period_s)| Params {
            observer_bandwidth_rad_per_s,
            column_period_s,
            ..AT_COLUMN
        });
    assert_eq!(refused(&samples), None);
    let says = refused(&lower).unwrap();
    assert!(
        says.starts_with("observer_bandwidth_rad_per_s * column_period_s = 1.00")
            && says.ends_with("[0, 1] rad"),
        "{says}"
    );
    for (wheel_damping_nm_s, says) in [
        (0.5, None),
        (
            0.75,
            Some("vehicle.column_damping_nm_s - wheel_damping_nm_s = -0.25 is outside [0, 10] N.m.s/rad"),
        ),
    ] {
        let mut of = Params {
            wheel_damping_nm_s,
            ..AT_COLUMN
        };
        of.vehicle.column_damping_nm_s = 0.5;
        assert_eq!(refused(&of).as_deref(), says);
        // Without a bar neither counts.
        of.torque_sensor = 0.0;
        of.column_period_s = 0.02;
        assert_eq!(refused(&of), None);
        assert_eq!(Config::new(&of).unwrap().sensor(), Some(Sensor::Hands));
        assert_eq!(hands_lag_s(&of), 0.0);
    }
}
