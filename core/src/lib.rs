//! The haptic-guidance steering controller: the only place that decides a torque.
//!
//! A driver and an automation hold one steering wheel; the automation guides with a torque that the
//! driver can always override. The way of a sample, the same on a desktop, in QEMU and on a board:
//!
//! ```text
//! frame -> bus (length, CRC, counter, range) -> inputs with ages -> law (9) -> envelope -> torque frame
//! ```
//!
//! [`ecu::Ecu`] is that whole way; [`controller::Controller`] is the part between the decoded inputs and
//! the command. The law, the envelope and the bus do not know each other: only the controller and the ECU
//! see them all.
//!
//! No allocation, no `unsafe`; and from `Ecu::receive` and `Ecu::step` no float and no panic is reachable,
//! which is proved on the linked image (`cargo xtask gate`). `Ecu::advise`, called when the torque is
//! already on its way, may use f32: what it estimates moves nothing.
//!
//! SI values as `f64` exist for parameters, for
//! the host and for tests, and cross into fixed point in [`quantity`] alone.

#![no_std]
#![forbid(unsafe_code)]

pub mod actuator;
mod background;
pub mod bus;
pub mod config;
pub mod controller;
pub mod download;
pub mod ecu;
pub mod envelope;
pub mod estimator;
pub mod faults;
mod injection;
pub mod law;
pub mod modes;
pub mod monitor;
pub mod params;
pub mod plausibility;
pub mod probe;
pub mod quantity;
pub mod ramp;
pub mod redundant;
pub mod rejections;
mod sine;
pub mod stored;
