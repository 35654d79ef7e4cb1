//! What each frame means. Positions, LSBs and ranges stand here and in `core/haptic.dbc`; `tests/dbc.rs` holds
//! the two together.
//!
//! Layout: eight bytes, little-endian (Intel) bit order; bits 0..7 CRC, bits 8..11 counter, signals from
//! bit 12. LSBs are powers of two in SI units, so that a raw value crosses into fixed point without a
//! rounding; only the wheel angle, which sensors give in degrees, is multiplied.

mod inputs;
mod outputs;
mod service;

pub use inputs::{Column, Demand, LanePreview, Vehicle};
pub use outputs::{FaultRecord, Guidance, ResetCause, Telemetry, Warning};
pub use service::{ParameterStatus, ParameterWrite, WriteOutcome};

use super::e2e::{Protection, ReceiverState, Reject};
use super::frame::Frame;
use crate::quantity::{Instant, Micros, shift_round};

/// A safety message: identifier, protection, and how its signals lie in a 64-bit little-endian word.
pub trait Message: Copy {
    /// CAN identifier.
    const ID: u16;
    /// CRC and counter.
    const PROTECTION: Protection;
    /// Largest step of the counter that lost frames explain within [`TIMEOUT`].
    const MAX_DELTA: u8;

    /// The signals in their bits; values outside a signal's range saturate.
    fn pack(&self) -> u64;

    /// The signals, or `None` where one is outside its range.
    fn unpack(word: u64) -> Option<Self>;

    /// The frame, protected under `counter` (modulo 16).
    #[must_use]
    fn encode(&self, counter: u8) -> Frame {
        let mut data = self.pack().to_le_bytes();
        Self::PROTECTION.protect(&mut data, counter);
        Frame::full(Self::ID, data)
    }

    /// Checks a frame and decodes it.
    ///
    /// # Errors
    /// The first check that it fails: length, CRC, counter, trust, range.
    fn decode(state: &mut ReceiverState, frame: &Frame) -> Result<Self, Reject> {
        let data = frame.full_data().ok_or(Reject::Length)?;
        let signals = Self::unpack(u64::from_le_bytes(data));
        // Nobody is trusted for a frame out of range; the gap that it leaves begins the count of clean ones anew.
        if signals.is_some() || state.is_trusted() {
            state.accept(&Self::PROTECTION, &data, Self::MAX_DELTA)?;
        }
        signals.ok_or(Reject::Range)
    }
}

/// Every safety message is stale at this age.
pub const TIMEOUT: Micros = Micros::from_ms(30);

const fn put(value: i64, start: u32, bits: u32) -> u64 {
    ((value as u64) & mask(bits)).wrapping_shl(start)
}

const fn unsigned(word: u64, start: u32, bits: u32) -> i64 {
    (word.wrapping_shr(start) & mask(bits)) as i64
}

const fn signed(word: u64, start: u32, bits: u32) -> i64 {
    let up = 64_u32.wrapping_sub(bits);
    (unsigned(word, start, bits).wrapping_shl(up)).wrapping_shr(up)
}

const fn mask(bits: u32) -> u64 {
    1_u64.wrapping_shl(bits).wrapping_sub(1)
}

/// `bits` of 2^-24 as a count of 2^-`lsb`, rounded, saturated to +-`max`.
fn to_lsb(bits: i32, lsb: u32, max: i64) -> i64 {
    shift_round(i64::from(bits), 24_u32.wrapping_sub(lsb)).clamp(max.wrapping_neg(), max)
}

/// The other way, exact.
fn from_lsb(raw: i64, lsb: u32) -> i64 {
    raw.wrapping_shl(24_u32.wrapping_sub(lsb))
}

/// The simulated time, which ends a tick of a lock-step run: the ECU steps when it arrives. Not protected,
/// and not part of a product image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SimTime(pub Instant);

impl SimTime {
    /// CAN identifier, the weakest on the bus.
    pub const ID: u16 = 0x7F0;

    /// Bytes 0..3: microseconds, little-endian.
    #[must_use]
    pub fn encode(self) -> Frame {
        Frame::full(Self::ID, u64::from(self.0.us()).to_le_bytes())
    }

    /// The instant, if this is such a frame.
    #[must_use]
    pub fn decode(frame: &Frame) -> Option<Self> {
        let [a, b, c, d, ..] = frame.full_data()?;
        (frame.id() == Self::ID).then(|| Self(Instant::from_us(u32::from_le_bytes([a, b, c, d]))))
    }
}
