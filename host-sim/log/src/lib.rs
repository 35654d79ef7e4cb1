//! Records of drives: the channels of a trace with name, unit and meaning, events, and the formats that records are
//! written in and read from: tables (CSV) and the bus (candump).

pub mod candump;
mod event;
pub mod table;
pub mod trace;

pub use event::Event;
