//! What a real road, a real camera and a driver without hands do to the ECU on the bench.

use crate::rig::Rig;
use haptic_core::bus::Reject;
use haptic_core::bus::messages::Message;
use haptic_core::lane::LaneSample;
use haptic_core::law::{EgoMotion, LawState};
use haptic_core::quantity::{Instant, Metres, Micros, Radians, Speed, TurningRate};
use haptic_core::safety::faults::Fault;
use haptic_core::safety::modes::Mode;
use haptic_core::safety::motion_history::MotionHistory;

const LANE: usize = 0;

/// Runs with the lane's sender at its own period and age; the bench's own is silent.
pub(crate) fn run_with_camera(rig: &mut Rig, counter: &mut u8, ms: u64, period_us: u64, age_us: u32) {
    rig.silent[LANE] = true;
    rig.lane.age = Micros::from_us(age_us);
    let start = rig.t_us;
    let mut pictures = 0;
    for _ in 0..ms {
        if rig.t_us - start >= pictures * period_us {
            pictures += 1;
            let frame = rig.lane.encode(*counter);
            *counter = counter.wrapping_add(1);
            let result = rig.send(&frame);
            rig.rejects.extend(result.err());
        }
        rig.tick();
    }
}

fn mode(rig: &Rig) -> Mode {
    // A step of no time changes nothing but counts: ask a copy.
    rig.clone().step().command.mode
}

#[test]
fn cameras_of_15_to_120_hz_and_150_ms_engage_and_stay() {
    for (hz, age_ms) in [
        (120, 0),
        (120, 25),
        (60, 50),
        (30, 100),
        (20, 120),
        (15, 150),
        (15, 50),
    ] {
        let (mut rig, mut counter) = (Rig::paper(), 0);
        rig.curve(0.6);
        let period = 1_000_000 / hz;
        run_with_camera(&mut rig, &mut counter, 900, period, age_ms * 1000);
        rig.engage = true;
        run_with_camera(&mut rig, &mut counter, 3000, period, age_ms * 1000);
        assert_eq!(mode(&rig), Mode::Active, "{hz} Hz, {age_ms} ms");
        assert!(
            (rig.applied - 0.6).abs() < 0.01,
            "{hz} Hz, {age_ms} ms: {} N.m",
            rig.applied
        );
        // Then silent: three of its periods, and 30 ms at least, from the last picture; guidance ends a second later.
        let (lost, _) = rig.run_until(300, |step| step.command.faults.contains(Fault::LaneTimeout));
        let (ms, step) = rig.run_until(1010, |step| step.command.mode == Mode::Handover);
        assert!(
            ms == 1000 && step.command.faults.contains(Fault::LaneTimeout),
            "{ms}"
        );
        let most = (3 * period / 1000).max(30) + 3;
        let least = most - 3 - period / 1000 - 4;
        assert!((least..=most).contains(&u64::from(lost)), "{hz} Hz: {lost} ms");
    }
}

/// A camera whose pictures come late and 2 to 40 ms apart: it is waited for as long as its gaps are
/// long, and when it falls silent, for three of them.
#[test]
fn a_camera_that_jitters_stays_and_its_silence_is_declared() {
    let (mut rig, mut counter) = (Rig::paper(), 0);
    rig.silent[LANE] = true;
    rig.curve(0.6);
    rig.lane.age = Micros::from_ms(20);
    let mut next_ms = 0;
    for ms in 0..4000_u32 {
        rig.engage = ms > 900;
        if ms >= next_ms {
            // Pictures close together, then a gap of 40 ms.
            next_ms = ms + [8, 3, 2, 40, 5, 8, 25][counter as usize % 7];
            let frame = rig.lane.encode(counter);
            counter = counter.wrapping_add(1);
            let result = rig.send(&frame);
            rig.rejects.extend(result.err());
        }
        rig.tick();
    }
    assert_eq!(mode(&rig), Mode::Active);
    let (lost, step) = rig.run_until(300, |step| step.command.faults.contains(Fault::LaneTimeout));
    assert_eq!(step.command.mode, Mode::Active);
    assert!((60..=121).contains(&lost), "{lost} ms");
}

