//! Every limit of the envelope one step below, at, and one step above its bound, in its own resolution of
//! 2^-24 N.m, on both sides and around zero; and random sequences against bounds computed in f64.

use haptic_core::controller::config::Config;
use haptic_core::controller::params::Params;
use haptic_core::quantity::{Instant, Micros, Torque};
use haptic_core::safety::envelope::{Envelope, EnvelopeState, LimitReason, Situation, WINDOW, Yielding};
use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};

/// The resolution of a torque, N.m.
const LSB: f64 = 1.0 / 16_777_216.0;
/// A rate's bound is right to 3 LSB, 0.2 uN.m: 8e-6 of at most 16 mN.m, and one rounding.
const RATE_ERROR: f64 = 3.0 * LSB;
const MS: u32 = 1000;

fn envelope(limit_nm: f64) -> Envelope {
    let params = Params {
        torque_limit_nm: limit_nm,
        ..Params::PAPER
    };
    Config::new(&params).unwrap().envelope
}

/// The nearest torque that there is.
fn near(nm: f64) -> f64 {
    Torque::from_nm(nm).nm()
}

/// One question to the envelope.
#[derive(Clone, Copy)]
struct Case {
    anchor: f64,
    applied: f64,
    elapsed_us: u32,
    driver: f64,
    distrusted: bool,
}

impl Case {
    /// Quiet but for the torque applied, which is the window's anchor too.
    fn at(applied: f64) -> Self {
        let applied = near(applied);
        Self {
            anchor: applied,
            applied,
            elapsed_us: MS,
            driver: 0.0,
            distrusted: false,
        }
    }

    fn mirrored(self) -> Self {
        Self {
            anchor: -self.anchor,
            applied: -self.applied,
            driver: -self.driver,
            ..self
        }
    }

    fn ask(&self, envelope: &Envelope, wanted: f64) -> (f64, LimitReason) {
        let start = Instant::from_us(u32::MAX - 250_000);
        let mut state = EnvelopeState::new(start);
        let mut step = |now: Instant, wanted: f64, applied: f64| {
            let at = Situation {
                applied: Torque::from_nm(applied),
                elapsed: Micros::from_us(self.elapsed_us),
                driver: Torque::from_nm(self.driver),
                yielding: Yielding::AtOnce,
            };
            let envelope = if self.distrusted {
                &envelope.distrusted()
            } else {
                envelope
            };
            envelope.step(&mut state, now, Torque::from_nm(wanted), &at)
        };
        // The first step sets the anchor, the second, across the wrap of the clock, is the question.
        let _ = step(start.after(WINDOW), self.anchor, self.anchor);
        let (torque, reason) = step(
            start.after(WINDOW).after(Micros::from_ms(1)),
            wanted,
            self.applied,
        );
        (torque.nm(), reason)
    }

    /// Asks one LSB inside, at, and one LSB outside `bound`, and the same mirrored.
    fn check(&self, envelope: &Envelope, bound: f64, outward: f64, reason: LimitReason) {
        for (case, sign) in [(*self, 1.0), (self.mirrored(), -1.0)] {
            let ask = |steps: f64| case.ask(envelope, sign * (bound + steps * outward * LSB));
            let expect = |steps: f64| sign * (bound + steps * outward * LSB);
            assert_eq!(ask(-1.0), (expect(-1.0), LimitReason::None), "{reason:?} L-1");
            assert_eq!(ask(0.0), (expect(0.0), LimitReason::None), "{reason:?} L");
            assert_eq!(ask(1.0), (expect(0.0), reason), "{reason:?} L+1");
        }
    }

    /// The bound itself, from a wanted torque far beyond it, checked against `expected` and then at L-1, L, L+1.
    fn check_rate(&self, envelope: &Envelope, expected: f64, outward: f64, reason: LimitReason) {
        let far = if reason == LimitReason::Reduction {
            0.0
        } else {
            outward * 4.9
        };
        let (bound, got) = self.ask(envelope, far);
        assert_eq!(got, reason);
        // The error is a share of the rate.
        let error = if self.distrusted {
            4.0 * RATE_ERROR
        } else {
            RATE_ERROR
        };
        assert!((bound - expected).abs() <= error, "{bound} is not {expected}");
        self.check(envelope, bound, outward, reason);
    }
}

#[test]
fn absolute() {
    for limit in [5.0, 3.0, 0.1] {
        let limit_nm = near(limit);
        let near = Case::at(limit_nm - 0.001);
        near.check(&envelope(limit), limit_nm, 1.0, LimitReason::Absolute);
        assert_eq!(
            Case::at(limit_nm).ask(&envelope(limit), 127.0),
            (limit_nm, LimitReason::Absolute)
        );
    }
}

