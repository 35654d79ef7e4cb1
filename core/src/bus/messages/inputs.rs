//! The messages that the ECU receives.

use super::{Info, Message, from_lsb, info, is_within, narrow, put, to_bits, to_lsb, unsigned};
use fixed::types::{I16F16, I24F40, I64F0};

use crate::controller::inputs::Request;
use crate::quantity::{Metres, Micros, Radians, Ratio, Speed, Torque, TurningRate, rounded};

/// Lane errors at the guidance's own points, from the camera's computer, about every 8.3 ms.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LanePreview {
    /// e_y' at the near point, +-4 m, LSB 2^-13 m, positive: the target is to the left.
    pub e_y: Metres,
    /// e_theta' at the far point, +-0.5 rad, LSB 2^-16 rad.
    pub e_theta: Radians,
    /// Age of the sample when the frame was sent, 0 to 204.7 ms, LSB 0.1 ms. It is carried in two signals: the
    /// remainder below 51.2 ms, the only one that senders of version 2.1 and older have, and the number of whole 51.2
    /// ms.
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
    const AGE_MAX: u32 = 2047;
}

impl Message for LanePreview {
    const INFO: Info = info::LanePreview;

    fn pack(&self, data: &mut [u8; 8]) {
        let age = (self.age.us().saturating_add(Self::AGE_LSB_US / 2) / Self::AGE_LSB_US).min(Self::AGE_MAX);
        let word = put(to_lsb(self.e_y.bits(), Self::E_Y_LSB, Self::E_Y_MAX), 12, 17)
            | put(
                to_lsb(self.e_theta.bits(), Self::E_THETA_LSB, Self::E_THETA_MAX),
                29,
                17,
            )
            | put(i64::from(age), 46, 9)
            | put(i64::from(age >> 9), 56, 2)
            | put(i64::from(self.valid), 55, 1);
        *data = word.to_le_bytes();
    }

    #[expect(clippy::as_conversions, reason = "masked to eleven bits")]
    fn unpack(data: &[u8; 8]) -> Option<Self> {
        let word = u64::from_le_bytes(*data);
        let e_y = narrow(word, 12, 17);
        let e_theta = narrow(word, 29, 17);
        let in_range = is_within(e_y, Self::E_Y_MAX) && is_within(e_theta, Self::E_THETA_MAX);
        in_range.then(|| Self {
            e_y: Metres::from_bits(to_bits(e_y, Self::E_Y_LSB)),
            e_theta: Radians::from_bits(to_bits(e_theta, Self::E_THETA_LSB)),
            age: Micros::from_us(
                ((unsigned(word, 46, 9) | unsigned(word, 56, 2) << 9) as u32).wrapping_mul(Self::AGE_LSB_US),
            ),
            valid: unsigned(word, 55, 1) != 0,
        })
    }
}

/// The column's sensors, every 2 ms.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Column {
    /// T_d, +-20 N.m, LSB 2^-12 N.m.
    pub driver_torque: Torque,
    /// phi, +-720 deg, LSB 0.01 deg.
    pub wheel_angle: Radians,
    /// The torque that the motor delivers, +-7.9 N.m, LSB 2^-12 N.m. The actuator is checked with it.
    pub motor_torque: Torque,
}

impl Column {
    const TORQUE_LSB: u32 = 12;
    /// +-20 N.m: no driver turns a wheel harder by hand.
    const DRIVER_MAX: i64 = 20 << Self::TORQUE_LSB;
    /// The range is wider than that of the guidance torque, so that a motor that delivers too much can be reported.
    const MOTOR_MAX: i64 = (1 << 15) - 1;
    /// +-720 deg: two turns, lock to lock.
    const ANGLE_MAX: i64 = 72_000;
    /// 0.01 deg, rad.
    const ANGLE_UNIT: I24F40 = I24F40::from_bits(191_900_981);
    /// 1 rad in 0.01 deg.
    const PER_RADIAN: I16F16 = I16F16::from_bits(375_493_621);
}

impl Message for Column {
    const INFO: Info = info::Column;

    fn pack(&self, data: &mut [u8; 8]) {
        let angle: I64F0 = rounded(self.wheel_angle.fixed().wide_mul(Self::PER_RADIAN));
        let angle = angle.to_bits().clamp(-Self::ANGLE_MAX, Self::ANGLE_MAX);
        let word = put(
            to_lsb(self.driver_torque.bits(), Self::TORQUE_LSB, Self::DRIVER_MAX),
            12,
            18,
        ) | put(angle, 30, 18)
            | put(
                to_lsb(self.motor_torque.bits(), Self::TORQUE_LSB, Self::MOTOR_MAX),
                48,
                16,
            );
        *data = word.to_le_bytes();
    }

