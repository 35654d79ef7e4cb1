//! The seam between the images and a board: one trait, one file per board, no default board.
//!
//! A board is chosen by the feature of its name. A new board is a new file here, a feature, and a memory map.

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use embedded_can::nb::Can;
use embedded_hal::digital::OutputPin;
use embedded_storage::nor_flash::NorFlash;
use haptic_core::bus::Frame;
use haptic_core::bus::messages::Column;
use haptic_core::quantity::{Instant, Micros, Torque};

use crate::reset;

#[cfg(any(feature = "mps2-an386", feature = "mps2-an500"))]
mod mps2;
#[cfg(any(feature = "mps2-an386", feature = "mps2-an500"))]
pub use mps2::Mps2 as ThisBoard;

#[cfg(feature = "nucleo-g474re")]
mod nucleo_g474re;
#[cfg(feature = "nucleo-g474re")]
pub use nucleo_g474re::NucleoG474re as ThisBoard;

#[cfg(feature = "sam-e54-xpro")]
mod sam_e54_xpro;
#[cfg(feature = "sam-e54-xpro")]
pub use sam_e54_xpro::SamE54Xpro as ThisBoard;

#[cfg(not(any(
    feature = "mps2-an386",
    feature = "mps2-an500",
    feature = "nucleo-g474re",
    feature = "sam-e54-xpro"
)))]
compile_error!(
    "no board is chosen: build haptic-firmware with --features mps2-an386, mps2-an500, nucleo-g474re or sam-e54-xpro"
);

/// The watchdog resets the processor when it was not fed for so long. Feeding is a millisecond apart; what
/// becomes of the torque meanwhile is in `docs/explanation/monitor-and-memory.md`, board by board.
pub const WATCHDOG: Micros = Micros::from_ms(16);

/// What the images need of a board.
pub trait Board: Sized {
    /// The bus controller.
    type Can: Can<Frame = Frame>;
    /// A light that is on while guidance acts.
    type Status: OutputPin;
    /// The flash whose last nine pages hold codes of faults ([`crate::codes`]), starts and keys ([`crate::keys`]) and
    /// parameters ([`crate::storage`]).
    type Flash: NorFlash;

    /// The feature that chooses the board.
    const NAME: &'static str;

    /// Whether the column's sensors are wired to the board. Its frames on the bus are then ignored.
    const HAS_COLUMN: bool = false;

    /// Takes the hardware, masks interrupts, starts the clocks and guards the stack ([`crate::stack`]). The torque
    /// is zero. To be called once, first.
    fn start() -> Self;

    /// The bus.
    fn can(&mut self) -> &mut Self::Can;

    /// The status light.
    fn status(&mut self) -> &mut Self::Status;

    /// Whether the chip's options are those that the memory map and the parameters' pages were laid out for. With
    /// others nothing is read from the flash or written to it, and the controller locks.
    fn has_expected_options(&self) -> bool {
        true
    }

    /// This processor's own number: a CRC-32 of what its maker wrote into it. Parameters that another one stored are not
    /// taken ([`crate::storage`]).
    fn hardware() -> u32;

    /// The flash. Only read and erased before the tick starts: while it erases, some boards' processors stand still. A few
    /// words may be programmed between two ticks without torque, in less than a millisecond.
    fn flash(&mut self) -> &mut Self::Flash;

    /// The free-running microsecond clock, which wraps after 2^32 us.
    fn now() -> Instant;

    /// A free-running counter of core clock cycles, for measurements.
    fn cycles() -> u32;

    /// Why the hardware started, and forgets it.
    fn reset_source(&mut self) -> reset::Hardware;

    /// Starts the 1 kHz tick.
    fn start_tick(&mut self);

    /// Whether a tick has passed since the last call.
    fn tick(&mut self) -> bool;

    /// Sleeps until a tick, or until the bus has something to do. May return early.
    fn sleep(&mut self);

    /// Starts the watchdog, which nothing but a reset stops ([`WATCHDOG`]).
    fn start_watchdog(&mut self);

    /// Feeds the watchdog. Only a step that the monitor permits may.
    fn feed_watchdog(&mut self);

    /// Sets the motor stage that is wired to the board; `None` switches it off. Without one, the actuator on the bus
    /// obeys the frames.
    fn set_torque(&mut self, _torque: Option<Torque>) {}

    /// Reads the column's sensors that are wired to the board; `None` when they disagree ([`Board::HAS_COLUMN`]).
    fn column(&mut self) -> Option<Column> {
        None
    }

    /// Whether the client at the other end of the bus has hung up. On a real bus nobody can.
    fn is_hung_up(&self) -> bool {
        false
    }

    /// Brings the torque to zero from any state, without the [`Board`]: what a panic or a fault calls.
    fn zero_torque();

    /// Writes bytes of the log; waits for the log port.
    fn log(bytes: &[u8]);
}

/// SysTick at 1 kHz, from the core's clock.
fn start_systick(systick: &mut SYST, core_clock_hz: u32) {
    systick.set_clock_source(SystClkSource::Core);
    systick.set_reload(core_clock_hz / 1000 - 1);
    systick.clear_current();
    systick.enable_interrupt();
    systick.enable_counter();
}

/// Bytes of the log for the debug probe (RTT).
#[cfg(any(feature = "nucleo-g474re", feature = "sam-e54-xpro"))]
fn log_to_probe(bytes: &[u8]) {
    // SAFETY: one core, and nothing else has the channel.
    if let Some(mut channel) = unsafe { rtt_target::UpChannel::conjure(0) } {
        channel.write(bytes);
    }
}
