//! Where a fault campaign reaches into a step, and the product's answer: nowhere.
//!
//! The steps of the ECU and of the controller are written once, over an [`Injection`]. The product's `Ecu` runs them
//! with [`NoInjection`], whose answers are constants: no field, no check and no branch of it is left in the machine
//! code, whatever features Cargo switches on for the build. `cargo xtask gate` compares the two images. Only
//! `crate::ecu::injection::InjectedEcu`, with the feature `fault-injection`, and a simulator's
//! `crate::ecu::Ecu::step_with_law`, with the feature `another-law`, run them with anything else.

use crate::quantity::Torque;

/// What can be made wrong inside a step.
pub(crate) trait Injection {
    /// The torque that the law is taken to ask for.
    fn law(&self, asked: Torque) -> Torque;
    /// Whether the monitor agrees with a guidance frame whatever it knows.
    fn monitor_passes(&self, guidance: &[u8; 8]) -> bool;
    /// Whether the last lane preview passes for one that came now.
    fn lane_never_ages(&self) -> bool;
}

/// Nothing is made wrong: the product.
pub(crate) struct NoInjection;

impl Injection for NoInjection {
    #[inline(always)]
    fn law(&self, asked: Torque) -> Torque {
        asked
    }

    #[inline(always)]
    fn monitor_passes(&self, _: &[u8; 8]) -> bool {
        false
    }

    #[inline(always)]
    fn lane_never_ages(&self) -> bool {
        false
    }
}
