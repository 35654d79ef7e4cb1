//! Any bytes in, invariants out: the frame decoders, SLCAN, and the ECU from frames and ticks.
//!
//! Byte streams come from a seeded generator that mixes noise with what the target understands, so that a plain
//! stable toolchain runs this and a failure comes back with the same seed. A million bytes each by default; longer
//! by hand, with another seed:
//!
//! ```text
//! HAPTIC_FUZZ_BYTES=1000000000 HAPTIC_FUZZ_SEED=7 cargo test --release -p haptic-core fuzz::
//! ```

use crate::rig::Rig;
use crate::rig::watch::Watch;
use haptic_core::bus::Frame;
use haptic_core::bus::e2e::ReceiverState;
use haptic_core::bus::messages::{
    Column, FaultRecord, Guidance, LanePreview, Message, Request, Vehicle, Warning,
};
use haptic_core::bus::slcan::{self, Line, Parser};
use haptic_core::quantity::{Metres, Radians};
use haptic_core::safety::faults::{Fault, FaultSet};
use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};

fn variable(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| {
        text.parse()
            .unwrap_or_else(|_| panic!("{name} = {text} is no number"))
    })
}

fn rng() -> SmallRng {
    SmallRng::seed_from_u64(variable("HAPTIC_FUZZ_SEED", 1))
}

fn bytes_to_eat() -> u64 {
    variable("HAPTIC_FUZZ_BYTES", 1_000_000)
}

/// Decodes as one message: what is accepted encodes to the same signals again, in the same bits.
fn decodes_to_itself<M: Message + PartialEq + core::fmt::Debug>(frame: &Frame) -> bool {
    let mut trusted = ReceiverState::TRUSTED;
    // A frame is protected anew, so that the fuzz gets past the CRC and at the signals.
    let Ok(mut bytes) = <[u8; 8]>::try_from(frame.data()) else {
        assert!(M::decode(&mut trusted, frame).is_err());
        return false;
    };
    M::PROTECTION.protect(&mut bytes, frame.data()[1]);
    let frame = Frame::new(frame.id(), &bytes).unwrap();
    let Ok(message) = M::decode(&mut trusted, &frame) else {
        return false;
    };
    let mut again = [0; 8];
    message.pack(&mut again);
    assert_eq!(M::unpack(&again), Some(message), "{frame:?}");
    true
}

#[test]
fn frame_decoders() {
    let mut rng = rng();
    let mut accepted = [0_u64; 7];
    for _ in 0..bytes_to_eat() / 8 {
        let mut bytes: [u8; 8] = rng.random();
        if rng.random_bool(0.5) {
            // Small signals, which more messages accept.
            bytes[2..]
                .iter_mut()
                .for_each(|byte| *byte &= rng.random::<u8>() & rng.random::<u8>());
        }
        let length = if rng.random_bool(0.1) {
            rng.random_range(0..=8)
        } else {
            8
        };
        let frame = Frame::new(rng.random_range(0..=Frame::MAX_ID), &bytes[..length]).unwrap();
        for (count, good) in accepted.iter_mut().zip([
            decodes_to_itself::<LanePreview>(&frame),
            decodes_to_itself::<Column>(&frame),
            decodes_to_itself::<Vehicle>(&frame),
            decodes_to_itself::<Request>(&frame),
            decodes_to_itself::<Guidance>(&frame),
            decodes_to_itself::<Warning>(&frame),
            decodes_to_itself::<FaultRecord>(&frame),
        ]) {
            *count += u64::from(good);
        }
    }
    println!("accepted by message: {accepted:?}");
    assert!(accepted.iter().all(|count| *count > 100), "{accepted:?}");
}

#[test]
fn slcan_lines() {
    let mut rng = rng();
    let mut parser = Parser::default();
    let (mut frames, mut lines) = (0_u64, 0_u64);
    let mut eaten = 0;
    while eaten < bytes_to_eat() {
        // A line as a client writes it, and then perhaps a byte of it changed, lost or doubled.
        let mut line = match rng.random_range(0..8) {
            0 => b"tTrRSCVNFsMmZXWLO\n"[rng.random_range(0..18)..][..1].to_vec(),
            1 => (0..rng.random_range(0..40)).map(|_| rng.random()).collect(),
            _ => {
                let length = rng.random_range(0..=8_usize);
                let id = rng.random_range(0..=Frame::MAX_ID);
                let data: Vec<String> = (0..length)
                    .map(|_| format!("{:02x}", rng.random::<u8>()))
                    .collect();
                format!("t{id:03X}{length}{}", data.concat()).into_bytes()
            }
        };
        line.push(b'\r');
        let at = rng.random_range(0..line.len());
        match rng.random_range(0..10) {
            0 => line[at] = rng.random(),
            1 => drop(line.remove(at)),
            2 => line.insert(at, line[at]),
            _ => {}
        }
        eaten += line.len() as u64;
        for byte in line {
            let Some(line) = parser.push(byte) else {
                assert!(byte != b'\r', "a line ends with every carriage return");
                continue;
            };
            lines += 1;
            let answer = line.answer();
            assert!(answer == b"\x07" || answer.ends_with(b"\r"));
            if let Line::Frame(frame) = line {
                frames += 1;
                let mut again = Parser::default();
                let text = slcan::format(&frame);
                let parsed: Vec<Line> = text.iter().filter_map(|byte| again.push(*byte)).collect();
                assert_eq!(parsed, [Line::Frame(frame)]);
            }
        }
    }
    println!("{frames} frames in {lines} lines");
    assert!(frames > 100);
}

