use std::cell::RefCell;
use std::collections::BTreeSet;

use haptic_core::bus::messages::{Column, Message, Vehicle};
use haptic_core::controller::params::{PARAMETERS, Params};
use haptic_core::quantity::{Radians, Speed, Torque};
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;
use haptic_core::service::stored::{self, Set};
use haptic_diag::data::{PARAMETERS_AT, entries};
use haptic_diag::server::{SESSION_MS, STORED_LAYOUT};
use haptic_diag::trouble::{EMPTY, code_of};
use proptest::bool::weighted;
use proptest::collection::vec;
use proptest::prelude::*;

use crate::cases::cases;
use crate::rig::{KEY, Rig};

/// C1111, of OwnIdentifier, which is number 17 of the list.
const OWN_IDENTIFIER: [u8; 3] = [0x51, 0x11, 0x00];

fn all_read(rig: &mut Rig, id: u16) -> Vec<u8> {
    let [high, low] = id.to_be_bytes();
    rig.expect(&[0x22, high, low], &[0x62, high, low])[3..].to_vec()
}

#[test]
fn a_session_ends_five_seconds_after_the_last_request() {
    let mut rig = Rig::new();
    assert_eq!(all_read(&mut rig, 0xF186), [1]);
    rig.expect(&[0x10, 3], &[0x50, 3]);
    for _ in 0..3 {
        rig.wait(SESSION_MS - 100);
        // Without an answer, as testers keep a session.
        assert_eq!(rig.ask(&[0x3E, 0x80]), None);
    }
    assert_eq!(all_read(&mut rig, 0xF186), [3]);
    rig.wait(SESSION_MS + 1);
    assert_eq!(all_read(&mut rig, 0xF186), [1]);
    rig.refuses(&[0x10, 2], 0x12);
}

#[test]
fn all_of_the_list_can_be_read_and_nothing_beside_it() {
    let mut rig = Rig::new();
    let ids: BTreeSet<u16> = entries().map(|entry| entry.id).collect();
    assert_eq!(ids.len(), entries().count(), "no identifier twice");
    let names: BTreeSet<&str> = entries().map(|entry| entry.name).collect();
    assert_eq!(names.len(), ids.len(), "no name twice");
    for id in 0..=u16::MAX {
        let [high, low] = id.to_be_bytes();
        let answer = rig.ask(&[0x22, high, low]).unwrap();
        assert_eq!(answer[0] == 0x62, ids.contains(&id), "{id:04X}");
        assert!(answer[0] == 0x62 || answer == [0x7F, 0x22, 0x31]);
    }
    for (index, value) in Params::PAPER.to_values().into_iter().enumerate() {
        let id = PARAMETERS_AT + index as u16;
        assert_eq!(
            all_read(&mut rig, id),
            (value as f32).to_be_bytes(),
            "{}",
            PARAMETERS[index].name
        );
    }
    assert_eq!(all_read(&mut rig, 0xF189), b"9.8.7");
    assert_eq!(all_read(&mut rig, 0xF188), b"0123456789ab");
    assert_eq!(all_read(&mut rig, 0xF18C), [0xCA, 0xFE, 0, 1]);
    assert_eq!(all_read(&mut rig, 0x0305), [0, 0, 0, 7]);
    // What is unknown is left out beside what is not.
    rig.expect(&[0x22, 0x77, 0x77, 0x03, 0x00], &[0x62, 0x03, 0x00, 1]);
    // The layout is that which a stored set begins with.
    let set = Set {
        params: Params::PAPER,
        vehicle: None,
    };
    assert_eq!(stored::save(&set, 1, 2)[..4], STORED_LAYOUT.to_le_bytes());
    rig.params = None;
    rig.refuses(&[0x22, 0x10, 0x00], 0x22);
}

#[test]
fn live_readings_are_those_of_the_last_good_frames() {
    let mut rig = Rig::new();
    for id in [0x0310, 0x0311, 0x0312, 0x0313] {
        let bytes: [u8; 4] = all_read(&mut rig, id).try_into().unwrap();
        assert!(f32::from_be_bytes(bytes).is_nan(), "{id:04X}: nobody said");
    }
    let column = Column {
        driver_torque: Torque::from_nm(-2.5),
        wheel_angle: Radians::from_rad(0.0),
        ..Column::default()
    };
    let vehicle = Vehicle {
        speeds: [Speed::from_m_per_s(20.0); 2],
        yaw_rate: None,
    };
    rig.server.receive(&column.encode(3), 0);
    rig.server.receive(&vehicle.encode(9), 0);
    assert_eq!(all_read(&mut rig, 0x0310), (-2.5_f32).to_be_bytes());
    assert_eq!(all_read(&mut rig, 0x0312), 20_f32.to_be_bytes());
    // A damaged one says nothing.
    let mut damaged = vehicle.encode(10).full_data().unwrap();
    damaged[7] ^= 1;
    rig.server
        .receive(&haptic_core::bus::Frame::full(Vehicle::ID, damaged), 0);
    let speed: [u8; 4] = all_read(&mut rig, 0x0312).try_into().unwrap();
    assert!(f32::from_be_bytes(speed).is_nan());
}

