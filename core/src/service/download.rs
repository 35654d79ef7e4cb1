//! New parameters over the bus: a set arrives field by field, is checked as a whole, and is handed to the caller to store.
//!
//! A set is one [`ParameterWrite`] for each field, in the order of [`PARAMETERS`], from the first to the last
//! without another field between. That order tells a lost, repeated or swapped frame; so the counter, which is the
//! field's number modulo 16, only picks the data ID of the CRC. [`ParameterStatus`] says what became of it.
//!
//! A set is taken in Standby only, or where the ECU is locked for want of one; while the vehicle stands, by both of its
//! speeds; within two seconds of a [`ParameterUnlock`] that names the set in use, so that a recorded download is none;
//! and not within ten seconds of a reset, which each set causes. A set takes time: whoever slips one in behind another's unlock
//! is interrupted by the fields of that one. None of this is a secret: it keeps a set from coming by
//! accident, in traffic, or in a stream that wears out the flash, and no more (`docs/security.md`).
//!
//! Nothing here touches the running controller: a set takes effect when the ECU starts with it. Not here: the memory.
//! Not in the torque path: checking a set is floating-point work.

use core::num::NonZeroU32;

use crate::bus::Frame;
use crate::bus::e2e::ReceiverState;
use crate::bus::messages::{
    Message, ParameterStatus, ParameterUnlock, ParameterValue, ParameterWrite, WriteOutcome,
};
use crate::controller::config::Setup;
use crate::controller::params::{PARAMETERS, Params};
use crate::safety::faults::{Fault, FaultSet};
use crate::safety::modes::Mode;
use crate::service::stored::{Set, Stored};

const VALUES: usize = PARAMETERS.len();
/// An unlock lasts for so long, ms.
pub const UNLOCK_MS: u32 = 2000;
/// Two unlocks that come closer, ms, are of two senders, and unlock nothing.
const UNLOCK_APART_MS: u32 = 400;
/// A field takes so long, ms, but for the first ones, which may have waited: clients send one in 10 ms.
const FIELD_MS: u32 = 4;
const FIELDS_AT_ONCE: u32 = 12;

/// The ECU's situation when a frame arrives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Conditions {
    /// The ECU's mode; see [`mode_for_parameters`].
    pub mode: Mode,
    /// The vehicle stands ([`crate::ecu::Ecu::stands`]).
    pub stands: bool,
    /// The last start was a power-up, or is ten seconds ago.
    pub settled: bool,
    /// The number of the stored set in use.
    pub in_use: Option<u32>,
    /// Time since the start, ms, which may wrap.
    pub now_ms: u32,
}

/// The mode that a download finds: an ECU that is locked for want of parameters alone takes some, as in Standby.
#[must_use]
pub fn mode_for_parameters(mode: Mode, faults: FaultSet) -> Mode {
    let mut parameters = FaultSet::NONE;
    parameters.insert(Fault::Parameters);
    match mode {
        Mode::Locked if faults.common(FaultSet::LOCKING) == parameters => Mode::Standby,
        _ => mode,
    }
}

/// The frame that has to come before those of a set for the vehicle of that number, by the numbers that the bus carries: that of
/// the set in use as [`ParameterStatus`] says it.
#[must_use]
pub fn unlock(in_use: u32, vehicle: u32) -> Frame {
    let unlock = ParameterUnlock {
        vehicle,
        sequence: in_use,
    };
    unlock.encode(0)
}

/// The value that is due at a turn, of the set in use.
#[must_use]
#[expect(clippy::as_conversions, reason = "fewer than 256 values; the bus carries f32")]
pub fn value(params: &Params, turn: u32) -> Option<ParameterValue> {
    let index = turn.checked_rem(VALUES as u32)?;
    let value = params.to_values().get(index as usize).copied()?;
    Some(ParameterValue {
        index: index as u8,
        value: value as f32,
    })
}

/// The frames that carry a set. Values are rounded to f32.
#[must_use]
#[expect(
    clippy::as_conversions,
    reason = "rounded to what the bus carries, which saturates to infinity"
)]
pub fn frames(params: &Params) -> [Frame; VALUES] {
    let mut index = 0_u8;
    params.to_values().map(|value| {
        let write = ParameterWrite {
            index,
            value: value as f32,
        };
        let frame = write.encode(index);
        index = index.wrapping_add(1);
        frame
    })
}

