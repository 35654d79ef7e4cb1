//! Seals an image: writes the CRC-32 of its code and constants into the ELF, where the image looks for it at every
//! start (`firmware/src/image.rs` says what is covered, and what follows).

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use crc::{CRC_32_ISO_HDLC, Crc};
use object::{Object, ObjectSection, ObjectSymbol};

/// `IMAGE_SEAL` before and after, and its bytes.
const UNSEALED: u32 = 0x0FF0_5EA1;
const SEALED: u32 = 0x5EA1_E0D5;
const LEN: usize = 8;
/// A byte of flash that nobody wrote.
const ERASED: u8 = 0xFF;

/// Seals the ELF in place and returns the CRC.
pub(crate) fn seal(elf: &Path) -> Result<u32> {
    let mut bytes = fs::read(elf).with_context(|| elf.display().to_string())?;
    let crc = seal_bytes(&mut bytes).with_context(|| elf.display().to_string())?;
    fs::write(elf, bytes).with_context(|| elf.display().to_string())?;
    Ok(crc)
}

fn seal_bytes(bytes: &mut [u8]) -> Result<u32> {
    let file = object::File::parse(&*bytes).context("no ELF file")?;
    let symbol = file.symbol_by_name("IMAGE_SEAL");
    let at = symbol
        .context("there is no place for a seal: only steering-ecu has one")?
        .address();
    let mut digest_of = Vec::new();
    let mut place = None;
    let mut end = None;
    for name in [".vector_table", ".text", ".rodata", ".data"] {
        let section = file
            .section_by_name(name)
            .with_context(|| format!("no section {name}"))?;
        let mut data = section.data()?.to_vec();
        if name == ".text" {
            // The image takes table and code in one piece. What the linker leaves between them to align the code is in no
            // file; a flasher erases it and leaves it so.
            let before: u64 = end.context("no table before the code")?;
            let gap = section.address().checked_sub(before);
            let gap = gap.filter(|gap| *gap < section.align()).with_context(|| {
                format!(
                    "a gap between {before:#x} and {:#x} that no alignment makes",
                    section.address()
                )
            })?;
            digest_of.push(vec![ERASED; gap as usize]);
        }
        end = Some(section.address() + data.len() as u64);
        let within = at.checked_sub(section.address()).map(|offset| offset as usize);
        if name == ".rodata" {
            let offset = within
                .filter(|offset| offset + LEN <= data.len())
                .context("the seal is not among the constants")?;
            let (start, _) = section.file_range().context("constants without bytes")?;
            place = Some(start as usize + offset);
            data.drain(offset..offset + LEN);
        }
        digest_of.push(data);
    }
    let place = place.context("no constants")?;
    let words = [0, 4].map(|i| u32::from_le_bytes(std::array::from_fn(|k| bytes[place + i + k])));
    ensure!(
        words[0] == UNSEALED || words[0] == SEALED,
        "what lies at the seal's place is none: {words:#x?}"
    );
    let crc = Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(&digest_of.concat());
    bytes[place..place + 4].copy_from_slice(&SEALED.to_le_bytes());
    bytes[place + 4..place + LEN].copy_from_slice(&crc.to_le_bytes());
    Ok(crc)
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use object::{Object, ObjectSection};

    use super::{SEALED, seal_bytes};

    /// A program of GNU's tools for ARM, none of ours: its sections laid out as cortex-m-rt has them.
    fn peer() -> Vec<u8> {
        let place = std::env::temp_dir().join(format!("haptic-seal-{}", std::process::id()));
        std::fs::create_dir_all(&place).unwrap();
        let [source, script, elf] = ["a.s", "a.x", "a.elf"].map(|name| place.join(name));
        let program = "
            .section .vector_table, \"a\"
            .word 0x20010000, 0x9
            .text
            .word 0x12345678
            .section .rodata
            .ascii \"1234\"
            .global IMAGE_SEAL
            IMAGE_SEAL: .word 0x0FF05EA1, 0
            .ascii \"5678\"
            .data
            .word 0x9ABCDEF0
        ";
        std::fs::write(&source, program).unwrap();
        std::fs::write(
            &script,
            "SECTIONS { .vector_table 0 : { *(.vector_table) } .text : { *(.text) } .rodata : { *(.rodata) }
             .data 0x20000000 : AT(0x1000) { *(.data) } /DISCARD/ : { *(*) } }",
        )
        .unwrap();
        let status = Command::new("arm-none-eabi-gcc")
            .args(["-mcpu=cortex-m4", "-nostdlib", "-Wl,--build-id=none", "-T"])
            .args([&script, &source])
            .arg("-o")
            .arg(&elf)
            .status()
            .expect("arm-none-eabi-gcc is missing: apt-get install gcc-arm-none-eabi");
        assert!(status.success());
        let bytes = std::fs::read(&elf).unwrap();
        std::fs::remove_dir_all(&place).unwrap();
        bytes
    }

    /// The CRC by zlib's definition, bit by bit.
    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(u32::MAX, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
                (crc >> 1) ^ if crc & 1 == 1 { 0xEDB8_8320 } else { 0 }
            })
        })
    }

    #[test]
    fn the_seal_is_the_crc_of_all_but_itself_and_may_be_renewed() {
        let mut elf = peer();
        let words: [u32; 3] = [0x2001_0000, 0x9, 0x1234_5678];
        let mut image: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        image.extend(b"12345678");
        image.extend(0x9ABC_DEF0_u32.to_le_bytes());
        let crc = seal_bytes(&mut elf).unwrap();
        assert_eq!(crc, crc32(&image));
        let file = object::File::parse(&*elf).unwrap();
        let constants = file.section_by_name(".rodata").unwrap().data().unwrap();
        let expected = [
            b"1234".as_slice(),
            &SEALED.to_le_bytes(),
            &crc.to_le_bytes(),
            b"5678",
        ]
        .concat();
        assert_eq!(constants, expected);
        let before = elf.clone();
        assert_eq!(seal_bytes(&mut elf).unwrap(), crc);
        assert_eq!(elf, before);
    }
}
