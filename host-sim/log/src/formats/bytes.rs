//! Little-endian numbers at places that a file names, and that may not be there.

use miniz_oxide::inflate::TINFLStatus;
use miniz_oxide::inflate::core::inflate_flags::TINFL_FLAG_COMPUTE_ADLER32 as COMPUTE_ADLER32;
use miniz_oxide::inflate::core::inflate_flags::TINFL_FLAG_PARSE_ZLIB_HEADER as PARSE_ZLIB_HEADER;
use miniz_oxide::inflate::core::inflate_flags::TINFL_FLAG_USING_NON_WRAPPING_OUTPUT_BUF as USING_NON_WRAPPING_OUTPUT_BUF;
use miniz_oxide::inflate::core::{DecompressorOxide, decompress};

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

/// A float of 16 bits (IEEE 754, binary16).
pub(super) fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 0x3FF));
    let size = match exponent {
        0 => fraction * 2_f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + fraction) * 2_f64.powi(exponent - 25),
    };
    if bits >> 15 == 1 { -size } else { size }
}

/// What the bytes of a file may grow to: so much however small it is, and so many times its size.
const USUAL: usize = 64 << 20;
const TIMES: usize = 64;
/// Most values, in the same way.
const USUAL_VALUES: usize = 20_000_000;

/// What a file may still grow to when it is read. A few bytes can stand for any number of zeros.
pub(super) struct Budget {
    bytes: usize,
    values: usize,
}

impl Budget {
    pub(super) fn new(file: &[u8]) -> Self {
        Self::of_size(file.len() as u64)
    }

    /// The budget of a file of so many bytes.
    pub(super) fn of_size(size: u64) -> Self {
        let more = usize::try_from(size).unwrap_or(usize::MAX).saturating_mul(TIMES);
        Self {
            bytes: USUAL.saturating_add(more),
            values: USUAL_VALUES.saturating_add(more),
        }
    }

    /// Undoes zlib.
    pub(super) fn inflated(&mut self, compressed: &[u8]) -> Result<Vec<u8>, RecordingError> {
        let inflated = miniz_oxide::inflate::decompress_to_vec_zlib_with_limit(compressed, self.bytes);
        let inflated = inflated.map_err(|e| match e.status {
            TINFLStatus::HasMoreOutput => too_large(),
            _ => RecordingError(format!("the compressed bytes are damaged ({e})")),
        })?;
        self.bytes -= inflated.len();
        Ok(inflated)
    }

    /// Undoes zlib as far as the bytes are good, and says whether all are.
    pub(super) fn inflated_as_far(&mut self, compressed: &[u8]) -> Result<(Vec<u8>, bool), RecordingError> {
        let flags = PARSE_ZLIB_HEADER | COMPUTE_ADLER32 | USING_NON_WRAPPING_OUTPUT_BUF;
        let mut state = DecompressorOxide::new();
        let mut out = vec![0; compressed.len().saturating_mul(4).max(64).min(self.bytes)];
        let (mut used, mut made) = (0, 0);
        let is_whole = loop {
            // The call that returns a vector leaves what it has not made as zeros at its end.
            let step = decompress(&mut state, &compressed[used..], &mut out, made, flags);
            (used, made) = (used + step.1, made + step.2);
            match step.0 {
                TINFLStatus::HasMoreOutput if out.len() == self.bytes => return Err(too_large()),
                TINFLStatus::HasMoreOutput => out.resize(out.len().saturating_mul(2).min(self.bytes), 0),
                status => break status == TINFLStatus::Done,
            }
        };
        out.truncate(made);
        self.bytes -= made;
        Ok((out, is_whole))
    }

    #[cfg(feature = "parquet")]
    /// So many values, or as many as may still come.
    pub(super) fn at_most(&self, values: usize) -> usize {
        values.min(self.values)
    }

    /// Takes so many values.
    pub(super) fn take(&mut self, values: usize) -> Result<(), RecordingError> {
        self.values = self.values.checked_sub(values).ok_or_else(too_large)?;
        Ok(())
    }
}

fn too_large() -> RecordingError {
    RecordingError(
        "it holds more than a file of its size can: it is damaged, or made to fill a memory".into(),
    )
}
