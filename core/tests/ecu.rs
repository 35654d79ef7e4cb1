//! The ECU from its frames: how it comes up, what each class of fault makes of it, and when.
//!
//! Above 500 lines because the classes of faults are one table of cases on one rig: split, a reader could not see
//! whether a class lacks a case.

use crate::rig::Rig;
use haptic_core::bus::messages::{FaultRecord, Guidance, Message, ResetCause, Warning};
use haptic_core::bus::{Frame, Reject};
use haptic_core::controller::Command;
use haptic_core::controller::config::Setup;
use haptic_core::ecu::injection::{InjectedEcu, Region};
use haptic_core::ecu::{Boot, Ecu, Step};
use haptic_core::quantity::{Instant, Micros, Radians, Torque};
use haptic_core::safety::envelope::LimitReason;
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;

const LANE: usize = 0;
const COLUMN: usize = 1;
const VEHICLE: usize = 2;
const REQUEST: usize = 3;
/// The resolution of the torque on the bus.
const BUS_LSB: f64 = 1.0 / 4096.0;

/// The signals of a frame, read without a receiver's history.
fn read<M: Message>(frame: &Frame) -> Option<M> {
    (frame.id() == M::ID).then(|| {
        let bytes = frame.payload().unwrap();
        assert!(M::PROTECTION.is_intact(bytes));
        M::unpack(bytes).unwrap()
    })
}

fn warns(step: &Step) -> bool {
    step.others.iter().any(|frame| read::<Warning>(frame).is_some())
}

#[test]
fn boot_standby_and_a_rising_edge_after_500_ms() {
    let mut rig = Rig::paper();
    rig.curve(1.0);
    rig.engage = true;
    let first = rig.tick();
    assert_eq!(
        (first.command.mode, first.command.torque),
        (Mode::Standby, Torque::ZERO)
    );
    // A request that was high from the start is no edge.
    assert_eq!(rig.run(1500).command.mode, Mode::Standby);
    rig.engage = false;
    rig.run(20);
    rig.engage = true;
    let (_, step) = rig.run_until(11, |step| step.command.mode == Mode::Active);
    // From zero, at 4 mN.m per step.
    let mut last = step.command.torque.nm();
    assert!((0.0..=0.004).contains(&last), "{last}");
    for _ in 0..240 {
        let torque = rig.tick().command.torque.nm();
        assert!(torque - last <= 0.004 && torque > last, "{last} to {torque}");
        last = torque;
    }
    assert!((0.9..=0.968).contains(&last), "{last} N.m after 242 ms");
    assert!((rig.run(50).command.torque.nm() - 1.0).abs() < 0.001);
}

#[test]
fn an_edge_before_500_ms_of_valid_data_is_lost() {
    for (ready_ms, engages) in [(480, false), (560, true)] {
        let mut rig = Rig::paper();
        rig.run(100);
        rig.silent[LANE] = true;
        // Lost after 31 ms; trusted again with the third clean frame, which comes within 24 ms.
        rig.run(60);
        rig.silent[LANE] = false;
        rig.run(ready_ms);
        rig.engage = true;
        assert_eq!(rig.run(300).command.mode == Mode::Active, engages, "{ready_ms}");
    }
}

#[test]
fn silence_of_any_input_hands_over_at_31_ms_linearly_in_2_s() {
    let faults = [
        (LANE, Fault::LaneTimeout),
        (COLUMN, Fault::ColumnTimeout),
        (VEHICLE, Fault::SpeedTimeout),
        (REQUEST, Fault::RequestTimeout),
    ];
    for (sender, fault) in faults {
        for torque in [1.5, -1.5] {
            let mut rig = Rig::active_in_curve(torque);
            // Up to the step with this sender's last frame.
            let period = [8, 2, 10, 10][sender];
            while !rig.ticks.is_multiple_of(period) {
                rig.tick();
            }
            rig.tick();
            let held = rig.applied;
            rig.silent[sender] = true;
            // A lane is gone on with for a second.
            for _ in 0..if sender == LANE { 1030 } else { 30 } {
                assert_eq!(rig.tick().command.mode, Mode::Active, "{fault:?}");
            }
            let held = if sender == LANE { rig.applied } else { held };
            // Without a driver torque no hand can end it sooner: half the time.
            // A lane has been gone on with on the same line for a second.
            let length = if matches!(sender, COLUMN | LANE) {
                1000
            } else {
                2000
            };
            for k in 1..=length {
                let step = rig.tick();
                assert_eq!(step.command.mode, Mode::Handover, "{fault:?} {k}");
                assert!(step.command.warning && step.command.faults.contains(fault));
                assert_eq!(warns(&step), k % 100 == 1, "a warning at once, then every 100 ms");
                let expected = held * (1.0 - f64::from(k) / f64::from(length));
                let got = step.command.torque.nm();
                assert!(
                    (got - expected).abs() <= 2.0 * BUS_LSB,
                    "{k}: {got}, not {expected}"
                );
            }
            assert_eq!(rig.applied, 0.0);
            // Ready again, but nothing re-engages by itself.
            rig.silent[sender] = false;
            let after = rig.run(1500);
            assert_eq!(
                (after.command.mode, after.command.torque),
                (Mode::Standby, Torque::ZERO)
            );
            assert_eq!(after.command.faults, FaultSet::NONE);
        }
    }
}

