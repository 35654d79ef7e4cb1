//! The largest stack frame of an image: one that is larger than the guard below the stack could step over it.

use std::path::Path;

use anyhow::{Context, Result, ensure};

use crate::tool;

/// Length of the guard (`firmware/src/stack.rs`).
const GUARD: u64 = 4096;

/// The largest frame of an ELF, bytes.
pub(crate) fn largest(elf: &Path) -> Result<u64> {
    let text = tool::output(
        tool::llvm("llvm-objdump")?
            .args(["-d", "--no-show-raw-insn"])
            .arg(elf),
    )?;
    let largest = text.lines().filter_map(frame).max();
    let bytes = largest.with_context(|| format!("{} has no frames", elf.display()))?;
    ensure!(
        bytes <= GUARD,
        "{}: a frame of {bytes} B could step over the guard of {GUARD} B below the stack",
        elf.display()
    );
    Ok(bytes)
}

/// The bytes that an instruction takes from the stack pointer: `sub.w sp, sp, #0x200` or `sub sp, #8`.
fn frame(line: &str) -> Option<u64> {
    let (_, instruction) = line.split_once('\t')?;
    let (_, operands) = instruction.strip_prefix("sub")?.split_once('\t')?;
    let amount = operands.trim().strip_prefix("sp, ")?;
    let amount = amount.strip_prefix("sp, ").unwrap_or(amount).strip_prefix('#')?;
    match amount.strip_prefix("0x") {
        Some(hex) => u64::from_str_radix(hex, 16).ok(),
        None => amount.parse().ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::frame;

    /// Lines as llvm-objdump prints them.
    #[test]
    fn what_is_taken_from_the_stack_pointer_is_read() {
        assert_eq!(frame("    1234:     \tsub.w\tsp, sp, #0xa28"), Some(2600));
        assert_eq!(frame("    1234:     \tsubw\tsp, sp, #0x43c"), Some(1084));
        assert_eq!(frame("    1234:     \tsub\tsp, #0x8"), Some(8));
        assert_eq!(frame("    1234:     \tsub\tsp, #64"), Some(64));
        assert_eq!(frame("    1234:     \tsubs\tr0, r1, #0x8"), None);
        assert_eq!(frame("    1234:     \tadd\tsp, #0x8"), None);
    }
}
