//! Whether the image in the flash is the one that was built: a CRC-32 over its code and constants, looked at once, at
//! every start.
//!
//! The linker cannot compute it. `cargo xtask seal` writes it into the ELF afterwards, into `IMAGE_SEAL`, which the
//! sum leaves out; `flash` and `run` seal what they put on a board. An image that nobody sealed is good for the bench
//! only (feature `bench`).
//!
//! Covered: the vector table, the code, the constants and the initial values of the data, in this order. Not here: what
//! follows a wrong sum (`product`), and errors that the flash itself finds (the board's file).

use crc::{CRC_32_ISO_HDLC, Crc};

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// What the seal says of itself, and the CRC.
pub type Seal = [u32; 2];

/// Nobody has sealed the image. `xtask/src/seal.rs` has both numbers too.
pub const UNSEALED: u32 = 0x0FF0_5EA1;
/// The second word is the CRC.
pub const SEALED: u32 = 0x5EA1_E0D5;

/// What came of the look.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// It is as it was built.
    Whole,
    /// Nobody has sealed it.
    Unsealed,
    /// Not as it was built.
    Damaged,
}

impl State {
    /// Whether the controller may run from it.
    pub const fn is_good(self) -> bool {
        match self {
            Self::Whole => true,
            Self::Unsealed => cfg!(feature = "bench"),
            Self::Damaged => false,
        }
    }
}

/// Judges an image of these parts by its seal.
pub fn judge<'a>(seal: Seal, parts: impl Iterator<Item = &'a [u8]>) -> State {
    let mut digest = CRC.digest();
    parts.for_each(|part| digest.update(part));
    match seal {
        [SEALED, crc] if crc == digest.finalize() => State::Whole,
        [UNSEALED, _] => State::Unsealed,
        _ => State::Damaged,
    }
}

/// A processor's number on the bus, from the words that its maker wrote into it.
pub fn number_of(words: &[u32]) -> u32 {
    let mut digest = CRC.digest();
    words.iter().for_each(|word| digest.update(&word.to_le_bytes()));
    digest.finalize()
}

/// Checks the image that runs against its seal.
#[cfg(target_os = "none")]
pub fn check() -> State {
    use core::slice::from_raw_parts;

    /// Written by `cargo xtask seal`.
    #[used]
    #[unsafe(no_mangle)]
    static IMAGE_SEAL: Seal = [UNSEALED, 0];

    unsafe extern "C" {
        static __vector_table: u8;
        static __etext: u8;
        static __srodata: u8;
        static __erodata: u8;
        static __sidata: u8;
        static __sdata: u8;
        static __edata: u8;
    }
    let seal = &raw const IMAGE_SEAL;
    // Only the addresses of the linker's symbols are used.
    let between = |from: *const u8, to: *const u8| {
        // SAFETY: the linker places both, in this order, in flash that nobody writes.
        unsafe { from_raw_parts(from, to as usize - from as usize) }
    };
    let data = (&raw const __edata) as usize - (&raw const __sdata) as usize;
    let parts = [
        between(&raw const __vector_table, &raw const __etext),
        between(&raw const __srodata, seal.cast()),
        between(seal.wrapping_add(1).cast(), &raw const __erodata),
        between(&raw const __sidata, (&raw const __sidata).wrapping_add(data)),
    ];
    // SAFETY: a static. Volatile, because the compiler knows no one who writes it.
    let seal = unsafe { seal.read_volatile() };
    judge(seal, parts.into_iter())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CRC-32 of "123456789", the check value of the catalogue.
    const CHECK: u32 = 0xCBF4_3926;

    fn state(seal: Seal, parts: &[&[u8]]) -> State {
        judge(seal, parts.iter().copied())
    }

    #[test]
    fn a_sealed_image_is_whole_until_a_bit_flips() {
        assert_eq!(state([SEALED, CHECK], &[b"1234", b"", b"56789"]), State::Whole);
        for bit in 0..72 {
            let mut image = *b"123456789";
            image[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(state([SEALED, CHECK], &[&image]), State::Damaged, "bit {bit}");
        }
        // And of the seal: a flipped state is neither.
        for bit in 0..32 {
            let seal = [SEALED ^ 1 << bit, CHECK];
            assert_eq!(state(seal, &[b"123456789"]), State::Damaged, "state bit {bit}");
            let seal = [SEALED, CHECK ^ 1 << bit];
            assert_eq!(state(seal, &[b"123456789"]), State::Damaged, "CRC bit {bit}");
        }
    }

    #[test]
    fn an_image_that_nobody_sealed_says_so_and_is_for_the_bench() {
        assert_eq!(state([UNSEALED, 0], &[b"123456789"]), State::Unsealed);
        assert_eq!(State::Unsealed.is_good(), cfg!(feature = "bench"));
        assert!(State::Whole.is_good() && !State::Damaged.is_good());
    }
}
