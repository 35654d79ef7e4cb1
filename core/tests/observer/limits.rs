//! Every limit on both sides and from both sides, extremes, and what is refused.

use haptic_core::observer::{AngleAt, Limit, Observer, Parameters, Reading, Setup, State};
use haptic_core::quantity::{Radians, Torque};
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};

fn observer(of: &Parameters) -> Observer {
    Observer::new(Setup::new(of).unwrap())
}

fn at_wheel() -> Parameters {
    Parameters {
        angle_at: AngleAt::Wheel,
        friction_nm: 0.0,
        b_w: 0.0,
        ..Parameters::default()
    }
}

fn reading(bar_nm: f64, angle_rad: Option<f64>) -> Reading {
    Reading {
        bar_torque: Torque::from_nm(bar_nm),
        angle: angle_rad.map(Radians::from_rad),
    }
}

#[test]
fn a_jump_of_the_angle_begins_anew_and_a_smaller_one_does_not() {
    for side in [1.0, -1.0] {
        for (jump, limit) in [(0.999, Limit::None), (1.001, Limit::AngleJump)] {
            let slow = Parameters {
                bandwidth: 5.0,
                ..at_wheel()
            };
            let (observer, mut state) = (observer(&slow), State::default());
            for _ in 0..100 {
                let estimate = observer.step(&mut state, &reading(side * 2.0, Some(0.0)));
                assert_eq!(estimate.limit, Limit::None);
            }
            // The wheel of a bar that is pushed moves: by how much is read from an angle that fits.
            let mut still = State::default();
            let _ = observer.step(&mut still, &reading(0.0, Some(0.0)));
            let estimate = observer.step(&mut still, &reading(0.0, Some(side * jump)));
            assert_eq!(estimate.limit, limit, "{side} {jump}");
            if limit == Limit::AngleJump {
                assert_eq!((estimate.hands, estimate.rate.rad_per_s()), (Torque::ZERO, 0.0));
            }
        }
    }
}

/// The bar as the only known torque, before the first sample and at it, up to the most that hands can do.
#[test]
fn hands_are_held_within_what_they_can_do() {
    for side in [1.0, -1.0] {
        for (bar_nm, expected_nm, limit) in [(7.99, 7.99, Limit::None), (8.01, 8.0, Limit::Torque)] {
            let observer = observer(&Parameters {
                most_nm: 8.0,
                ..at_wheel()
            });
            assert_eq!(observer.setup().most(), 8.0);
            let estimate = observer.step(&mut State::default(), &reading(side * bar_nm, None));
            assert!(
                (estimate.hands.nm() - side * expected_nm).abs() < 1e-6,
                "{estimate:?}"
            );
            assert_eq!(estimate.limit, limit);
        }
    }
}

/// A free fall of the wheel: 30 N.m at 0.044 kg.m2 reach 100 rad/s in 147 ms, with no sample that says otherwise.
#[test]
fn the_rate_is_held_where_no_wheel_turns() {
    for side in [1.0, -1.0] {
        let (observer, mut state) = (observer(&at_wheel()), State::default());
        let _ = observer.step(&mut state, &reading(side * -30.0, Some(0.0)));
        let mut seen = Vec::new();
        for _ in 0..200 {
            // The hands' torque stays what the bar's was, -30 N.m; a bar of 0 leaves all of it to the wheel.
            let estimate = observer.step(&mut state, &reading(0.0, None));
            seen.push((estimate.rate.rad_per_s(), estimate.limit));
        }
        assert_eq!(seen[140].1, Limit::None);
        assert!((seen[199].0 + side * 100.0).abs() < 1e-3, "{:?}", seen[199]);
        assert_eq!(seen[199].1, Limit::Rate);
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
    let edges = [
        Parameters {
            j_w: 0.005,
            k_tb: 5.0,
            bandwidth: 400.0,
            b_w: 5.0,
            friction_nm: 5.0,
            most_nm: 100.0,
            ..at_wheel()
        },
        Parameters {
            j_w: 0.5,
            k_tb: 5.0,
            angle_at: AngleAt::Column,
            bandwidth: 400.0,
            most_nm: 100.0,
            ..at_wheel()
        },
        Parameters {
            j_w: 0.005,
            sample_ms: 20.0,
            bandwidth: 5.0,
            most_nm: 1.0,
            ..at_wheel()
        },
    ];
    for of in edges {
        let (observer, mut state) = (observer(&of), State::default());
        for _ in 0..200_000 {
            let [bar, angle] = [(); 2].map(|()| match random.random_range(0..3) {
                0 => extremes[random.random_range(0..extremes.len())],
                1 => random.random_range(-128.0..128.0),
                _ => random.random_range(-1.0..1.0),
            });
            let estimate = observer.step(
                &mut state,
                &reading(bar, random.random_bool(0.7).then_some(angle)),
            );
            assert!(
                estimate.hands.nm().abs() <= of.most_nm + 1e-6 && estimate.rate.rad_per_s().abs() <= 100.1
            );
        }
    }
}

#[test]
fn parameters_out_of_range_are_refused_by_name_value_and_range() {
    let standard = Parameters::default();
    for (of, words) in [
        (
            Parameters {
                j_w: 0.0049,
                ..standard
            },
            "j_w = 0.0049 is outside 0.005 to 0.5",
        ),
        (
            Parameters {
                k_tb: 1000.1,
                ..standard
            },
            "k_tb = 1000.1 is outside 5 to 1000",
        ),
        (
            Parameters {
                bandwidth: f64::NAN,
                ..standard
            },
            "bandwidth = NaN is outside 5 to 400",
        ),
        (
            Parameters {
                bandwidth: 126.0,
                sample_ms: 8.0,
                ..standard
            },
            "bandwidth = 126 is outside 5 to 125",
        ),
        (
            Parameters {
                b_w: -0.1,
                ..standard
            },
            "b_w = -0.1 is outside 0 to 5",
        ),
    ] {
        assert_eq!(Setup::new(&of).unwrap_err().to_string(), words);
    }
    for j_w in [0.005, 0.5] {
        assert!(Setup::new(&Parameters { j_w, ..standard }).is_ok());
    }
}
