//! What writes parameters and says which are in use, and what tells of frames that were not used. Never the torque
//! path's.

#![expect(
    clippy::as_conversions,
    reason = "a code is its discriminant, and a field is masked to fewer bits than its type has"
)]

use super::{Info, Message, info, put, unsigned};
use crate::bus::e2e::Reject;
use crate::controller::params::PARAMETERS;

/// One field of a new set of parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParameterWrite {
    /// Which field, in the order of [`PARAMETERS`].
    pub index: u8,
    /// Its value, SI. On the bus as an IEEE 754 binary32.
    pub value: f32,
}

/// A parameter lies the same way in both directions.
macro_rules! carry_a_parameter {
    ($($name:ident)*) => {$(
        impl Message for $name {
            const INFO: Info = info::$name;

            fn pack(&self, data: &mut [u8; 8]) {
                let word = put(i64::from(self.index), 12, 8) | put(i64::from(self.value.to_bits()), 32, 32);
                *data = word.to_le_bytes();
            }

            fn unpack(data: &[u8; 8]) -> Option<Self> {
                let word = u64::from_le_bytes(*data);
                let index = unsigned(word, 12, 8) as u8;
                let value = f32::from_bits(unsigned(word, 32, 32) as u32);
                // There are no others.
                (usize::from(index) < PARAMETERS.len()).then_some(Self { index, value })
            }
        }
    )*};
}
carry_a_parameter! { ParameterWrite ParameterValue }

/// What has to come before a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ParameterUnlock {
    /// The number of the vehicle that the set is for, 0 to [`Identity::VEHICLE_MAX`]; 0: nobody says.
    pub vehicle: u32,
    /// The number of the set in use, as [`ParameterStatus`] says it: a download that was recorded names another one.
    pub sequence: u32,
}

impl Message for ParameterUnlock {
    const INFO: Info = info::ParameterUnlock;

    fn pack(&self, data: &mut [u8; 8]) {
        let word = put(i64::from(self.vehicle), 12, 20) | put(i64::from(self.sequence), 32, 32);
        *data = word.to_le_bytes();
    }

    fn unpack(data: &[u8; 8]) -> Option<Self> {
        let word = u64::from_le_bytes(*data);
        Some(Self {
            vehicle: unsigned(word, 12, 20) as u32,
            sequence: unsigned(word, 32, 32) as u32,
        })
    }
}

/// One parameter in use; the next every 100 ms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParameterValue {
    /// Which field, in the order of [`PARAMETERS`].
    pub index: u8,
    /// Its value, SI, rounded to a binary32.
    pub value: f32,
}

/// How often a message was not used for a reason; the next pair that there is every 100 ms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rejection {
    /// Its identifier.
    pub id: u16,
    /// Why.
    pub reason: Reject,
    /// How many times since the start, saturating.
    pub count: u16,
}

impl Message for Rejection {
    const INFO: Info = info::Rejection;

    fn pack(&self, data: &mut [u8; 8]) {
        let word = put(i64::from(self.id), 12, 11)
            | put(i64::from(self.reason as u8), 24, 4)
            | put(i64::from(self.count), 32, 16);
        *data = word.to_le_bytes();
    }

    fn unpack(data: &[u8; 8]) -> Option<Self> {
        let word = u64::from_le_bytes(*data);
        Some(Self {
            id: unsigned(word, 12, 11) as u16,
            reason: Reject::from_code(unsigned(word, 24, 4))?,
            count: unsigned(word, 32, 16) as u16,
        })
    }
}

/// What became of the last set that was sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum WriteOutcome {
    /// None was sent since the start.
    None = 0,
    /// Its last field has not come.
    Receiving = 1,
    /// Refused: the ECU was not in Standby.
    NotInStandby = 2,
    /// Refused: a field came out of its order.
    OutOfOrder = 3,
    /// Refused: a parameter is outside its range.
    OutOfRange = 4,
    /// It is being stored, and the ECU starts anew with it.
    Taken = 5,
    /// Refused: the vehicle moves, or nobody says that it stands.
    NotStanding = 6,
    /// Refused: it was not unlocked within the last two seconds, by the number of the set in use.
    NotUnlocked = 7,
    /// Refused: the ECU has not run for ten seconds since a reset.
    TooSoon = 8,
    /// Refused: its fields came faster than a client sends them.
    TooFast = 9,
}

impl WriteOutcome {
    /// The outcome of a code on the bus.
    #[must_use]
    pub const fn from_code(code: i64) -> Option<Self> {
        Some(match code {
            0 => Self::None,
            1 => Self::Receiving,
            2 => Self::NotInStandby,
            3 => Self::OutOfOrder,
            4 => Self::OutOfRange,
            5 => Self::Taken,
            6 => Self::NotStanding,
            7 => Self::NotUnlocked,
            8 => Self::TooSoon,
            9 => Self::TooFast,
            _ => return None,
        })
    }
}

/// The parameters in use, every second.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ParameterStatus {
    /// Whether they come from the memory; otherwise they are those built into the image.
    pub stored: bool,
    /// A copy in the memory cannot be read: its write was cut short, or the memory is damaged.
    pub damaged: bool,
    /// What became of the last set that was sent.
    pub outcome: WriteOutcome,
    /// The number of the stored set; each write counts one up.
    pub sequence: u32,
}

impl Message for ParameterStatus {
    const INFO: Info = info::ParameterStatus;

    fn pack(&self, data: &mut [u8; 8]) {
        let word = put(i64::from(self.stored), 12, 1)
            | put(i64::from(self.damaged), 13, 1)
            | put(i64::from(self.outcome as u8), 16, 4)
            | put(i64::from(self.sequence), 32, 32);
        *data = word.to_le_bytes();
    }

    fn unpack(data: &[u8; 8]) -> Option<Self> {
        let word = u64::from_le_bytes(*data);
        Some(Self {
            stored: unsigned(word, 12, 1) != 0,
            damaged: unsigned(word, 13, 1) != 0,
            outcome: WriteOutcome::from_code(unsigned(word, 16, 4))?,
            sequence: unsigned(word, 32, 32) as u32,
        })
    }
}

/// What the stored set is bound to, every second.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Identity {
    /// The number of the vehicle that the set in use is for; 0: nobody said.
    pub vehicle: u32,
    /// This processor's own number: a CRC-32 of what its maker wrote into it.
    pub hardware: u32,
}

impl Identity {
    /// 20 bits: the last six digits of a vehicle identification number fit.
    pub const VEHICLE_MAX: u32 = (1 << 20) - 1;
}

impl Message for Identity {
    const INFO: Info = info::Identity;

    fn pack(&self, data: &mut [u8; 8]) {
        let word = put(i64::from(self.vehicle), 12, 20) | put(i64::from(self.hardware), 32, 32);
        *data = word.to_le_bytes();
    }

    fn unpack(data: &[u8; 8]) -> Option<Self> {
        let word = u64::from_le_bytes(*data);
        Some(Self {
            vehicle: unsigned(word, 12, 20) as u32,
            hardware: unsigned(word, 32, 32) as u32,
        })
    }
}
