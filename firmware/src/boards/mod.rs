//! The seam between the images and a board: one trait, one file per board, no default board.
//!
//! A board is chosen by the feature of its name. A new board is a new file here, a feature, and a memory map.

use embedded_can::nb::Can;
use embedded_hal::digital::OutputPin;
use haptic_core::bus::Frame;
use haptic_core::quantity::Instant;

#[cfg(feature = "mps2-an386")]
mod mps2_an386;
#[cfg(feature = "mps2-an386")]
pub use mps2_an386::Mps2An386 as ThisBoard;

#[cfg(not(feature = "mps2-an386"))]
compile_error!("no board is chosen: build haptic-firmware with --features mps2-an386");

/// What the images need of a board.
pub trait Board: Sized {
    /// The bus controller.
    type Can: Can<Frame = Frame>;
    /// A light that is on while guidance acts.
    type Status: OutputPin;

    /// The feature that chooses the board.
    const NAME: &'static str;

    /// Takes the hardware, masks interrupts and starts the clocks. To be called once, first.
    fn start() -> Self;

    /// The bus.
    fn can(&mut self) -> &mut Self::Can;

    /// The status light.
    fn status(&mut self) -> &mut Self::Status;

    /// The free-running microsecond clock, which wraps after 2^32 us.
    fn now() -> Instant;

    /// A free-running counter of core clock cycles, for measurements.
    fn cycles() -> u32;

    /// Starts the 1 kHz tick.
    fn start_tick(&mut self);

    /// Whether a tick has passed since the last call.
    fn tick(&mut self) -> bool;

    /// Sleeps until a tick, or until the bus has something to do. May return early.
    fn sleep(&mut self);

    /// Brings the torque to zero from any state, without the [`Board`]: what a panic or a fault calls.
    fn zero_torque();

    /// Writes bytes of the log; waits for the log port.
    fn log(bytes: &[u8]);
}