#[test]
fn a_handover_starts_from_the_torque_before_the_silence() {
    // The law asks for more and more, also while the command is silent; the torque of just before is what is trusted.
    let mut rig = Rig::active_in_curve(0.4);
    let mut torque = 0.4;
    while torque < 1.0 || !rig.ticks.is_multiple_of(10) {
        torque += 0.0024;
        rig.curve(torque);
        rig.tick();
    }
    let trusted = rig.applied;
    rig.curve(torque + 0.2);
    rig.tick();
    rig.silent[REQUEST] = true;
    rig.run(30);
    assert!(rig.applied > 1.08, "{}", rig.applied);
    // The reduction limit brings it down to the ramp at 8 mN.m per step.
    let before = rig.applied;
    assert!((rig.tick().command.torque.nm() - (before - 0.008)).abs() <= BUS_LSB);
    for k in 2..=2000 {
        let got = rig.tick().command.torque.nm();
        let ramp = trusted * (1.0 - f64::from(k) / 2000.0);
        // At most 40 ms of history lie between two remembered outputs.
        assert!(k < 100 || (got - ramp).abs() <= 0.02, "{k}: {got}, not {ramp}");
    }
}

#[test]
fn a_handover_after_an_implausible_input_starts_from_the_torque_800_ms_before() {
    for sign in [1.0, -1.0] {
        let mut rig = Rig::active_in_curve(sign * 0.4);
        // The second source drifts to 1.9 m/s above the first.
        for k in 1..=19 {
            rig.speeds = [crate::rig::SPEED, crate::rig::SPEED + 0.1 * f64::from(k)];
            rig.run(10);
        }
        // At most 5 ms of history lie between two remembered outputs, and the torque rises by 2.4 mN.m per ms.
        let mut outputs = Vec::new();
        for k in 0..600 {
            rig.curve(sign * (0.4 + 0.0024 * f64::from(k)));
            rig.tick();
            outputs.push(rig.applied);
        }
        rig.speeds[1] = crate::rig::SPEED + 2.1;
        let (ms, step) = rig.run_until(320, |step| step.command.mode == Mode::Handover);
        assert!(step.command.faults.contains(Fault::SpeedImplausible));
        let declared = outputs.len() + ms as usize - 1;
        let trusted = outputs[declared - 800];
        assert!(
            (0.4..0.8).contains(&(sign * trusted)) && sign * rig.applied > 1.0,
            "{trusted} of {}",
            rig.applied
        );
        for k in 2..=2000 {
            let got = rig.tick().command.torque.nm();
            let ramp = trusted * (1.0 - f64::from(k) / 2000.0);
            // Before, the reduction limit brings it down to the ramp at 8 mN.m per step.
            assert!(k < 200 || (got - ramp).abs() <= 0.1, "{k}: {got}, not {ramp}");
        }
        assert_eq!(rig.applied, 0.0);
    }
}

/// What a lie about the lane made may have the wrong sign, and nobody knows since when.
#[test]
fn a_handover_after_an_implausible_lane_starts_from_zero() {
    for sign in [1.0, -1.0] {
        let mut rig = Rig::active_in_curve(sign);
        rig.run(3000);
        // To the side at 0.09 rad without getting there.
        rig.lane.e_theta = Radians::from_rad(rig.lane.e_theta.rad() + sign * 0.09);
        let (_, step) = rig.run_until(2000, |step| step.command.mode == Mode::Handover);
        assert!(step.command.faults.contains(Fault::LaneImplausible));
        let mut last = rig.applied;
        assert!(sign * last > 0.9, "{last}");
        // At four times the reduction limit, which is 8 mN.m per step.
        while last.abs() > 0.032 {
            let next = rig.tick().command.torque.nm();
            assert!(
                (sign * (last - next) - 0.032).abs() <= BUS_LSB,
                "{last} to {next}"
            );
            last = next;
        }
        assert_eq!(rig.tick().command.torque, Torque::ZERO);
        assert_eq!(rig.tick().command.mode, Mode::Handover);
    }
}

/// The curve may end before the handover does; what it took away does not come back.
#[test]
fn a_handover_holds_no_more_than_the_law_asks_for_while_the_lane_is_there() {
    for sign in [1.0, -1.0] {
        let mut rig = Rig::active_in_curve(sign * 1.5);
        rig.silent[REQUEST] = true;
        rig.run_until(60, |step| step.command.mode == Mode::Handover);
        rig.run(100);
        let line = |ms: f64| 1.5 * (1.0 - ms / 2000.0);
        assert!(
            (sign * rig.applied - line(100.0)).abs() < 0.005,
            "{}",
            rig.applied
        );
        // For longer than the low-pass of the rates and the fall at 8 N.m/s need; the rates of the step ask for less for a while.
        for (asked, expected) in [(0.6, 0.6), (1.5, 0.6), (-0.1, 0.0), (1.5, 0.0)] {
            rig.curve(sign * asked);
            rig.run(300);
            assert!(
                (sign * rig.applied - expected).abs() < 0.01,
                "{asked}: {}",
                rig.applied
            );
        }
        assert_eq!(rig.tick().command.mode, Mode::Handover);
    }
}

