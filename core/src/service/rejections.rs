//! Counts of rejected frames for each pair of message and reason. They reveal a sender with a wrong data ID, or
//! forged frames. [`Rejection`] reports one pair after the other on the bus.
//!
//! The counts are outside the torque path and not kept twice, as no torque depends on them. The array is of fixed
//! size, so that a flipped bit can only spoil a count.

use crate::bus::Reject;
use crate::bus::messages::{MESSAGES, Rejection};

const REASONS: usize = Reject::ALL.len();
const PAIRS: usize = MESSAGES.len() * REASONS;

/// The counts since the start.
#[derive(Debug, Clone)]
pub struct Rejections {
    counts: [u16; PAIRS],
    /// The pair that is reported next, if its count is not zero.
    next: usize,
}

impl Default for Rejections {
    fn default() -> Self {
        Self::NONE
    }
}

impl Rejections {
    /// Nothing was rejected.
    pub const NONE: Self = Self {
        counts: [0; PAIRS],
        next: 0,
    };

    /// Counts a rejected frame. One whose identifier is not in the list of messages is not counted.
    #[expect(clippy::as_conversions, reason = "the code of a variant")]
    pub fn count(&mut self, id: u16, reason: Reject) {
        let message = MESSAGES.iter().position(|message| message.id == id);
        let place = message.map(|message| message.saturating_mul(REASONS).saturating_add(reason as usize));
        if let Some(count) = place.and_then(|place| self.counts.get_mut(place)) {
            *count = count.saturating_add(1);
        }
    }

    /// The sum over all messages and reasons, saturating.
    #[must_use]
    pub fn total(&self) -> u32 {
        let counts = self.counts.iter().map(|count| u32::from(*count));
        counts.fold(0, u32::saturating_add)
    }

    /// The next pair, in turn, whose count is not zero.
    pub fn line(&mut self) -> Option<Rejection> {
        for _ in 0..PAIRS {
            let place = self.next % PAIRS;
            self.next = place.wrapping_add(1);
            let message = MESSAGES.get(place / REASONS)?;
            let reason = Reject::ALL.get(place % REASONS)?;
            let count = self.counts.get(place).copied().unwrap_or(0);
            if count > 0 {
                return Some(Rejection {
                    id: message.id,
                    reason: *reason,
                    count,
                });
            }
        }
        None
    }
}