#[test]
fn a_sample_that_is_older_than_150_ms_is_none() {
    for (age_us, engages) in [(150_000, true), (150_100, false)] {
        let (mut rig, mut counter) = (Rig::paper(), 0);
        run_with_camera(&mut rig, &mut counter, 900, 33_333, age_us);
        rig.engage = true;
        run_with_camera(&mut rig, &mut counter, 100, 33_333, age_us);
        assert_eq!(mode(&rig) == Mode::Active, engages, "{age_us} us");
        assert_eq!(rig.rejects.contains(&Reject::Older), !engages);
    }
}

#[test]
fn no_hand_is_warned_after_15_s_of_guidance_and_ends_it_after_30() {
    let mut rig = Rig::active_in_curve(0.5);
    rig.driver = Some(0.3);
    rig.run(20);
    let (ms, step) = rig.run_until(16_000, |step| step.command.warning);
    assert!((14_900..=15_001).contains(&ms), "{ms}");
    assert!(step.command.faults.contains(Fault::HandsOff) && step.command.mode == Mode::Active);
    assert!(
        step.others.iter().any(|frame| frame.id() == 0x0D0),
        "a warning frame at once"
    );
    // A hand, and all is well.
    let mut held = rig.clone();
    held.driver = Some(0.4);
    let step = held.run(10);
    assert!(!step.command.warning && step.command.mode == Mode::Active);
    let (ms, _) = rig.run_until(16_000, |step| step.command.mode == Mode::Fade);
    assert!((14_990..=15_001).contains(&ms), "{ms}");
    // Why it ends is told as long as it does.
    let step = rig.run(20);
    assert!(step.command.mode == Mode::Fade && step.command.warning);
    assert!(step.command.faults.contains(Fault::HandsOff));
    // 4 N.m/s, and nothing re-engages by itself.
    let (ms, _) = rig.run_until(200, |step| step.command.mode == Mode::Standby);
    assert!((80..=130).contains(&ms), "{ms}");
    assert_eq!(rig.run(2000).command.mode, Mode::Standby);
}

#[test]
fn a_hand_or_a_guidance_that_does_nothing_is_never_warned() {
    // A hand that answers by 0.1 N.m every 5 s.
    let mut rig = Rig::active_in_curve(0.5);
    for k in 0..12 {
        rig.driver = Some(if k % 2 == 0 { 0.45 } else { 0.55 });
        for _ in 0..5000 {
            assert!(!rig.tick().command.warning);
        }
    }
    // A steady hand in a steady bend: no sensor is off by half a newton metre.
    let mut rig = Rig::active_in_curve(0.5);
    rig.driver = Some(-0.5);
    for _ in 0..40_000 {
        assert!(!rig.tick().command.warning);
    }
    // A straight on which nothing is asked for, and one that is probed: a hand that follows the probe answers with nothing.
    let mut rig = Rig::active_in_curve(0.0);
    rig.driver = Some(0.0);
    rig.probe = true;
    for _ in 0..40_000 {
        assert!(!rig.tick().command.warning);
    }
    // A straight on which nothing is asked for.
    let mut rig = Rig::active_in_curve(0.0);
    rig.driver = Some(0.0);
    for _ in 0..40_000 {
        assert!(!rig.tick().command.warning);
    }
}

