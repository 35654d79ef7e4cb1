//! What each frame means. Positions, LSBs and ranges stand here and in `core/haptic.dbc`; `tests/dbc.rs` holds
//! the two together.
//!
//! Layout: little-endian (Intel) bit order; bits 0..7 CRC, bits 8..11 counter, signals from bit 12. A message of
//! eight bytes packs its signals into one 64-bit word, a longer one writes them with [`put_field`] and reads them
//! with [`field`]. LSBs are powers of two in SI units, so that raw values become fixed point without rounding; only
//! the wheel angle, which sensors give in degrees, is multiplied.

mod inputs;
mod outputs;
mod service;

pub use crate::controller::inputs::Request;
pub use inputs::{Column, LanePreview, Vehicle};
pub use outputs::{FaultRecord, Guidance, ResetCause, Telemetry, Warning};
pub use service::{
    Identity, ParameterStatus, ParameterUnlock, ParameterValue, ParameterWrite, Rejection, WriteOutcome,
};

use fixed::types::I40F24;

use super::e2e::{Protection, ReceiverState, Reject};
use super::frame::CanFrame;
use crate::quantity::Micros;

/// Version of the bus: of identifiers, layouts and data IDs. `core/haptic.dbc` carries the same.
pub const VERSION: &str = "2.3.0";

/// Who sends a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sender {
    /// The camera's computer.
    Camera,
    /// The column's sensors.
    ColumnModule,
    /// The vehicle's computer, which wants guidance.
    Host,
    /// This ECU.
    Ecu,
}

/// What the list says of a message.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Info {
    /// Name, as in the DBC file.
    pub name: &'static str,
    /// CAN identifier.
    pub id: u16,
    /// CRC and counter.
    pub protection: Protection,
    /// Largest step of the counter that lost frames within [`TIMEOUT`] explain.
    pub max_delta: u8,
    /// Who sends it.
    pub sender: Sender,
    /// Shortest time between two frames, ms. For a message without a fixed period it is the shortest that the bus
    /// load is computed with.
    pub period_ms: f64,
}

/// Declares the messages: `identifier name, data ID constant, largest step of the counter, sender, period`.
macro_rules! messages {
    ($($id:literal $name:ident, $constant:literal, $max_delta:literal, $sender:ident, $period_ms:expr;)*) => {
        /// Every message, most urgent first.
        pub const MESSAGES: [Info; [$($id),*].len()] = [$(info::$name),*];

        /// Who sends under an identifier of the list.
        #[must_use]
        pub const fn sender_of(id: u16) -> Option<Sender> {
            match id {
                $($id => Some(Sender::$sender),)*
                _ => None,
            }
        }

        /// What [`Message::INFO`] is, by name.
        mod info {
            use super::{Info, Protection, Sender};
            $(
                #[expect(non_upper_case_globals, reason = "named as its message")]
                pub(super) const $name: Info = Info {
                    name: stringify!($name),
                    id: $id,
                    protection: Protection::new($constant),
                    max_delta: $max_delta,
                    sender: Sender::$sender,
                    period_ms: $period_ms,
                };
            )*
        }
    };
}

// The one list of messages. One more is one more line, its struct with its bits (`inputs`, `outputs`, `service`), and
// its signals in `core/haptic.dbc`; `core/tests/dbc.rs` holds the three and the table in `docs/reference/bus.md`
// together. The monitor decodes torque, mode, lane and column by itself.
messages! {
    0x0C0 Guidance, 0x5A, 14, Ecu, 1.0;
    0x0D0 Warning, 0x66, 14, Ecu, 100.0;
    0x100 LanePreview, 0x11, 3, Camera, 8.333_333_333_333_334;
    0x110 Column, 0x22, 3, ColumnModule, 2.0;
    0x120 Vehicle, 0x33, 3, Host, 10.0;
    0x130 Request, 0x44, 3, Host, 10.0;
    0x140 ParameterWrite, 0x55, 14, Host, 10.0;
    0x148 ParameterUnlock, 0xBB, 14, Host, 1000.0;
    0x300 FaultRecord, 0x77, 14, Ecu, 100.0;
    0x310 Telemetry, 0x88, 2, Ecu, 20.0;
    0x320 ParameterStatus, 0x99, 2, Ecu, 1000.0;
    0x330 ParameterValue, 0xCC, 14, Ecu, 100.0;
    0x340 Rejection, 0xAA, 14, Ecu, 100.0;
    0x350 Identity, 0xDD, 2, Ecu, 1000.0;
}

/// Whether the ECU receives an identifier: that of a message of the list from another sender.
#[must_use]
pub const fn is_input(id: u16) -> bool {
    matches!(
        sender_of(id),
        Some(Sender::Camera | Sender::ColumnModule | Sender::Host)
    )
}

/// A safety message of `N` bytes, eight on classic CAN: what the list says of it, and how its signals lie in the payload.
pub trait Message<const N: usize = 8>: Copy {
    /// Its line of the list.
    const INFO: Info;
    /// CAN identifier.
    const ID: u16 = Self::INFO.id;
    /// CRC and counter.
    const PROTECTION: Protection = Self::INFO.protection;
    /// Largest step of the counter that lost frames explain within [`TIMEOUT`].
    const MAX_DELTA: u8 = Self::INFO.max_delta;

    /// Puts the signals into their bits of a payload that is zero; values outside a signal's range saturate.
    fn pack(&self, data: &mut [u8; N]);

