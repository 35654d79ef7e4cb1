//! Attacks from the bus with frames that pass every check of the bus, as docs/security.md has them: what is treated
//! is refused, what is not is bounded, and both leave a trace. Frames are made by the codec: there is no secret to know.

use crate::rig::Rig;
use haptic_core::bus::messages::{
    Column, Guidance, LanePreview, MESSAGES, Message, Request, Sender, Vehicle, WriteOutcome,
};
use haptic_core::bus::{Frame, Reject};
use haptic_core::controller::params::Params;
use haptic_core::quantity::{Metres, Micros, Radians, Ratio, Speed, Torque};
use haptic_core::safety::envelope::LimitReason;
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;
use haptic_core::service::download::{Conditions, Download, frames, unlock};
use haptic_core::service::rejections::Rejections;

const COLUMN: usize = 1;
const VEHICLE: usize = 2;
const REQUEST: usize = 3;

/// A torque frame of somebody else: the motor on the bus may have obeyed it.
#[test]
fn a_frame_in_the_name_of_this_ecu_hands_over_and_keeps_it_from_engaging() {
    let forged = Guidance {
        torque: Torque::from_nm(4.5),
        limit: LimitReason::None,
        mode: Mode::Active,
        warning: false,
        faults: FaultSet::NONE,
        reset: Default::default(),
    }
    .encode(3);
    let mut rig = Rig::active_in_curve(1.0);
    assert_eq!(rig.send(&forged), Err(Reject::OwnIdentifier));
    let step = rig.tick();
    assert_eq!(step.command.mode, Mode::Handover);
    assert!(step.command.faults.contains(Fault::OwnIdentifier) && step.command.warning);
    assert!(rig.applied > 0.9, "no sudden loss: {} N.m", rig.applied);
    // Every identifier of this ECU, whatever the frame holds; no other is taken for one.
    for message in MESSAGES {
        for data in [&[][..], &[0; 8]] {
            let mut rig = Rig::active_in_curve(0.5);
            let frame = Frame::new(message.id, data).unwrap();
            let result = rig.send(&frame);
            let is_own = message.sender == Sender::Ecu;
            assert_eq!(result == Err(Reject::OwnIdentifier), is_own, "{}", message.name);
            let fault = rig.tick().command.faults.contains(Fault::OwnIdentifier);
            assert_eq!(fault, is_own, "{}", message.name);
        }
    }
    // For a second after the last one, nothing engages.
    let mut rig = Rig::paper();
    rig.run(700);
    let _ = rig.send(&forged);
    rig.engage = true;
    for ms in 1..=1000 {
        let command = rig.tick().command;
        assert!(command.faults.contains(Fault::OwnIdentifier), "{ms}");
        assert_eq!(command.mode, Mode::Standby, "{ms}");
    }
    assert!(!rig.tick().command.faults.contains(Fault::OwnIdentifier));
}

/// The counter lets three of sixteen old frames of the column pass, one of each counter; fourteen used to.
#[test]
fn a_replayed_column_frame_passes_with_three_counters_of_sixteen() {
    let mut accepted = 0;
    for back in 0..16_u8 {
        let mut rig = Rig::active_in_curve(0.5);
        while !rig.ticks.is_multiple_of(2) {
            rig.tick();
        }
        rig.tick();
        // The column's frames so far: one in two ticks, from counter 0 on.
        let last = (rig.ticks / 2) as u8;
        let old = Column {
            driver_torque: Torque::ZERO,
            wheel_angle: Radians::ZERO,
            motor_torque: Torque::ZERO,
        };
        let frame = old.encode(last.wrapping_sub(back));
        accepted += u32::from(rig.send(&frame).is_ok());
    }
    assert_eq!(accepted, 3);
}

/// The window opens with the silence, so that what a gap lost is no fault of the next frame.
#[test]
fn a_gap_of_twenty_milliseconds_is_bridged() {
    for lost in 1..=10 {
        let mut rig = Rig::active_in_curve(0.5);
        while !rig.ticks.is_multiple_of(2) {
            rig.tick();
        }
        rig.silent[COLUMN] = true;
        rig.run(2 * lost);
        rig.silent[COLUMN] = false;
        rig.rejects.clear();
        rig.run(100);
        assert_eq!(rig.rejects, [], "{lost} lost");
    }
}

