//! A message of 64 bytes, as an authenticated bus or a sensor of its own would have it, from its signals to its frame and back.

use haptic_core::bus::e2e::{Protection, ReceiverState};
use haptic_core::bus::messages::{Info, MESSAGES, Message, field, put_field};
use haptic_core::bus::{FdFrame, Frame, Reject};

/// Eight channels of 57 bits, none at a byte's edge, and a last one that ends with the payload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Long {
    channels: [i64; 8],
    last: i64,
}

const FIRST: u32 = 13;
const STRIDE: u32 = 58;

impl Message<64> for Long {
    const INFO: Info = MESSAGES[2];

    fn pack(&self, data: &mut [u8; 64]) {
        for (place, channel) in (FIRST..).step_by(STRIDE as usize).zip(self.channels) {
            put_field(data, channel, place, 57);
        }
        put_field(data, self.last, 505, 7);
    }

    fn unpack(data: &[u8; 64]) -> Option<Self> {
        let channels = core::array::from_fn(|k| field(data, FIRST + STRIDE * k as u32, 57));
        let last = field(data, 505, 7);
        (last <= 100).then_some(Self { channels, last })
    }
}

const SENT: Long = Long {
    channels: [
        0,
        1,
        0x1FF_FFFF_FFFF_FFFF,
        0x123_4567_89AB_CDEF,
        42,
        1 << 56,
        7,
        0xA5A5,
    ],
    last: 100,
};

/// The CRC of profile 2, bit by bit.
fn crc(bytes: impl Iterator<Item = u8>) -> u8 {
    let bit = |crc: u8, _| crc << 1 ^ if crc & 0x80 != 0 { 0x2F } else { 0 };
    !bytes.fold(0xFF, |crc, byte| (0..8).fold(crc ^ byte, bit))
}

#[test]
fn sixty_four_bytes_arrive_as_they_were_sent() {
    let mut state = ReceiverState::TRUSTED;
    for counter in 0..20 {
        let frame = SENT.encode(counter);
        assert_eq!(Long::decode(&mut state, &frame), Ok(SENT));
        // A number of 512 bits, by its bits.
        let bit = |place: u32| i64::from(frame.data()[place as usize / 8] >> (place % 8) & 1);
        let number = |start: u32, bits: u32| (0..bits).map(|k| bit(start + k) << k).sum::<i64>();
        for (k, channel) in SENT.channels.iter().enumerate() {
            assert_eq!(number(FIRST + STRIDE * k as u32, 57), *channel);
        }
        assert_eq!((number(505, 7), number(8, 4)), (100, i64::from(counter % 16)));
        // 0xA6 is the eleventh data ID of the bus's list, 0xAE, XORed with 0x11 and so on: the list of the DBC file.
        let list = [
            0xD9, 0xAD, 0xC1, 0x0B, 0x75, 0xF8, 0xE0, 0x7C, 0x7A, 0xE6, 0xAE, 0x92, 0x9B, 0x3E, 0xEA, 0x5E,
        ];
        let id = list[usize::from(counter % 16)] ^ 0x11;
        assert_eq!(
            frame.data()[0],
            crc(frame.data()[1..].iter().copied().chain([id]))
        );
    }
}

#[test]
fn a_flipped_bit_anywhere_a_wrong_length_and_a_signal_out_of_range_are_refused() {
    let frame = SENT.encode(1);
    for bit in 0..512 {
        let mut data = frame.full_data().unwrap();
        data[bit / 8] ^= 1 << (bit % 8);
        let mut state = ReceiverState::TRUSTED;
        assert!(
            Long::decode(&mut state, &FdFrame::full(frame.id(), data)).is_err(),
            "{bit}"
        );
    }
    let mut state = ReceiverState::TRUSTED;
    let shorter = FdFrame::new(frame.id(), &frame.data()[..48]).unwrap();
    assert_eq!(Long::decode(&mut state, &shorter), Err(Reject::Length));
    let classic = Frame::new(frame.id(), &frame.data()[..8]).unwrap();
    assert_eq!(Long::decode(&mut state, &classic), Err(Reject::Length));
    let beyond = Long { last: 101, ..SENT };
    assert_eq!(Long::decode(&mut state, &beyond.encode(2)), Err(Reject::Range));
}

/// What ends with the payload is cut there, and so is what begins beyond it.
#[test]
fn fields_beyond_a_payload_are_cut() {
    let mut data = [0; 12];
    put_field(&mut data, -1, 90, 20);
    put_field(&mut data, -1, 200, 8);
    assert_eq!(data, [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFC]);
    assert_eq!((field(&data, 90, 20), field(&data, 200, 8)), (0x3F, 0));
    // A field is put in place of what was there.
    put_field(&mut data, 0x12, 88, 8);
    assert_eq!(data[11], 0x12);
}

/// Nothing to protect: less than the CRC and the counter.
#[test]
fn a_payload_of_less_than_two_bytes_is_never_intact() {
    let protection = Protection::new(0x11);
    for bytes in 0..2 {
        let mut data = vec![0x5A; bytes];
        protection.protect(&mut data, 3);
        assert_eq!(data, vec![0x5A; bytes]);
        assert!(!protection.is_intact(&data));
        let mut state = ReceiverState::TRUSTED;
        assert_eq!(state.accept(&protection, &data, 3), Err(Reject::Crc));
    }
}
