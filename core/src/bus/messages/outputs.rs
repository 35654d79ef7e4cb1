//! What the ECU says.

use super::{Message, from_lsb, put, signed, to_lsb, unsigned};
use crate::bus::e2e::Protection;
use crate::envelope::LimitReason;
use crate::faults::{Fault, FaultSet, Record};
use crate::modes::Mode;
use crate::quantity::{Gain, Torque};
use crate::reliance::Reading;

/// Why the ECU last started.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum ResetCause {
    /// Power came.
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
    /// The driver has to take over.
    pub warning: bool,
    /// What is wrong, one bit each.
    pub faults: FaultSet,
    /// Why the ECU last started.
    pub reset: ResetCause,
}

impl Guidance {
    const TORQUE_LSB: u32 = 12;
    /// +-5 N.m, the widest profile of the envelope.
    const TORQUE_MAX: i64 = 5 << Self::TORQUE_LSB;

    /// A torque as this message carries it, less than one LSB away. Rounded toward zero, so that no upper bound
    /// that held before is crossed by rounding; the envelope's bound on the reduction leaves room for it.
    #[must_use]
    pub fn rounded(torque: Torque) -> Torque {
        const LSB: i64 = 1 << (24 - Guidance::TORQUE_LSB);
        let raw = (i64::from(torque.bits()) / LSB).clamp(-Self::TORQUE_MAX, Self::TORQUE_MAX);
        Torque::from_wide(from_lsb(raw, Self::TORQUE_LSB))
    }
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
            | put(i64::from(self.mode as u8), 32, 4)
            | put(i64::from(self.warning), 36, 1)
            | put(i64::from(self.faults.bits()), 37, 15)
            | put(i64::from(self.reset as u8), 52, 3)
    }

    fn unpack(word: u64) -> Option<Self> {
        let torque = signed(word, 12, 16);
        let guidance = Self {
            torque: Torque::from_wide(from_lsb(torque, Self::TORQUE_LSB)),
            limit: LimitReason::from_code(unsigned(word, 28, 4))?,
            mode: Mode::from_code(unsigned(word, 32, 4) as u32)?,
            warning: unsigned(word, 36, 1) != 0,
            faults: FaultSet::from_bits(unsigned(word, 37, 15) as u16),
            reset: ResetCause::from_code(unsigned(word, 52, 3))?,
        };
        (torque.abs() <= Self::TORQUE_MAX).then_some(guidance)
    }
}

/// The driver has to take over: in the same step as the reaction, then every 100 ms while it holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Warning {
    /// The mode that made it necessary.
    pub mode: Mode,
    /// Why.
    pub faults: FaultSet,
}

impl Message for Warning {
    const ID: u16 = 0x0D0;
    const PROTECTION: Protection = Protection::new(0x66);
    const MAX_DELTA: u8 = 14;

    fn pack(&self) -> u64 {
        put(i64::from(self.mode as u8), 12, 4) | put(i64::from(self.faults.bits()), 16, 15)
    }

    fn unpack(word: u64) -> Option<Self> {
        Some(Self {
            mode: Mode::from_code(unsigned(word, 12, 4) as u32)?,
            faults: FaultSet::from_bits(unsigned(word, 16, 15) as u16),
        })
    }
}

/// One line of the fault history, the next every 100 ms, for as long as there is one.
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
    const ID: u16 = 0x300;
    const PROTECTION: Protection = Protection::new(0x77);
    const MAX_DELTA: u8 = 14;

    fn pack(&self) -> u64 {
        put(i64::from(self.index), 12, 4)
            | put(i64::from(self.total), 16, 4)
            | put(i64::from(self.record.fault as u8), 20, 4)
            | put(i64::from(self.record.count), 24, 8)
            | put(i64::from(self.record.age_s), 32, 16)
    }

    fn unpack(word: u64) -> Option<Self> {
        let code = unsigned(word, 20, 4);
        let fault = Fault::ALL
            .into_iter()
            .find(|fault| i64::from(*fault as u8) == code)?;
        Some(Self {
            index: unsigned(word, 12, 4) as u8,
            total: unsigned(word, 16, 4) as u8,
            record: Record {
                fault,
                count: unsigned(word, 24, 8) as u8,
                age_s: unsigned(word, 32, 16) as u16,
            },
        })
    }
}

/// The probe and what it tells, every 20 ms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Telemetry {
    /// The part of the guidance torque that is the probe, +-0.4995 N.m, LSB 2^-12 N.m, while there is one.
    pub probe: Option<Torque>,
    /// K_hg, +-4, LSB 2^-10, and its standard deviation, 0 to 1.999, LSB 2^-10, once identified.
    pub reliance: Option<Reading>,
}

impl Telemetry {
    const TORQUE_LSB: u32 = 12;
    const TORQUE_MAX: i64 = (1 << 11) - 1;
    const RELIANCE_LSB: u32 = 10;
    const RELIANCE_MAX: i64 = 4 << Self::RELIANCE_LSB;
    const DEVIATION_MAX: i64 = (1 << 11) - 1;
}

impl Message for Telemetry {
    const ID: u16 = 0x310;
    const PROTECTION: Protection = Protection::new(0x88);
    const MAX_DELTA: u8 = 2;

    fn pack(&self) -> u64 {
        let probe = self.probe.unwrap_or(Torque::ZERO);
        let reading = self.reliance.unwrap_or(Reading {
            k_hg: Gain::ZERO,
            deviation: Gain::ZERO,
        });
        let deviation = to_lsb(reading.deviation.bits(), Self::RELIANCE_LSB, Self::DEVIATION_MAX);
        put(to_lsb(probe.bits(), Self::TORQUE_LSB, Self::TORQUE_MAX), 12, 12)
            | put(i64::from(self.probe.is_some()), 24, 1)
            | put(i64::from(self.reliance.is_some()), 25, 1)
            | put(
                to_lsb(reading.k_hg.bits(), Self::RELIANCE_LSB, Self::RELIANCE_MAX),
                26,
                14,
            )
            | put(deviation, 40, 11)
    }

    fn unpack(word: u64) -> Option<Self> {
        let probe = Torque::from_wide(from_lsb(signed(word, 12, 12), Self::TORQUE_LSB));
        let k_hg = signed(word, 26, 14);
        let reading = Reading {
            k_hg: Gain::from_wide(from_lsb(k_hg, Self::RELIANCE_LSB)),
            deviation: Gain::from_wide(from_lsb(unsigned(word, 40, 11), Self::RELIANCE_LSB)),
        };
        (k_hg.abs() <= Self::RELIANCE_MAX).then(|| Self {
            probe: (unsigned(word, 24, 1) != 0).then_some(probe),
            reliance: (unsigned(word, 25, 1) != 0).then_some(reading),
        })
    }
}
