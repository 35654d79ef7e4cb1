//! Proof that the frames which command the ECU are their sender's and fresh, in the manner of AUTOSAR SecOC, in front of
//! `haptic_core::ecu::Ecu::receive`.
//!
//! - [`fresh`]: a proof and its freshness: MAC, epochs, counts.
//! - [`messages`]: which messages carry one and where, and the messages that belong to it; `authentication.dbc` describes them.
//! - [`verifier`]: the ECU's side. What has no proof does not reach the controller.
//! - [`prover`]: the side of camera and host.
//!
//! The frames themselves stay as `core/haptic.dbc` has them, CRC and counter included, so the controller checks them as it does
//! without a proof: what never comes is a lost input to it.
//!
//! Not here: where keys and the number of starts are kept (`haptic-firmware`). Column is not authenticated: its proofs would fill an eighth
//! of the bus.

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

pub mod fresh;
pub mod messages;
pub mod prover;
pub mod verifier;

use fresh::{Algorithm, Chosen, Key};
use haptic_core::bus::messages::Sender;

/// What the ECU shares with its senders: a key with each, so that no sender can speak for the other.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Keys {
    /// Which MAC they are for.
    pub algorithm: Algorithm,
    /// The camera's.
    pub camera: Key,
    /// The host's.
    pub host: Key,
}

impl Keys {
    /// Keys that everybody knows, for the bench: the example of RFC 4493, section 4, and its bytes from the last to the first.
    #[must_use]
    pub const fn bench(algorithm: Algorithm) -> Self {
        Self {
            algorithm,
            camera: *b"\x3c\x4f\xcf\x09\x88\x15\xf7\xab\xa6\xd2\xae\x28\x16\x15\x7e\x2b",
            host: *b"\x2b\x7e\x15\x16\x28\xae\xd2\xa6\xab\xf7\x15\x88\x09\xcf\x4f\x3c",
        }
    }

    /// Both MACs: the camera's and the host's.
    fn macs(&self) -> [Chosen; 2] {
        [&self.camera, &self.host].map(|key| Chosen::new(self.algorithm, key))
    }
}

/// A sender's MAC of [`Keys::macs`].
const fn mac_of(macs: &[Chosen; 2], sender: Sender) -> &Chosen {
    let [camera, host] = macs;
    if matches!(sender, Sender::Camera) {
        camera
    } else {
        host
    }
}
