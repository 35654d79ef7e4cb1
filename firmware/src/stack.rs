//! The stack: its budget, the MPU guard below it, and how much of it was ever used.
//!
//! `stack.x` places the budget at the end of RAM and the guard below. The guard is a region of the memory
//! protection unit that nothing may touch: a stack that outgrows its budget faults at once instead of
//! overwriting data, and the fault's handler tells the cause by the address. A single frame larger than the
//! guard could step over it: `cargo xtask boards` looks for such.
//!
//! Not here: what follows a fault (`reset`).

use cortex_m::peripheral::{MPU, SCB};

/// Length of the guard, a power of two, as in `stack.x`. More than the largest frame, 4.3 KB, which is a whole ECU on its way to its place.
const GUARD: u32 = 8192;

/// What untouched stack holds.
const PAINT: u32 = 0x5AFE_57AC;

/// The control bits: the unit is on, what has no region is as without the unit. Handlers of faults run
/// without protection, so that they have a stack.
const ENABLE: u32 = 1;
const DEFAULT_MAP: u32 = 1 << 2;
/// The base address carries its region's number.
const VALID: u32 = 1 << 4;
/// No instruction is fetched from the region; the access bits, zero, forbid data too.
const NEVER_EXECUTE: u32 = 1 << 28;

/// Bits of the fault status: a data access was forbidden, an exception's frame found no place, the address is
/// known.
const FORBIDDEN: u32 = 1 << 1;
const NO_PLACE: u32 = 1 << 4;
const ADDRESS_VALID: u32 = 1 << 7;

unsafe extern "C" {
    static mut _stack_start: u32;
    static mut _stack_end: u32;
    static _stack_guard: u32;
}

fn guard() -> u32 {
    // Only its address is used.
    (&raw const _stack_guard) as u32
}

/// Forbids the guard.
pub fn protect(mpu: &mut MPU) {
    let size = GUARD.trailing_zeros() - 1;
    // SAFETY: nothing lies in the guard (`stack.x`), so nothing loses access.
    unsafe {
        mpu.rbar.write(guard() | VALID);
        mpu.rasr.write(NEVER_EXECUTE | size << 1 | ENABLE);
        mpu.ctrl.write(DEFAULT_MAP | ENABLE);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

/// Paints what lies below the caller's frame, so that [`used`] can tell.
#[inline(never)]
pub fn paint() {
    let end = cortex_m::register::msp::read();
    let mut word = &raw mut _stack_end;
    // Below this frame by more than the loop needs.
    while (word as u32) < end - 64 {
        // SAFETY: between the guard and the stack pointer nothing is alive.
        unsafe {
            word.write_volatile(PAINT);
            word = word.add(1);
        }
    }
}

/// Bytes of the stack that were ever used since [`paint`].
pub fn used() -> u32 {
    let start = (&raw const _stack_start) as u32;
    let mut word = &raw const _stack_end;
    // SAFETY: reads words of the stack's own memory.
    while (word as u32) < start && unsafe { word.read_volatile() } == PAINT {
        word = word.wrapping_add(1);
    }
    start - word as u32
}

/// Bytes of the stack.
pub fn budget() -> u32 {
    (&raw const _stack_start) as u32 - (&raw const _stack_end) as u32
}

/// Whether the fault under way is the stack's: for a handler of faults.
pub fn overflowed() -> bool {
    // SAFETY: reads of two registers without side effect.
    let (status, address) = unsafe { ((*SCB::PTR).cfsr.read(), (*SCB::PTR).mmfar.read()) };
    let in_guard = status & FORBIDDEN != 0
        && status & ADDRESS_VALID != 0
        && (guard()..guard() + GUARD).contains(&address);
    in_guard || status & NO_PLACE != 0
}
