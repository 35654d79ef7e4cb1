//! The CAN bus: classic frames at 500 kbit/s, described for every other tool by `core/haptic.dbc`.
//!
//! - [`frame`]: a frame, and `embedded-can`'s view of it.
//! - [`e2e`]: counter and CRC-8 of the safety frames (AUTOSAR E2E profile 2), both ends.
//! - [`messages`]: what each frame means; signal positions, LSBs and ranges as in the DBC file.
//! - [`slcan`]: the same frames as Lawicel ASCII on a serial line.
//!
//! Not here: what to do about a missing or implausible message.

pub mod e2e;
pub mod frame;
pub mod messages;
pub mod slcan;

pub use e2e::Reject;
pub use frame::{CanFrame, FdFrame, Frame};
