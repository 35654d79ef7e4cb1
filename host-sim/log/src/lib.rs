//! Records of drives.

mod event;
pub mod trace;

pub use event::Event;