#[test]
fn a_fault_has_a_code_a_count_and_a_snapshot_across_resets_until_it_is_cleared() {
    let mut rig = Rig::new();
    assert_eq!(rig.expect(&[0x19, 2, 0xFF], &[0x59, 2]), [0x59, 2, 0x2B]);
    let [a, b, c] = OWN_IDENTIFIER;
    for appearance in 1..=2 {
        rig.command.faults = FaultSet::NONE.with(Fault::OwnIdentifier);
        rig.command.mode = Mode::Active;
        rig.command.torque = Torque::from_nm(1.5);
        rig.step();
        assert_eq!(
            rig.expect(&[0x19, 2, 0xFF], &[0x59, 2]),
            [0x59, 2, 0x2B, a, b, c, 0x2B]
        );
        let count = rig.expect(&[0x19, 6, a, b, c, 0xFF], &[0x59, 6]);
        assert_eq!(count, [0x59, 6, a, b, c, 0x2B, 1, appearance]);
        rig.command.faults = FaultSet::NONE;
        rig.command.torque = Torque::ZERO;
        rig.step();
    }
    // Present no more.
    assert_eq!(rig.expect(&[0x19, 1, 0x08], &[0x59, 1]), [0x59, 1, 0x2B, 1, 0, 1]);
    assert_eq!(rig.expect(&[0x19, 1, 0x01], &[0x59, 1]), [0x59, 1, 0x2B, 1, 0, 0]);
    let snapshot = rig.expect(&[0x19, 4, a, b, c, 1], &[0x59, 4, a, b, c, 0x2A, 1, 8]);
    assert_eq!(snapshot[8..11], [0x03, 0x00, Mode::Active as u8]);
    assert_eq!(snapshot[11..17], [0x03, 0x01, 0, 2, 0, 0], "bit 17");
    assert_eq!(
        snapshot[17..23],
        [&[0x03, 0x02][..], &1.5_f32.to_be_bytes()].concat()
    );
    assert_eq!(snapshot.len(), 8 + 3 + 7 * 6);

    // A reset leaves it alone; it did not appear since then.
    let mut rig = Rig::with(rig.cells, Some(KEY));
    assert_eq!(
        rig.expect(&[0x19, 2, 0x08], &[0x59, 2]),
        [0x59, 2, 0x2B, a, b, c, 0x28]
    );
    assert_eq!(rig.expect(&[0x19, 4, a, b, c, 1], &[0x59, 4])[8..], snapshot[8..]);

    rig.refuses(&[0x14, 0xFF, 0xFF, 0xFF], 0x7F);
    rig.expect(&[0x10, 3], &[0x50, 3]);
    rig.refuses(&[0x14, 0x51, 0x11, 0x01], 0x31);
    // Another code's clearing does not clear this one.
    rig.expect(&[0x14, 0x51, 0x10, 0x00], &[0x54]);
    assert_eq!(rig.expect(&[0x19, 2, 0x08], &[0x59, 2]).len(), 7);
    rig.expect(&[0x14, a, b, c], &[0x54]);
    assert_eq!(rig.expect(&[0x19, 2, 0x08], &[0x59, 2]).len(), 3);
    assert_eq!(
        rig.expect(&[0x19, 4, a, b, c, 1], &[0x59, 4]),
        [0x59, 4, a, b, c, 0]
    );
    let mut rig = Rig::with(rig.cells, Some(KEY));
    assert_eq!(rig.expect(&[0x19, 2, 0x08], &[0x59, 2]).len(), 3);
}

