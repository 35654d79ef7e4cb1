//! The messages that the ECU sends.

#![expect(
    clippy::as_conversions,
    reason = "a code is its discriminant, and a field is masked to fewer bits than its type has"
)]

use super::{Info, Message, from_lsb, info, put, signed, to_lsb, unsigned};
use crate::bus::frame::Frame;
use crate::estimator::Reading;
use crate::quantity::{Ratio, Torque};
use crate::safety::envelope::LimitReason;
use crate::safety::faults::{Fault, FaultSet, Record};
use crate::safety::modes::Mode;

/// Why the ECU last started.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[repr(u8)]
#[non_exhaustive]
pub enum ResetCause {
    /// The power was switched on.
    #[default]
    PowerOn = 0,
    /// The watchdog was not fed.
    Watchdog = 1,
    /// The processor took a fault.
    HardFault = 2,
    /// A software check failed outside the torque path.
    Panic = 3,
    /// The stack ran into its guard.
    StackOverflow = 4,
    /// Supply voltage fell too low.
    BrownOut = 5,
    /// New parameters were written over the bus, and are in use from now on.
    NewParameters = 6,
}

impl ResetCause {
    /// The cause of a code on the bus or in memory that survived the reset.
    #[must_use]
    pub const fn from_code(code: i64) -> Option<Self> {
        Some(match code {
            0 => Self::PowerOn,
            1 => Self::Watchdog,
            2 => Self::HardFault,
            3 => Self::Panic,
            4 => Self::StackOverflow,
            5 => Self::BrownOut,
            6 => Self::NewParameters,
            _ => return None,
        })
    }
}

/// The guidance torque that the ECU applies, and its status, every 1 ms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Guidance {
    /// T_h, +-5 N.m, LSB 2^-12 N.m.
    pub torque: Torque,
    /// The limit that acted.
    pub limit: LimitReason,
    /// The mode.
    pub mode: Mode,
    /// Whether the driver has to take over.
    pub warning: bool,
    /// The faults present, one bit each. The frame has room for the first [`Guidance::FAULTS`] of the fault word.
    pub faults: FaultSet,
    /// Why the ECU last started.
    pub reset: ResetCause,
}

/// The classes of all faults present, those without a bit of their own in the frame too.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Classes {
    /// An input failed.
    pub b: bool,
    /// The computation, memory, timing or output failed.
    pub c: bool,
    /// The ECU must not leave Boot.
    pub locked: bool,
}

impl Guidance {
    /// How many faults of the fault word have a bit in this frame; the others are in [`Warning`] and [`FaultRecord`].
    pub const FAULTS: u32 = 21;

    /// The classes that a guidance frame names.
    #[must_use]
    pub fn classes(frame: &Frame) -> Option<Classes> {
        let word = u64::from_le_bytes(frame.full_data().filter(|_| frame.id() == Self::ID)?);
        Some(Classes {
            b: unsigned(word, 58, 1) != 0,
            c: unsigned(word, 59, 1) != 0,
            locked: unsigned(word, 60, 1) != 0,
        })
    }

    const TORQUE_LSB: u32 = 12;
    /// +-5 N.m, the widest profile of the envelope.
    const TORQUE_MAX: i64 = 5 << Self::TORQUE_LSB;

    /// The torque that this message carries for a torque, less than one LSB away. It is rounded toward zero, so that
    /// rounding crosses no upper bound; the envelope's bound on the reduction leaves room for it.
    #[must_use]
    pub fn rounded(torque: Torque) -> Torque {
        const LSB: i32 = 1 << (24 - Guidance::TORQUE_LSB);
        let cut = Torque::from_bits(torque.bits() % LSB);
        torque.minus(cut).within(Torque::from_nm(5.0))
    }
}

impl Message for Guidance {
    const INFO: Info = info::Guidance;

    fn pack(&self, data: &mut [u8; 8]) {
        let word = put(
            to_lsb(self.torque.bits(), Self::TORQUE_LSB, Self::TORQUE_MAX),
            12,
            16,
        ) | put(i64::from(self.limit as u8), 28, 4)
            | put(i64::from(self.mode as u8), 32, 4)
            | put(i64::from(self.warning), 36, 1)
            | put(i64::from(self.faults.bits()), 37, Self::FAULTS)
            | put(i64::from(self.faults.intersects(FaultSet::INPUT)), 58, 1)
            | put(i64::from(self.faults.intersects(FaultSet::CRITICAL)), 59, 1)
            | put(i64::from(self.faults.intersects(FaultSet::LOCKING)), 60, 1)
            | put(i64::from(self.reset as u8), 61, 3);
        *data = word.to_le_bytes();
    }

    fn unpack(data: &[u8; 8]) -> Option<Self> {
        let word = u64::from_le_bytes(*data);
        let torque = signed(word, 12, 16);
        let guidance = Self {
            torque: Torque::from_wide(from_lsb(torque, Self::TORQUE_LSB)),
            limit: LimitReason::from_code(unsigned(word, 28, 4))?,
            mode: Mode::from_code(unsigned(word, 32, 4) as u32)?,
            warning: unsigned(word, 36, 1) != 0,
            faults: FaultSet::from_bits(unsigned(word, 37, Self::FAULTS) as u32),
            reset: ResetCause::from_code(unsigned(word, 61, 3))?,
        };
        (torque.abs() <= Self::TORQUE_MAX).then_some(guidance)
    }
}

