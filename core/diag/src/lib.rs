//! What a workshop's tester asks of the ECU: UDS (ISO 14229-1) over ISO-TP (ISO 15765-2) on classic CAN with normal
//! addressing.
//!
//! - [`isotp`]: messages of up to 4,095 bytes in frames of eight.
//! - [`data`]: the one list of what can be read, and under which identifier.
//! - [`trouble`]: which faults there were, with a snapshot of each, in memory that a reset leaves alone.
//! - [`security`]: the challenge that has to be answered before anything is written.
//! - [`server`]: sessions, services, and the routine that hands new parameters to `haptic_core::service::download`.
//!
//! Nothing here takes part in a step. [`server::Server::receive`] keeps a frame; the answer is worked out behind the torque,
//! one request in a step and one frame in a step. New parameters pass the checks of the download as those of any sender do.
//!
//! Not here: the flash, the restart, and the key's place (`haptic-firmware`).

#![no_std]
#![forbid(unsafe_code)]
// As in core: nothing wraps, panics or is cut unseen.
#![cfg_attr(
    not(test),
    deny(
        clippy::arithmetic_side_effects,
        clippy::as_conversions,
        clippy::indexing_slicing,
        clippy::panic,
        clippy::unwrap_used
    )
)]

pub mod data;
pub mod isotp;
pub mod security;
pub mod server;
pub mod trouble;

/// The tester's requests come under this CAN identifier, and flow control for the answers.
pub const REQUEST_ID: u16 = 0x730;
/// The ECU's answers come under this one.
pub const RESPONSE_ID: u16 = 0x738;
