//! New parameters over the bus: a set arrives field by field, is checked as a whole, and is then somebody's to store.
//!
//! A set is one [`ParameterWrite`] for each field, in the order of [`PARAMETERS`], from the first to the last
//! without another field between. That order tells a lost, repeated or swapped frame; so the counter, which is the
//! field's number modulo 16, only picks the data ID of the CRC. Every frame must find the ECU in Standby.
//! [`ParameterStatus`] says what became of it.
//!
//! Nothing here touches the running controller: a set takes effect when the ECU starts with it. Not here: the memory.
//! Not in the torque path: checking a set is floating-point work.

use crate::bus::Frame;
use crate::bus::e2e::ReceiverState;
use crate::bus::messages::{Message, ParameterStatus, ParameterWrite, WriteOutcome};
use crate::config::Config;
use crate::modes::Mode;
use crate::params::{PARAMETERS, Params};
use crate::stored::Stored;

const VALUES: usize = PARAMETERS.len();

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

/// A set on its way in.
#[derive(Debug, Clone)]
pub struct Download {
    values: [f64; VALUES],
    /// The field that must come next.
    next: usize,
    outcome: WriteOutcome,
}

impl Download {
    /// Nothing has come.
    pub const NEW: Self = Self {
        values: [0.0; VALUES],
        next: 0,
        outcome: WriteOutcome::None,
    };

    /// Takes a frame; `mode` is the ECU's. Returns the set that it completes, every parameter within its range.
    /// Other messages, and frames that are damaged on the way, are ignored.
    pub fn receive(&mut self, frame: &Frame, mode: Mode) -> Option<Params> {
        if frame.id() != ParameterWrite::ID {
            return None;
        }
        // No history: the order of the fields says more than the counter.
        let write = ParameterWrite::decode(&mut { ReceiverState::TRUSTED }, frame).ok()?;
        let index = usize::from(write.index);
        if index == 0 {
            self.next = 0;
        }
        let slot = self.values.get_mut(index).filter(|_| index == self.next);
        self.outcome = match (mode, slot) {
            (Mode::Standby, Some(slot)) => {
                *slot = f64::from(write.value);
                WriteOutcome::Receiving
            }
            (Mode::Standby, None) => WriteOutcome::OutOfOrder,
            _ => WriteOutcome::NotInStandby,
        };
        self.next = match self.outcome {
            WriteOutcome::Receiving => index.saturating_add(1),
            // Only the first field begins a set.
            _ => usize::MAX,
        };
        if self.next < VALUES || self.outcome != WriteOutcome::Receiving {
            return None;
        }
        let params = Params::from_values(&self.values);
        let is_good = Config::new(&params).is_ok();
        self.outcome = if is_good {
            WriteOutcome::Taken
        } else {
            WriteOutcome::OutOfRange
        };
        is_good.then_some(params)
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
