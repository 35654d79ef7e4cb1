//! The pages of a column, unpacked here: without C for Zstandard, and with a look at what a damaged page says of itself.
//!
//! The crate parquet would need zstd's C sources, which take 38 s of a processor to compile, and it allocates what a page's
//! heading asks for. Here it finds the pages, told that they are not compressed, and decodes what they unpack to.

use std::io::Read;
use std::sync::Arc;

use bytes::Bytes;
use flate2::read::MultiGzDecoder;
use parquet::basic::{Compression, Encoding};
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::ColumnChunkMetaData;
use parquet::file::serialized_reader::SerializedPageReader;

/// What a page may unpack to: writers make pages of one megabyte.
const LARGEST: usize = 128 << 20;
/// Most that LZ4 packs, as a factor.
const LZ4_MOST: usize = 255;
/// Most that Snappy packs, as a factor: copies of 64 bytes take 3.
const SNAPPY_MOST: usize = 22;

/// The pages of a column chunk.
pub(super) struct Pages {
    packed: SerializedPageReader<Bytes>,
    compression: Compression,
    has_dictionary: bool,
}

fn refuse<T>(what: impl std::fmt::Display) -> Result<T> {
    Err(ParquetError::General(what.to_string()))
}

impl Pages {
    /// # Errors
    /// A compression that is not read.
    pub(super) fn new(file: &Bytes, column: &ColumnChunkMetaData, rows: usize) -> Result<Self> {
        let compression = column.compression();
        if let Compression::BROTLI(_) | Compression::LZ4 | Compression::LZO = compression {
            let codec = column.compression_codec();
            return refuse(format!(
                "it is compressed with {codec:?}, which is not read; with pandas: \
                 pandas.read_parquet(\"IN.parquet\").to_parquet(\"OUT.parquet\", compression=\"zstd\")"
            ));
        }
        let plain = column.clone().into_builder();
        let plain = plain.set_compression(Compression::UNCOMPRESSED);
        Ok(Self {
            packed: SerializedPageReader::new(Arc::new(file.clone()), &plain.build()?, rows, None)?,
            compression,
            has_dictionary: false,
        })
    }

    fn unpacked(&mut self, mut page: Page) -> Result<Page> {
        match &mut page {
            Page::DictionaryPage { buf, num_values, .. } => {
                *buf = unpack(self.compression, buf)?;
                // A number takes two bytes at least.
                if *num_values as usize > buf.len() / 2 {
                    let bytes = buf.len();
                    return refuse(format!(
                        "a dictionary of {bytes} bytes has no {num_values} values"
                    ));
                }
                self.has_dictionary = true;
            }
            Page::DataPage { buf, encoding, .. } => {
                self.check(*encoding)?;
                *buf = unpack(self.compression, buf)?;
            }
            Page::DataPageV2 {
                buf,
                num_values,
                encoding,
                num_nulls,
                def_levels_byte_len,
                rep_levels_byte_len,
                is_compressed,
                ..
            } => {
                self.check(*encoding)?;
                let levels = *def_levels_byte_len as usize + *rep_levels_byte_len as usize;
                if levels > buf.len() || num_nulls > num_values {
                    return refuse("the heading of a page is damaged");
                }
                if *is_compressed {
                    let values = unpack(self.compression, &buf[levels..])?;
                    *buf = [&buf[..levels], &values].concat().into();
                    *is_compressed = false;
                }
            }
        }
        Ok(page)
    }

    fn check(&self, encoding: Encoding) -> Result<()> {
        let needs_one = matches!(encoding, Encoding::RLE_DICTIONARY | Encoding::PLAIN_DICTIONARY);
        if needs_one && !self.has_dictionary {
            return refuse("there is no dictionary before its first use");
        }
        Ok(())
    }
}

/// What packed bytes hold.
fn unpack(compression: Compression, packed: &[u8]) -> Result<Bytes> {
    if packed.is_empty() {
        return Ok(Bytes::new());
    }
    let damaged = |e: &dyn std::fmt::Display| ParquetError::General(format!("a page does not unpack: {e}"));
    let unpacked = match compression {
        Compression::GZIP(_) => to_limit(MultiGzDecoder::new(packed))?,
        Compression::ZSTD(_) => {
            to_limit(ruzstd::decoding::StreamingDecoder::new(packed).map_err(|e| damaged(&e))?)?
        }
        Compression::SNAPPY => {
            let size = snap::raw::decompress_len(packed).map_err(|e| damaged(&e))?;
            if size > packed.len().saturating_mul(SNAPPY_MOST) {
                let bytes = packed.len();
                return refuse(format!("a page of {bytes} bytes does not unpack to {size}"));
            }
            let unpacked = snap::raw::Decoder::new().decompress_vec(packed);
            unpacked.map_err(|e| damaged(&e))?
        }
        Compression::LZ4_RAW => {
            let largest = packed.len().saturating_mul(LZ4_MOST).min(LARGEST);
            // How large it is was said in the page's heading, which is not handed on.
            let sizes = [4, 16, 64, LZ4_MOST].map(|times| packed.len().saturating_mul(times).min(largest));
            let mut unpacked = Err(ParquetError::General("a page does not unpack".into()));
            for size in sizes {
                let mut bytes = vec![0; size];
                unpacked = lz4_flex::block::decompress_into(packed, &mut bytes)
                    .map(|size| bytes[..size].to_vec())
                    .map_err(|e| damaged(&e));
                if unpacked.is_ok() {
                    break;
                }
            }
            unpacked?
        }
        _ => packed.to_vec(),
    };
    Ok(unpacked.into())
}

fn to_limit(unpacking: impl Read) -> Result<Vec<u8>> {
    let mut unpacked = Vec::new();
    let read = unpacking.take(LARGEST as u64 + 1).read_to_end(&mut unpacked);
    read.map_err(|e| ParquetError::General(format!("a page does not unpack: {e}")))?;
    if unpacked.len() > LARGEST {
        return refuse(format!("a page unpacks to more than {} MB", LARGEST >> 20));
    }
    Ok(unpacked)
}

impl PageReader for Pages {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        let page = self.packed.get_next_page()?;
        page.map(|page| self.unpacked(page)).transpose()
    }

    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        self.packed.peek_next_page()
    }

    fn skip_next_page(&mut self) -> Result<()> {
        self.packed.skip_next_page()
    }
}

impl Iterator for Pages {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}
