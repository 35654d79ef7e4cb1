//! End-to-end protection of the safety frames: AUTOSAR E2E profile 2.
//!
//! Byte 0 is a CRC-8 (polynomial 0x2F, init 0xFF, xorout 0xFF) over all bytes from 1 on and then one byte of the
//! message's data ID list, picked by the 4-bit counter in the low nibble of byte 1. The list below detects
//! every 1-, 2- and 3-bit flip of an eight-byte frame for every counter; a message uses it XORed with a
//! constant of its own, which keeps that property and makes a frame under another message's identifier fail.
//!
//! A longer frame of CAN FD is protected in the same way, its length known to the receiver. Up to 12 bytes every three flips are
//! detected, from 16 bytes on only single ones (`core/tests/e2e.rs`): a longer message that moves a torque needs a longer CRC
//! or a MAC.
//!
//! The receiver rejects a bad frame and continues with the next. A sender that was silent beyond its time-out has to
//! send three clean frames in a row before it is trusted again. Terms: *delta* is the counter's step from the last
//! accepted frame, modulo 16; *clean* is a frame that is intact, the next in count, and in range. (A lane preview
//! that is marked as not valid counts as clean.) Time is not known here: how fast the ECU's own receivers let a counter go on
//! is said in `core/src/ecu/counting.rs`.

use crc::{CRC_8_AUTOSAR, Crc};

/// Data IDs, one for each counter value.
const DATA_IDS: [u8; 16] = [
    0xD9, 0xAD, 0xC1, 0x0B, 0x75, 0xF8, 0xE0, 0x7C, 0x7A, 0xE6, 0xAE, 0x92, 0x9B, 0x3E, 0xEA, 0x5E,
];

/// Clean frames in a row before a resumed sender is trusted.
pub const CLEAN_FRAMES_TO_TRUST: u8 = 3;

static CRC: Crc<u8> = Crc::<u8>::new(&CRC_8_AUTOSAR);

/// CRC-8/AUTOSAR: polynomial 0x2F, init 0xFF, xorout 0xFF, not reflected.
#[must_use]
pub fn crc8(bytes: &[u8]) -> u8 {
    CRC.checksum(bytes)
}

/// The CRC of a payload whose bytes from 1 on are in place: over these, and then the data ID that its counter picks.
#[expect(
    clippy::indexing_slicing,
    reason = "a counter of four bits in a list of sixteen"
)]
#[inline(always)]
fn payload_crc(head: u8, rest: &[u8], list: &[u8; 16]) -> u8 {
    let mut digest = CRC.digest();
    digest.update(&[head]);
    digest.update(rest);
    digest.update(&[list[usize::from(head & 0x0F)]]);
    digest.finalize()
}

/// The protection of one message: the data ID list XORed with the message's constant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Protection {
    list: [u8; 16],
}

impl Protection {
    /// Protection with the list of this bus and a message's own constant.
    #[must_use]
    #[expect(
        clippy::indexing_slicing,
        clippy::arithmetic_side_effects,
        reason = "at compile time"
    )]
    pub const fn new(constant: u8) -> Self {
        let mut list = DATA_IDS;
        let mut i = 0;
        while i < 16 {
            list[i] ^= constant;
            i += 1;
        }
        Self { list }
    }

    /// Protection with any list, for tests against other implementations.
    #[must_use]
    pub const fn with_list(list: [u8; 16]) -> Self {
        Self { list }
    }

    /// Fills in byte 0 and the low nibble of byte 1. A payload of less than two bytes has no room for them, and stays as it is.
    #[inline(always)]
    pub fn protect(&self, data: &mut [u8], counter: u8) {
        if let [crc, head, rest @ ..] = data {
            *head = (*head & 0xF0) | (counter & 0x0F);
            *crc = payload_crc(*head, rest, &self.list);
        }
    }

    /// The counter of a payload, if its CRC fits.
    #[inline(always)]
    fn intact_counter(&self, data: &[u8]) -> Option<u8> {
        let [crc, head, rest @ ..] = data else {
            return None;
        };
        (*crc == payload_crc(*head, rest, &self.list)).then_some(head & 0x0F)
    }

    /// Whether the CRC fits the data and its counter.
    #[must_use]
    pub fn is_intact(&self, data: &[u8]) -> bool {
        self.intact_counter(data).is_some()
    }
}

