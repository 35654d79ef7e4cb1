//! What can be wrong, and its short history on the ECU.

use crate::quantity::{Instant, Micros};

/// A fault, by its bit in the status frame. Classes as in `docs/safety.md`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Fault {
    /// B: no usable lane preview for 30 ms.
    LaneTimeout = 0,
    /// B: the lane preview's sender does not vouch for it.
    LaneInvalid = 1,
    /// B: the lateral error does not move as yaw error, wheel and speed say it must.
    LaneImplausible = 2,
    /// B: no usable driver torque and wheel angle for 30 ms.
    ColumnTimeout = 3,
    /// B: driver torque and wheel angle do not belong together.
    ColumnImplausible = 4,
    /// B: no usable speed for 30 ms.
    SpeedTimeout = 5,
    /// B: the two speeds differ by 2 m/s or more.
    SpeedImplausible = 6,
    /// B: no usable command for 30 ms.
    CommandTimeout = 7,
    /// C: steps late or missing.
    Deadline = 8,
    /// C: the monitor disagreed with a command.
    Monitor = 9,
    /// C: two copies of a vital state differ.
    Memory = 10,
    /// C: the torque delivered is not the torque commanded.
    Actuator = 11,
    /// C: the monitor passed a command that it has to refuse.
    SelfTest = 12,
    /// Locked: no good copy of the parameters.
    Parameters = 13,
    /// Locked: three resets within 10 s.
    ResetLoop = 14,
}

impl Fault {
    /// Every fault, in the order of the bits.
    pub const ALL: [Self; 15] = [
        Self::LaneTimeout,
        Self::LaneInvalid,
        Self::LaneImplausible,
        Self::ColumnTimeout,
        Self::ColumnImplausible,
        Self::SpeedTimeout,
        Self::SpeedImplausible,
        Self::CommandTimeout,
        Self::Deadline,
        Self::Monitor,
        Self::Memory,
        Self::Actuator,
        Self::SelfTest,
        Self::Parameters,
        Self::ResetLoop,
    ];
}

/// A set of faults.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct FaultSet(u16);

impl FaultSet {
    /// No fault.
    pub const NONE: Self = Self(0);
    /// Every input fault (class B).
    pub const INPUT: Self = Self(0x00FF);
    /// Inputs that arrive, but cannot be true: since when is unknown.
    pub const IMPLAUSIBLE: Self = Self(0x0054);
    /// Every fault of class C.
    pub const CRITICAL: Self = Self(0x1F00);
    /// What forbids to leave Boot.
    pub const LOCKING: Self = Self(0x6000);

    /// The set with these bits; bit 15 names no fault and is dropped.
    #[must_use]
    pub const fn from_bits(bits: u16) -> Self {
        Self(bits & 0x7FFF)
    }

    /// One bit for each fault.
    #[must_use]
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// Whether the fault is in the set.
    #[must_use]
    pub const fn contains(self, fault: Fault) -> bool {
        self.0 & Self::bit(fault) != 0
    }

    /// Whether the sets have a fault in common.
    #[must_use]
    pub const fn intersects(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    /// Adds a fault.
    pub fn insert(&mut self, fault: Fault) {
        self.0 |= Self::bit(fault);
    }

    /// Adds a fault if `present`.
    pub fn insert_if(&mut self, present: bool, fault: Fault) {
        if present {
            self.insert(fault);
        }
    }

    /// Adds or removes a fault.
    pub fn set(&mut self, present: bool, fault: Fault) {
        self.0 &= !Self::bit(fault);
        self.insert_if(present, fault);
    }

    /// What is in both.
    #[must_use]
    pub const fn common(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// All of both.
    #[must_use]
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// What is here and not in `other`.
    #[must_use]
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    const fn bit(fault: Fault) -> u16 {
        1_u16.wrapping_shl(fault as u32)
    }
}

/// One kind of fault in the history.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Record {
    /// Which.
    pub fault: Fault,
    /// How many times it appeared, saturating.
    pub count: u8,
    /// Seconds since it last appeared, saturating.
    pub age_s: u16,
}

/// How often each fault appeared since power-up, and when last.
///
/// Not kept twice: it moves nothing. Fixed arrays, so that a flipped bit can only spoil a count or an age.
#[derive(Debug, Clone)]
pub struct History {
    /// How often, by fault.
    counts: [u8; 15],
    /// In which second, by fault. A step counts one second on, and no age.
    seen_s: [u32; 15],
    present: FaultSet,
    /// Appeared since power-up.
    ever: FaultSet,
    /// Whole seconds since power-up, saturating: no instant that could outlive a wrap of the clock.
    seconds: u32,
    /// Start of the running one.
    second: Instant,
}

const SECOND: Micros = Micros::from_ms(1000);

impl History {
    /// No fault so far.
    #[must_use]
    pub const fn new(now: Instant) -> Self {
        Self {
            counts: [0; 15],
            seen_s: [0; 15],
            present: FaultSet::NONE,
            ever: FaultSet::NONE,
            seconds: 0,
            second: now,
        }
    }

    /// Takes the faults present in this step.
    pub fn step(&mut self, now: Instant, present: FaultSet) {
        let appeared = present.without(self.present);
        self.present = present;
        self.ever = self.ever.union(present);
        if now.since(self.second) >= SECOND {
            self.second = now;
            self.seconds = self.seconds.saturating_add(1);
        }
        if appeared == FaultSet::NONE {
            return;
        }
        let lines = self.counts.iter_mut().zip(&mut self.seen_s);
        for (fault, (count, seen_s)) in Fault::ALL.into_iter().zip(lines) {
            if appeared.contains(fault) {
                (*count, *seen_s) = (count.saturating_add(1), self.seconds);
            }
        }
    }

    /// How many kinds of fault ever appeared.
    #[must_use]
    pub const fn kinds(&self) -> u32 {
        self.ever.bits().count_ones()
    }

    /// Every fault that ever appeared, in the order of the bits.
    pub fn records(&self) -> impl Iterator<Item = Record> {
        let lines = self.counts.iter().zip(&self.seen_s);
        let records = Fault::ALL.into_iter().zip(lines);
        records
            .filter(|(fault, _)| self.ever.contains(*fault))
            .map(|(fault, (count, seen_s))| Record {
                fault,
                count: *count,
                age_s: self.seconds.saturating_sub(*seen_s).min(u32::from(u16::MAX)) as u16,
            })
    }
}
