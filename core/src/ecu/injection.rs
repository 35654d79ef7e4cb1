//! Faults from inside, for campaigns and tests: bits of the redundant memory, a law that lies, a monitor that agrees
//! when it should not, a lane preview that never ages. Faults on the bus need nothing of this: they are injected as
//! bytes.
//!
//! Only with the feature `fault-injection`, which no product image has. The product's type, [`Ecu`], is the same with
//! and without it; an [`InjectedEcu`] is another type around it. With nothing injected it behaves as any other, bit
//! for bit.

use core::ops::{Deref, DerefMut};

use super::{Ecu, Step};
use crate::controller::injection::Injection;
use crate::observer::Sensor;
use crate::quantity::{Instant, Torque};
use crate::safety::redundant::{Redundant, Words};

/// An ECU that can be made to lie. Everything but its step is the product's own.
#[derive(Debug, Clone)]
pub struct InjectedEcu {
    ecu: Ecu,
    injected: Injected,
}

/// Faults held until they are taken back.
#[derive(Debug, Clone, Copy)]
struct Injected {
    law: Option<Torque>,
    monitor_passes: fn(&[u8; 8]) -> bool,
    lane_never_ages: bool,
}

impl Injection for Injected {
    fn law(&self, asked: Torque) -> Torque {
        self.law.unwrap_or(asked)
    }

    fn monitor_passes(&self, guidance: &[u8; 8]) -> bool {
        (self.monitor_passes)(guidance)
    }

    fn lane_never_ages(&self) -> bool {
        self.lane_never_ages
    }
}

impl InjectedEcu {
    /// Nothing injected.
    #[must_use]
    pub fn new(ecu: Ecu) -> Self {
        let injected = Injected {
            law: None,
            monitor_passes: |_| false,
            lane_never_ages: false,
        };
        Self { ecu, injected }
    }

    /// [`Ecu::step`], with what was injected.
    pub fn step(&mut self, now: Instant) -> Step {
        self.ecu.step_with(now, &self.injected)
    }

    /// Replaces the torque that the law asks for, until `None`.
    pub fn force_law(&mut self, torque: Option<Torque>) {
        self.injected.law = torque;
    }

    /// Makes the monitor agree with every guidance frame whose bytes are in `passes`, whatever it knows.
    pub fn blind_monitor(&mut self, passes: fn(&[u8; 8]) -> bool) {
        self.injected.monitor_passes = passes;
    }

    /// Makes the last lane preview look fresh for ever.
    pub fn keep_lane_fresh(&mut self) {
        self.injected.lane_never_ages = true;
    }
}

impl Deref for InjectedEcu {
    type Target = Ecu;

    fn deref(&self) -> &Ecu {
        &self.ecu
    }
}

impl DerefMut for InjectedEcu {
    fn deref_mut(&mut self) -> &mut Ecu {
        &mut self.ecu
    }
}

/// Where a bit of the redundant memory lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Region {
    /// Gains, limits and margins.
    Config,
    /// What the controller remembers: mode, law, envelope, plausibility, ramp, and with a bar the hands.
    Controller,
    /// Inputs, the torque applied, faults, and what the monitor remembers.
    Ecu,
    /// The monitor's limits.
    Monitor,
}

impl Region {
    /// Every region that each step compares.
    pub const ALL: [Self; 4] = [Self::Config, Self::Controller, Self::Ecu, Self::Monitor];
}

impl Ecu {
    /// Number of bits in a region, both copies counted.
    #[must_use]
    pub fn redundant_bits(&self, region: Region) -> usize {
        // A bit that does not exist flips nothing and counts them all.
        self.clone().flip(region, usize::MAX)
    }

    /// Flips one bit, 0 to [`Ecu::redundant_bits`] exclusive, of one of the copies; others are ignored.
    pub fn flip_bit(&mut self, region: Region, bit: usize) {
        self.flip(region, bit);
    }

    fn flip(&mut self, region: Region, bit: usize) -> usize {
        let mut words = 0;
        match region {
            Region::Config => flip(&mut self.controller.config, bit, &mut words),
            Region::Controller => {
                flip(&mut self.state.memory, bit, &mut words);
                if let Some(Sensor::Bar(_)) = self.controller.config.value().sensor() {
                    flip(&mut self.state.observer, bit, &mut words);
                }
            }
            Region::Ecu => {
                flip(&mut self.receivers.lane, bit, &mut words);
                flip(&mut self.receivers.column, bit, &mut words);
                flip(&mut self.receivers.motion, bit, &mut words);
                flip(&mut self.receivers.request, bit, &mut words);
                flip(&mut self.memory, bit, &mut words);
            }
            Region::Monitor => flip(&mut self.monitor, bit, &mut words),
        }
        words.saturating_mul(32)
    }
}

/// Flips a bit of a region if it lies here, `words` words into it, and counts the words.
#[expect(
    clippy::as_conversions,
    reason = "only the place within a word counts, modulo 32"
)]
fn flip<T: Words>(guarded: &mut Redundant<T>, bit: usize, words: &mut usize) {
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