#[test]
fn every_fault_has_a_code_and_all_at_once_are_stored() {
    let mut rig = Rig::new();
    let mut all = FaultSet::NONE;
    Fault::ALL.into_iter().for_each(|fault| all.insert(fault));
    rig.command.faults = all;
    // One in a step.
    rig.wait(Fault::COUNT as u32);
    let supported = rig.expect(&[0x19, 0x0A], &[0x59, 0x0A, 0x2B]);
    assert_eq!(supported.len(), 3 + 4 * Fault::COUNT);
    for (fault, line) in Fault::ALL.into_iter().zip(supported[3..].chunks(4)) {
        assert_eq!(line, [0x51, fault as u8, 0, 0x2B]);
        assert_eq!(code_of(fault), 0x51_0000 + ((fault as u32) << 8));
    }
    assert_eq!(rig.expect(&[0x19, 2, 0x01], &[0x59, 2])[3..], supported[3..]);
    // Cleared while they are present, they come back at once.
    rig.expect(&[0x10, 3], &[0x50, 3]);
    rig.expect(&[0x14, 0xFF, 0xFF, 0xFF], &[0x54]);
    rig.wait(Fault::COUNT as u32);
    assert_eq!(rig.expect(&[0x19, 2, 0x08], &[0x59, 2]).len(), supported.len());
    for code in [[0x51, 21, 0], [0x51, 0, 1], [0, 0, 0], [0xFF, 0xFF, 0xFF]] {
        let [a, b, c] = code;
        rig.refuses(&[0x19, 4, a, b, c, 1], 0x31);
        rig.refuses(&[0x19, 6, a, b, c, 1], 0x31);
    }
    rig.refuses(&[0x19, 4, 0x51, 0, 0, 2], 0x31);
}

/// A cell that a flipped bit or noise spoiled is an empty one.
#[test]
fn a_spoiled_cell_is_empty() {
    let mut rig = Rig::new();
    rig.command.faults = FaultSet::NONE.with(Fault::LaneTimeout);
    rig.step();
    let stored = |cells| {
        let mut rig = Rig::with(cells, Some(KEY));
        rig.expect(&[0x19, 1, 0x08], &[0x59, 1])[5]
    };
    assert_eq!(stored(rig.cells), 1);
    for word in 0..rig.cells[0].len() {
        for bit in 0..32 {
            let mut cells = rig.cells;
            cells[0][word] ^= 1 << bit;
            assert_eq!(stored(cells), 0, "bit {bit} of word {word}");
        }
    }
    let noise = vec(any::<u32>(), EMPTY.as_flattened().len());
    cases(1, 100, &noise, |noise| {
        let mut cells = EMPTY;
        cells.as_flattened_mut().copy_from_slice(&noise);
        prop_assert_eq!(stored(cells), 0);
        Ok(())
    });
}

#[test]
fn a_reset_is_for_who_proved_himself_beside_a_vehicle_that_stands() {
    let mut rig = Rig::new();
    rig.refuses(&[0x11, 1], 0x7F);
    rig.expect(&[0x10, 3], &[0x50, 3]);
    rig.refuses(&[0x11, 1], 0x33);
    rig.open();
    rig.stands = false;
    rig.refuses(&[0x11, 1], 0x88);
    (rig.stands, rig.command.mode) = (true, Mode::Active);
    rig.refuses(&[0x11, 1], 0x22);
    rig.command.mode = Mode::Standby;
    assert!(!rig.is_reset);
    rig.expect(&[0x11, 1], &[0x51, 1]);
    rig.wait(45);
    assert!(!rig.is_reset, "the answer leaves first");
    rig.wait(10);
    assert!(rig.is_reset);
}

/// Anything at all from a bus: no panic, and nothing is written or reset.
#[test]
fn noise_unlocks_nothing() {
    let services = prop::sample::select(&[0x10_u8, 0x11, 0x14, 0x19, 0x22, 0x27, 0x2E, 0x31, 0x3E, 0x85]);
    let request = (weighted(0.8), 0..8_u8, services);
    // Up to 20 seconds, which is longer than a session and the wait for another proof.
    let heard = vec((vec(any::<u8>(), 0..=8), request, any::<u32>()), 0..=20_000);
    let answers = RefCell::new(BTreeSet::new());
    cases(47, 20, &heard, |heard| {
        let mut rig = Rig::new();
        for (mut data, (is_near, length, service), faults) in heard {
            if let ([head, of, rest @ ..], true) = (&mut data[..], is_near) {
                (*head, *of) = (length, service);
                rest.iter_mut().take(1).for_each(|sub| *sub &= 0x83);
            }
            rig.say(&data);
            answers.borrow_mut().extend(rig.step().map(|frame| frame[1]));
            rig.command.faults = FaultSet::from_bits(faults);
            prop_assert!(!rig.is_reset && rig.set.is_none());
        }
        Ok(())
    });
    let answers = answers.into_inner();
    assert!(answers.len() > 8, "{answers:02X?}");
}
