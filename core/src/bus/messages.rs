//! What each frame means. Positions, LSBs and ranges stand here and in `core/haptic.dbc`; `tests/dbc.rs` holds
//! the two together.
//!
//! Layout: eight bytes, little-endian (Intel) bit order; bits 0..7 CRC, bits 8..11 counter, signals from
//! bit 12. LSBs are powers of two in SI units, so that a raw value crosses into fixed point without a
//! rounding; only the wheel angle, which sensors give in degrees, is multiplied.

use super::e2e::{Protection, ReceiverState, Reject};
use super::frame::Frame;
use crate::envelope::LimitReason;
use crate::quantity::{Instant, Metres, Micros, Radians, Torque, shift_round};

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
        state.accept(&Self::PROTECTION, &data, Self::MAX_DELTA)?;
        Self::unpack(u64::from_le_bytes(data)).ok_or(Reject::Range)
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

/// Lane errors at the guidance's own points, from the camera's computer, about every 8.3 ms.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LanePreview {
    /// e_y' at the near point, +-4 m, LSB 2^-13 m, positive: the target is to the left.
    pub e_y: Metres,
    /// e_theta' at the far point, +-0.5 rad, LSB 2^-16 rad.
    pub e_theta: Radians,
    /// Age of the sample when the frame was sent, 0 to 51.1 ms, LSB 0.1 ms.
    pub age: Micros,
    /// Whether the sender vouches for the errors.
    pub valid: bool,
}

impl LanePreview {
    const E_Y_LSB: u32 = 13;
    const E_THETA_LSB: u32 = 16;
    /// +-4 m, the widest error the law is specified for.
    const E_Y_MAX: i64 = 4 << Self::E_Y_LSB;
    /// +-0.5 rad, likewise.
    const E_THETA_MAX: i64 = 1 << (Self::E_THETA_LSB - 1);
    const AGE_LSB_US: u32 = 100;
    const AGE_MAX: u32 = 511;
}

impl Message for LanePreview {
    const ID: u16 = 0x100;
    const PROTECTION: Protection = Protection::new(0x11);
    const MAX_DELTA: u8 = 3;

    fn pack(&self) -> u64 {
        let age = (self.age.us().saturating_add(Self::AGE_LSB_US / 2) / Self::AGE_LSB_US).min(Self::AGE_MAX);
        put(to_lsb(self.e_y.bits(), Self::E_Y_LSB, Self::E_Y_MAX), 12, 17)
            | put(
                to_lsb(self.e_theta.bits(), Self::E_THETA_LSB, Self::E_THETA_MAX),
                29,
                17,
            )
            | put(i64::from(age), 46, 9)
            | put(i64::from(self.valid), 55, 1)
    }

    fn unpack(word: u64) -> Option<Self> {
        let e_y = signed(word, 12, 17);
        let e_theta = signed(word, 29, 17);
        let in_range = e_y.abs() <= Self::E_Y_MAX && e_theta.abs() <= Self::E_THETA_MAX;
        in_range.then(|| Self {
            e_y: Metres::from_wide(from_lsb(e_y, Self::E_Y_LSB)),
            e_theta: Radians::from_wide(from_lsb(e_theta, Self::E_THETA_LSB)),
            age: Micros::from_us((unsigned(word, 46, 9) as u32).wrapping_mul(Self::AGE_LSB_US)),
            valid: unsigned(word, 55, 1) != 0,
        })
    }
}

/// Driver torque and wheel angle, from the column's sensors, every 2 ms.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Column {
    /// T_d, +-20 N.m, LSB 2^-12 N.m.
    pub driver_torque: Torque,
    /// phi, +-720 deg, LSB 0.01 deg.
    pub wheel_angle: Radians,
}

impl Column {
    const TORQUE_LSB: u32 = 12;
    /// +-20 N.m: no driver turns a wheel harder by hand.
    const TORQUE_MAX: i64 = 20 << Self::TORQUE_LSB;
    /// +-720 deg: two turns, lock to lock.
    const ANGLE_MAX: i64 = 72_000;
    /// 0.01 deg in 2^-40 rad.
    const ANGLE_UNIT: i64 = 191_900_981;
    /// 1 rad in 0.01 deg, with 16 fractional bits.
    const PER_RADIAN: i64 = 375_493_621;
}

impl Message for Column {
    const ID: u16 = 0x110;
    const PROTECTION: Protection = Protection::new(0x22);
    const MAX_DELTA: u8 = 14;

    fn pack(&self) -> u64 {
        let angle = shift_round(
            i64::from(self.wheel_angle.bits()).wrapping_mul(Self::PER_RADIAN),
            40,
        )
        .clamp(-Self::ANGLE_MAX, Self::ANGLE_MAX);
        put(
            to_lsb(self.driver_torque.bits(), Self::TORQUE_LSB, Self::TORQUE_MAX),
            12,
            18,
        ) | put(angle, 30, 18)
    }

    fn unpack(word: u64) -> Option<Self> {
        let torque = signed(word, 12, 18);
        let angle = signed(word, 30, 18);
        (torque.abs() <= Self::TORQUE_MAX && angle.abs() <= Self::ANGLE_MAX).then(|| Self {
            driver_torque: Torque::from_wide(from_lsb(torque, Self::TORQUE_LSB)),
            wheel_angle: Radians::from_wide(shift_round(angle.wrapping_mul(Self::ANGLE_UNIT), 16)),
        })
    }
}

/// The guidance torque that the ECU applies, and what held it back, every 1 ms.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Guidance {
    /// T_h, +-5 N.m, LSB 2^-12 N.m.
    pub torque: Torque,
    /// The limit that acted.
    pub limit: LimitReason,
}

impl Guidance {
    const TORQUE_LSB: u32 = 12;
    /// +-5 N.m, the widest profile of the envelope.
    const TORQUE_MAX: i64 = 5 << Self::TORQUE_LSB;
}

impl Message for Guidance {
    const ID: u16 = 0x0C0;
    const PROTECTION: Protection = Protection::new(0x5A);
    const MAX_DELTA: u8 = 14;

    fn pack(&self) -> u64 {
        put(
            to_lsb(self.torque.bits(), Self::TORQUE_LSB, Self::TORQUE_MAX),
            12,
            16,
        ) | put(i64::from(self.limit as u8), 28, 4)
    }

    fn unpack(word: u64) -> Option<Self> {
        let torque = signed(word, 12, 16);
        let limit = LimitReason::from_code(unsigned(word, 28, 4))?;
        (torque.abs() <= Self::TORQUE_MAX).then(|| Self {
            torque: Torque::from_wide(from_lsb(torque, Self::TORQUE_LSB)),
            limit,
        })
    }
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