/// 1.5 N.m in 2 s are 0.75 mN.m in a step. Where the driver pushes against them it is 2.25.
#[test]
fn a_handover_goes_faster_while_the_driver_pushes_against_it_and_no_longer() {
    for sign in [1.0, -1.0] {
        let mut rig = Rig::active_in_curve(sign * 1.5);
        let start = rig.applied.abs();
        rig.silent[REQUEST] = true;
        rig.run_until(60, |step| step.command.mode == Mode::Handover);
        for (driver, times) in [(-0.09, 1.0), (-0.11, 3.0), (0.11, 1.0), (-0.3, 3.0), (0.0, 1.0)] {
            rig.driver = Some(sign * driver);
            // Until the next column frame has come.
            rig.run(4);
            let before = rig.applied;
            rig.run(50);
            let fallen = sign * (before - rig.applied);
            let expected = times * 50.0 * start / 2000.0;
            assert!(
                (fallen - expected).abs() <= 2.0 * BUS_LSB,
                "{driver}: {fallen}, not {expected}"
            );
        }
    }
}

/// 2 s from there, four times as fast: nobody knows what the driver does, whatever the column says.
#[test]
fn a_handover_from_an_implausible_column_takes_half_a_second_whether_the_driver_seems_to_oppose_or_not() {
    for (sign, driver) in [(1.0, 4.0), (1.0, -1.7), (-1.0, 4.0), (-1.0, -1.7)] {
        let mut rig = Rig::active_in_curve(sign);
        rig.run(3000);
        let start = rig.applied.abs();
        rig.driver = Some(sign * driver);
        let (_, step) = rig.run_until(3000, |step| step.command.mode == Mode::Handover);
        assert!(step.command.faults.contains(Fault::ColumnImplausible));
        assert!(!step.command.faults.contains(Fault::ColumnTimeout));
        let before = rig.applied;
        rig.run(100);
        let fallen = sign * (before - rig.applied);
        let expected = 100.0 * start / 500.0;
        assert!(
            (fallen - expected).abs() <= 0.005,
            "{driver}: {fallen}, not {expected}"
        );
    }
}

#[test]
fn a_silence_of_20_ms_is_no_fault() {
    for sender in [LANE, COLUMN, VEHICLE, REQUEST] {
        let mut rig = Rig::active_in_curve(1.0);
        rig.silent[sender] = true;
        rig.run(16);
        rig.silent[sender] = false;
        let after = rig.run(300);
        assert_eq!(after.command.mode, Mode::Active);
        assert_eq!(after.command.faults, FaultSet::NONE);
    }
}

#[test]
fn one_bad_frame_is_rejected_and_the_last_good_one_stays() {
    for (sender, what, wanted) in (0..4).flat_map(|sender| {
        [
            (sender, "crc", Reject::Crc),
            (sender, "length", Reject::Length),
            (sender, "repeat", Reject::Repeated),
            (sender, "jump", Reject::Jump),
        ]
    }) {
        let mut rig = Rig::active_in_curve(1.0);
        let before = rig.applied;
        let good = rig.frame(sender);
        let bad = match what {
            "crc" => {
                let mut bytes: [u8; 8] = good.data().try_into().unwrap();
                bytes[5] ^= 0x10;
                Frame::new(good.id(), &bytes).unwrap()
            }
            "length" => Frame::new(good.id(), &good.data()[..7]).unwrap(),
            "repeat" => {
                rig.send(&good).unwrap();
                good
            }
            _ => {
                rig.send(&good).unwrap();
                // Four ahead, or five: the column's window is open by another for each 2 ms.
                let mut ahead = rig.clone();
                (0..5).map(|_| ahead.frame(sender)).last().unwrap()
            }
        };
        assert_eq!(rig.send(&bad), Err(wanted), "{sender} {what}");
        assert_eq!(rig.run(100).command.mode, Mode::Active);
        assert!((rig.applied - before).abs() < 0.001, "{sender} {what}");
    }
    // Another message's frame under this identifier, and a frame of no interest.
    let mut rig = Rig::active_in_curve(1.0);
    let column = rig.frame(COLUMN);
    let masked = Frame::new(0x100, column.data()).unwrap();
    assert_eq!(rig.send(&masked), Err(Reject::Crc));
    assert_eq!(rig.send(&Frame::new(0x555, &[1, 2, 3]).unwrap()), Ok(()));
}

#[test]
fn a_resumed_sender_shows_three_clean_frames() {
    let mut rig = Rig::active_in_curve(1.0);
    rig.silent[LANE] = true;
    rig.run(100);
    rig.silent[LANE] = false;
    rig.rejects.clear();
    rig.run(50);
    assert_eq!(rig.rejects, [Reject::NotTrusted, Reject::NotTrusted]);
}

