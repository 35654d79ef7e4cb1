//! A driver torque that is stuck or frozen: a hand that turns the wheel against the guidance is soon free of it, and guidance does
//! not begin. The bounds are counted here, from the angles and times that the bench makes.

use haptic_core::safety::faults::Fault;
use haptic_core::safety::modes::Mode;

use crate::rig::Rig;

/// 8 deg and a count of the sensor, and 0.5 deg, rad.
const TURNED: f64 = 0.142;
const TURNED_WHEN_ASKED: f64 = 0.009;

/// Active in a curve in which the guidance carries everything and the driver torque has stuck at a value; by yaw rate and lane the
/// vehicle goes on, whatever the wheel does.
fn stuck(torque: f64, at: f64) -> Rig {
    let mut rig = Rig::paper();
    rig.curve(torque);
    rig.yaw_rate = Some(rig.lane.e_theta.rad() / 0.7);
    rig.run(600);
    rig.engage = true;
    rig.run(1500);
    rig.driver = Some(at);
    let last = rig.run(1500);
    assert_eq!(last.command.mode, Mode::Active);
    rig
}

/// Whatever the guidance asks for: 1 s after the hand began, or as soon as it has turned the wheel by 8 deg, the column is
/// implausible, and half a second later there is no torque. So long at most the hand holds against what the override would have
/// taken away.
#[test]
fn a_hand_is_free_of_the_guidance_soon_after_the_driver_torque_has_stuck() {
    for torque in [-1.3, -0.3, 0.4, 1.3] {
        for deg_per_s in [-60.0_f64, -9.0, 9.0, 30.0] {
            let mut rig = stuck(torque, 0.0);
            // The last change was long ago: the count begins anew every two seconds.
            let (mut turned, mut due_ms, mut free_ms) = (0.0_f64, None, None);
            for ms in 0..5000_u32 {
                rig.wheel += deg_per_s.to_radians() * 1e-3;
                turned += deg_per_s.to_radians().abs() * 1e-3;
                let step = rig.tick();
                if turned > TURNED && due_ms.is_none() {
                    due_ms = Some(ms);
                }
                if step.command.mode != Mode::Active && rig.applied == 0.0 {
                    assert!(step.command.faults.contains(Fault::ColumnImplausible));
                    free_ms = Some(ms);
                    break;
                }
            }
            // 8 deg may fall into two counts, and then 8 more are needed, within a second at least.
            let (due_ms, free_ms) = (due_ms.expect("it turns"), free_ms.expect("it is noticed"));
            let most = 2 * due_ms + 1000 + 500 + 20;
            println!("{torque} N.m, {deg_per_s} deg/s: free after {free_ms} ms");
            assert!(free_ms <= most, "{torque} {deg_per_s}: {free_ms} of {most} ms");
            // And it does not come back.
            rig.engage = false;
            rig.run(100);
            rig.engage = true;
            assert_eq!(rig.run(2000).command.mode, Mode::Standby);
        }
    }
}

/// A torque that moves by as little as the bus tells is alive.
#[test]
fn a_driver_torque_that_moves_is_believed_however_far_the_wheel_turns() {
    let mut rig = stuck(0.4, 0.0);
    let straight = rig.wheel;
    for ms in 0..6000_u32 {
        rig.driver = Some(f64::from(ms / 900 % 2) / 4096.0);
        // 10 deg to and fro, each way within two seconds.
        rig.wheel = straight + 0.09 * (f64::from(ms) * 0.5e-3 * std::f64::consts::PI).sin();
        let step = rig.tick();
        assert_eq!(step.command.mode, Mode::Active, "{ms} ms");
    }
}

#[test]
fn guidance_does_not_begin_while_the_driver_torque_is_still_and_the_wheel_turns() {
    for (deg_per_s, begins) in [(0.0_f64, true), (0.2, true), (1.0, false), (-1.0, false)] {
        let mut rig = Rig::paper();
        rig.yaw_rate = Some(0.0);
        rig.driver = Some(0.0);
        for _ in 0..3000 {
            rig.wheel += deg_per_s.to_radians() * 1e-3;
            rig.tick();
        }
        let turned = 2.0 * deg_per_s.to_radians().abs();
        rig.engage = true;
        let step = rig.run(50);
        assert_eq!(
            step.command.mode == Mode::Active,
            begins,
            "{turned} of {TURNED_WHEN_ASKED}"
        );
        assert_eq!(step.command.faults.contains(Fault::ColumnImplausible), !begins);
        // Once it moves, guidance begins on the next request.
        rig.engage = false;
        rig.driver = Some(0.01);
        rig.run(600);
        rig.engage = true;
        assert_eq!(rig.run(50).command.mode, Mode::Active);
    }
}

/// The probe moves the wheel by half a degree to and fro, and nothing of it is felt.
#[test]
fn a_driver_torque_that_does_not_answer_the_probe_is_found() {
    for (swings, answers, found) in [(0.6, false, true), (0.6, true, false), (0.4, false, false)] {
        let mut rig = stuck(0.3, 0.1);
        let straight = rig.wheel;
        rig.probe = true;
        let left = (0..4000_u32).find(|ms| {
            let phase = f64::from(*ms) * 1e-3 * 2.5 * std::f64::consts::TAU;
            rig.wheel = straight + 0.5 * f64::to_radians(swings) * phase.sin();
            rig.driver = Some(if answers { 0.1 + 0.002 * phase.sin() } else { 0.1 });
            rig.tick().command.mode != Mode::Active
        });
        assert_eq!(left.is_some(), found, "{swings} deg: {left:?}");
        assert!(left.is_none_or(|ms| (990..=1500).contains(&ms)), "{left:?}");
    }
}
