//! What the receivers let pass, and for how long a silent sender is waited for: three of its periods
//! (`docs/explanation/plausibility.md`).
//!
//! The period is the longest time between two messages lately. It grows at once and falls by a sixty-fourth of the way with
//! each message; it is no less than 10 ms and no more than the slowest sender's. The expected times are worked out here in
//! milliseconds and f64.

use crate::rig::Rig;
use haptic_core::bus::Reject;
use haptic_core::bus::messages::Message;
use haptic_core::ecu::Step;
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;

const LANE: usize = 0;
const COLUMN: usize = 1;
const VEHICLE: usize = 2;
const REQUEST: usize = 3;
/// What the slowest camera has, ms: 15 pictures a second.
const SLOWEST_MS: f64 = 1000.0 / 15.0;

/// Pictures with these times between them, ms, and then no more: for how long the ECU waits after the last, ms.
fn waits(gaps_ms: &[u32]) -> u32 {
    let mut rig = Rig::paper();
    rig.silent[LANE] = true;
    let mut is_heard = false;
    let lost = |step: &Step| step.command.faults.contains(Fault::LaneTimeout);
    // The third intact frame is the first that is taken.
    let gaps = [&[8; 3], gaps_ms].concat();
    for (counter, gap) in (0_u8..16).cycle().zip(&gaps) {
        for _ in 1..*gap {
            let is_lost = lost(&rig.tick());
            assert!(!is_lost || !is_heard, "{gaps_ms:?}: lost within {gap} ms");
        }
        let frame = rig.lane.encode(counter);
        is_heard = rig.send(&frame).is_ok();
        rig.tick();
    }
    assert!(is_heard);
    // The last was heard one step ago.
    rig.run_until(300, lost).0 + 1
}

/// The first step after three periods.
fn expected(period_ms: f64) -> u32 {
    (3.0 * period_ms).floor() as u32 + 1
}

#[test]
fn a_camera_is_waited_for_as_long_as_its_pictures_are_apart() {
    // One picture says nothing: the slowest camera's.
    assert_eq!(waits(&[]), expected(SLOWEST_MS));
    // Two say how far apart they are, but no less than a quarter of the slowest.
    for gap in [20, 33, 50, 66] {
        assert_eq!(waits(&[gap]), expected(f64::from(gap)), "{gap} ms");
        assert_eq!(waits(&[gap; 5]), expected(f64::from(gap)), "{gap} ms");
    }
    // Cut to whole microseconds.
    assert_eq!(waits(&[8]), expected((1e3 * SLOWEST_MS / 4.0).floor() / 1e3));
}

#[test]
fn a_period_grows_at_once_and_falls_slowly() {
    let after = |longest: f64, gap: f64, times: i32| gap + (longest - gap) * (63.0_f64 / 64.0).powi(times);
    let mut gaps = vec![20; 10];
    gaps.push(50);
    assert_eq!(waits(&gaps), expected(50.0));
    for times in [1, 20, 200] {
        let gaps = [&gaps[..], &vec![20; times]].concat();
        assert_eq!(waits(&gaps), expected(after(50.0, 20.0, times as i32)), "{times}");
    }
    // A quick camera is waited for 30 ms.
    assert_eq!(waits(&[8; 400]), 31);
    // Longer than the slowest's is the slowest's, and the next two say how far apart they are.
    let gaps = [&[50; 5][..], &[140]].concat();
    assert_eq!(waits(&gaps), expected(SLOWEST_MS));
    assert_eq!(waits(&[&gaps[..], &[30]].concat()), expected(30.0));
}

/// A column is waited for by three periods of 20 ms at most, the vehicle's own messages by three of 25 ms, however far apart they come.
/// Those between are lost.
#[test]
fn slower_senders_are_waited_for_as_long_as_the_slowest() {
    for (sender, fault, gap, wait_ms) in [
        (COLUMN, Fault::ColumnTimeout, 16, 48),
        (COLUMN, Fault::ColumnTimeout, 24, 60),
        (VEHICLE, Fault::SpeedTimeout, 20, 60),
        (VEHICLE, Fault::SpeedTimeout, 30, 75),
        (REQUEST, Fault::RequestTimeout, 20, 60),
        (REQUEST, Fault::RequestTimeout, 30, 75),
    ] {
        let mut rig = Rig::active_in_curve(1.0);
        let mut since = 0;
        for _ in 0..20 * gap {
            rig.silent[sender] = !rig.ticks.is_multiple_of(gap);
            since = if rig.silent[sender] { since + 1 } else { 0 };
            assert!(!rig.tick().command.faults.contains(fault), "{fault:?} {gap}");
        }
        rig.silent[sender] = true;
        let (ms, _) = rig.run_until(100, |step| step.command.faults.contains(fault));
        assert_eq!(since + ms, wait_ms + 1, "{fault:?} {gap}");
    }
}