#[test]
fn a_jump_of_the_lane_or_the_speed_is_rejected_and_becomes_a_fault_when_it_stays() {
    let mut rig = Rig::active_in_curve(1.0);
    rig.lane.e_y = haptic_core::quantity::Metres::from_m(rig.lane.e_y.m() - 3.5);
    rig.rejects.clear();
    let (ms, step) = rig.run_until(60, |step| step.command.faults.contains(Fault::LaneStep));
    assert!(ms <= 31 + 8 && step.command.mode == Mode::Active, "{ms}");
    assert!(rig.rejects.len() >= 3 && rig.rejects.iter().all(|r| *r == Reject::Step));
    // Four seconds for a line that comes no nearer, and three frames of a sender that was refused.
    let (ms, step) = rig.run_until(4100, |step| step.command.mode == Mode::Handover);
    assert!((4000..=4032).contains(&ms), "{ms}");
    assert!(step.command.faults.contains(Fault::LaneStep));
    assert!(
        !step.command.faults.contains(Fault::LaneTimeout),
        "frames do arrive"
    );
    let mut rig = Rig::active_in_curve(1.0);
    rig.speeds = [crate::rig::SPEED + 6.0; 2];
    let (ms, step) = rig.run_until(400, |step| step.command.mode == Mode::Handover);
    assert!((320..=345).contains(&ms), "{ms}");
    assert!(step.command.faults.contains(Fault::SpeedStep));
    assert!(
        !step.command.faults.contains(Fault::SpeedTimeout),
        "frames do arrive"
    );
}

#[test]
fn a_sample_older_than_the_last_is_rejected() {
    let mut rig = Rig::active_in_curve(1.0);
    rig.run(8);
    let fresh = rig.frame(LANE);
    assert_eq!(rig.send(&fresh), Ok(()));
    rig.lane.age = Micros::from_us(100);
    let older = rig.frame(LANE);
    assert_eq!(rig.send(&older), Err(Reject::Older));
    // Ages that wander by less than a period are no fault.
    for k in 0..100 {
        rig.lane.age = Micros::from_ms(k % 5);
        assert_eq!(rig.run(8).command.mode, Mode::Active);
    }
    assert!((rig.applied - 1.0).abs() < 0.001);
}

#[test]
fn an_invalid_preview_is_the_reason_of_its_time_out() {
    let mut rig = Rig::active_in_curve(1.0);
    rig.lane.valid = false;
    rig.run(16);
    rig.lane.valid = true;
    // A blink.
    assert_eq!(rig.run(100).command.faults, FaultSet::NONE);
    rig.lane.valid = false;
    let (_, step) = rig.run_until(1060, |step| step.command.mode == Mode::Handover);
    assert!(step.command.faults.contains(Fault::LaneInvalid));
}

#[test]
fn speeds_that_disagree_and_speeds_too_low() {
    for (apart, expected) in [(1.99, Mode::Active), (2.0, Mode::Handover)] {
        let mut rig = Rig::active_in_curve(1.0);
        // No jump: the second source drifts away.
        for k in 1..=20 {
            rig.speeds[1] = crate::rig::SPEED + apart * f64::from(k) / 20.0;
            rig.run(10);
        }
        // Both round to the bus's 2^-8 m/s.
        rig.speeds = [16.0, 16.0 + apart];
        // A wheel may slip for 0.3 s.
        let step = rig.run(290);
        assert_eq!(step.command.mode, Mode::Active, "{apart}");
        let step = rig.run(20);
        assert_eq!(step.command.mode, expected, "{apart}");
        let implausible = step.command.faults.contains(Fault::SpeedImplausible);
        assert_eq!(implausible, expected == Mode::Handover);
    }
    let mut rig = Rig::active_in_curve(0.0);
    for k in 0..=130 {
        rig.speeds = [crate::rig::SPEED - 0.1 * f64::from(k); 2];
        rig.run(10);
    }
    let step = rig.tick();
    assert_eq!(step.command.mode, Mode::Standby, "slower than 5 m/s, class A");
    assert_eq!(step.command.faults, FaultSet::NONE);
    // One of two is enough: which of them is right is unknown.
    for slow in [0, 1] {
        let mut rig = Rig::active_in_curve(0.0);
        for k in 0..=110 {
            rig.speeds = [crate::rig::SPEED - 0.1 * f64::from(k); 2];
            rig.run(10);
        }
        assert_eq!(rig.tick().command.mode, Mode::Active, "5.67 m/s");
        rig.speeds[slow] = 4.9;
        rig.run(10);
        assert_ne!(rig.tick().command.mode, Mode::Active, "4.9 m/s");
        assert_eq!(rig.run(300).command.mode, Mode::Standby);
    }
}

#[test]
fn at_a_walking_pace_nothing_is_implausible() {
    for (speed, plausible) in [(4.9, true), (5.5, false)] {
        // To the side at 0.3 rad without getting there, or 5 N.m that turn nothing.
        for fault in [Fault::LaneImplausible, Fault::ColumnImplausible] {
            let mut rig = Rig::paper();
            rig.speeds = [speed; 2];
            if fault == Fault::LaneImplausible {
                rig.lane.e_theta = Radians::from_rad(0.3);
            } else {
                rig.driver = Some(5.0);
            }
            rig.run(100);
            let declared = (0..2000).any(|_| rig.tick().command.faults.contains(fault));
            assert_eq!(declared, !plausible, "{speed} {fault:?}");
        }
    }
}