    fn unpack(data: &[u8; 8]) -> Option<Self> {
        let word = u64::from_le_bytes(*data);
        let driver = narrow(word, 12, 18);
        let angle = narrow(word, 30, 18);
        let motor = narrow(word, 48, 16);
        let in_range = is_within(driver, Self::DRIVER_MAX)
            && is_within(angle, Self::ANGLE_MAX)
            && is_within(motor, Self::MOTOR_MAX);
        in_range.then(|| Self {
            driver_torque: Torque::from_bits(to_bits(driver, Self::TORQUE_LSB)),
            wheel_angle: Radians::from_wide(rounded(Self::ANGLE_UNIT.wrapping_mul_int(angle.into()))),
            motor_torque: Torque::from_bits(to_bits(motor, Self::TORQUE_LSB)),
        })
    }
}

/// The vehicle's speed from two independent sources and its yaw rate, every 10 ms.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Vehicle {
    /// Both speeds, 0 to 90 m/s, LSB 2^-8 m/s.
    pub speeds: [Speed; 2],
    /// The measured yaw rate, less than +-2 rad/s, LSB 2^-12 rad/s; `None` from a sender that has no good one. Frames
    /// of version 2.1 and before, whose bits here are zero, say `None`.
    pub yaw_rate: Option<TurningRate>,
}

impl Vehicle {
    const LSB: u32 = 8;
    /// 90 m/s are 324 km/h.
    const MAX: i64 = 90 << Self::LSB;
    const YAW_RATE_LSB: u32 = 12;
    /// 114 deg/s, more than a car's yaw rate sensor measures.
    const YAW_RATE_MAX: i64 = (1 << 13) - 1;
}

impl Message for Vehicle {
    const INFO: Info = info::Vehicle;

    fn pack(&self, data: &mut [u8; 8]) {
        let [a, b] = self.speeds.map(|v| to_lsb(v.bits(), Self::LSB, Self::MAX));
        let yaw_rate = self.yaw_rate.unwrap_or(TurningRate::ZERO).bits();
        let word = put(a, 12, 16)
            | put(b, 28, 16)
            | put(to_lsb(yaw_rate, Self::YAW_RATE_LSB, Self::YAW_RATE_MAX), 44, 14)
            | put(i64::from(self.yaw_rate.is_some()), 58, 1);
        *data = word.to_le_bytes();
    }

    fn unpack(data: &[u8; 8]) -> Option<Self> {
        let word = u64::from_le_bytes(*data);
        let raw = [narrow(word, 12, 16), narrow(word, 28, 16)];
        // Guidance is for driving forwards: a negative speed is the sender's fault.
        let in_range = raw.iter().all(|v| (0..=Self::MAX).contains(&i64::from(*v)));
        let is_valid = unsigned(word, 58, 1) != 0;
        let yaw_rate = if is_valid { narrow(word, 44, 14) } else { 0 };
        (in_range && is_within(yaw_rate, Self::YAW_RATE_MAX)).then(|| Self {
            speeds: raw.map(|v| Speed::from_bits(to_bits(v, Self::LSB))),
            yaw_rate: is_valid.then(|| TurningRate::from_bits(to_bits(yaw_rate, Self::YAW_RATE_LSB))),
        })
    }
}

/// LSB of the authority, 2^-7, and the raw value of an authority of 1.
const AUTHORITY_LSB: u32 = 7;
const AUTHORITY_MAX: i64 = 1 << AUTHORITY_LSB;

impl Message for Request {
    const INFO: Info = info::Request;

    fn pack(&self, data: &mut [u8; 8]) {
        let authority = to_lsb(self.authority.bits(), AUTHORITY_LSB, AUTHORITY_MAX).max(0);
        let word =
            put(i64::from(self.engage), 12, 1) | put(authority, 13, 8) | put(i64::from(self.probe), 21, 1);
        *data = word.to_le_bytes();
    }

    fn unpack(data: &[u8; 8]) -> Option<Self> {
        let word = u64::from_le_bytes(*data);
        let authority = unsigned(word, 13, 8);
        (authority <= AUTHORITY_MAX).then(|| Self {
            engage: unsigned(word, 12, 1) != 0,
            authority: Ratio::from_wide(from_lsb(authority, AUTHORITY_LSB)),
            probe: unsigned(word, 21, 1) != 0,
        })
    }
}
