//! The faults that the ECU declares, and their history since power-up.
//!
//! [`faults!`](self) below is the one list of faults. One more fault is one more line of it, with the next free code;
//! its class decides what the ECU does. `core/tests/dbc.rs` then asks for its names in `core/haptic.dbc`, and
//! `core/tests/faults.rs` for its row in `docs/reference/bus.md`.

use crate::quantity::{Instant, Micros};

/// The class of a fault, which decides the reaction (`docs/explanation/behaviour.md`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Class {
    /// The guidance has to end, and nothing is wrong with the ECU: the torque fades.
    A,
    /// An input failed: the torque is handed over.
    B,
    /// The computation, memory, timing or output failed: no torque until the next power-up.
    C,
    /// The ECU must not leave Boot.
    Locked,
    /// Guidance goes on with one input less.
    L,
}

/// Declares the faults: `code Name: class, unseen;`. The code is the fault's bit in the fault word. *Unseen*, in ms,
/// is how long the fault may have spoilt the torque before it was declared, beside the age of its input. No handover
/// starts from a torque of that time. It is 0 where the age of the input covers it, or where the torque does not
/// depend on the input. Where it is longer than torques are remembered, the handover starts from zero.
macro_rules! faults {
    ($($(#[$doc:meta])* $code:literal $name:ident: $class:ident, $unseen_ms:literal;)*) => {
        /// A fault, by its bit in the fault word. More will come.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(u8)]
        #[non_exhaustive]
        pub enum Fault {
            $($(#[$doc])* $name = $code,)*
        }

        impl Fault {
            /// How many faults there are.
            pub const COUNT: usize = [$($code),*].len();

            /// Every fault, in the order of the bits.
            pub const ALL: [Self; Self::COUNT] = [$(Self::$name),*];

            /// Its class.
            #[must_use]
            pub const fn class(self) -> Class {
                match self {
                    $(Self::$name => Class::$class,)*
                }
            }

            /// The fault of a code on the bus.
            #[must_use]
            pub const fn from_code(code: i64) -> Option<Self> {
                match code {
                    $($code => Some(Self::$name),)*
                    _ => None,
                }
            }
        }

        impl FaultSet {
            /// The longest time that any of them may have acted before it was declared, beside the ages of the inputs.
            #[must_use]
            pub fn unseen(self) -> Micros {
                let mut longest = Micros::from_us(0);
                $(if self.contains(Fault::$name) {
                    longest = longest.max(Micros::from_ms($unseen_ms));
                })*
                longest
            }
        }
    };
}

faults! {
    /// B: no usable lane preview for three periods of the camera, or for 1 s more of guidance.
    0 LaneTimeout: B, 0;
    /// B: the camera marks its preview as not valid.
    1 LaneInvalid: B, 0;
    /// B: the lateral error does not move as yaw error, wheel and speed say it must.
    2 LaneImplausible: B, 10_000;
    /// B: no usable driver torque and wheel angle for three periods of the sender.
    3 ColumnTimeout: B, 0;
    /// B: driver torque and wheel angle do not belong together.
    4 ColumnImplausible: B, 1500;
    /// B: no usable speed for three periods of the sender.
    5 SpeedTimeout: B, 0;
    /// B: the two speeds differ by 2 m/s or more.
    6 SpeedImplausible: B, 800;
    /// B: no usable request for three periods of the sender.
    7 RequestTimeout: B, 0;
    /// C: steps late or missing.
    8 Deadline: C, 0;
    /// C: the monitor disagreed with a command.
    9 Monitor: C, 0;
    /// C: the two copies of a redundant state differ.
    10 Memory: C, 0;
    /// C: a torque is delivered that was not commanded.
    11 Actuator: C, 0;
    /// C: the monitor passed a command that it has to refuse.
    12 SelfTest: C, 0;
    /// Locked: no good copy of the parameters.
    13 Parameters: Locked, 0;
    /// Locked: three resets within 10 s, or ten since power-up.
    14 ResetLoop: Locked, 0;
    /// B: lane previews arrive, and for three periods, or 4 s of guidance, each is too far from the last one used to be true.
    15 LaneStep: B, 0;
    /// B: speeds arrive, and for 0.3 s and three periods each is too far from the last one used to be true.
    16 SpeedStep: B, 0;
    /// B: another node sends under an identifier of this ECU; for a second after the last such frame.
    17 OwnIdentifier: B, 0;
    /// B: the motor delivers less than was commanded.
    18 MotorWeak: B, 0;
    /// A: no hand on the wheel for 15 s of guidance; after 30 s the guidance ends.
    19 HandsOff: A, 0;
    /// L: the yaw rate is impossible, or denied by wheel angle and speed: guidance goes on without it.
    20 YawRate: L, 0;
}

// The word has 32 bits, and a fault's code is its place in the list.
#[expect(clippy::as_conversions, clippy::indexing_slicing, reason = "at compile time")]
const _: () = {
    assert!(Fault::COUNT <= 32, "the fault word is full");
    let mut i = 0;
    while i < Fault::COUNT {
        assert!(Fault::ALL[i] as usize == i, "codes count up from 0");
        i += 1;
    }
};

/// A set of faults: the fault word, one bit for each.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct FaultSet(u32);

impl FaultSet {
    /// No fault.
    pub const NONE: Self = Self(0);
    /// Every input fault (class B).
    pub const INPUT: Self = Self::of_class(Class::B);
    /// Every fault of class C.
    pub const CRITICAL: Self = Self::of_class(Class::C);
    /// Every fault that keeps the ECU in Boot (class Locked).
    pub const LOCKING: Self = Self::of_class(Class::Locked);
    /// Every fault that ends guidance with a fade (class A).
    pub const FADING: Self = Self::of_class(Class::A);
    /// Every fault that has a name.
    const NAMED: u32 =
        Self::FADING.0 | Self::INPUT.0 | Self::CRITICAL.0 | Self::LOCKING.0 | Self::of_class(Class::L).0;

    /// Every fault of a class.
    #[must_use]
    #[expect(
        clippy::as_conversions,
        clippy::indexing_slicing,
        clippy::arithmetic_side_effects,
        reason = "the index stays below the count"
    )]
    pub const fn of_class(class: Class) -> Self {
        let (mut set, mut i) = (0, 0);
        while i < Fault::COUNT {
            if Fault::ALL[i].class() as u8 == class as u8 {
                set |= Self::bit(Fault::ALL[i]);
            }
            i += 1;
        }
        Self(set)
    }

    /// The set with these bits; those that name no fault are dropped.
    #[must_use]
    pub const fn from_bits(bits: u32) -> Self {
        Self(bits & Self::NAMED)
    }

    /// One bit for each fault.
    #[must_use]
    pub const fn bits(self) -> u32 {
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

    /// The set with one fault more.
    #[must_use]
    pub const fn with(self, fault: Fault) -> Self {
        Self(self.0 | Self::bit(fault))
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

    /// The faults in both sets.
    #[must_use]
    pub const fn common(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// The faults in either set.
    #[must_use]
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The faults of this set that are not in `other`.
    #[must_use]
    pub const fn difference(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    #[expect(clippy::as_conversions, reason = "a code is its discriminant")]
    const fn bit(fault: Fault) -> u32 {
        1_u32.wrapping_shl(fault as u32)
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
    /// Whether it is there now.
    pub present: bool,
}

/// How often each fault appeared since power-up, and when last.
///
/// It is not kept twice, as no torque depends on it. Its arrays are of fixed size, so that a flipped bit can only
/// spoil a count or an age.
#[derive(Debug, Clone)]
pub struct FaultHistory {
    /// How often each fault appeared.
    counts: [u8; Fault::COUNT],
    /// The second in which each fault last appeared.
    seen_s: [u32; Fault::COUNT],
    present: FaultSet,
    /// Every fault that appeared since power-up.
    ever: FaultSet,
    /// Whole seconds since power-up, saturating. An instant would not do: the clock wraps.
    seconds: u32,
    /// Start of the present second.
    second: Instant,
}

const SECOND: Micros = Micros::from_ms(1000);

impl FaultHistory {
    /// No fault so far.
    #[must_use]
    pub const fn new(now: Instant) -> Self {
        Self {
            counts: [0; Fault::COUNT],
            seen_s: [0; Fault::COUNT],
            present: FaultSet::NONE,
            ever: FaultSet::NONE,
            seconds: 0,
            second: now,
        }
    }

    /// Takes the faults present in this step.
    pub fn step(&mut self, now: Instant, present: FaultSet) {
        let appeared = present.difference(self.present);
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

    /// A line: of the faults that ever appeared, in the order of the bits, the one of this index.
    #[must_use]
    #[expect(clippy::as_conversions, reason = "at most 32 bits; an age of at most 65,535")]
    pub fn record(&self, index: u32) -> Option<Record> {
        // Each round takes the lowest bit away.
        let above = (0..index.min(u32::BITS)).fold(self.ever.bits(), |left, _| left & left.wrapping_sub(1));
        let place = above.trailing_zeros() as usize;
        let fault = *Fault::ALL.get(place)?;
        let (count, seen_s) = (*self.counts.get(place)?, *self.seen_s.get(place)?);
        Some(Record {
            fault,
            count,
            age_s: self.seconds.saturating_sub(seen_s).min(u32::from(u16::MAX)) as u16,
            present: self.present.contains(fault),
        })
    }
}
