//! A NOR flash in memory, for machines without one and for tests, with a supply that can be cut.
//!
//! Like the STM32G4's: pages of 2 KiB, words of eight bytes that are programmed once after an erase. With
//! [`Nor::cut_after`], the supply lasts for so many words and erases; the operation after them is left half done:
//! of a word some bits are programmed, of a page some words are erased and others hold what they like.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};

/// Bytes of a page.
pub const PAGE: usize = 2048;
/// Bytes of a word.
pub const WORD: usize = 8;

/// The model, over some memory.
pub struct Nor<M> {
    memory: M,
    /// Operations until the supply is cut; None: never.
    left: Option<u32>,
}

/// Why an operation failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NorError {
    /// The supply is gone.
    Cut,
    /// A word that is programmed already cannot be programmed.
    NotErased,
    /// Unaligned, or beyond the end.
    Request(NorFlashErrorKind),
}

impl NorFlashError for NorError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Request(kind) => *kind,
            Self::Cut | Self::NotErased => NorFlashErrorKind::Other,
        }
    }
}

impl<M: AsRef<[u8]> + AsMut<[u8]>> Nor<M> {
    /// A flash with what its memory holds.
    pub const fn new(memory: M) -> Self {
        Self { memory, left: None }
    }

    /// The supply lasts for `operations` more words and erases.
    pub fn cut_after(&mut self, operations: u32) {
        self.left = Some(operations);
    }

    /// Whether the supply is gone.
    pub fn is_cut(&self) -> bool {
        self.left == Some(0)
    }

    /// The memory.
    pub fn into_memory(self) -> M {
        self.memory
    }

    /// Counts an operation. The last one before the end is not done in full.
    fn spend(&mut self) -> Result<bool, NorError> {
        match &mut self.left {
            None => Ok(true),
            Some(0) => Err(NorError::Cut),
            Some(left) => {
                *left -= 1;
                Ok(*left > 0)
            }
        }
    }
}

/// Bits that an operation cut short has reached: any, but the same in every run.
fn reached(at: usize) -> u8 {
    ((at as u32).wrapping_mul(0x9E37_79B9) >> 24) as u8
}

impl<M> ErrorType for Nor<M> {
    type Error = NorError;
}

impl<M: AsRef<[u8]> + AsMut<[u8]>> ReadNorFlash for Nor<M> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorError> {
        check_read(self, offset, bytes.len()).map_err(NorError::Request)?;
        if self.is_cut() {
            return Err(NorError::Cut);
        }
        let from = offset as usize;
        bytes.copy_from_slice(&self.memory.as_ref()[from..from + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.memory.as_ref().len()
    }
}

impl<M: AsRef<[u8]> + AsMut<[u8]>> NorFlash for Nor<M> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorError> {
        check_erase(self, from, to).map_err(NorError::Request)?;
        for page in (from as usize..to as usize).step_by(PAGE) {
            let is_whole = self.spend()?;
            for (at, byte) in self.memory.as_mut()[page..page + PAGE].iter_mut().enumerate() {
                *byte |= if is_whole { 0xFF } else { reached(at) };
            }
            if !is_whole {
                return Err(NorError::Cut);
            }
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorError> {
        check_write(self, offset, bytes.len()).map_err(NorError::Request)?;
        for (i, word) in bytes.chunks_exact(WORD).enumerate() {
            let at = offset as usize + i * WORD;
            if self.memory.as_ref()[at..at + WORD] != [0xFF; WORD] {
                return Err(NorError::NotErased);
            }
            let is_whole = self.spend()?;
            for (k, byte) in word.iter().enumerate() {
                self.memory.as_mut()[at + k] = if is_whole { *byte } else { byte | reached(at + k) };
            }
            if !is_whole {
                return Err(NorError::Cut);
            }
        }
        Ok(())
    }
}