#[test]
fn a_disengagement_fades_at_4_nm_per_s() {
    let mut rig = Rig::active_in_curve(1.5);
    rig.engage = false;
    let (_, first) = rig.run_until(11, |step| step.command.mode == Mode::Fade);
    let mut torque = first.command.torque.nm();
    for k in 2..=374 {
        let Command {
            torque: next, limit, ..
        } = rig.tick().command;
        let next = next.nm();
        assert_eq!(limit, LimitReason::Mode);
        assert!(
            (torque - next - 0.004).abs() <= BUS_LSB,
            "{k}: {torque} to {next}"
        );
        torque = next;
    }
    let (ms, _) = rig.run_until(5, |step| step.command.mode == Mode::Standby);
    assert!(ms >= 2 && rig.applied == 0.0);
    // A request in mid-fade is no use either.
    let mut rig = Rig::active_in_curve(1.5);
    rig.engage = false;
    rig.run(30);
    rig.engage = true;
    assert_eq!(rig.run(1000).command.mode, Mode::Standby);
}

/// Every second step comes 10 ms late: the ramp goes on by 44 mN.m in two steps, the reduction limit earns 24.
#[test]
fn a_fade_lasts_until_the_torque_is_zero_even_where_steps_are_late() {
    let mut rig = Rig::active_in_curve(1.5);
    rig.engage = false;
    rig.run_until(11, |step| step.command.mode == Mode::Fade);
    let mut before = rig.applied;
    let steps = (0..500)
        .find(|k| {
            let step = rig.tick_after(if k % 2 == 0 { 10_000 } else { 1_000 });
            assert!(before - rig.applied <= 0.016, "{before} to {}", rig.applied);
            before = rig.applied;
            step.command.mode == Mode::Standby
        })
        .unwrap();
    // 1.5 N.m at 12 mN.m a step; the ramp itself ends after 68.
    assert!((120..=135).contains(&steps), "{steps}");
}

#[test]
fn a_handover_becomes_a_fade_when_the_driver_switches_off() {
    let mut rig = Rig::active_in_curve(1.5);
    rig.silent[LANE] = true;
    rig.run_until(1060, |step| step.command.mode == Mode::Handover);
    rig.engage = false;
    rig.run_until(11, |step| step.command.mode == Mode::Fade);
    rig.run_until(400, |step| step.command.mode == Mode::Standby);
}

#[test]
fn what_the_driver_pushes_away_in_a_handover_does_not_come_back() {
    let mut rig = Rig::active_in_curve(1.5);
    rig.silent[LANE] = true;
    rig.run_until(1060, |step| step.command.mode == Mode::Handover);
    // 2.4 N.m against the torque leaves 5 - 3*(2.4 - 0.8) = 0.2 N.m.
    rig.driver = Some(-2.4);
    rig.run_until(3, |step| step.command.limit == LimitReason::DriverOverride);
    assert!((rig.applied - 0.2).abs() <= BUS_LSB, "{}", rig.applied);
    rig.driver = None;
    let mut last = rig.applied;
    for _ in 0..2000 {
        let torque = rig.tick().command.torque.nm();
        assert!(torque <= last, "{last} to {torque}");
        last = torque;
    }
    assert_eq!(last, 0.0);
}

#[test]
fn late_and_early_steps() {
    let run = |spans: &[u32]| {
        let mut rig = Rig::active_in_curve(1.0);
        for span in spans {
            rig.tick_after(*span);
        }
        rig.tick().command
    };
    let fault = |command: &Command| command.faults.contains(Fault::Deadline);
    for tolerated in [
        &[2_500, 2_500][..],
        &[2_501, 1_000, 2_501],
        &[10_000],
        &[499, 499, 499, 1000],
        &[500, 500, 500, 500],
    ] {
        assert!(!fault(&run(tolerated)), "{tolerated:?}");
    }
    for fatal in [
        &[2_501, 2_501][..],
        &[10_001],
        &[499, 499, 499, 499],
        &[0, 0, 0, 0],
    ] {
        let command = run(fatal);
        assert!(fault(&command), "{fatal:?}");
        assert_eq!((command.mode, command.torque), (Mode::Fault, Torque::ZERO));
    }
}

#[test]
fn a_motor_that_does_not_obey() {
    let motors: [fn(f64) -> f64; 3] = [|t| t + 0.3, |t| 1.3 * t, |t| -t];
    for motor in motors {
        let mut rig = Rig::active_in_curve(1.0);
        rig.motor = motor;
        let (ms, step) = rig.run_until(20, |step| step.command.mode == Mode::Fault);
        assert!(step.command.faults.contains(Fault::Actuator) && step.command.torque == Torque::ZERO);
        assert!((10..=20).contains(&ms), "{ms}");
        // Latched, with an obedient motor too.
        rig.motor = |t| t;
        rig.engage = false;
        rig.run(50);
        rig.engage = true;
        assert_eq!(rig.run(1500).command.mode, Mode::Fault);
    }
    // What is missing is handed over, and the driver warned; it is no fault of class C.
    let motors: [fn(f64) -> f64; 2] = [|t| t / 2.0, |_| 0.0];
    for motor in motors {
        let mut rig = Rig::active_in_curve(1.0);
        rig.motor = motor;
        let (ms, step) = rig.run_until(60, |step| step.command.mode != Mode::Active);
        assert!(step.command.faults.contains(Fault::MotorWeak) && step.command.warning);
        assert!(
            step.command.mode == Mode::Handover && (50..=56).contains(&ms),
            "{ms}"
        );
        // From the torque that was applied, over two seconds.
        assert!((rig.applied - 1.0).abs() < 0.01, "{}", rig.applied);
        assert_eq!(rig.run(1500).command.mode, Mode::Handover);
        assert_eq!(rig.run(600).command.mode, Mode::Standby);
    }
    // Within the margin of 0.1 N.m there is nothing to say; one that ignores zero is found in Standby too.
    let mut rig = Rig::active_in_curve(1.0);
    rig.motor = |t| t + 0.099;
    assert_eq!(rig.run(200).command.mode, Mode::Active);
    let mut rig = Rig::paper();
    rig.motor = |_| 0.11;
    rig.run(30);
    assert_eq!(rig.tick().command.mode, Mode::Fault);
}