#[test]
fn wind_up() {
    for applied in [0.0, LSB, 2.0 * LSB, 0.25, 4.0] {
        for (elapsed_us, growth) in [(500, 0.002), (1000, 0.004), (1234, 0.004_936), (2000, 0.008)] {
            let case = Case {
                elapsed_us,
                ..Case::at(applied)
            };
            case.check_rate(&envelope(5.0), applied + growth, 1.0, LimitReason::WindUp);
        }
    }
}

#[test]
fn reduction() {
    // The guidance frame rounds toward zero, by less than its LSB of 2^-12 N.m: that much is kept back.
    const ROUNDING: f64 = 1.0 / 4096.0;
    for applied in [0.1, 1.0, 4.0] {
        for (elapsed_us, fall) in [(500, 0.004), (1000, 0.008), (2000, 0.016)] {
            for (distrusted, times) in [(false, 1.0), (true, 4.0)] {
                let case = Case {
                    elapsed_us,
                    distrusted,
                    ..Case::at(applied)
                };
                case.check_rate(
                    &envelope(5.0),
                    applied - times * fall + ROUNDING,
                    -1.0,
                    LimitReason::Reduction,
                );
            }
        }
    }
}

#[test]
fn across_zero_the_old_torque_falls_and_the_new_one_winds_up() {
    let envelope = envelope(5.0);
    // What 8 N.m/s takes away in a millisecond, to the LSB.
    let fall = 1.0 - Case::at(1.0).ask(&envelope, 0.0).0;
    for applied in [0.0, LSB, 0.004, fall - LSB, fall] {
        Case::at(applied).check_rate(&envelope, -0.004, -1.0, LimitReason::WindUp);
        Case::at(applied).check(&envelope, 0.0, 0.0, LimitReason::None);
    }
    // One LSB more than can fall in a step: what is left keeps its sign.
    Case::at(fall + LSB).check(&envelope, LSB, -1.0, LimitReason::Reduction);
}

#[test]
fn no_time_no_change_and_a_late_step_earns_no_more_than_two_ticks() {
    let envelope = envelope(5.0);
    let ask = |elapsed_us, wanted| {
        let case = Case {
            elapsed_us,
            ..Case::at(1.0)
        };
        case.ask(&envelope, wanted)
    };
    assert_eq!(ask(0, 2.0), (1.0, LimitReason::WindUp));
    assert_eq!(ask(0, 0.5), (1.0, LimitReason::Reduction));
    for late in [2001, 5 * MS, 500 * MS, u32::MAX] {
        assert_eq!(ask(late, 2.0), ask(2000, 2.0), "{late}");
        assert_eq!(ask(late, 0.5), ask(2000, 0.5), "{late}");
    }
    assert!((ask(u32::MAX, 2.0).0 - 1.008).abs() <= RATE_ERROR);
}

#[test]
fn window() {
    // The wind-up limit alone allows 1.0 N.m in 250 ms: the window acts when elapsed times and clock disagree.
    let window = near(1.2);
    for anchor in [0.0, LSB, 1.0, near(3.7)] {
        let case = Case {
            anchor,
            applied: anchor + window - near(0.001),
            elapsed_us: MS,
            driver: 0.0,
            distrusted: false,
        };
        case.check(&envelope(5.0), anchor + window, 1.0, LimitReason::Window);
        // The magnitude counts, not the sign of the anchor.
        let other_side = Case {
            applied: -case.applied,
            ..case
        };
        other_side.check(&envelope(5.0), -(anchor + window), -1.0, LimitReason::Window);
    }
}

#[test]
fn the_anchor_moves_every_250_ms_to_the_torque_applied() {
    let envelope = envelope(5.0);
    let window = near(1.2);
    for start_us in [0, u32::MAX - 100_000] {
        let start = Instant::from_us(start_us);
        let mut state = EnvelopeState::new(start);
        let mut ask = |after_us: u32, applied: f64| {
            let at = Situation {
                applied: Torque::from_nm(applied),
                elapsed: Micros::from_ms(1),
                driver: Torque::ZERO,
                yielding: Yielding::AtOnce,
            };
            let now = start.after(Micros::from_us(after_us));
            let (torque, reason) = envelope.step(&mut state, now, Torque::MAX, &at);
            (torque.nm(), reason)
        };
        // Anchor 0 until 250 ms have passed, to the microsecond; then the torque applied at that moment.
        assert_eq!(ask(0, window), (window, LimitReason::Window));
        assert_eq!(ask(249_999, window), (window, LimitReason::Window));
        assert_eq!(ask(250_000, window).1, LimitReason::WindUp);
        assert_eq!(ask(499_999, 2.0 * window), (2.0 * window, LimitReason::Window));
        assert_eq!(ask(500_000, 1.0).1, LimitReason::WindUp);
        assert_eq!(ask(500_001, 1.0 + window), (1.0 + window, LimitReason::Window));
    }
}