/// Why a frame was not accepted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
#[repr(u8)]
pub enum Reject {
    /// Not as long as its message is.
    Length,
    /// The CRC does not fit: flipped bits, or another message's data ID.
    Crc,
    /// The counter repeats the last accepted one.
    Repeated,
    /// The counter went back, or further ahead than lost frames explain.
    Jump,
    /// Not yet three clean frames since the sender was silent.
    NotTrusted,
    /// A signal is outside its range.
    Range,
    /// The value is further from the last one than a vehicle can move.
    Step,
    /// The sample was true before the last one was.
    Older,
    /// The identifier is this ECU's: another node sends in its name.
    OwnIdentifier,
    /// The counter went on faster than any sender counts, or twice as fast as this one did.
    TooFast,
    /// Two senders count under one identifier, and neither is believed.
    TwoSenders,
}

impl Reject {
    /// Every reason, in the order of its codes on the bus.
    pub const ALL: [Self; 11] = [
        Self::Length,
        Self::Crc,
        Self::Repeated,
        Self::Jump,
        Self::NotTrusted,
        Self::Range,
        Self::Step,
        Self::Older,
        Self::OwnIdentifier,
        Self::TooFast,
        Self::TwoSenders,
    ];

    /// The reason of a code on the bus.
    #[must_use]
    #[expect(clippy::as_conversions, reason = "the code of a variant")]
    pub fn from_code(code: i64) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|reason| i64::from(*reason as u8) == code)
    }
}

/// What a receiver remembers of one sender.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReceiverState {
    /// Counter of the last frame; `None` before the first.
    last: Option<u8>,
    /// Clean frames in a row, up to [`CLEAN_FRAMES_TO_TRUST`].
    clean: u8,
}

impl ReceiverState {
    /// A sender that has sent nothing yet.
    pub const NEW: Self = Self { last: None, clean: 0 };
    /// A sender that is trusted from its first frame on, for studies that start in mid-drive.
    pub const TRUSTED: Self = Self {
        last: None,
        clean: CLEAN_FRAMES_TO_TRUST,
    };

    /// Two bytes for memory that is kept twice, which holds any bits: the counter, or more than its four bits before the first.
    pub(crate) const fn bytes(self) -> [u8; 2] {
        let last = match self.last {
            Some(counter) => counter,
            None => u8::MAX,
        };
        [last, self.clean]
    }

    /// The state of two such bytes.
    pub(crate) fn of_bytes([last, clean]: [u8; 2]) -> Self {
        let last = (last <= 0x0F).then_some(last);
        Self { last, clean }
    }

    /// Whether the next frame in order is used at once.
    #[must_use]
    pub const fn is_trusted(&self) -> bool {
        self.clean >= CLEAN_FRAMES_TO_TRUST
    }

    /// The step from the last counter, modulo 16; `None` before the first.
    #[inline(always)]
    pub(crate) fn delta(&self, counter: u8) -> Option<u8> {
        self.last.map(|last| counter.wrapping_sub(last) & 0x0F)
    }

    /// Checks a frame and stores its counter. `max_delta` is the largest step of the counter that lost frames within
    /// the message's time-out explain.
    ///
    /// # Errors
    /// Why the frame must not be used.
    #[inline(always)]
    pub fn accept(&mut self, protection: &Protection, data: &[u8], max_delta: u8) -> Result<(), Reject> {
        let counter = protection.intact_counter(data).ok_or(Reject::Crc)?;
        let delta = self.delta(counter);
        if !self.is_trusted() {
            self.clean = if delta == Some(1) {
                self.clean.saturating_add(1)
            } else {
                1
            };
            self.last = Some(counter);
            return if self.is_trusted() {
                Ok(())
            } else {
                Err(Reject::NotTrusted)
            };
        }
        match delta {
            Some(0) => Err(Reject::Repeated),
            // A frame out of order must not change the stored counter, so that the next one in order is still
            // accepted.
            Some(delta) if delta > max_delta => Err(Reject::Jump),
            _ => {
                self.last = Some(counter);
                Ok(())
            }
        }
    }
}
