//! Whether the motor delivers what it is told.
//!
//! The delivered torque comes back with the column's sensors, a few milliseconds late, so it is compared with
//! all that was commanded in the last 8 ms. A measurement speaks for 4 ms, two periods of the column: compared
//! with later commands, an old one would turn a silent column into a faulty motor. Not kept twice: a flip here
//! raises a fault or hides one until the next few samples; fixed arrays, so that it can do nothing else.

use crate::quantity::Torque;

/// Sensor error and ripple of a motor torque.
const MARGIN: Torque = Torque::from_nm(0.1);
/// So many steps of disobedience are tolerated.
const PATIENCE: u32 = 10;
/// So many steps are judged by one measurement.
const SPEAKS_FOR: u32 = 4;
/// Commands that a measurement may be an echo of. A power of two, so that the place is a mask.
const COMMANDS: usize = 8;

/// The last commands, and what came of them; at first nothing commanded, nothing delivered.
#[derive(Debug, Clone, Default)]
pub struct Actuator {
    /// A ring.
    commanded: [Torque; COMMANDS],
    /// Where the oldest is. Every number names a place, modulo the ring.
    oldest: usize,
    delivered: Torque,
    /// Steps that the measurement still speaks for.
    fresh: u32,
    astray: u32,
}

impl Actuator {
    /// Takes a measurement.
    pub fn deliver(&mut self, torque: Torque) {
        (self.delivered, self.fresh) = (torque, SPEAKS_FOR);
    }

    /// Takes the command of the last step; `false` when the motor has been away from what it was told for
    /// more than 10 ms. Without a measurement there is nothing to say: its silence is a fault of the column.
    #[expect(clippy::indexing_slicing, reason = "a place is modulo the ring")]
    pub fn obeys(&mut self, commanded: Torque) -> bool {
        self.commanded[self.oldest % COMMANDS] = commanded;
        self.oldest = self.oldest.wrapping_add(1);
        if self.fresh > 0 {
            self.fresh = self.fresh.saturating_sub(1);
            let is_obedient = self.is_within(commanded, commanded) || {
                let range = |(low, high): (Torque, Torque), t: &Torque| (low.min(*t), high.max(*t));
                let (low, high) = self.commanded.iter().fold((commanded, commanded), range);
                self.is_within(low, high)
            };
            self.astray = if is_obedient {
                0
            } else {
                self.astray.saturating_add(1)
            };
        }
        self.astray <= PATIENCE
    }

    /// Whether the torque delivered is no further than the margin from commands between `low` and `high`.
    fn is_within(&self, low: Torque, high: Torque) -> bool {
        self.delivered >= low.plus(MARGIN.opposite()) && self.delivered <= high.plus(MARGIN)
    }
}