    /// The signals, or `None` where one is outside its range.
    fn unpack(data: &[u8; N]) -> Option<Self>;

    /// The frame, protected under `counter` (modulo 16).
    #[must_use]
    fn encode(&self, counter: u8) -> CanFrame<N> {
        let mut data = [0; N];
        self.pack(&mut data);
        Self::PROTECTION.protect(&mut data, counter);
        CanFrame::full(Self::ID, data)
    }

    /// Checks a frame and decodes it.
    ///
    /// # Errors
    /// The first check that it fails: length, CRC, counter, trust, range.
    fn decode<const C: usize>(state: &mut ReceiverState, frame: &CanFrame<C>) -> Result<Self, Reject> {
        Self::decode_within(state, frame, Self::MAX_DELTA)
    }

    /// Checks a frame and decodes it, with the step of the counter that may have been lost: more, the longer the sender was silent.
    ///
    /// # Errors
    /// See [`Message::decode`].
    #[inline(always)]
    fn decode_within<const C: usize>(
        state: &mut ReceiverState,
        frame: &CanFrame<C>,
        max_delta: u8,
    ) -> Result<Self, Reject> {
        let data = frame.payload::<N>().ok_or(Reject::Length)?;
        let signals = Self::unpack(data);
        // A frame out of range does not make a sender trusted; the gap that it leaves in the counter restarts the
        // count of clean frames.
        if signals.is_some() || state.is_trusted() {
            state.accept(&Self::PROTECTION, data, max_delta)?;
        }
        signals.ok_or(Reject::Range)
    }
}

/// At this age every safety message is out of date.
pub const TIMEOUT: Micros = Micros::from_ms(30);

/// Writes a signal of at most 57 bits into a payload of any length: `value` from bit `start` on, in place of what was there.
/// Bits beyond the payload are dropped.
pub fn put_field(data: &mut [u8], value: i64, start: u32, bits: u32) {
    let (byte, shift) = place(start);
    let (kept, new) = (!put(-1, shift, bits), put(value, shift, bits));
    let word = (word_at(data, byte) & kept) | new;
    let bytes = data.iter_mut().skip(byte).zip(word.to_le_bytes());
    bytes.for_each(|(to, from)| *to = from);
}

/// A signal of at most 57 bits, without a sign; bits beyond the payload are zero.
#[must_use]
pub fn field(data: &[u8], start: u32, bits: u32) -> i64 {
    let (byte, shift) = place(start);
    unsigned(word_at(data, byte), shift, bits)
}

/// The byte that a bit lies in, and its place there.
#[expect(clippy::as_conversions, reason = "an index of 32 bits")]
const fn place(start: u32) -> (usize, u32) {
    ((start / 8) as usize, start % 8)
}

/// Eight bytes of a payload from one on, those beyond its end zero.
fn word_at(data: &[u8], byte: usize) -> u64 {
    let mut word = [0; 8];
    let bytes = word.iter_mut().zip(data.iter().skip(byte));
    bytes.for_each(|(to, from)| *to = *from);
    u64::from_le_bytes(word)
}

#[expect(clippy::as_conversions, reason = "two's complement, then masked to its bits")]
const fn put(value: i64, start: u32, bits: u32) -> u64 {
    ((value as u64) & mask(bits)).wrapping_shl(start)
}

#[expect(clippy::as_conversions, reason = "masked to fewer bits than an i64 has")]
const fn unsigned(word: u64, start: u32, bits: u32) -> i64 {
    (word.wrapping_shr(start) & mask(bits)) as i64
}

#[expect(clippy::as_conversions, reason = "widens")]
const fn signed(word: u64, start: u32, bits: u32) -> i64 {
    narrow(word, start, bits) as i64
}

/// A signed field of at most 32 bits, in as many: half the work for a 32-bit core.
#[expect(clippy::as_conversions, reason = "the upper half of a word")]
const fn narrow(word: u64, start: u32, bits: u32) -> i32 {
    let up = 64_u32.wrapping_sub(start).wrapping_sub(bits);
    let top = (word.wrapping_shl(up) >> 32) as i32;
    top.wrapping_shr(32_u32.wrapping_sub(bits))
}

/// Whether a field is within +-`max`.
fn is_within(raw: i32, max: i64) -> bool {
    (max.wrapping_neg()..=max).contains(&i64::from(raw))
}

/// A field as a count of 2^-24, exact; it has room, for its range has.
const fn to_bits(raw: i32, lsb: u32) -> i32 {
    raw.wrapping_shl(24_u32.wrapping_sub(lsb))
}

const fn mask(bits: u32) -> u64 {
    1_u64.wrapping_shl(bits).wrapping_sub(1)
}

/// `bits` of 2^-24 as a count of 2^-`lsb`, rounded, saturated to +-`max`.
fn to_lsb(bits: i32, lsb: u32, max: i64) -> i64 {
    // Half a count more and one bit less: in 32 bits, as the sum of both has no room for more.
    let halves = bits.wrapping_shr(23_u32.wrapping_sub(lsb));
    i64::from(halves.wrapping_add(1) >> 1).clamp(max.wrapping_neg(), max)
}

/// The other way, exact.
fn from_lsb(raw: i64, lsb: u32) -> I40F24 {
    I40F24::from_bits(raw.wrapping_shl(24_u32.wrapping_sub(lsb)))
}