/// A vehicle that swings about a straight line by 20 mrad, in f64: what the law makes of samples that are 50 to 150 ms old
/// when they come, against equation (9) of the errors and rates of now.
#[test]
fn a_late_sample_is_made_up_for() {
    let law = haptic_core::controller::config::Config::PAPER.law().unwrap();
    let law = law.coefficients();
    for (hz, kmh, age_ms) in [
        (0.5, 60.0, 50),
        (0.5, 60.0, 100),
        (0.5, 100.0, 100),
        (0.5, 130.0, 150),
        (1.0, 60.0, 100),
        (1.0, 100.0, 100),
    ] {
        let v = kmh / 3.6;
        let omega = hz * std::f64::consts::TAU;
        // Heading, its rate, its rate's rate, and the way to the side.
        let psi = |t: f64| 0.02 * (omega * t).sin();
        let rate = |t: f64| 0.02 * omega * (omega * t).cos();
        let y = |t: f64| -0.02 * v / omega * (omega * t).cos();
        let errors = |t: f64| [-y(t) - 0.3 * v * psi(t), -psi(t)];
        let exact = |t: f64| {
            let [e_y, e_theta] = errors(t);
            let e_y_rate = -v * psi(t) - 0.3 * v * rate(t);
            0.25 * (2.0 * e_y + 0.05 * e_y_rate + 40.0 * e_theta - rate(t))
        };
        let clock = Instant::from_us(u32::MAX - 900_000);
        let mut motion_history = MotionHistory::new();
        let [mut late, mut plain] = [LawState::NEW; 2];
        let mut old = LaneSample::default();
        let [mut worst, mut worst_plain, mut most]: [f64; 3] = [0.0; 3];
        for ms in 0..6000_u32 {
            let (t, now) = (f64::from(ms) * 1e-3, clock.after(Micros::from_ms(ms)));
            if ms % 10 == 0 {
                motion_history.record_turning_rate(now, TurningRate::from_rad_per_s(rate(t)));
            }
            if ms % 33 == 0 && ms >= age_ms {
                let [e_y, e_theta] = errors(t - f64::from(age_ms) * 1e-3);
                old = LaneSample {
                    e_y: Metres::from_m(e_y),
                    e_theta: Radians::from_rad(e_theta),
                    at: clock.after(Micros::from_ms(ms - age_ms)),
                };
            }
            let without = law.step(&mut plain, now, old, &EgoMotion::STEADY).nm();
            // What the controller makes of the past.
            let (turned, then) = motion_history.turned(now, old.at);
            let age_s = f64::from(now.since(old.at).us()) * 1e-6;
            let since = EgoMotion::new(
                Radians::from_rad(turned.rad() - then.rad_per_s() * age_s),
                TurningRate::from_rad_per_s(rate(t) - then.rad_per_s()),
                Speed::from_m_per_s(v),
                Metres::from_m(0.3 * v),
            );
            let with = law.step(&mut late, now, old, &since).nm();
            if ms > 1000 {
                most = most.max(exact(t).abs());
                worst = worst.max((with - exact(t)).abs());
                worst_plain = worst_plain.max((without - exact(t)).abs());
            }
        }
        println!(
            "{hz} Hz, {kmh} km/h, {age_ms} ms old at 30 Hz: {worst:.3} N.m off of {most:.3}, by its rates alone {worst_plain:.3}"
        );
        assert!(
            worst < 0.25 * worst_plain,
            "{hz} {kmh} {age_ms}: {worst} {worst_plain}"
        );
    }
}

/// A camera 100 ms late sees a straight road while the vehicle begins to turn to the left at 0.1 rad/s. After 100 ms it points
/// 0.01 rad away from what the picture says, so that the near point, 5 m ahead, lies 0.05 m aside and the vehicle itself 0.008 m.
/// By K_1 times a1' to a4': -0.029 N.m, -0.008 N.m (0.67 m/s), -0.1 N.m and -0.025 N.m.
#[test]
fn what_a_late_camera_did_not_see_yet_is_made_up_for() {
    for do_speeds_differ in [false, true] {
        let mut rig = Rig::paper();
        rig.lane.age = Micros::from_ms(100);
        rig.yaw_rate = Some(0.0);
        rig.run(600);
        rig.engage = true;
        rig.run(1000);
        if do_speeds_differ {
            // By 2.7 m/s: the last on which they agreed is gone on with, for 0.3 s.
            for _ in 0..3 {
                rig.speeds[1] += 0.9;
                rig.run(10);
            }
        }
        assert_eq!((mode(&rig), rig.applied), (Mode::Active, 0.0));
        rig.turn(0.1);
        // A sensor that is alive moves by its last bit.
        rig.driver = Some(1.0 / 4096.0);
        rig.run(100);
        assert_eq!(mode(&rig), Mode::Active);
        // Half of a period of the vehicle's message, 5 ms, is 2.5 % of it.
        assert!((rig.applied + 0.162).abs() < 0.005, "{} N.m", rig.applied);
    }
}

/// Whoever asks for guidance is there: 15 s without a hand are counted from then.
#[test]
fn hands_begin_anew_with_guidance() {
    let mut rig = Rig::active_in_curve(0.5);
    rig.driver = Some(0.3);
    rig.run(20);
    assert!(!rig.run(14_000).command.warning);
    rig.engage = false;
    rig.run_until(500, |step| step.command.mode == Mode::Standby);
    rig.run(600);
    rig.engage = true;
    let (ms, _) = rig.run_until(16_000, |step| step.command.warning);
    assert!((14_900..=15_100).contains(&ms), "{ms}");
}
