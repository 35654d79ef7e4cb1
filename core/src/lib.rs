//! The haptic-guidance steering controller: the only place that decides a torque.
//!
//! A driver and an automation hold one steering wheel. The automation guides with a torque that the driver can always
//! override. A camera sees how far the vehicle is from its lane (e_y') and how it points away from it (e_theta'); the
//! guidance law turns both, and their rates, into a torque. Everything else here makes sure that this torque is never
//! a surprise: it is bounded, it changes slowly, it ends gently when an input fails, and a second computation has to
//! agree with it every millisecond.
//!
//! # The way of a sample
//!
//! The same on a desktop, in QEMU and on a board:
//!
//! ```text
//! frame            bus            length, CRC, counter, range          -> rejected, the last good one stays
//!   -> inputs      ecu            possible step, age                   -> lost after three periods
//!   -> checks      plausibility   can the inputs be true together?     -> Handover
//!   -> mode        modes          Boot, Standby, Active, Fade, Handover, Fault, Locked
//!   -> law (9)     law, probe     what the lane asks for               or ramp: the way to zero
//!   -> envelope    envelope       limits on torque, rates, against the driver
//!   -> frame       bus            Guidance, Warning, FaultRecord
//!   -> permission  monitor        a second, simpler computation, its own decoding
//!   -> motor       actuator       does it deliver what it was told?
//! afterwards       background     K_hg from the probe (estimator), Telemetry
//! ```
//!
//! [`ecu::Ecu`] is that whole way; [`controller::Controller`] is the part between the decoded inputs and the command.
//! The law, the envelope, the mode machine, the bus and the monitor do not know each other: only the controller and
//! the ECU see them all.
//!
//! # An ECU at work
//!
//! ```
//! use haptic_core::bus::messages::{Column, Request, LanePreview, Message, Vehicle};
//! use haptic_core::controller::config::Setup;
//! use haptic_core::ecu::{Boot, Ecu};
//! use haptic_core::safety::modes::Mode;
//! use haptic_core::controller::params::Params;
//! use haptic_core::quantity::{Instant, Metres, Micros, Radians, Ratio, Speed};
//!
//! let setup = Setup::new(&Params::PAPER)?;
//! let mut ecu = Ecu::new(Some(&setup), Boot::default(), Instant::from_us(0));
//! let mut last = None;
//! for ms in 1..=1500_u32 {
//!     let now = Instant::from_us(ms * 1000);
//!     // Half a metre to the right of the line, 72 km/h. Guidance is asked for from 0.8 s on.
//!     let e_y = Metres::from_m(0.5);
//!     let lane = LanePreview { e_y, e_theta: Radians::ZERO, age: Micros::from_us(0), valid: true };
//!     let speeds = [Speed::from_m_per_s(20.0); 2];
//!     let request = Request { engage: ms >= 800, authority: Ratio::ONE, probe: false };
//!     // The motor delivers what the last frame told it.
//!     let motor_torque = last.unwrap_or_default();
//!     let column = Column { motor_torque, ..Column::default() };
//!     let frames = [
//!         (8, lane.encode((ms / 8) as u8)),
//!         (2, column.encode((ms / 2) as u8)),
//!         (10, Vehicle { speeds, yaw_rate: None }.encode((ms / 10) as u8)),
//!         (10, request.encode((ms / 10) as u8)),
//!     ];
//!     for (period, frame) in frames {
//!         if ms % period == 0 {
//!             // Until a sender has shown three clean frames, it is not trusted.
//!             let _ = ecu.receive(&frame, now);
//!         }
//!     }
//!     let step = ecu.step(now);
//!     last = Some(step.command.torque);
//!     assert!(step.permitted);
//!     assert_eq!(step.command.mode == Mode::Active, ms >= 800);
//! }
//! // Equation (9): K_1*a1'*e_y' = 0.25*2*0.5 = 0.25 N.m to the left, to an LSB of the bus.
//! assert!((last.unwrap_or_default().nm() - 0.25).abs() < 1.0 / 4096.0);
//! # Ok::<(), haptic_core::controller::params::ParamError>(())
//! ```
//!
//! # What holds in every line
//!
//! No allocation, no `unsafe`. From `Ecu::receive` and `Ecu::step` no float and no panic is reachable, which is proved
//! on the linked image (`cargo xtask gate`). `Ecu::background_step`, called when the torque is already on its way, may
//! use f32: what it estimates moves nothing. State that must survive a bit flip is kept twice ([`safety::redundant`]). SI
//! values as `f64` exist for parameters, for the host and for tests, and cross into fixed point in [`quantity`] alone.
//!
//! # Where things are listed
//!
//! Parameters in [`controller::params`], faults in [`safety::faults`], messages in [`bus::messages`], modes and what leads
//! from one to another in [`safety::modes`]: each declared once.

#![no_std]
#![forbid(unsafe_code)]
// Nothing wraps, panics or computes in floating point unseen: where one of these is meant, it says why.
#![cfg_attr(
    not(test),
    deny(
        clippy::arithmetic_side_effects,
        clippy::as_conversions,
        clippy::float_arithmetic,
        clippy::indexing_slicing,
        clippy::panic,
        clippy::unwrap_used
    )
)]

pub mod bus;
pub mod controller;
pub mod ecu;
pub mod estimator;
pub mod lane;
pub mod law;
pub mod observer;
pub mod quantity;
pub mod safety;
pub mod service;
