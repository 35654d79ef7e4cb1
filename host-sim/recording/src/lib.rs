//! A recorded drive, as it is read and checked before anything is made of it.
//!
//! A log is a CSV file (`log`), a recording of the bus (`bus_trace`) or a file of another tool (`recording`), whose columns a
//! [`Layout`] names. All three become a [`DriveLog`]: on an even grid, in SI units, what is missing no number.

mod bus_trace;
mod log;
mod recording;

pub use bus_trace::{HAPTIC_DBC, Recording, SingleTrack};
pub use log::{COLUMNS, DriveLog, LogError, SPEED_COLUMN, SWITCH_RATE_NM_S, median, refuse};
pub use recording::{Layout, Mapping, Signals, Table, of_bytes, of_table, open};