/// `clamp(L + 3*(T_d + 0.8), 0, L)` and `-clamp(L + 3*(0.8 - T_d), 0, L)`, as controller documents give them.
fn override_bounds(limit: f64, driver: f64) -> (f64, f64) {
    let from = near(0.8);
    (
        -(limit + 3.0 * (from - driver)).clamp(0.0, limit),
        (limit + 3.0 * (driver + from)).clamp(0.0, limit),
    )
}

#[test]
fn driver_override() {
    for limit in [5.0, 3.0] {
        let envelope = envelope(limit);
        for driver in [-0.81, -1.0, -1.5, -1.79, -2.0, -2.4, -2.46] {
            let driver = near(driver);
            let (_, high) = override_bounds(limit, driver);
            // The torque applied stands at the bound; a bound of zero has its own test below.
            if high > 0.0 {
                let case = Case {
                    driver,
                    ..Case::at(high)
                };
                case.check(&envelope, high, 1.0, LimitReason::DriverOverride);
            }
        }
    }
}

#[test]
fn the_hand_values_of_the_override() {
    let ask = |driver: f64, wanted: f64| {
        let case = Case {
            driver,
            ..Case::at(wanted)
        };
        case.ask(&envelope(5.0), wanted)
    };
    // Opposing torque, and what is left of 5 N.m: 0.80 nothing lost, 0.81 three hundredths, 2.47 and more all.
    for (opposing, left) in [
        (0.80, 5.0),
        (0.81, 4.97),
        (1.8, 2.0),
        (2.47, 0.0),
        (10.0, 0.0),
        (128.0, 0.0),
    ] {
        for sign in [1.0, -1.0] {
            let (torque, reason) = ask(-sign * opposing, sign * 5.0);
            // Two inputs rounded to an LSB, times the slope.
            assert!((torque - sign * left).abs() <= 6.0 * LSB, "{opposing}: {torque}");
            assert_eq!(
                reason == LimitReason::DriverOverride,
                opposing > 0.8,
                "{opposing}"
            );
            // A driver who helps is not opposed.
            assert_eq!(ask(sign * opposing, sign * 5.0), (sign * 5.0, LimitReason::None));
        }
    }
    // At once: no reduction limit applies to the driver's hand.
    assert_eq!(ask(-10.0, 5.0), (0.0, LimitReason::DriverOverride));
    // With no torque there is nothing to take away, and none may begin.
    let idle = Case {
        driver: -10.0,
        ..Case::at(0.0)
    };
    assert_eq!(idle.ask(&envelope(5.0), 0.0), (0.0, LimitReason::None));
    assert_eq!(idle.ask(&envelope(5.0), LSB), (0.0, LimitReason::DriverOverride));
}

#[test]
fn every_code_has_its_reason_and_no_other() {
    let reasons: Vec<_> = (-1..=9).map(LimitReason::from_code).collect();
    use LimitReason::{Absolute, DriverOverride, Mode, Monitor, None as Nothing, Reduction, WindUp, Window};
    let expected = [
        Nothing,
        Absolute,
        Window,
        WindUp,
        Reduction,
        DriverOverride,
        Mode,
        Monitor,
    ];
    assert_eq!(reasons[0], None);
    assert_eq!(reasons[1..9], expected.map(Some));
    assert_eq!(reasons[9..], [None, None]);
}

/// The envelope of the header of `envelope.rs`, in f64 and with an anchor of its own.
struct Reference {
    limit: f64,
    anchor: f64,
    anchor_at_us: u64,
}

impl Reference {
    /// The bounds of the next torque.
    fn bounds(&mut self, now_us: u64, applied: f64, elapsed_us: u32, driver: f64) -> (f64, f64) {
        if now_us - self.anchor_at_us >= 250_000 {
            (self.anchor, self.anchor_at_us) = (applied, now_us);
        }
        let dt = f64::from(elapsed_us.min(2000)) * 1e-6;
        // What rounding to the bus may take away is kept back from the fall.
        let (growth, fall) = (4.0 * dt, (8.0 * dt - 1.0 / 4096.0).max(0.0));
        let size = applied.abs();
        let high = size + growth;
        let low = if size > fall { size - fall } else { -growth };
        let (low, high) = if applied < 0.0 { (-high, -low) } else { (low, high) };
        let window = self.anchor.abs() + 1.2;
        let (left, right) = override_bounds(self.limit, driver);
        let bound = |x: f64| x.clamp(-window, window).clamp(low, high).clamp(left, right);
        (bound(-self.limit), bound(self.limit))
    }
}

