//! Flash and RAM of the images, from the sections of their ELF files.
//!
//! Flash: vectors, code, constants and the initial values of variables. RAM: variables; the stack, which grows
//! down from the end of the RAM, is not in it.

use std::path::Path;

use anyhow::{Context, Result, ensure};

use crate::tool;

/// Bytes of an image.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Size {
    pub(crate) flash: u64,
    pub(crate) ram: u64,
}

/// The size of an ELF.
pub(crate) fn read(elf: &Path) -> Result<Size> {
    let text = tool::output(tool::llvm("llvm-size")?.arg("-A").arg(elf))?;
    let mut size = Size { flash: 0, ram: 0 };
    for line in text.lines() {
        let mut words = line.split_whitespace();
        let (Some(section), Some(bytes)) = (words.next(), words.next()) else {
            continue;
        };
        let bytes = || {
            bytes
                .parse::<u64>()
                .with_context(|| format!("llvm-size says: {line}"))
        };
        match section {
            ".vector_table" | ".text" | ".rodata" => size.flash += bytes()?,
            ".data" => {
                size.flash += bytes()?;
                size.ram += bytes()?;
            }
            ".bss" | ".uninit" => size.ram += bytes()?,
            _ => {}
        }
    }
    ensure!(size.flash > 0, "{} has no code", elf.display());
    Ok(size)
}
