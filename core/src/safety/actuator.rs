//! Whether the motor delivers what it is told.
//!
//! The delivered torque comes back with the column's sensors, a few milliseconds late, and a motor needs time of its
//! own. So it is compared with a band: all that an honest motor may deliver of what was commanded, with a dead time of
//! up to 8 ms, a first-order lag of up to 20 ms, and an error of 0.1 N.m and an eighth of the torque. The ends of the
//! band go at once to where the command goes away from zero of the band, and follow it back with 21 ms: whatever a
//! motor with a shorter lag does, it does within them.
//!
//! Two things can be wrong, and they are not alike. A torque that nobody asked for steers the vehicle: *astray*, and
//! no torque any more. A torque that is missing leaves the driver with more to do, at once and for good if it were cut
//! as well: *weak*, and what is left is handed over.
//!
//! A measurement speaks for 4 ms, two periods of the column: compared with later commands, an old one would turn a
//! silent column into a faulty motor. Not kept twice: a flip here raises a fault or hides one until the next few
//! samples; fixed arrays, so that it can do nothing else.

use fixed::types::{I0F32, I8F24};

use crate::quantity::Torque;

/// Sensor error and ripple of a motor torque.
const MARGIN: Torque = Torque::from_nm(0.1);
/// The torque's own error, of which a magnet's temperature is most: 2^-3 of it.
const ERROR_SHIFT: u32 = 3;
/// So many steps of a torque that should not be there are tolerated.
const ASTRAY_PATIENCE: u32 = 10;
/// So many steps of a torque that is missing: longer than the lag of a motor that is not first order.
const WEAK_PATIENCE: u32 = 50;
/// So many steps are judged by one measurement.
const SPEAKS_FOR: u32 = 4;
/// Commands that a measurement may be an echo of. A power of two, so that the place is a mask.
const COMMANDS: usize = 8;

/// What the motor makes of its commands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motor {
    /// What an honest one would.
    Obeys,
    /// It has delivered less than it was told for more than 50 ms.
    Weak,
    /// It has delivered a torque that it was not told for more than 10 ms.
    Astray,
}

/// The last commands, and what came of them; at first nothing commanded, nothing delivered.
#[derive(Debug, Clone, Default)]
pub struct Actuator {
    /// A ring.
    commanded: [Torque; COMMANDS],
    /// Where the oldest is. Every number names a place, modulo the ring.
    oldest: usize,
    /// Ends of what an honest motor may deliver now.
    low: Torque,
    high: Torque,
    delivered: Torque,
    /// Steps that the measurement still speaks for.
    fresh: u32,
    astray: u32,
    weak: u32,
}

impl Actuator {
    /// Takes a measurement.
    pub fn deliver(&mut self, torque: Torque) {
        (self.delivered, self.fresh) = (torque, SPEAKS_FOR);
    }

    /// Takes the command of the last step. Without a measurement there is nothing to say: its silence is a fault of
    /// the column.
    #[expect(clippy::indexing_slicing, reason = "a place is modulo the ring")]
    pub fn judge(&mut self, commanded: Torque) -> Motor {
        let place = &mut self.commanded[self.oldest % COMMANDS];
        let before = core::mem::replace(place, commanded);
        self.oldest = self.oldest.wrapping_add(1);
        let (low, high) = (commanded.min(before), commanded.max(before));
        // An end moves out at once, and back with a lag.
        self.high = if self.high > high {
            lagging(self.high, high)
        } else {
            high
        };
        self.low = if self.low < low {
            lagging(self.low, low)
        } else {
            low
        };
        if self.fresh > 0 {
            self.fresh = self.fresh.saturating_sub(1);
            // The usual case first: within the band, whatever the errors may be.
            if self.low <= self.delivered && self.delivered <= self.high {
                (self.astray, self.weak) = (0, 0);
                return Motor::Obeys;
            }
            let error =
                |t: Torque| Torque::from_fixed(t.abs().fixed().wrapping_shr(ERROR_SHIFT)).plus(MARGIN);
            let above = |t: Torque| self.delivered > t.plus(error(t));
            let below = |t: Torque| self.delivered < t.minus(error(t));
            let is_astray = above(self.high.max(Torque::ZERO)) || below(self.low.min(Torque::ZERO));
            let is_weak = !is_astray && (above(self.high) || below(self.low));
            let count = |so_far: u32, goes_on: bool| if goes_on { so_far.saturating_add(1) } else { 0 };
            self.astray = count(self.astray, is_astray);
            self.weak = count(self.weak, is_weak);
        }
        if self.astray > ASTRAY_PATIENCE {
            Motor::Astray
        } else if self.weak > WEAK_PATIENCE {
            Motor::Weak
        } else {
            Motor::Obeys
        }
    }
}

/// An end of the band, a step of 1 ms on its way back to the command: 3/64 of it, a lag of 21 ms. Rounded down, so that it
/// never passes the command.
fn lagging(end: Torque, command: Torque) -> Torque {
    const SHARE: I0F32 = I0F32::from_bits(3 << (32 - 6));
    // Nothing wraps: a frame has room for commands of 5 N.m, and the ends lie between commands.
    let way = command.fixed().wrapping_sub(end.fixed());
    let back = I8F24::wrapping_from_num(way.wide_mul(SHARE));
    Torque::from_fixed(end.fixed().wrapping_add(back))
}