#[test]
fn the_driver_who_opposes_wins_in_the_same_step() {
    let mut rig = Rig::active_in_curve(1.5);
    rig.driver = Some(-2.47);
    while !rig.ticks.is_multiple_of(2) {
        rig.tick();
    }
    let step = rig.tick();
    assert_eq!(step.command.torque, Torque::ZERO);
    assert_eq!(
        (step.command.limit, step.command.mode),
        (LimitReason::DriverOverride, Mode::Active)
    );
}

#[test]
fn where_a_limit_acts_no_more_counts_as_probe_than_was_applied() {
    // 2.45 N.m against the torque leaves 5 - 3*(2.45 - 0.8) = 0.05 N.m, 2.47 nothing. The probe's first half
    // wave would add up to 0.2 N.m, its second take as much away.
    for (opposing, left) in [(2.45, 0.05), (2.47, 0.0)] {
        for periods in [1.0, 1.5] {
            let mut rig = Rig::active_in_curve(1.5);
            rig.probe = true;
            rig.run_until(11, |step| step.command.probe.is_some());
            rig.run((periods * 400.0) as u32 - 1);
            rig.driver = Some(-opposing);
            rig.run_until(3, |step| step.command.limit == LimitReason::DriverOverride);
            // Before the column's check has seen enough of a driver who pushes without effect.
            for _ in 0..100 {
                let step = rig.tick();
                assert!((rig.applied - left).abs() <= BUS_LSB, "{}", rig.applied);
                let probe = step.command.probe.unwrap().nm();
                let upward = periods == 1.0;
                assert!(
                    (0.0..=left + 2.0 * BUS_LSB).contains(&probe) && (upward || probe == 0.0),
                    "{probe}"
                );
                assert!(!upward || left == 0.0 || probe > 0.0);
            }
        }
    }
}

#[test]
fn damaged_memory_is_reported_for_good() {
    for region in Region::ALL {
        let mut rig = Rig::active_in_curve(1.0);
        rig.ecu.flip_bit(region, 40);
        for _ in 0..100 {
            let command = rig.tick().command;
            assert_eq!((command.mode, command.torque), (Mode::Fault, Torque::ZERO));
            assert!(
                command.faults.contains(Fault::Memory),
                "{region:?}: {:?}",
                command.faults
            );
        }
    }
}

/// Engages on a straight, a wrap of the microsecond clock after guidance ended in a curve: with what the law remembered,
/// the metres between would be a movement within milliseconds.
#[test]
fn what_was_before_a_wrap_of_the_clock_is_forgotten() {
    let mut rig = Rig::active_in_curve(-1.5);
    rig.engage = false;
    rig.run_until(11, |step| step.command.mode == Mode::Fade);
    let again = rig.t_us + (1 << 32) + 5_000;
    rig.run(500);
    rig.curve(0.0);
    while rig.t_us < again {
        // As late as a step may be, but for the last second.
        rig.tick_after(if rig.t_us + 1_000_000 < again {
            2_400
        } else {
            1_000
        });
    }
    rig.engage = true;
    rig.run_until(11, |step| step.command.mode == Mode::Active);
    for _ in 0..100 {
        rig.tick();
        assert!(rig.applied.abs() < 0.001, "{} N.m", rig.applied);
    }
}

#[test]
fn no_parameters_or_a_reset_loop_lock() {
    let boots = [
        (true, 3, Fault::ResetLoop),
        (false, 0, Fault::Parameters),
        (true, 200, Fault::ResetLoop),
    ];
    for (good, recent_resets, fault) in boots {
        let boot = Boot {
            reset: ResetCause::Watchdog,
            recent_resets,
            ..Boot::default()
        };
        let mut rig = Rig::new(good.then_some(&Setup::PAPER), boot);
        rig.curve(1.0);
        let first = rig.tick();
        assert_eq!(first.command.mode, Mode::Locked);
        assert!(first.command.faults.contains(fault) && first.command.warning && warns(&first));
        assert_eq!(
            read::<Guidance>(&first.guidance).unwrap().reset,
            ResetCause::Watchdog
        );
        rig.run(600);
        rig.engage = true;
        let last = rig.run(600);
        assert_eq!(
            (last.command.mode, last.command.torque),
            (Mode::Locked, Torque::ZERO)
        );
    }
    let boot = Boot {
        reset: ResetCause::BrownOut,
        recent_resets: 2,
        ..Boot::default()
    };
    let mut rig = Rig::new(Some(&Setup::PAPER), boot);
    let step = rig.tick();
    assert_eq!(step.command.mode, Mode::Standby);
    assert_eq!(
        read::<Guidance>(&step.guidance).unwrap().reset,
        ResetCause::BrownOut
    );
}

