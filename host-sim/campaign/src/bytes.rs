//! Frames as the campaign reads and forges them: its own CRC and its own bit fields, in f64.
//!
//! Shares nothing with the core's bus, on purpose: a wrong scale or position there would otherwise agree with
//! itself here. Positions, LSBs and identifiers are those of `core/haptic.dbc`; the data ID list is the one
//! that the bus is specified with.

use haptic_core::bus::Frame;

/// CAN identifiers.
pub(super) const GUIDANCE: u16 = 0x0C0;
pub(super) const WARNING: u16 = 0x0D0;
pub(super) const LANE: u16 = 0x100;
pub(super) const COLUMN: u16 = 0x110;
pub(super) const VEHICLE: u16 = 0x120;
pub(super) const REQUEST: u16 = 0x130;
/// What the ECU hears, in the order of the senders' counters.
pub(super) const MESSAGES: [u16; 4] = [LANE, COLUMN, VEHICLE, REQUEST];

/// Codes of the modes.
pub(super) const STANDBY: u64 = 1;
pub(super) const ACTIVE: u64 = 2;
pub(super) const FADE: u64 = 3;
pub(super) const HANDOVER: u64 = 4;
pub(super) const FAULT: u64 = 5;
pub(super) const LOCKED: u64 = 6;
/// Bit of the fault of a line elsewhere, which is a warning in Active.
pub(super) const LANE_STEP: u64 = 1 << 15;

const DATA_IDS: [u8; 16] = [
    0xD9, 0xAD, 0xC1, 0x0B, 0x75, 0xF8, 0xE0, 0x7C, 0x7A, 0xE6, 0xAE, 0x92, 0x9B, 0x3E, 0xEA, 0x5E,
];

/// What a message XORs the data IDs with; `None` for a message that is not protected.
fn constant(id: u16) -> Option<u8> {
    Some(match id {
        GUIDANCE => 0x5A,
        WARNING => 0x66,
        LANE => 0x11,
        COLUMN => 0x22,
        VEHICLE => 0x33,
        REQUEST => 0x44,
        _ => return None,
    })
}

/// CRC-8, polynomial 0x2F, init 0xFF, xorout 0xFF, bit by bit.
fn crc8(bytes: impl IntoIterator<Item = u8>) -> u8 {
    let mut crc = 0xFF_u8;
    for byte in bytes {
        crc ^= byte;
        for _ in 0..8 {
            crc = if crc & 0x80 != 0 {
                (crc << 1) ^ 0x2F
            } else {
                crc << 1
            };
        }
    }
    !crc
}

/// The CRC that a full frame under `id` must have; `None` where there is none.
fn expected_crc(id: u16, data: &[u8]) -> Option<u8> {
    let [_, rest @ ..] = data else { return None };
    let list_entry = DATA_IDS[usize::from(*rest.first()? & 0x0F)] ^ constant(id)?;
    Some(crc8(rest.iter().copied().chain([list_entry])))
}

/// Whether a frame is eight bytes long and its CRC fits its identifier.
pub(super) fn is_intact(frame: &Frame) -> bool {
    frame.data().len() == 8 && expected_crc(frame.id(), frame.data()) == frame.data().first().copied()
}

fn word(frame: &Frame) -> u64 {
    let mut bytes = [0; 8];
    let data = frame.data();
    bytes[..data.len()].copy_from_slice(data);
    u64::from_le_bytes(bytes)
}

/// Unsigned little-endian field.
pub(super) fn unsigned(frame: &Frame, start: u32, bits: u32) -> u64 {
    (word(frame) >> start) & ((1 << bits) - 1)
}

/// Signed little-endian field.
pub(super) fn signed(frame: &Frame, start: u32, bits: u32) -> i64 {
    let raw = unsigned(frame, start, bits) as i64;
    if raw >= 1 << (bits - 1) {
        raw - (1 << bits)
    } else {
        raw
    }
}

