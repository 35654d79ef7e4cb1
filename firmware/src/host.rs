//! Words from the host that runs QEMU, by semihosting.

use cortex_m_semihosting::debug::{self, EXIT_FAILURE, EXIT_SUCCESS};
use cortex_m_semihosting::nr;

/// What follows QEMU's `-semihosting-config` arguments, joined by blanks; empty if there are none.
pub fn command_line(buffer: &mut [u8]) -> &str {
    let mut block = [buffer.as_mut_ptr() as usize, buffer.len()];
    // SAFETY: SYS_GET_CMDLINE writes at most `buffer.len()` bytes and then their number into the block.
    let failed = unsafe { cortex_m_semihosting::syscall1(nr::GET_CMDLINE, block.as_mut_ptr() as usize) };
    // SAFETY: the host wrote to the block, which the compiler cannot know.
    let [_, len] = unsafe { core::ptr::read_volatile(&block) };
    match buffer.get(..len) {
        Some(text) if failed == 0 => core::str::from_utf8(text).unwrap_or(""),
        _ => "",
    }
}

/// Ends QEMU, with exit code 0 or 1.
pub fn exit(is_well: bool) -> ! {
    loop {
        debug::exit(if is_well { EXIT_SUCCESS } else { EXIT_FAILURE });
    }
}
