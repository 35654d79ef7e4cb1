//! Records of drives: what a run leaves behind.
//!
//! A [`trace::Trace`] is a table of evenly spaced [`trace::Sample`]s, one channel a field, with the unit in its name. It is the
//! truth of the simulated world, not what a sensor saw. An [`Event`] says in words what happened when.
//!
//! Records are written in and read from tables ([`table`], CSV) and the bus ([`candump`]). With the feature `formats` a
//! [`recording::Recording`] is read and written in the formats of other tools (`formats`).
//!
//! This crate knows nothing of ours, so that what reads records (metrics, identification, reports) needs no simulator.
//!
//! ```
//! use haptic_log::trace::{Sample, Trace};
//!
//! let sample = |k: u32| Sample {
//!     time_s: f64::from(k) / 200.0,
//!     lateral_error_m: 0.1,
//!     ..Sample::default()
//! };
//! let trace = Trace {
//!     sample_rate_hz: 200.0,
//!     samples: (0..400).map(sample).collect(),
//! };
//! assert_eq!(trace.samples.last().unwrap().time_s, 1.995);
//! ```
//!
//! Not here: what a record means (`haptic-analysis`), and how it is drawn (`haptic-report`).

pub mod bus;
pub mod candump;
mod event;
#[cfg(feature = "formats")]
pub mod formats;
#[cfg(feature = "parquet")]
pub mod guard;
pub mod near;
pub mod notes;
pub mod recording;
pub mod table;
pub mod trace;
pub mod units;

pub use event::Event;