/// Sent first, with the next counter: every frame of the true sender is then refused, which is counted, and after the
/// sixteenth that the rogue's do not outweigh (one in eight) nobody is believed.
#[test]
fn a_masquerade_is_counted_and_ends_the_trust() {
    let mut rig = Rig::active_in_curve(0.0);
    let mut rejections = Rejections::default();
    let mut accepted = [0, 0];
    for _ in 0..250 {
        while !rig.ticks.is_multiple_of(8) {
            rig.tick();
        }
        let honest = rig.frame(0);
        let counter = honest.data()[1] & 0x0F;
        let lie = LanePreview {
            e_y: Metres::from_m(0.2),
            e_theta: Radians::ZERO,
            age: Micros::from_us(0),
            valid: true,
        };
        rig.silent[0] = true;
        for (who, frame) in [lie.encode(counter), honest].iter().enumerate() {
            match rig.send(frame) {
                Ok(()) => accepted[who] += 1,
                Err(reason) => rejections.count(frame.id(), reason),
            }
        }
        rig.run(1);
        // The harm is what the law makes of 0.2 m, 0.5 N.m/m, and of its step.
        assert!(rig.applied.abs() < 0.13, "{} N.m", rig.applied);
    }
    // 8 for each refused and 1 less for each used: 7*18 + 8 are more than 128.
    assert_eq!(accepted, [19, 0]);
    let line = rejections.line().unwrap();
    assert_eq!((line.id, line.reason, line.count), (0x100, Reject::Repeated, 19));
    let line = rejections.line().unwrap();
    assert_eq!((line.id, line.reason), (0x100, Reject::NotTrusted));
    let command = rig.run(1500).command;
    assert_eq!(command.mode, Mode::Standby);
    assert!(command.faults.contains(Fault::LaneTimeout));
}

/// Not treated: whoever sends the next Request is the host.
#[test]
fn a_forged_request_engages_within_every_limit() {
    let mut rig = Rig::paper();
    rig.curve(1.0);
    rig.run(700);
    while !rig.ticks.is_multiple_of(10) {
        rig.tick();
    }
    let honest = rig.frame(REQUEST);
    let forged = Request {
        engage: true,
        authority: Ratio::from_si(1.0),
        probe: false,
    }
    .encode(honest.data()[1]);
    assert_eq!(rig.send(&forged), Ok(()));
    assert_eq!(rig.send(&honest), Err(Reject::Repeated));
    rig.silent[REQUEST] = true;
    assert_eq!(rig.tick().command.mode, Mode::Active);
    // From zero, at the wind-up limit; and over with the host's next word.
    assert!(rig.applied <= 0.004);
    rig.silent[REQUEST] = false;
    let (ms, _) = rig.run_until(20, |step| step.command.mode == Mode::Fade);
    assert!(ms <= 20, "{ms}");
}

/// Not treated: six frames of a motor that is away from its command end the guidance until power-up. A sudden loss, at
/// any torque; the frames are the true ones but for one signal.
#[test]
fn a_forged_motor_torque_stops_the_guidance_for_good() {
    let mut rig = Rig::active_in_curve(1.0);
    rig.motor = |torque| torque + 0.3;
    let (ms, step) = rig.run_until(20, |step| step.command.mode == Mode::Fault);
    assert!(step.command.faults.contains(Fault::Actuator));
    assert!((10..=13).contains(&ms), "{ms} ms");
}

/// Nineteen frames in five milliseconds used to store any set that is within its ranges, at any speed.
#[test]
fn parameters_are_refused_at_any_speed_but_standstill() {
    let strong = Params {
        k_1: 4.0,
        a_1: 8.0,
        a_3: 8.0,
        ..Params::PAPER
    };
    for (speed, known, outcome) in [
        (27.8, true, WriteOutcome::NotStanding),
        (0.3, true, WriteOutcome::NotStanding),
        (0.0, false, WriteOutcome::NotStanding),
        (0.0, true, WriteOutcome::Taken),
    ] {
        let mut rig = Rig::paper();
        rig.speeds = [speed; 2];
        rig.silent[VEHICLE] = !known;
        let step = rig.run(1100);
        assert_eq!(step.command.mode, Mode::Standby);
        let conditions = Conditions {
            mode: step.command.mode,
            stands: rig.ecu.stands(),
            settled: true,
            in_use: None,
            now_ms: 1100,
        };
        let mut download = Download::NEW;
        download.receive(&unlock(0, 0), &conditions);
        for (now_ms, frame) in (1100..).step_by(10).zip(frames(&strong)) {
            let _ = download.receive(&frame, &Conditions { now_ms, ..conditions });
        }
        assert_eq!(download.status(None, false).outcome, outcome, "{speed} m/s");
    }
}

