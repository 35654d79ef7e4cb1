//! A yaw rate that lies, beside honest senders: it is left out, and the lane is not blamed.
//!
//! The bench drives at 60 km/h; table 9's vehicle turns by 0.1 rad/s where its wheel stands at 0.4 rad.

use crate::rig::{Rig, SPEED};
use haptic_core::quantity::{Metres, Radians};
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;

const YAW_RATE: FaultSet = FaultSet::NONE.with(Fault::YawRate);

/// In Active in a bend that the vehicle follows at `rate`, rad/s.
fn in_bend(rate: f64) -> Rig {
    let mut rig = Rig::paper();
    rig.turn(rate);
    (rig.lane.e_y, rig.lane.e_theta) = (Metres::ZERO, Radians::from_rad(0.7 * rate));
    // What table 9's column feels of its tyres.
    rig.aligning = 0.987_4 * SPEED * rate;
    rig.run(600);
    rig.engage = true;
    let step = rig.run(2000);
    assert_eq!(
        (step.command.mode, step.command.faults),
        (Mode::Active, FaultSet::NONE)
    );
    rig
}

/// When YawRate comes, ms; nothing else may. `None` if it does not within 5 s. The pictures have noise: one that comes again is
/// no witness.
fn declared(rig: &mut Rig) -> Option<u32> {
    let e_theta = rig.lane.e_theta.rad();
    (1..=5000).find(|ms| {
        rig.lane.e_theta = Radians::from_rad(e_theta + f64::from(ms % 7) * 2e-5);
        let step = rig.tick();
        assert_eq!(step.command.mode, Mode::Active, "{:?}", step.command.faults);
        assert!(
            YAW_RATE.union(step.command.faults) == YAW_RATE,
            "{:?}",
            step.command.faults
        );
        step.command.faults == YAW_RATE
    })
}

/// Who sends no yaw rate any more does not lie. What was distrusted, for 13 m/s2 to the side, stays so until it has agreed for
/// 3 s, and no time without it counts.
#[test]
fn a_yaw_rate_that_is_not_sent_is_no_fault() {
    for sign in [1.0, -1.0] {
        let mut rig = in_bend(0.0);
        rig.yaw_rate = Some(0.8 * sign);
        assert_eq!(rig.run(500).command.faults, YAW_RATE);
        rig.yaw_rate = None;
        rig.run(50);
        for _ in 0..4000 {
            let step = rig.tick();
            assert_eq!(
                (step.command.mode, step.command.faults),
                (Mode::Active, FaultSet::NONE)
            );
        }
        rig.yaw_rate = Some(0.0);
        assert_eq!(rig.run(2900).command.faults, YAW_RATE);
        assert_eq!(rig.run(200).command.faults, FaultSet::NONE);
    }
}

/// In a bend of 0.1 rad/s: what is too much by `d` sums up to `d*(1 - exp(-t))`, beyond 0.03 and a quarter of the larger rate.
/// The lane would be blamed sooner: 0.7*v*d*(1 - exp(-t)) m beyond 0.8 m, or 0.4 m missing. And not so soon where the line is
/// not known yet.
#[test]
fn what_wheel_and_speed_deny_is_not_believed_and_the_lane_not_blamed() {
    for (wrong, most_ms) in [(0.0, 1000), (-0.1, 600), (0.2, 1000), (0.04, 1500)] {
        let mut rig = in_bend(0.1);
        rig.yaw_rate = Some(wrong);
        let ms = declared(&mut rig).unwrap_or(u32::MAX);
        assert!((100..=most_ms).contains(&ms), "{wrong}: {ms} ms");
        // Guidance goes on for as long as it lasts, and the fault ends 3 s after it.
        for _ in 0..20 {
            assert_eq!(rig.run(500).command.faults, YAW_RATE, "{wrong}");
        }
        rig.turn(0.1);
        let (ms, _) = rig.run_until(8000, |step| step.command.faults == FaultSet::NONE);
        assert!((3000..=6000).contains(&ms), "{wrong}: back after {ms} ms");
    }
}

