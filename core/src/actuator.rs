//! Whether the motor delivers what it is told.
//!
//! The delivered torque comes back with the column's sensors, a few milliseconds late, so it is compared with
//! all that was commanded in the last 8 ms. Not kept twice: a flip here raises a fault or hides one until the
//! next few samples.

use heapless::Deque;

use crate::quantity::Torque;

/// Sensor error and ripple of a motor torque.
const MARGIN: Torque = Torque::from_nm(0.1);
/// So many steps of disobedience are a fault.
const PATIENCE: u32 = 10;

/// The last commands, and what came of them.
#[derive(Debug, Clone)]
pub struct Actuator {
    commanded: Deque<Torque, 8>,
    delivered: Option<Torque>,
    astray: u32,
}

impl Actuator {
    /// Nothing commanded, nothing delivered.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            commanded: Deque::new(),
            delivered: None,
            astray: 0,
        }
    }

    /// Takes a measurement.
    pub fn deliver(&mut self, torque: Torque) {
        self.delivered = Some(torque);
    }

    /// Takes the command of the last step; `false` when the motor has been away from what it was told for
    /// 10 ms. Without a measurement there is nothing to say: its silence is a fault of the column.
    pub fn obeys(&mut self, commanded: Torque) -> bool {
        if self.commanded.is_full() {
            self.commanded.pop_front();
        }
        // There is room: the oldest has just left.
        let _ = self.commanded.push_back(commanded);
        let Some(delivered) = self.delivered else {
            return true;
        };
        let low = self.commanded.iter().min().copied().unwrap_or(commanded);
        let high = self.commanded.iter().max().copied().unwrap_or(commanded);
        let margin = i64::from(MARGIN.bits());
        let torque = i64::from(delivered.bits());
        let near = torque >= i64::from(low.bits()).saturating_sub(margin)
            && torque <= i64::from(high.bits()).saturating_add(margin);
        self.astray = if near { 0 } else { self.astray.saturating_add(1) };
        self.astray <= PATIENCE
    }
}

impl Default for Actuator {
    fn default() -> Self {
        Self::new()
    }
}