#[test]
fn random_sequences_stay_inside_the_f64_bounds_and_reach_them() {
    let mut rng = SmallRng::seed_from_u64(3);
    let mut reached = [0; 8];
    for _ in 0..400 {
        let limit = [5.0, 3.0, 1.0][rng.random_range(0..3)];
        let envelope = envelope(limit);
        let mut now_us = u64::from(u32::MAX) - 500_000;
        let mut state = EnvelopeState::new(Instant::from_us(now_us as u32));
        let mut reference = Reference {
            limit,
            anchor: 0.0,
            anchor_at_us: now_us,
        };
        let (mut applied, mut driver) = (Torque::ZERO, 0.0_f64);
        let mut wanted = 0.0_f64;
        for _ in 0..2000 {
            let tick_us = if rng.random_bool(0.9) {
                1000
            } else {
                rng.random_range(0..8000)
            };
            now_us += tick_us;
            // A caller whose elapsed times run fast is what the window is for.
            let elapsed_us = (tick_us as u32) * rng.random_range(1..3);
            if rng.random_bool(0.02) {
                wanted = rng.random_range(-8.0..8.0);
            }
            if rng.random_bool(0.01) {
                driver = rng.random_range(-3.0..3.0);
            }
            let driver_nm = Torque::from_nm(driver);
            let at = Situation {
                applied,
                elapsed: Micros::from_us(elapsed_us),
                driver: driver_nm,
                yielding: Yielding::AtOnce,
            };
            let now = Instant::from_us(now_us as u32);
            let (torque, reason) = envelope.step(&mut state, now, Torque::from_nm(wanted), &at);
            let (low, high) = reference.bounds(now_us, applied.nm(), elapsed_us, driver_nm.nm());
            let slack = 4.0 * LSB;
            // On the kink between falling and crossing zero a rate's own error decides.
            let fall = (8.0 * f64::from(elapsed_us.min(2000)) * 1e-6 - 1.0 / 4096.0).max(0.0);
            if (applied.nm().abs() - fall).abs() <= RATE_ERROR {
                applied = torque;
                continue;
            }
            assert!(
                torque.nm() >= low - slack && torque.nm() <= high + slack,
                "{} outside {low}..{high} ({reason:?})",
                torque.nm()
            );
            // Nothing is taken that no bound takes.
            let expected = wanted.clamp(low, high);
            assert!(
                (torque.nm() - expected).abs() <= slack,
                "{} for {expected}",
                torque.nm()
            );
            reached[reason as usize] += 1;
            applied = torque;
        }
    }
    println!("steps by reason: {reached:?}");
    assert!(reached[..6].iter().all(|count| *count > 50), "{reached:?}");
}

/// By hand: a hand of 10 N.m leaves nothing of 4 N.m, at 64 N.m/s; a step of 5 ms counts as 2 ms. Less an LSB of the bus.
#[test]
fn an_estimated_hand_is_yielded_to_at_64_nm_per_s() {
    let lsb = 1.0 / 4096.0;
    for sign in [1.0, -1.0] {
        for (applied, elapsed_us, opposing, left) in [
            (4.0, 1000, 10.0, 3.936 + lsb),
            (4.0, 5000, 10.0, 3.872 + lsb),
            (0.05, 1000, 10.0, 0.0),
            // 5 - 3*(1.15 - 0.8) is 3.95, which is less than a step away; 0.7 N.m is no override.
            (4.0, 1000, 1.15, 3.95),
            (4.0, 1000, 0.7, 4.0),
        ] {
            let start = Instant::from_us(0);
            let at = Situation {
                applied: Torque::from_nm(sign * applied),
                elapsed: Micros::from_us(elapsed_us),
                driver: Torque::from_nm(-sign * opposing),
                yielding: Yielding::Gradually,
            };
            let mut state = EnvelopeState::new(start);
            let now = start.after(WINDOW);
            let (torque, reason) = envelope(5.0).step(&mut state, now, at.applied, &at);
            let off = torque.nm() - sign * left;
            assert!(off.abs() < 1e-5, "{applied} {opposing}: {}", torque.nm());
            let expected = if opposing < 0.8 {
                LimitReason::None
            } else {
                LimitReason::DriverOverride
            };
            assert_eq!(reason, expected);
        }
    }
}
