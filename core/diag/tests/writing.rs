use std::num::NonZeroU32;

use haptic_core::controller::params::{PARAMETERS, Params};
use haptic_core::safety::modes::Mode;
use haptic_core::service::download;
use haptic_core::service::stored::{Set, Stored};
use haptic_diag::data::PARAMETERS_AT;

use crate::rig::Rig;

const COMMIT: [u8; 4] = [0x31, 1, 2, 0];
const RESULT: [u8; 4] = [0x31, 3, 2, 0];

fn write(name: &str, value: f32) -> Vec<u8> {
    let index = PARAMETERS
        .iter()
        .position(|parameter| parameter.name == name)
        .unwrap();
    let [high, low] = (PARAMETERS_AT + index as u16).to_be_bytes();
    let [a, b, c, d] = value.to_be_bytes();
    vec![0x2E, high, low, a, b, c, d]
}

fn rig() -> Rig {
    let mut rig = Rig::new();
    rig.stored = Some(Stored {
        set: Set {
            params: Params::PAPER,
            vehicle: NonZeroU32::new(77),
        },
        sequence: 41,
        copy: 1,
    });
    rig.open();
    rig
}

#[test]
fn a_set_that_was_written_and_committed_is_handed_over_whole() {
    let mut rig = rig();
    let request = write("torque_limit_nm", 3.0);
    assert_eq!(rig.expect(&request, &[0x6E]), [0x6E, request[1], request[2]]);
    assert_eq!(rig.set, None);
    rig.refuses(&RESULT, 0x24);
    rig.expect(&COMMIT, &[0x71, 1, 2, 0]);
    rig.refuses(&COMMIT, 0x21);
    rig.refuses(&request, 0x22);
    rig.wait(20);
    assert_eq!(
        rig.expect(&RESULT, &[0x71, 3, 2, 0])[4..],
        [1, 1],
        "under way, receiving"
    );
    rig.wait(400);
    let set = rig.set.unwrap();
    let rounded = |params: Params| params.to_values().map(|value| value as f32);
    let expected = Params {
        torque_limit_nm: 3.0,
        ..Params::PAPER
    };
    assert_eq!(rounded(set.params), rounded(expected));
    assert_eq!(set.vehicle, NonZeroU32::new(77), "that of the set in use");
    assert_eq!(rig.expect(&RESULT, &[0x71, 3, 2, 0])[4..], [0, 5], "taken");
}

#[test]
fn the_vehicle_s_number_can_be_written() {
    let mut rig = rig();
    rig.refuses(&[0x2E, 0x02, 0x02, 0, 0x10, 0, 0], 0x31);
    rig.expect(&[0x2E, 0x02, 0x02, 0, 0x0F, 0xFF, 0xFF], &[0x6E, 2, 2]);
    rig.expect(&COMMIT, &[0x71]);
    rig.wait(400);
    assert_eq!(rig.set.unwrap().vehicle, NonZeroU32::new(0xF_FFFF));
    // What is not written is not.
    for id in [0x0201_u16, 0xF186, 0x0300, 0x0FFF] {
        let [high, low] = id.to_be_bytes();
        rig.refuses(&[0x2E, high, low, 0, 0, 0, 0], 0x31);
    }
}

/// Both ends of every range are in it, as binary32; what lies next to them is not.
#[test]
fn every_range_is_kept() {
    let mut rig = rig();
    for parameter in PARAMETERS {
        let (least, most) = (parameter.min as f32, parameter.max as f32);
        for good in [least, most] {
            rig.expect(&write(parameter.name, good), &[0x6E]);
        }
        for bad in [
            least.next_down(),
            most.next_up(),
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
        ] {
            rig.refuses(&write(parameter.name, bad), 0x31);
        }
    }
    let right = write("k_1", 0.25);
    for length in [4, 5, 6] {
        rig.refuses(&right[..length], 0x13);
    }
    rig.refuses(&[&right[..], &[0]].concat(), 0x13);
}

#[test]
fn a_commit_asks_for_standby_standstill_and_something_to_commit() {
    let mut rig = rig();
    rig.refuses(&COMMIT, 0x24);
    rig.expect(&write("k_1", 0.125), &[0x6E]);
    for mode in [
        Mode::Boot,
        Mode::Active,
        Mode::Fade,
        Mode::Handover,
        Mode::Fault,
        Mode::Locked,
    ] {
        rig.command.mode = mode;
        rig.refuses(&COMMIT, 0x22);
    }
    rig.command.mode = Mode::Standby;
    rig.stands = false;
    rig.refuses(&COMMIT, 0x88);
    (rig.stands, rig.settled) = (true, false);
    rig.refuses(&COMMIT, 0x22);
    rig.settled = true;
    rig.expect(&COMMIT, &[0x71]);
    // A vehicle that drives off meanwhile: the download refuses the rest.
    rig.wait(100);
    rig.stands = false;
    rig.wait(400);
    assert_eq!(rig.set, None);
    assert_eq!(rig.expect(&RESULT, &[0x71, 3, 2, 0])[4..], [0, 6], "not standing");
    // Once more, where it stands again.
    rig.stands = true;
    rig.expect(&COMMIT, &[0x71]);
    rig.wait(400);
    assert!(rig.set.is_some());
}

/// Whoever writes beside it spoils it, and nothing of a mixture is taken.
#[test]
fn somebody_else_s_field_between_spoils_the_set() {
    let mut rig = rig();
    rig.expect(&write("k_1", 0.125), &[0x6E]);
    rig.expect(&COMMIT, &[0x71]);
    rig.wait(55);
    let foreign = download::frames(&Params::PAPER)[20];
    let conditions = download::Conditions {
        mode: Mode::Standby,
        stands: true,
        settled: true,
        in_use: Some(41),
        now_ms: rig.now_ms,
    };
    assert_eq!(rig.download.receive(&foreign, &conditions), None);
    rig.wait(400);
    assert_eq!(rig.set, None);
    assert_eq!(rig.expect(&RESULT, &[0x71, 3, 2, 0])[4..], [0, 3], "out of order");
}

#[test]
fn an_ecu_without_a_set_needs_all_of_one() {
    let mut rig = rig();
    (rig.params, rig.stored) = (None, None);
    rig.expect(&write("k_1", 0.125), &[0x6E]);
    rig.refuses(&COMMIT, 0x24);
    for (parameter, value) in PARAMETERS.iter().zip(Params::PAPER.to_values()) {
        rig.expect(&write(parameter.name, value as f32), &[0x6E]);
    }
    rig.expect(&COMMIT, &[0x71]);
    rig.wait(400);
    assert!(rig.set.is_some());
}

#[test]
fn what_was_written_is_forgotten_with_its_session() {
    let mut rig = rig();
    rig.expect(&write("k_1", 0.125), &[0x6E]);
    rig.open();
    rig.refuses(&COMMIT, 0x24);
    rig.refuses(&[0x31, 1, 0x77, 0x77], 0x31);
    rig.refuses(&[0x31, 2, 2, 0], 0x12);
}