/// The driver has to take over. The message is sent in the step of the reaction, and then every 100 ms for as long as
/// the warning lasts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Warning {
    /// The mode that made the warning necessary.
    pub mode: Mode,
    /// Why.
    pub faults: FaultSet,
}

impl Message for Warning {
    const INFO: Info = info::Warning;

    fn pack(&self, data: &mut [u8; 8]) {
        let word = put(i64::from(self.mode as u8), 12, 4) | put(i64::from(self.faults.bits()), 16, 32);
        *data = word.to_le_bytes();
    }

    fn unpack(data: &[u8; 8]) -> Option<Self> {
        let word = u64::from_le_bytes(*data);
        Some(Self {
            mode: Mode::from_code(unsigned(word, 12, 4) as u32)?,
            faults: FaultSet::from_bits(unsigned(word, 16, 32) as u32),
        })
    }
}

/// One line of the fault history. Each 100 ms the next line is sent, if the history has any.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FaultRecord {
    /// Which line.
    pub index: u8,
    /// How many lines there are.
    pub total: u8,
    /// The line.
    pub record: Record,
}

impl Message for FaultRecord {
    const INFO: Info = info::FaultRecord;

    fn pack(&self, data: &mut [u8; 8]) {
        let word = put(i64::from(self.index), 12, 5)
            | put(i64::from(self.total), 17, 6)
            | put(i64::from(self.record.fault as u8), 23, 5)
            | put(i64::from(self.record.present), 28, 1)
            | put(i64::from(self.record.count), 32, 8)
            | put(i64::from(self.record.age_s), 40, 16);
        *data = word.to_le_bytes();
    }

    fn unpack(data: &[u8; 8]) -> Option<Self> {
        let word = u64::from_le_bytes(*data);
        Some(Self {
            index: unsigned(word, 12, 5) as u8,
            total: unsigned(word, 17, 6) as u8,
            record: Record {
                fault: Fault::from_code(unsigned(word, 23, 5))?,
                count: unsigned(word, 32, 8) as u8,
                age_s: unsigned(word, 40, 16) as u16,
                present: unsigned(word, 28, 1) != 0,
            },
        })
    }
}

/// The probe and the estimate of K_hg that follows from it, every 20 ms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Telemetry {
    /// The part of the guidance torque that is the probe, +-0.4995 N.m, LSB 2^-12 N.m, while there is one.
    pub probe: Option<Torque>,
    /// K_hg, +-4, LSB 2^-10, and its standard deviation, 0 to 1.999, LSB 2^-10, once identified.
    pub k_hg: Option<Reading>,
}

impl Telemetry {
    const TORQUE_LSB: u32 = 12;
    const TORQUE_MAX: i64 = (1 << 11) - 1;
    const K_HG_LSB: u32 = 10;
    const K_HG_MAX: i64 = 4 << Self::K_HG_LSB;
    const DEVIATION_MAX: i64 = (1 << 11) - 1;
}

impl Message for Telemetry {
    const INFO: Info = info::Telemetry;

    fn pack(&self, data: &mut [u8; 8]) {
        let probe = self.probe.unwrap_or(Torque::ZERO);
        let reading = self.k_hg.unwrap_or(Reading {
            k_hg: Ratio::ZERO,
            deviation: Ratio::ZERO,
        });
        let deviation = to_lsb(reading.deviation.bits(), Self::K_HG_LSB, Self::DEVIATION_MAX);
        let word = put(to_lsb(probe.bits(), Self::TORQUE_LSB, Self::TORQUE_MAX), 12, 12)
            | put(i64::from(self.probe.is_some()), 24, 1)
            | put(i64::from(self.k_hg.is_some()), 25, 1)
            | put(
                to_lsb(reading.k_hg.bits(), Self::K_HG_LSB, Self::K_HG_MAX),
                26,
                14,
            )
            | put(deviation, 40, 11);
        *data = word.to_le_bytes();
    }

    fn unpack(data: &[u8; 8]) -> Option<Self> {
        let word = u64::from_le_bytes(*data);
        let probe = Torque::from_wide(from_lsb(signed(word, 12, 12), Self::TORQUE_LSB));
        let k_hg = signed(word, 26, 14);
        let reading = Reading {
            k_hg: Ratio::from_wide(from_lsb(k_hg, Self::K_HG_LSB)),
            deviation: Ratio::from_wide(from_lsb(unsigned(word, 40, 11), Self::K_HG_LSB)),
        };
        (k_hg.abs() <= Self::K_HG_MAX).then(|| Self {
            probe: (unsigned(word, 24, 1) != 0).then_some(probe),
            k_hg: (unsigned(word, 25, 1) != 0).then_some(reading),
        })
    }
}
