//! What a node on the bus can do that computes CRC and counter as the senders do. There is no authentication: a row bounds
//! the harm, it does not claim that the frame is refused.

use super::{BLIND_MS, FaultCase, STALE_MS};
use crate::bytes::{COLUMN, LANE, REQUEST, VEHICLE};
use crate::injection::{Change, Hand, Injection, Signal, Wire};

const fn false_lane(to_m: f64, hides_hand: bool) -> Injection {
    Injection::FalseLane {
        to_m,
        ms: 160,
        hides_hand,
    }
}

const fn wire(wire: Wire) -> Injection {
    Injection::Wire(wire)
}

/// Twenty periods of the host: sixteen contradictions, which the frames that were used outweigh in part.
const TWO_SENDERS_MS: u32 = 210;

const fn between(id: u16, start: u32, bits: u32, more: i64) -> Injection {
    wire(Wire::Between {
        id,
        start,
        bits,
        more,
    })
}

pub(super) const ROWS: &[FaultCase] = rows! {
    "attack-lane-0.29" "lane lie of 0.29 m in every frame"
        [Injection::Sensor(Signal::LateralError, Change::Plus(0.29))] .may_hand_over();
    "attack-lane-4" "lane lie to 4 m in 160 ms, e_theta' matched to the yaw rate"
        [false_lane(4.0, false)] .may_hand_over().torque(5.0);
    "attack-lane-and-column" "the same, and the driver torque made to fit the column"
        [false_lane(4.0, true)] .only_rules().torque(5.0);
    "attack-lane-and-column-opposed" "the same while the driver pulls back with 10 N.m"
        [
            false_lane(4.0, true),
            Injection::Hand(Hand::Opposes { torque_nm: 10.0, ms: 1000 }),
        ] .only_rules().torque(5.0);
    "attack-motor-reading" "six column frames whose motor torque is 0.2 N.m off"
        [Injection::Sensor(Signal::MotorTorque, Change::Plus(0.2))] .only_rules().lasts(12);
    "attack-masquerade" "another node sends each lane preview first, 0.29 m aside, with the camera's counter"
        [wire(Wire::Outrun(2376))] .hands_over(TWO_SENDERS_MS + BLIND_MS);
    "attack-between-lane" "six frames of another node between two of the camera's, 0.24 m aside, in order with all"
        [between(LANE, 12, 17, 1966)] .hands_over(TWO_SENDERS_MS + BLIND_MS);
    "attack-between-column" "six between two of the column's, which say 1 N.m less"
        [between(COLUMN, 12, 18, -4096)] .hands_over(50);
    "attack-between-vehicle" "six between two of the vehicle's, with a speed 0.9 m/s lower"
        [between(VEHICLE, 12, 16, -230)] .hands_over(TWO_SENDERS_MS);
    "attack-between-request" "six between two of the host's, with an authority of 0.5"
        [between(REQUEST, 13, 8, -64)] .hands_over(TWO_SENDERS_MS);
    "attack-flood" "a flood that lets no frame through for 200 ms"
        [wire(Wire::Lost(&[LANE, COLUMN, VEHICLE, REQUEST], None))] .hands_over(STALE_MS).lasts(200);
    "attack-replay-column" "column frames of 0.5 s ago in place of the column's"
        [wire(Wire::Replayed(&[COLUMN], 500))] .only_rules();
};