#[test]
fn a_speed_that_is_silent_has_not_jumped() {
    let mut rig = Rig::active_in_curve(1.0);
    rig.silent[VEHICLE] = true;
    let (_, step) = rig.run_until(60, |step| step.command.faults.contains(Fault::SpeedTimeout));
    assert!(!step.command.faults.contains(Fault::SpeedStep));
}

/// One that steps follows the other, both are held, and nobody minds for 0.3 s: the brakes let a wheel go sooner.
#[test]
fn wheels_that_slip_are_no_fault() {
    for slips in [[-4.0, 0.0], [0.0, -4.0], [-3.0, -5.0], [5.0, 5.0]] {
        let mut rig = Rig::active_in_curve(1.0);
        for (ms, slips) in [(290, slips), (60, [0.0; 2]), (60, slips), (200, [0.0; 2])] {
            rig.speeds = slips.map(|slip| crate::rig::SPEED + slip);
            for _ in 0..ms {
                let step = rig.tick();
                assert_eq!(step.command.mode, Mode::Active, "{slips:?}");
                assert!((rig.applied - 1.0).abs() < 0.01, "{slips:?}: {} N.m", rig.applied);
                assert_eq!(step.command.faults, FaultSet::NONE);
            }
        }
    }
}

/// A slip that goes in and out by ramps of so many ms, and lasts `ms` between.
fn ramps([into, ms, out]: [f64; 3], t_ms: f64) -> f64 {
    let rising = if into > 0.0 { t_ms / into } else { 1.0 };
    let falling = if out > 0.0 {
        (into + ms + out - t_ms) / out
    } else {
        f64::from(t_ms < into + ms)
    };
    rising.min(falling).clamp(0.0, 1.0)
}

/// Drives through a slip of wheels as `sides` have it, m/s: guidance goes on, and no fault is told.
fn rides_out(sides: [f64; 2], shape: [f64; 3]) -> Result<(), String> {
    let mut rig = Rig::active_in_curve(1.0);
    let length_ms = shape.iter().sum::<f64>() as u32 + 1500;
    for ms in 0..length_ms {
        let share = ramps(shape, f64::from(ms));
        rig.speeds = sides.map(|slip| crate::rig::SPEED + slip * share);
        let step = rig.tick();
        if step.command.mode != Mode::Active || step.command.faults != FaultSet::NONE {
            return Err(format!(
                "{sides:?} {shape:?} after {ms} ms: {:?}",
                step.command.faults
            ));
        }
    }
    Ok(())
}

/// Slowly away and fast back, either wheel, to both sides: what ended guidance every time. Where two new speeds agree they are
/// taken.
#[test]
fn a_wheel_that_slips_slowly_and_comes_back_fast_is_no_fault() {
    for sign in [1.0, -1.0] {
        for wheel in [[1.0, 0.0], [0.0, 1.0]] {
            let sides = |slip: f64| wheel.map(|share: f64| sign * share * slip);
            // 1.2 m/s low for a second, then right at once; 3 m/s in 40 ms, and back in 10 or 20 ms.
            for (slip, shape) in [
                (1.2, [20.0, 1000.0, 0.0]),
                (1.9, [1000.0, 1000.0, 0.0]),
                (3.0, [40.0, 0.0, 10.0]),
                (3.0, [40.0, 0.0, 20.0]),
                (3.0, [40.0, 100.0, 10.0]),
                (5.0, [60.0, 50.0, 0.0]),
            ] {
                assert_eq!(rides_out(sides(slip), shape), Ok(()));
            }
        }
    }
}

