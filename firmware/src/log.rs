//! defmt's way out: encoded messages over the board's log port, time-stamped by the board's clock.
//!
//! The port and not semihosting, so that an image runs the same with and without a debugger. `cargo xtask qemu`
//! decodes and prints the messages.

use core::cell::UnsafeCell;

use crate::boards::{Board, ThisBoard};

#[defmt::global_logger]
struct Logger;

struct Shared(UnsafeCell<defmt::Encoder>);

// SAFETY: one core with interrupts masked for good (`Board::start`): messages are written one after the other.
// Only a fault can come between, and its handler never returns to the message it broke off.
unsafe impl Sync for Shared {}

static ENCODER: Shared = Shared(UnsafeCell::new(defmt::Encoder::new()));

// SAFETY: as for `Shared`; each encoder borrow ends with its function.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        // SAFETY: nobody else has the encoder: messages do not come between one another.
        unsafe { &mut *ENCODER.0.get() }.start_frame(ThisBoard::log);
    }

    unsafe fn flush() {}

    unsafe fn release() {
        // SAFETY: as in `acquire`.
        unsafe { &mut *ENCODER.0.get() }.end_frame(ThisBoard::log);
    }

    unsafe fn write(bytes: &[u8]) {
        // SAFETY: as in `acquire`.
        unsafe { &mut *ENCODER.0.get() }.write(bytes, ThisBoard::log);
    }
}

defmt::timestamp!("{=u32:us}", ThisBoard::now().us());
