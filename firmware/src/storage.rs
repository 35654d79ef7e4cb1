//! Keeps the parameters in flash as two copies of the set, each in pages of its own. A copy is written only while the
//! other one is good.
//!
//! A copy is a region of two pages, in which the crate `sequential-storage` appends items and erases the older page
//! when the newer one is full. A set is the block of `haptic_core::service::stored`, with version, number and CRC-32.
//! [`save`] writes the copy that was not loaded, reads it back, and only then writes the other one. So the power may
//! fail at any moment: either the last good set or the new one can be read.
//!
//! [`repair`] rewrites a copy that cannot be read, or that is older because a write was cut short, from the other
//! one. It runs at each start, not at the next write, so that a damaged copy does not remain until the other one is
//! damaged too.
//!
//! The copies lie in the last four pages of the flash they are given, and the key for security access in the one before
//! ([`key`]); the board's memory map leaves these out.
//!
//! Two regions and the read-back are there for this reason: the crate's own map also recovers from a write that was
//! cut short, but after repeated cuts a write that it reported as done can be missing at the next start (its issue
//! 136). Here this costs a second attempt, and never the set. Not here: when to write (`product`: at a start, before
//! anything moves).

use core::future::Future;
use core::pin::pin;
use core::task::{Context, Poll, Waker};

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use embassy_embedded_hal::adapter::BlockingAsync;
use embedded_storage::nor_flash::NorFlash;
use haptic_core::service::stored::{self, BYTES, Set, Stored};
use haptic_diag::security::{BENCH_KEY, Key};
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage};

/// Pages of a copy: with fewer there would be no page to move to when one is full.
const PAGES: u32 = 2;
/// The block's key in its region.
const KEY: u8 = 0;
/// Key and block, rounded up to the words of any flash.
const BUFFER: usize = (1 + BYTES).next_multiple_of(32);

const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// What was found in the flash.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Found {
    /// The newest good set.
    pub stored: Option<Stored>,
    /// Whether each copy is there but cannot be read, or is another processor's.
    pub damaged: [bool; 2],
}

/// A set could not be written or read back. Copies that were good before are still good.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WriteFailed;

/// Reads both copies; `hardware` is the number of this processor, whose copies alone are used.
pub fn load<F: NorFlash>(flash: &mut F, hardware: u32) -> Found {
    let copies = [0, 1].map(|copy| read(flash, copy));
    // Whether a copy is good is decided without the other one.
    let is_good = |copy: &Option<[u8; BYTES]>| {
        copy.as_ref()
            .is_some_and(|bytes| stored::load([bytes, &[]], hardware).is_some())
    };
    let damaged = [0, 1].map(|copy| !is_good(&copies[copy]) && !is_blank(flash, copy));
    let [a, b] = copies
        .each_ref()
        .map(|copy| copy.as_ref().map_or(&[][..], |bytes| bytes));
    Found {
        stored: stored::load([a, b], hardware),
        damaged,
    }
}

/// Writes a set into both copies, one after the other.
///
/// # Errors
/// The first copy does not read back; the second one was not touched.
pub fn save<F: NorFlash>(
    flash: &mut F,
    set: &Set,
    last: Option<&Stored>,
    hardware: u32,
) -> Result<(), WriteFailed> {
    let (copy, sequence) = last.map_or((0, 1), |last| (1 - last.copy, last.sequence.wrapping_add(1)));
    let bytes = stored::save(set, sequence, hardware);
    for copy in [copy, 1 - copy] {
        write(flash, copy, &bytes)?;
    }
    Ok(())
}

/// The key for security access: its bytes and their CRC-32, little-endian, at the beginning of the page before the copies, written
/// with the image where the ECU is made and never here. An image for the bench has one that everybody knows if there is none.
pub fn key<F: NorFlash>(flash: &mut F) -> Option<Key> {
    const BENCH: Option<Key> = if cfg!(feature = "bench") {
        Some(BENCH_KEY)
    } else {
        None
    };
    let pages = (2 * PAGES + 1) * F::ERASE_SIZE as u32;
    // Read in whole words of any flash.
    let mut bytes = [0; 32];
    let place = (flash.capacity() as u32).checked_sub(pages);
    if place.is_none_or(|place| flash.read(place, &mut bytes).is_err()) {
        return BENCH;
    }
    let (key, rest) = bytes.split_first_chunk::<16>()?;
    let crc = rest.first_chunk().copied().map(u32::from_le_bytes);
    if crc == Some(CRC.checksum(key)) {
        Some(*key)
    } else {
        BENCH
    }
}

/// Rewrites the copy that is not in use from the one in use, if they differ. The copy in use is not touched.
///
/// # Errors
/// It does not read back.
pub fn repair<F: NorFlash>(flash: &mut F, found: &Found, hardware: u32) -> Result<(), WriteFailed> {
    let Some(Stored { set, sequence, copy }) = &found.stored else {
        return Ok(());
    };
    let bytes = stored::save(set, *sequence, hardware);
    if read(flash, 1 - copy).as_ref() == Some(&bytes) {
        return Ok(());
    }
    write(flash, 1 - copy, &bytes)
}

/// First and last byte of a copy's region.
fn region<F: NorFlash>(flash: &F, copy: usize) -> core::ops::Range<u32> {
    let length = PAGES * F::ERASE_SIZE as u32;
    let end = flash.capacity() as u32 - if copy == 0 { length } else { 0 };
    end - length..end
}

type NoCache = Cache<Uncached, Uncached, Uncached, u8>;

fn map<F: NorFlash>(flash: &mut F, copy: usize) -> MapStorage<u8, BlockingAsync<&mut F>, NoCache> {
    let region = region(flash, copy);
    MapStorage::new(
        BlockingAsync::new(flash),
        MapConfig::new(region),
        NoCache::new_uncached(),
    )
}

fn read<F: NorFlash>(flash: &mut F, copy: usize) -> Option<[u8; BYTES]> {
    let mut buffer = [0; BUFFER];
    let found = now(map(flash, copy).fetch_item::<&[u8]>(&mut buffer, &KEY));
    found.ok().flatten().and_then(|bytes| bytes.try_into().ok())
}

fn write<F: NorFlash>(flash: &mut F, copy: usize, bytes: &[u8; BYTES]) -> Result<(), WriteFailed> {
    for is_second_try in [false, true] {
        if is_second_try {
            // Remains of interrupted writes may be in the way.
            let region = region(flash, copy);
            flash.erase(region.start, region.end).map_err(|_| WriteFailed)?;
        }
        let mut buffer = [0; BUFFER];
        let stored = now(map(flash, copy).store_item(&mut buffer, &KEY, &bytes.as_slice()));
        if stored.is_ok() && read(flash, copy).as_ref() == Some(bytes) {
            return Ok(());
        }
    }
    Err(WriteFailed)
}

fn is_blank<F: NorFlash>(flash: &mut F, copy: usize) -> bool {
    let mut chunk = [0; 64];
    region(flash, copy)
        .step_by(chunk.len())
        .all(|at| flash.read(at, &mut chunk).is_ok() && chunk == [0xFF; 64])
}

/// Runs a future that never waits, as the flash below blocks, and returns its result.
fn now<T>(work: impl Future<Output = T>) -> T {
    let mut work = pin!(work);
    loop {
        if let Poll::Ready(result) = work.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            return result;
        }
    }
}
