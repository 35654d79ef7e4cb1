//! A step with another law in the place of (9), for simulators that compare laws. Everything after the law is the product's: the
//! probe, the envelope, the mode machine, the monitor ([`crate::safety::monitor::Monitor::with_another_law`]).
//!
//! Only with the feature `another-law`, which no product image has. Not here: faults that are injected (`injection`), and any law.

use super::{Ecu, Step};
use crate::controller::injection::Injection;
use crate::quantity::{Instant, Torque};

/// The torque that another law demands.
struct Asked(Torque);

impl Injection for Asked {
    fn law(&self, _: Torque) -> Torque {
        self.0
    }

    fn monitor_passes(&self, _: &[u8; 8]) -> bool {
        false
    }

    fn lane_never_ages(&self) -> bool {
        false
    }
}

impl Ecu {
    /// [`Ecu::step`], where `asked` is what the law asks for.
    #[inline(never)]
    pub fn step_with_law(&mut self, now: Instant, asked: Torque) -> Step {
        self.step_with(now, &Asked(asked))
    }
}