/// The frame with another value in a field and a CRC that fits: what a sender would send who believes it.
pub(super) fn with_field(frame: &Frame, start: u32, bits: u32, value: i64) -> Frame {
    let mask = ((1_u64 << bits) - 1) << start;
    let changed = (word(frame) & !mask) | (((value as u64) << start) & mask);
    sealed(frame.id(), changed.to_le_bytes())
}

/// The frame under another counter, with a CRC that fits.
pub(super) fn with_counter(frame: &Frame, counter: u8) -> Frame {
    with_field(frame, 8, 4, i64::from(counter))
}

/// The frame with one bit flipped, its CRC as it was.
pub(super) fn with_bit_flipped(frame: &Frame, bit: u32) -> Frame {
    let changed = word(frame) ^ (1 << bit);
    renamed(frame.id(), &changed.to_le_bytes())
}

/// The bytes under an identifier, as they are.
pub(super) fn renamed(id: u16, bytes: &[u8]) -> Frame {
    Frame::new(id, bytes).expect("an identifier and a length from a real frame")
}

fn sealed(id: u16, mut data: [u8; 8]) -> Frame {
    if let Some(crc) = expected_crc(id, &data) {
        data[0] = crc;
    }
    renamed(id, &data)
}

/// The guidance frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Status {
    pub(super) counter: u8,
    pub(super) torque_nm: f64,
    pub(super) limit: u64,
    pub(super) mode: u64,
    pub(super) warning: bool,
    pub(super) faults: u64,
    /// Whether some fault of class B, of class C, of class Locked is present, one bit each.
    pub(super) classes: u64,
    pub(super) reset: u64,
}

impl Status {
    pub(super) fn decode(frame: &Frame) -> Self {
        Self {
            counter: unsigned(frame, 8, 4) as u8,
            torque_nm: signed(frame, 12, 16) as f64 / 4096.0,
            limit: unsigned(frame, 28, 4),
            mode: unsigned(frame, 32, 4),
            warning: unsigned(frame, 36, 1) != 0,
            faults: unsigned(frame, 37, 21),
            classes: unsigned(frame, 58, 3),
            reset: unsigned(frame, 61, 3),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptic_core::bus::messages::{Column, LanePreview, Message, Request, Vehicle};

    #[test]
    fn the_crc_has_its_published_check_values() {
        assert_eq!(crc8(*b"123456789"), 0xDF);
        // AUTOSAR's example for profile 2: data IDs 01..10, eight bytes of zero payload.
        for (counter, crc) in [(0_u8, 0x0E), (1, 0x1B), (2, 0x98)] {
            let bytes = [counter, 0, 0, 0, 0, 0, 0, counter + 1];
            assert_eq!(crc8(bytes), crc, "counter {counter}");
        }
    }

    #[test]
    fn frames_of_the_core_are_intact_here_and_forged_ones_only_where_they_are_meant_to_be() {
        let frames = [
            LanePreview::default().encode(3),
            Column::default().encode(15),
            Vehicle::default().encode(0),
            Request {
                engage: true,
                authority: haptic_core::quantity::Ratio::ONE,
                probe: false,
            }
            .encode(9),
        ];
        for frame in &frames {
            assert!(is_intact(frame));
            assert!(is_intact(&with_field(frame, 12, 16, -1)));
            assert_eq!(signed(&with_field(frame, 12, 16, -5), 12, 16), -5);
            assert_eq!(unsigned(&with_counter(frame, 7), 8, 4), 7);
            for bit in 0..64 {
                assert!(!is_intact(&with_bit_flipped(frame, bit)), "bit {bit}");
            }
            for other in [LANE, COLUMN, VEHICLE, REQUEST, GUIDANCE]
                .iter()
                .filter(|id| **id != frame.id())
            {
                assert!(!is_intact(&renamed(*other, frame.data())), "{other:#x}");
            }
        }
    }
}
