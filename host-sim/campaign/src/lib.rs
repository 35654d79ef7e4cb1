//! The fault campaign: every fault that the ECU must survive, injected by name into the closed loop.
//!
//! A *row* is one fault of the table with its class, deadline and torque bound. A *trial* is one run of a row with
//! one seed. Faults are injected between the world and the ECU, in a sensor's value, on the bus, in the clock, in
//! memory, in the motor; whatever reaches the ECU goes through the shipping receive and step. In every cycle a
//! checker of invariants that shares nothing with the core checks what must always hold.
//!
//! ```text
//! world -> senders -> bus -> Ecu -> motor -> world        checker: frames in and out, every cycle
//!            ^         ^      ^       ^                   residual: since when the fault can be seen
//!            +--- one injection ------+                   verdict: class, deadline, torque bound
//! ```
//!
//! ```
//! use haptic_campaign::{World, table};
//!
//! let frozen = table::rows().find(|row| row.name == "lateral-error-frozen").unwrap();
//! let outcome = World::new(None).run(frozen, 6);
//! let said: Vec<_> = outcome.reported.iter().map(|event| event.what.as_str()).collect();
//! assert_eq!(said[..2], ["The ECU reports LaneImplausible", "The ECU goes to Handover"]);
//! ```
//!
//! What is marked Q runs in QEMU as well, with the image in the place of the ECU (`target`).
//!
//! Not here: faults that only an image has (watchdog, stack, processor fault). They are in the table, and in
//! `tests/resets.rs`.

mod bytes;
pub mod campaign;
mod deviation;
pub mod document;
pub mod drivers;
mod ecu_harness;
mod injection;
mod invariants;
mod residual;
mod roads;
mod senders;
mod speed_change;
mod start_up;
pub mod table;
pub mod target;
mod trial;
mod trial_record;
mod verdict;
mod wire;

pub use deviation::Deviation;
pub use drivers::OFF_ROAD_M;
pub use invariants::Violation;
pub use residual::Detectability;
pub use speed_change::SpeedChange;
pub use trial::{TrialOutcome, World};
