//! Checks whether the motor delivers the torque that was commanded.
//!
//! The measured torque comes with the column's sensors, a few milliseconds late, and the motor itself has a lag. So
//! the measurement is compared with a band: all torques that a working motor may deliver for the last commands, with
//! a dead time of up to 8 ms, a first-order lag of up to 20 ms, and an error of 0.1 N.m plus an eighth of the torque.
//! An end of the band moves outward with the command at once, and back with a lag of 21 ms, so that the torque of a
//! motor with a shorter lag stays inside.
//!
//! Two faults are told apart. An *astray* motor delivers a torque that was not commanded, which steers the vehicle:
//! the torque is switched off. A *weak* motor delivers too little. Switching it off would take the rest from the
//! driver at once, so the ECU hands over what is left.
//!
//! A measurement is used for 4 ms, two periods of the column's sensors. An older one, compared with newer commands,
//! would make a silent column look like a faulty motor. The state is not kept twice: a flipped bit raises or hides a
//! fault until the next few samples, and can do nothing else, as all arrays are of fixed size.

use fixed::types::{I0F32, I8F24};

use crate::quantity::Torque;

/// Sensor error and ripple of a motor torque.
const MARGIN: Torque = Torque::from_nm(0.1);
/// Relative error of the torque, 2^-3, mostly from the temperature of the motor's magnets.
const ERROR_SHIFT: u32 = 3;
/// How many steps with a torque that was not commanded are tolerated.
const ASTRAY_PATIENCE: u32 = 10;
/// How many steps with a missing torque are tolerated: longer than the lag of a motor of higher order.
const WEAK_PATIENCE: u32 = 50;
/// How many steps use one measurement.
const SPEAKS_FOR: u32 = 4;
/// How many earlier commands are remembered: a measurement may answer any of them. A power of two, so that the index
/// is a mask.
const COMMANDS: usize = 8;

/// How the motor follows its commands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motor {
    /// It delivers what a working motor may deliver.
    Obeys,
    /// It has delivered less than commanded for more than 50 ms.
    Weak,
    /// It has delivered a torque that was not commanded for more than 10 ms.
    Astray,
}

/// The last commands, the band and the last measurement; all zero at first.
#[derive(Debug, Clone, Default)]
pub struct Actuator {
    /// The last commands, in a ring.
    commanded: [Torque; COMMANDS],
    /// Index of the oldest command, modulo the length of the ring.
    oldest: usize,
    /// Ends of the band.
    low: Torque,
    high: Torque,
    delivered: Torque,
    /// For how many more steps the measurement is used.
    fresh: u32,
    astray: u32,
    weak: u32,
}

impl Actuator {
    /// Takes a measurement.
    pub fn deliver(&mut self, torque: Torque) {
        (self.delivered, self.fresh) = (torque, SPEAKS_FOR);
    }

    /// Takes the command of the last step, and judges the motor. Without a fresh measurement the verdict stays as it
    /// is: a missing measurement is a fault of the column.
    #[expect(clippy::indexing_slicing, reason = "a place is modulo the ring")]
    pub fn judge(&mut self, commanded: Torque) -> Motor {
        let place = &mut self.commanded[self.oldest % COMMANDS];
        let before = core::mem::replace(place, commanded);
        self.oldest = self.oldest.wrapping_add(1);
        let (low, high) = (commanded.min(before), commanded.max(before));
        // An end moves outward at once, and back with a lag.
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
            // The usual case first: inside the band even without any error.
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

/// Moves an end of the band back towards the command for one step of 1 ms, by 3/64 of the distance: a lag of 21 ms.
/// The result is rounded so that it never passes the command.
fn lagging(end: Torque, command: Torque) -> Torque {
    const SHARE: I0F32 = I0F32::from_bits(3 << (32 - 6));
    // Nothing wraps: a frame has room for commands of 5 N.m, and the ends lie between commands.
    let way = command.fixed().wrapping_sub(end.fixed());
    let back = I8F24::wrapping_from_num(way.wide_mul(SHARE));
    Torque::from_fixed(end.fixed().wrapping_add(back))
}