/// One instruction to the bench, from a few bytes.
fn act(rig: &mut Rig, rng: &mut SmallRng) -> Option<u32> {
    let operand: [u8; 8] = rng.random();
    let sender = usize::from(operand[0] % 4);
    let small = |byte: u8| f64::from(byte.cast_signed()) / 128.0;
    match rng.random_range(0..1000_u32) {
        // Time passes, mostly as it should.
        0..940 => return Some(1000),
        940 if operand[0] < 20 => return Some(u32::from(operand[1]) * 16),
        941 if operand[0] < 2 => return Some(u32::from(u16::from_le_bytes([operand[1], operand[2]]))),
        // Signals jump anywhere, or a little.
        962..964 => rig.lane.e_y = Metres::from_m(4.0 * small(operand[1])),
        964..966 => rig.lane.e_theta = Radians::from_rad(0.5 * small(operand[1])),
        966..972 => rig.lane.e_y = Metres::from_m(rig.lane.e_y.m() + 0.3 * small(operand[1])),
        972 => rig.driver = Some(20.0 * small(operand[1])),
        973 => rig.driver = None,
        974 => rig.speeds = [80.0 * small(operand[1]).abs(), 80.0 * small(operand[2]).abs()],
        975 => rig.speeds = [crate::rig::SPEED; 2],
        976 => rig.engage = operand[1] < 128,
        977 => rig.wheel = 12.0 * small(operand[1]),
        978 => rig.silent[sender] = !rig.silent[sender],
        979..982 => rig.silent = [false; 4],
        982..984 => rig.curve(3.0 * small(operand[1])),
        // Frames out of turn: good ones, with a flipped bit, under any identifier, of any length, any bytes.
        984..988 => {
            let frame = rig.frame(sender);
            let _ = rig.send(&frame);
        }
        988..992 => {
            let frame = rig.frame(sender);
            let mut bytes: [u8; 8] = frame.data().try_into().unwrap();
            bytes[usize::from(operand[1] % 8)] ^= 1 << (operand[2] % 8);
            let _ = rig.send(&Frame::new(frame.id(), &bytes).unwrap());
        }
        992..994 => {
            let frame = rig.frame(sender);
            let id = u16::from_le_bytes([operand[1], operand[2]]) & Frame::MAX_ID;
            let _ = rig.send(&Frame::new(id, frame.data()).unwrap());
        }
        _ => {
            let id = [0x100, 0x110, 0x120, 0x130][sender];
            let _ = rig.send(&Frame::new(id, &operand[..usize::from(operand[1] % 9)]).unwrap());
        }
    }
    None
}

#[test]
fn ecu() {
    let mut rng = rng();
    let engaged = Rig::active_in_curve(1.0);
    let mut eaten = 0;
    let mut counts = Watch::new(5.0);
    // Each stream begins with guidance on and lasts until the ECU has been idle for a second.
    while eaten < bytes_to_eat() {
        let mut rig = engaged.clone();
        let mut watch = Watch::engaged(&rig);
        let mut idle = 0;
        for _ in 0..20_000 {
            eaten += 8;
            let Some(us) = act(&mut rig, &mut rng) else {
                continue;
            };
            let step = rig.tick_after(us);
            rig.rejects.clear();
            watch.check(&rig, &step);
            idle += u32::from(!step.command.mode.may_have_torque());
            if idle > 1000 {
                break;
            }
            // Nothing that comes in over the bus is a fault of the ECU itself, but for late ticks and for a
            // motor torque that the fuzz made up.
            let mut own = step.command.faults.common(FaultSet::CRITICAL);
            for fault in [Fault::Deadline, Fault::Actuator] {
                own.set(false, fault);
            }
            assert_eq!(own, FaultSet::NONE, "{:?}", step.command);
        }
        (0..7).for_each(|i| counts.by_mode[i] += watch.by_mode[i]);
        (0..8).for_each(|i| counts.by_limit[i] += watch.by_limit[i]);
    }
    println!(
        "steps by mode {:?}, by limit {:?}",
        counts.by_mode, counts.by_limit
    );
    assert!(counts.by_mode[1..6].iter().all(|count| *count > 0), "{counts:?}");
}