/// Both wheels, by ramps of 0 to 1 s in and out: to 4.5 m/s, as 1 m/s and 12 m/s2 for 0.3 s are 4.6. A slip of more that went
/// in slowly and comes back at once is a step of a vehicle, and ends guidance.
#[test]
fn both_wheels_slip_in_and_out_by_ramps() {
    for slip in [-4.5, -3.0, -1.2, 1.2, 3.0, 4.5] {
        for into in [0.0, 20.0, 100.0, 300.0, 1000.0] {
            for out in [0.0, 10.0, 20.0, 50.0, 100.0, 1000.0] {
                assert_eq!(rides_out([slip; 2], [into, 200.0, out]), Ok(()));
            }
        }
    }
    for slip in [-5.5, 5.5] {
        assert!(rides_out([slip; 2], [1000.0, 200.0, 0.0]).is_err());
    }
}

/// One of two that stays 2 m/s and more away is a fault after 0.3 s, however slowly it went.
#[test]
fn a_speed_that_dies_slowly_is_told() {
    for sides in [[-15.0, 0.0], [0.0, -15.0], [15.0, 0.0], [0.0, 15.0]] {
        for ramp_ms in [1000.0, 3000.0, 10_000.0] {
            let mut rig = Rig::active_in_curve(1.0);
            let away_ms = 2.0 / 15.0 * ramp_ms;
            let mut told_ms = None;
            for ms in 0..ramp_ms as u32 {
                let share = f64::from(ms) / ramp_ms;
                rig.speeds = sides.map(|slip| crate::rig::SPEED + slip * share);
                let step = rig.tick();
                if step.command.faults.contains(Fault::SpeedImplausible) {
                    told_ms.get_or_insert(f64::from(ms));
                }
            }
            let late_ms = told_ms.map(|ms| ms - away_ms);
            assert!(
                late_ms.is_some_and(|ms| (290.0..=325.0).contains(&ms)),
                "{sides:?} {ramp_ms}: {late_ms:?}"
            );
        }
    }
    // A drift that stays within 2 m/s is none.
    for sides in [[-1.9, 0.0], [0.0, -1.9], [1.9, 0.0], [0.0, 1.9]] {
        assert_eq!(rides_out(sides, [5000.0, 1000.0, 5000.0]), Ok(()));
    }
}

/// On a straight, 1.9 rad/s in two messages: nothing of it reaches the lane that goes on, or its check.
#[test]
fn a_yaw_rate_that_no_vehicle_has_is_left_out() {
    for spike in [1.9, -1.9, 0.2] {
        let mut rig = Rig::paper();
        rig.yaw_rate = Some(0.0);
        rig.run(600);
        rig.engage = true;
        rig.run(1000);
        for _ in 0..20 {
            for (rate, ms) in [(spike, 20), (0.0, 100)] {
                rig.yaw_rate = Some(rate);
                for _ in 0..ms {
                    let step = rig.tick();
                    assert_eq!(
                        (step.command.mode, step.command.faults),
                        (Mode::Active, FaultSet::NONE)
                    );
                    assert_eq!(rig.applied, 0.0, "{spike}");
                }
            }
        }
    }
}

/// Three frames of the column may be lost at once, and as many more as fit into its silence; fourteen at most.
#[test]
fn the_column_may_have_lost_what_fits_into_its_silence() {
    let mut rig = Rig::paper();
    // The last step has heard a frame.
    rig.run(601);
    for (silence_ms, most) in [(1, 3), (2, 4), (10, 8), (20, 13), (22, 14), (29, 14)] {
        for step in 1..=15_u32 {
            let mut rig = rig.clone();
            rig.t_us += 1000 * silence_ms;
            let frame = (0..step).map(|_| rig.frame(COLUMN)).last().unwrap();
            let expected = if step <= most { Ok(()) } else { Err(Reject::Jump) };
            assert_eq!(rig.send(&frame), expected, "{step} after {silence_ms} ms");
        }
    }
}

/// Two frames of the column within a step, of which one says that the hand opposes: what the last says counts, for the monitor too,
/// which else would find the torque to fall too fast, or to stay.
#[test]
fn of_two_frames_in_a_step_the_last_counts() {
    for pushes in [[false, true], [true, false]] {
        let mut rig = Rig::active_in_curve(1.0);
        rig.t_us += 1000;
        for push in pushes {
            rig.driver = push.then_some(-10.0);
            let frame = rig.frame(COLUMN);
            assert_eq!(rig.send(&frame), Ok(()));
        }
        let step = rig.step();
        assert!(step.permitted);
        assert_eq!(step.command.torque.nm() == 0.0, pushes[1], "{} N.m", rig.applied);
    }
}