/// The field that may come next, beside the first, which may always begin a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Due {
    /// That of this index.
    Field(usize),
    /// None: the set was refused.
    Nothing,
}

/// A set that is being received.
#[derive(Debug, Clone)]
pub struct Download {
    values: [f64; VALUES],
    due: Due,
    /// When it was unlocked, and for a set for which vehicle.
    unlocked_ms: Option<u32>,
    vehicle: Option<NonZeroU32>,
    /// When the last unlock came, and the first field of this set.
    asked_ms: Option<u32>,
    began_ms: u32,
    outcome: WriteOutcome,
}

impl Download {
    /// Before the first frame.
    pub const NEW: Self = Self {
        values: [0.0; VALUES],
        due: Due::Field(0),
        unlocked_ms: None,
        vehicle: None,
        asked_ms: None,
        began_ms: 0,
        outcome: WriteOutcome::None,
    };

    /// Takes a frame. Returns the set that it completes, every parameter within its range. Other messages, and frames
    /// that are damaged on the way, are ignored.
    pub fn receive(&mut self, frame: &Frame, conditions: &Conditions) -> Option<Set> {
        let since_ms = |at: u32| conditions.now_ms.wrapping_sub(at);
        match frame.id() {
            ParameterUnlock::ID => {
                let unlock = ParameterUnlock::decode(&mut { ReceiverState::TRUSTED }, frame).ok()?;
                // The bus says 0 where there is none.
                let is_right = unlock.sequence == conditions.in_use.unwrap_or(0);
                let before = self.asked_ms.replace(conditions.now_ms);
                let is_alone = before.is_none_or(|at| since_ms(at) >= UNLOCK_APART_MS);
                self.unlocked_ms = (is_right && is_alone).then_some(conditions.now_ms);
                self.vehicle = NonZeroU32::new(unlock.vehicle);
                return None;
            }
            ParameterWrite::ID => {}
            _ => return None,
        }
        // Each frame is judged without a history of counters, as the order of the fields says more.
        let write = ParameterWrite::decode(&mut { ReceiverState::TRUSTED }, frame).ok()?;
        let index = usize::from(write.index);
        if index == 0 {
            (self.due, self.began_ms) = (Due::Field(0), conditions.now_ms);
        } else if self.due == Due::Nothing {
            // The rest of a refused set keeps the reason.
            return None;
        }
        let slot = self
            .values
            .get_mut(index)
            .filter(|_| self.due == Due::Field(index));
        let is_unlocked = self.unlocked_ms.is_some_and(|at| since_ms(at) <= UNLOCK_MS);
        let most = (since_ms(self.began_ms) / FIELD_MS).saturating_add(FIELDS_AT_ONCE);
        self.outcome = match slot {
            _ if conditions.mode != Mode::Standby => WriteOutcome::NotInStandby,
            _ if !conditions.stands => WriteOutcome::NotStanding,
            _ if !conditions.settled => WriteOutcome::TooSoon,
            _ if !is_unlocked => WriteOutcome::NotUnlocked,
            _ if u32::from(write.index) > most => WriteOutcome::TooFast,
            Some(slot) => {
                *slot = f64::from(write.value);
                WriteOutcome::Receiving
            }
            None => WriteOutcome::OutOfOrder,
        };
        if self.outcome != WriteOutcome::Receiving {
            // For one attempt.
            self.unlocked_ms = None;
        }
        self.due = match self.outcome {
            WriteOutcome::Receiving => Due::Field(index.saturating_add(1)),
            _ => Due::Nothing,
        };
        if self.due != Due::Field(VALUES) {
            return None;
        }
        let params = Params::from_values(&self.values);
        self.unlocked_ms = None;
        // A set that the next start would refuse is not taken.
        let is_good = Setup::check(&params).is_ok();
        self.outcome = if is_good {
            WriteOutcome::Taken
        } else {
            WriteOutcome::OutOfRange
        };
        is_good.then_some(Set {
            params,
            vehicle: self.vehicle,
        })
    }

    /// What the bus is told: the set in use, whether a copy of it cannot be read, and what became of the last one
    /// that was sent.
    #[must_use]
    pub const fn status(&self, in_use: Option<&Stored>, damaged: bool) -> ParameterStatus {
        ParameterStatus {
            stored: in_use.is_some(),
            damaged,
            outcome: self.outcome,
            sequence: match in_use {
                Some(stored) => stored.sequence,
                None => 0,
            },
        }
    }
}
