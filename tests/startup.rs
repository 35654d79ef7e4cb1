//! What a product makes of what it finds at its start: without parameters it locks until a set comes over the bus; an
//! image that is not as it was built, or that nobody sealed, begins in Fault.
//!
//! The frames are taken apart by hand, from `core/haptic.dbc`.

use std::path::PathBuf;
use std::process::Command;

use crate::machine::{Machine, image};

const BOARD: &str = "mps2-an386";
/// Values of `Guidance_Mode`.
const FAULT: u64 = 5;
const LOCKED: u64 = 6;
/// Bits of the faults in the torque frame.
const MEMORY: u32 = 47;
const PARAMETERS: u32 = 50;
/// The seal's first word (`firmware/src/image.rs`).
const SEALED: u32 = 0x5EA1_E0D5;

/// The product as it leaves the house, and its seal: the state and the CRC.
fn sealed() -> (PathBuf, [u8; 8]) {
    let elf = image(BOARD, "product");
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(["xtask", "seal"])
        .arg(&elf)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    // "sealed with 0x1234abcd"
    let crc = said
        .trim()
        .rsplit_once("0x")
        .map(|(_, hex)| u32::from_str_radix(hex, 16));
    let crc = crc
        .unwrap_or_else(|| panic!("cargo xtask seal says: {said}"))
        .unwrap();
    let mut seal = [0; 8];
    seal[..4].copy_from_slice(&SEALED.to_le_bytes());
    seal[4..].copy_from_slice(&crc.to_le_bytes());
    (elf, seal)
}

/// Mode and torque frame of a start, the same for a second.
fn comes_up(elf: &std::path::Path) -> (u64, u64) {
    let mut machine = Machine::run(BOARD, elf, "none");
    let mut seen = None;
    let mut frames = 0;
    while frames < 1000 {
        let (0x0C0, word) = machine.frame() else { continue };
        let mode = (word >> 32) & 0xF;
        assert_eq!(*seen.get_or_insert(mode), mode);
        assert_eq!((word >> 12) & 0xFFFF, 0, "torque");
        frames += 1;
        if frames == 1000 {
            return (mode, word);
        }
    }
    unreachable!()
}

#[test]
fn a_product_with_a_blank_flash_locks() {
    let (mode, word) = comes_up(&sealed().0);
    assert_eq!(mode, LOCKED);
    assert_eq!((word >> PARAMETERS & 1, word >> MEMORY & 1), (1, 0));
}

#[test]
fn an_image_that_nobody_sealed_begins_in_fault() {
    let (mode, word) = comes_up(&image(BOARD, "product"));
    assert_eq!((mode, word >> MEMORY & 1), (FAULT, 1));
}

/// The sum is another one: it could as well be a bit of the code.
#[test]
fn an_image_that_is_not_as_it_was_built_begins_in_fault() {
    let (elf, seal) = sealed();
    let mut bytes = std::fs::read(&elf).unwrap();
    let at = bytes.windows(8).position(|window| window == seal).unwrap();
    bytes[at + 4] ^= 0x10;
    std::fs::write(&elf, bytes).unwrap();
    let (mode, word) = comes_up(&elf);
    assert_eq!((mode, word >> MEMORY & 1), (FAULT, 1));
}