/// Class C lasts until power-up, and a reset is none; what an input did before it is over.
#[test]
fn a_latched_fault_outlives_a_reset() {
    let mut latched = FaultSet::NONE;
    latched.insert(Fault::Monitor);
    latched.insert(Fault::LaneInvalid);
    let boot = Boot {
        reset: ResetCause::Watchdog,
        recent_resets: 1,
        latched,
    };
    let mut rig = Rig::new(Some(&Setup::PAPER), boot);
    rig.curve(1.0);
    let first = rig.tick();
    assert_eq!(first.command.mode, Mode::Fault);
    assert!(first.permitted && first.command.warning && warns(&first));
    assert!(!first.command.faults.contains(Fault::LaneInvalid));
    rig.run(600);
    rig.engage = true;
    let last = rig.run(600);
    assert_eq!(
        (last.command.mode, last.command.torque),
        (Mode::Fault, Torque::ZERO)
    );
    assert!(last.command.faults.contains(Fault::Monitor) && last.permitted);
}

#[test]
fn a_monitor_stuck_at_ok_is_found_within_a_second() {
    let mut rig = Rig::active_in_curve(1.0);
    rig.ecu.blind_monitor(|_| true);
    let (ms, step) = rig.run_until(1000, |step| step.command.mode == Mode::Fault);
    assert!(step.command.faults.contains(Fault::SelfTest));
    // Step 2561 is the first after 2100 to be one more than a multiple of 512.
    assert_eq!(ms, 2562 - 2100);
    assert_eq!(step.command.torque, Torque::ZERO);
}

#[test]
fn a_monitor_with_one_dead_rule_is_found_when_its_turn_comes() {
    // What each passes, no drive at 1 N.m shows: 5 N.m and more, a torque in Standby, less than 0.5 N.m in Active, and
    // of those only what is away from the lane.
    let dead: [fn(&[u8; 8]) -> bool; 4] = [
        |bytes| u64::from_le_bytes(*bytes) >> 12 & 0xFFFF > 5 * 4096,
        |bytes| bytes[4] & 0x0F == 1 && u64::from_le_bytes(*bytes) >> 12 & 0xFFFF != 0,
        |bytes| bytes[4] & 0x0F == 2 && u64::from_le_bytes(*bytes) >> 12 & 0xFFFF < 2048,
        |bytes| bytes[4] & 0x0F == 2 && (1024..2048).contains(&(u64::from_le_bytes(*bytes) >> 12 & 0xFFFF)),
    ];
    for (passes, is_column_in_every_step) in dead.into_iter().flat_map(|dead| [(dead, false), (dead, true)]) {
        let mut rig = Rig::active_in_curve(1.0);
        rig.ecu.blind_monitor(passes);
        let found = (0..6 * 512).any(|_| {
            // A step with a new sample of the column has work enough, and yet not for ever.
            if is_column_in_every_step && !rig.ticks.is_multiple_of(2) {
                let frame = rig.frame(COLUMN);
                rig.send(&frame).unwrap();
            }
            rig.tick().command.faults.contains(Fault::SelfTest)
        });
        assert!(found, "{is_column_in_every_step}");
    }
    let mut rig = Rig::active_in_curve(1.0);
    for _ in 0..12 * 512 {
        let step = rig.tick();
        assert_eq!((step.command.faults, step.permitted), (FaultSet::NONE, true));
    }
}

#[test]
fn a_lane_preview_that_never_ages_is_stale_to_the_monitor() {
    let mut rig = Rig::active_in_curve(1.0);
    while !rig.ticks.is_multiple_of(8) {
        rig.tick();
    }
    rig.tick();
    rig.ecu.keep_lane_fresh();
    rig.silent[LANE] = true;
    let (ms, step) = rig.run_until(1800, |step| step.command.mode != Mode::Active);
    assert_eq!((ms, step.command.mode), (1761, Mode::Fault));
    assert!(step.command.faults.contains(Fault::Monitor) && !step.permitted);
}

#[test]
fn the_monitor_hears_that_the_host_asks_for_the_probe() {
    // The law lies by 0.25 N.m, within the monitor's 0.3; the probe's 0.2 on top are not.
    for sign in [1.0, -1.0] {
        let mut rig = Rig::active_in_curve(0.0);
        rig.ecu.force_law(Some(Torque::from_nm(sign * 0.25)));
        rig.run(100);
        rig.probe = true;
        let mut most: f64 = 0.0;
        // Its amplitude is whole after the first period of 400 ms.
        for _ in 0..900 {
            assert_eq!(rig.tick().command.mode, Mode::Active);
            most = most.max(sign * rig.applied);
        }
        assert!(most > 0.44, "{most} N.m");
    }
}

#[test]
fn a_law_that_lies_with_interruptions_meets_the_monitor_too() {
    for sign in [1.0, -1.0] {
        let mut rig = Rig::active_in_curve(0.0);
        let ms = (1..1000)
            .find(|ms| {
                let lie = if ms % 16 == 0 { 0.0 } else { sign * 5.0 };
                rig.ecu.force_law(Some(Torque::from_nm(lie)));
                let mode = rig.tick().command.mode;
                assert!(rig.applied.abs() < 0.4, "{} N.m after {ms} ms", rig.applied);
                mode == Mode::Fault
            })
            .unwrap();
        // 0.3 N.m of band at 15*4 - 8 mN.m in 16 ms, and 20 ms of patience.
        assert!((90..=125).contains(&ms), "{ms}");
    }
}

