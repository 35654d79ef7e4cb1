//! Little-endian numbers at places that a file names, and that may not be there.

use crate::recording::RecordingError;

/// Bytes of a file.
#[derive(Clone, Copy)]
pub(super) struct Bytes<'a>(pub(super) &'a [u8]);

impl<'a> Bytes<'a> {
    /// `size` bytes from `at` on.
    pub(super) fn slice(self, at: u64, size: u64) -> Result<&'a [u8], RecordingError> {
        let whole = || -> Option<&'a [u8]> {
            let from = usize::try_from(at).ok()?;
            self.0.get(from..from.checked_add(usize::try_from(size).ok()?)?)
        };
        whole().ok_or_else(|| {
            RecordingError(format!(
                "byte {at}: {size} bytes are wanted, the file ends at {}",
                self.0.len()
            ))
        })
    }

    fn array<const N: usize>(self, at: u64) -> Result<[u8; N], RecordingError> {
        let mut array = [0; N];
        array.copy_from_slice(self.slice(at, N as u64)?);
        Ok(array)
    }

    pub(super) fn u8(self, at: u64) -> Result<u8, RecordingError> {
        Ok(self.array::<1>(at)?[0])
    }

    pub(super) fn u16(self, at: u64) -> Result<u16, RecordingError> {
        self.array(at).map(u16::from_le_bytes)
    }

    pub(super) fn u32(self, at: u64) -> Result<u32, RecordingError> {
        self.array(at).map(u32::from_le_bytes)
    }

    pub(super) fn u64(self, at: u64) -> Result<u64, RecordingError> {
        self.array(at).map(u64::from_le_bytes)
    }

    pub(super) fn f64(self, at: u64) -> Result<f64, RecordingError> {
        self.array(at).map(f64::from_le_bytes)
    }
}

/// What a file's compressed bytes may grow to: 1 GiB.
const LARGEST: usize = 1 << 30;

/// Undoes zlib, up to a size that no recording needs.
pub(super) fn inflated(compressed: &[u8]) -> Result<Vec<u8>, RecordingError> {
    miniz_oxide::inflate::decompress_to_vec_zlib_with_limit(compressed, LARGEST)
        .map_err(|e| RecordingError(format!("the compressed bytes are damaged ({})", e)))
}