/// One of two sources is enough to keep a set out: the other may be the forged one.
#[test]
fn both_speeds_have_to_be_next_to_nothing() {
    for speeds in [[0.0, 0.3], [0.3, 0.0]] {
        let mut rig = Rig::paper();
        rig.speeds = speeds;
        rig.run(1100);
        assert!(!rig.ecu.stands());
    }
    let mut rig = Rig::paper();
    rig.speeds = [0.25; 2];
    rig.run(1000);
    assert!(
        !rig.ecu.stands(),
        "a hundred messages in a row, and two before of a sender that is not trusted"
    );
    rig.run(30);
    assert!(rig.ecu.stands());
    // Forged once, contradicted by the next true one.
    let forged = Vehicle {
        speeds: [Speed::ZERO; 2],
        yaw_rate: None,
    };
    let mut rig = Rig::paper();
    rig.run(100);
    let next = rig.frame(VEHICLE).data()[1];
    assert_eq!(rig.send(&forged.encode(next)), Ok(()), "the last speeds are held");
    assert!(!rig.ecu.stands());
}

/// Forged frames of 1 m/s less each, beside the true sender or in its place: 100 km/h at 12 m/s2 take 2.3 s, and a second
/// without a frame refused comes behind them.
#[test]
fn standstill_is_not_forged_by_walking_the_speed_down() {
    for (beside, stands_within) in [(true, u32::MAX), (false, 3400)] {
        let mut rig = Rig::paper();
        rig.speeds = [27.8; 2];
        rig.run(1500);
        let (mut speed, mut stood_at) = (27.8_f64, u32::MAX);
        for ms in 0..6000 {
            if ms % 10 == 0 {
                speed = (speed - 1.0).max(0.0);
                rig.speeds = [speed; 2];
                let forged = rig.frame(VEHICLE);
                let _ = rig.send(&forged);
            }
            rig.speeds = [27.8; 2];
            rig.silent[VEHICLE] = !beside;
            rig.tick();
            if rig.ecu.stands() {
                stood_at = stood_at.min(ms);
            }
        }
        assert!(
            stood_at > 2200 && stood_at <= stands_within,
            "{beside}: {stood_at} ms"
        );
    }
}

#[test]
fn rejections_are_told_pair_by_pair() {
    let mut rejections = Rejections::NONE;
    assert_eq!((rejections.line(), rejections.total()), (None, 0));
    for (id, reason, times) in [
        (0x110, Reject::Crc, 3),
        (0x100, Reject::Step, 1),
        (0x0C0, Reject::OwnIdentifier, 70_000),
        // None of the bus's.
        (0x555, Reject::Crc, 5),
    ] {
        for _ in 0..times {
            rejections.count(id, reason);
        }
    }
    let expected = [
        (0x0C0, Reject::OwnIdentifier, u16::MAX),
        (0x100, Reject::Step, 1),
        (0x110, Reject::Crc, 3),
    ];
    assert_eq!(rejections.total(), u32::from(u16::MAX) + 4);
    for _ in 0..2 {
        for expected in expected {
            let line = rejections.line().unwrap();
            assert_eq!((line.id, line.reason, line.count), expected);
        }
    }
}

/// A whole simulated vehicle on the bus, in a bend that asks for 2 N.m, whose driver torque moves by so much to and fro. Within
/// 0.08 N.m nobody's hand is there: warned after 15 s, over after 30 s. A larger one passes for a hand, and only the limits bound it.
#[test]
fn a_phantom_vehicle_whose_driver_torque_dithers_lasts_for_thirty_seconds() {
    for (dither_nm, ends) in [(0.01, true), (0.1, false)] {
        let mut rig = Rig::active_in_curve(2.0);
        let (mut warned_s, mut ended_s) = (None, None);
        for ms in 0..40_000_u32 {
            let sign = if ms / 2 % 2 == 0 { 1.0 } else { -1.0 };
            rig.driver = Some(sign * dither_nm);
            let command = rig.tick().command;
            assert!(rig.applied.abs() < 2.05, "{} N.m", rig.applied);
            if command.warning {
                warned_s.get_or_insert(f64::from(ms) * 1e-3);
            }
            if command.mode != Mode::Active {
                ended_s.get_or_insert(f64::from(ms) * 1e-3);
            }
        }
        println!("+-{dither_nm} N.m: warned after {warned_s:?} s, over after {ended_s:?} s");
        let within = |at_s: Option<f64>, most_s: f64| at_s.is_some_and(|at_s| at_s < most_s);
        assert_eq!(within(warned_s, 15.1) && within(ended_s, 30.1), ends);
        assert_eq!(ended_s.is_some(), ends);
    }
}