#[test]
fn a_law_that_lies_meets_the_limits_and_then_the_monitor() {
    for lie in [5.0, -5.0, 127.0] {
        let mut rig = Rig::active_in_curve(0.0);
        rig.ecu.force_law(Some(Torque::from_nm(lie)));
        let (ms, step) = rig.run_until(200, |step| {
            assert!(step.command.torque.nm().abs() < 0.4);
            step.command.mode == Mode::Fault
        });
        // 0.3 N.m of band at 4 mN.m per ms, and 20 ms of patience.
        assert!((90..=100).contains(&ms), "{ms}");
        assert!(step.command.faults.contains(Fault::Monitor) && !step.permitted);
        assert_eq!(
            (step.command.limit, step.command.torque),
            (LimitReason::Monitor, Torque::ZERO)
        );
        rig.ecu.force_law(None);
        let after = rig.run(500);
        assert_eq!(
            (after.command.mode, after.command.torque),
            (Mode::Fault, Torque::ZERO)
        );
    }
}

#[test]
fn the_history_goes_round_with_counts_and_ages() {
    let mut rig = Rig::active_in_curve(0.0);
    for _ in 0..3 {
        rig.silent[LANE] = true;
        rig.run(100);
        rig.silent[LANE] = false;
        rig.run(100);
    }
    rig.silent[VEHICLE] = true;
    rig.run(100);
    rig.silent[VEHICLE] = false;
    rig.run(4_500);
    let mut lines: Vec<_> = (0..400)
        .flat_map(|_| rig.tick().others)
        .filter_map(|frame| read::<FaultRecord>(&frame))
        .collect();
    lines.sort_by_key(|line| line.index);
    let read = |line: &FaultRecord| (line.index, line.total, line.record.fault, line.record.count);
    // At power-up nothing is heard yet: each input was missing once before its first frames.
    assert_eq!(
        lines.iter().map(read).collect::<Vec<_>>(),
        [
            (0, 4, Fault::LaneTimeout, 4),
            (1, 4, Fault::ColumnTimeout, 1),
            (2, 4, Fault::SpeedTimeout, 2),
            (3, 4, Fault::RequestTimeout, 1),
        ]
    );
    // Lane 5.0 to 5.4 s ago, speed 4.5 to 4.9 s, the others since power-up, 7.2 to 7.6 s: whole seconds.
    let ages: Vec<u16> = lines.iter().map(|line| line.record.age_s).collect();
    for (age, least) in ages.iter().zip([4, 7, 4, 7]) {
        assert!((least..=least + 1).contains(age), "{ages:?}");
    }
}

#[test]
fn warnings_and_lines_of_the_history_are_counted_and_half_a_turn_apart() {
    // The fiftieth step of a hundred has a sample of the column.
    warns_and_tells(0, 51);
    warns_and_tells(1, 50);
}

/// Where the drive begins with so many steps more, lines come in this step of a hundred.
fn warns_and_tells(more: u64, place: u64) {
    let mut rig = Rig::active_in_curve(1.0);
    (0..more).for_each(|_| drop(rig.step()));
    rig.silent[LANE] = true;
    let counter = |step: &Step, id: u16| {
        let mut frames = step.others.iter().filter(|frame| frame.id() == id);
        frames.next().map(|frame| frame.data()[1] & 0x0F)
    };
    let (_, first) = rig.run_until(1060, |step| step.command.mode == Mode::Handover);
    let mut warnings = vec![counter(&first, Warning::ID)];
    let mut lines = 0;
    for _ in 0..400 {
        let step = rig.tick();
        warnings.extend(warns(&step).then(|| counter(&step, Warning::ID)));
        if let Some(counter) = counter(&step, FaultRecord::ID) {
            // Steps count from zero.
            let at = rig.ticks - 1 + more;
            assert_eq!(at % 100, place);
            lines += 1;
            assert_eq!(u64::from(counter), at / 100 % 16);
        }
    }
    assert_eq!(warnings, [Some(0), Some(1), Some(2), Some(3), Some(4)]);
    assert_eq!(lines, 4);
}

#[test]
fn engaged_from_the_start_for_studies() {
    let now = Instant::from_us(0);
    let mut ecu = Ecu::engaged(&Setup::PAPER, now);
    let mut rig = Rig::paper();
    rig.engage = true;
    for sender in 0..4 {
        let frame = rig.frame(sender);
        assert_eq!(ecu.receive(&frame, now), Ok(()));
    }
    assert_eq!(ecu.step(now.after(Micros::from_ms(1))).command.mode, Mode::Active);
    assert_eq!(ecu.config(), Some(Setup::PAPER.config));
}

#[test]
fn without_a_fault_the_history_is_silent() {
    let mut rig = Rig::paper();
    rig.engage = true;
    rig.ecu = InjectedEcu::new(Ecu::engaged(&Setup::PAPER, rig.now()));
    for _ in 0..250 {
        let step = rig.tick();
        assert_eq!((step.command.faults, step.others.len()), (FaultSet::NONE, 0));
    }
}