/// An offset of its zero, a bank or a wheel that is mounted askew stays below 30 mrad and is learnt.
#[test]
fn what_differs_by_a_constant_is_learnt() {
    for by in [0.02, -0.02] {
        let mut rig = in_bend(0.0);
        // The lane check learns 0.15 m/s of it within 16 s; here nothing of the lane contradicts the offset.
        rig.engage = true;
        rig.wheel = by * 17.0 * 2.635 * (1.0 + 0.001_752_9 * SPEED * SPEED) / SPEED;
        rig.aligning = 0.0;
        rig.driver = Some(0.0);
        assert_eq!(declared(&mut rig), None, "{by}");
    }
}

/// A wheel that stands askew by 0.03 rad/s is learnt in 90 s, up to 0.025 rad/s and no further: of a rate `r` that it then stands
/// for, `r - 0.025` sums up, and it is too much beyond 0.03 and a quarter of `r`. So from 0.0733 rad/s on.
#[test]
fn no_more_than_25_mrad_a_second_is_learnt() {
    for sign in [1.0, -1.0] {
        let mut learnt = in_bend(0.0);
        learnt.turn(0.03 * sign);
        (learnt.yaw_rate, learnt.driver) = (Some(0.0), Some(0.0));
        assert_eq!(learnt.run(90_000).command.faults, FaultSet::NONE);
        for (rate, is_declared) in [(0.071, false), (0.077, true)] {
            let mut rig = learnt.clone();
            rig.turn(rate * sign);
            rig.yaw_rate = Some(0.0);
            assert_eq!(declared(&mut rig).is_some(), is_declared, "{rate}");
        }
    }
}

/// Wheel and speed deny a rate up to 3 m/s2 aside, 0.18 rad/s at 60 km/h.
#[test]
fn what_is_wrong_in_a_bend_of_almost_3_m_per_s2_is_denied_too() {
    for sign in [1.0, -1.0] {
        for wrong in [0.07, 0.27] {
            let mut rig = in_bend(0.17 * sign);
            rig.yaw_rate = Some(wrong * sign);
            let ms = declared(&mut rig);
            assert!(ms.is_some_and(|ms| (100..=1500).contains(&ms)), "{wrong}: {ms:?}");
        }
    }
}

/// Impossible for 0.1 s: left out; for longer: not believed. A step of 0.15 rad/s, or 12 m/s2 to the side: 0.72 rad/s.
#[test]
fn what_no_vehicle_has_is_left_out_and_then_not_believed() {
    for rate in [0.2, -0.2, 0.75, 1.9] {
        for (ms, is_declared) in [(20, false), (90, false), (130, true)] {
            let mut rig = in_bend(0.0);
            rig.yaw_rate = Some(rate);
            let step = rig.run(ms);
            rig.yaw_rate = Some(0.0);
            assert_eq!(step.command.faults == YAW_RATE, is_declared, "{rate}, {ms} ms");
            assert_eq!(rig.run(100).command.mode, Mode::Active);
            assert_eq!(rig.applied, 0.0);
        }
    }
}

/// A yaw rate that grows by 0.1 rad/s in each message steps over nothing: it is left out from 12 m/s2 aside on, 0.72 rad/s at 60 km/h.
/// The wheel follows, so that nothing else denies it.
#[test]
fn twelve_m_per_s2_aside_are_the_most() {
    for sign in [1.0, -1.0] {
        for (rate, is_declared) in [(0.7, false), (0.75, true)] {
            let mut rig = in_bend(0.0);
            for step in 1..=8 {
                rig.turn(sign * f64::min(0.1 * f64::from(step), rate));
                rig.run(10);
            }
            let step = rig.run(130);
            assert_eq!(
                step.command.faults.contains(Fault::YawRate),
                is_declared,
                "{rate}"
            );
        }
    }
}
