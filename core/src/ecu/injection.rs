//! Faults from inside, for campaigns and tests: bits of the vital memory, a law that lies, a monitor that
//! agrees when it should not, a lane preview that never ages. Faults on the bus need nothing of this: they are injected as bytes.
//!
//! Only with the feature `fault-injection`, which no product image has. With nothing injected an ECU of such
//! a build behaves as any other, bit for bit.

use super::Ecu;
use crate::quantity::Torque;
use crate::vital::{Guarded, Vital};

/// Faults held until they are taken back.
#[derive(Debug, Clone, Copy)]
pub(super) struct Injected {
    pub(super) monitor_passes: fn(&[u8; 8]) -> bool,
    pub(super) lane_never_ages: bool,
}

impl Default for Injected {
    fn default() -> Self {
        Self {
            monitor_passes: |_| false,
            lane_never_ages: false,
        }
    }
}

/// Where a bit of the vital memory lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Region {
    /// Gains, limits and margins.
    Config,
    /// What the controller remembers: mode, law, envelope, plausibility, ramp.
    Controller,
    /// Inputs, the torque applied, faults, and what the monitor remembers.
    Ecu,
    /// The monitor's limits.
    Monitor,
}

impl Region {
    /// Every region.
    pub const ALL: [Self; 4] = [Self::Config, Self::Controller, Self::Ecu, Self::Monitor];
}

impl Ecu {
    /// Number of bits in a region, both copies counted.
    #[must_use]
    pub fn vital_bits(&self, region: Region) -> usize {
        // A bit that does not exist flips nothing and counts them all.
        self.clone().flip(region, usize::MAX)
    }

    /// Flips one bit, 0 to [`Ecu::vital_bits`] exclusive, of one of the copies; others are ignored.
    pub fn flip_bit(&mut self, region: Region, bit: usize) {
        self.flip(region, bit);
    }

    /// Replaces the torque that the law asks for, until `None`.
    pub fn force_law(&mut self, torque: Option<Torque>) {
        self.state.forced_law = torque;
    }

    /// Makes the monitor agree with every guidance frame whose bytes are in `passes`, whatever it knows.
    pub fn blind_monitor(&mut self, passes: fn(&[u8; 8]) -> bool) {
        self.injected.monitor_passes = passes;
    }

    /// Makes the last lane preview look fresh for ever.
    pub fn keep_lane_fresh(&mut self) {
        self.injected.lane_never_ages = true;
    }

    fn flip(&mut self, region: Region, bit: usize) -> usize {
        let mut words = 0;
        match region {
            Region::Config => flip(&mut self.controller.config, bit, &mut words),
            Region::Controller => flip(&mut self.state.vitals, bit, &mut words),
            Region::Ecu => {
                flip(&mut self.receivers.lane, bit, &mut words);
                flip(&mut self.receivers.column, bit, &mut words);
                flip(&mut self.receivers.speeds, bit, &mut words);
                flip(&mut self.receivers.request, bit, &mut words);
                flip(&mut self.vitals, bit, &mut words);
            }
            Region::Monitor => flip(&mut self.monitor, bit, &mut words),
        }
        words.saturating_mul(32)
    }
}

/// Flips a bit of a region if it lies here, `words` words into it, and counts the words.
fn flip<T: Vital>(guarded: &mut Guarded<T>, bit: usize, words: &mut usize) {
    guarded.change_copies(&mut |word| {
        let mask = if bit / 32 == *words {
            1_u32.wrapping_shl(bit as u32)
        } else {
            0
        };
        *words = words.saturating_add(1);
        word ^ mask
    });
}
