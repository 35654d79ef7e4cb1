//! What the authentication of frames needs of the flash: the keys, and a number of this start that no start had before.
//!
//! The keys lie in the page of the key for security access, from byte 64 on: which MAC (1: SipHash-2-4, 2: AES-CMAC) in four bytes, the
//! camera's key, the host's key, and the CRC-32 of these, little-endian. They are written with the image where the ECU is made,
//! and never here.
//!
//! Starts are counted in the two pages before that one, an entry of 16 bytes for each, only where there are keys. An entry that a cut of
//! the supply left half written is passed over. A page is erased when the other one is full, so the newest entry is always
//! there, and the count never goes back.

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use embedded_storage::nor_flash::NorFlash;
use haptic_secoc::Keys;
use haptic_secoc::fresh::Algorithm;
use haptic_secoc::verifier::{Credentials, STARTS};

const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);
/// Pages from the end of the flash to the keys' one, and to both of the starts.
const KEYS_PAGE: u32 = 5;
const STARTS_PAGES: u32 = 7;
/// Where in its page the keys begin, and how long they are with their CRC.
const AT: u32 = 64;
const LENGTH: usize = 40;
/// Whole words of any flash.
const ENTRY: usize = 16;

/// The bytes of keys.
#[must_use]
pub fn bytes(keys: &Keys) -> [u8; LENGTH] {
    let code: u32 = match keys.algorithm {
        Algorithm::SipHash => 1,
        Algorithm::AesCmac => 2,
    };
    let mut bytes = [0; LENGTH];
    bytes[..4].copy_from_slice(&code.to_le_bytes());
    bytes[4..20].copy_from_slice(&keys.camera);
    bytes[20..36].copy_from_slice(&keys.host);
    let crc = CRC.checksum(&bytes[..36]);
    bytes[36..].copy_from_slice(&crc.to_le_bytes());
    bytes
}

/// Where keys lie, in a flash of that many bytes.
#[must_use]
pub fn place<F: NorFlash>(flash: &F) -> Option<u32> {
    Some(page(flash, KEYS_PAGE)? + AT)
}

/// What this start authenticates with. It counts the start, once; the flash must be at rest otherwise.
#[inline(never)]
pub fn credentials<F: NorFlash>(flash: &mut F) -> Credentials {
    // Read in whole words of any flash.
    let mut stored = [0; 64];
    if place(flash).is_none_or(|place| flash.read(place, &mut stored).is_err()) {
        return Credentials::None;
    }
    if stored == [0xFF; 64] {
        return if cfg!(feature = "bench") {
            Credentials::Bench
        } else {
            Credentials::None
        };
    }
    match read(&stored) {
        Some(keys) => Credentials::Keys(keys, count(flash)),
        // There were some: not for the bench, whatever the image is.
        None => Credentials::None,
    }
}

fn read(stored: &[u8; 64]) -> Option<Keys> {
    let (stored, _) = stored.split_first_chunk::<LENGTH>()?;
    let algorithm = match stored[..4] {
        [1, 0, 0, 0] => Algorithm::SipHash,
        [2, 0, 0, 0] => Algorithm::AesCmac,
        _ => return None,
    };
    let keys = Keys {
        algorithm,
        camera: *stored[4..].first_chunk()?,
        host: *stored[20..].first_chunk()?,
    };
    (bytes(&keys) == *stored).then_some(keys)
}

/// The first byte of the page that many from the end.
pub(crate) fn page<F: NorFlash>(flash: &F, from_end: u32) -> Option<u32> {
    (flash.capacity() as u32).checked_sub(from_end * F::ERASE_SIZE as u32)
}

/// What one page holds of starts: the newest, and the place behind what is written, if the page is not full.
#[derive(Default)]
struct Page {
    newest: Option<u32>,
    free: Option<u32>,
}

/// Counts this start; None where it does not read back, or the numbers are used up.
fn count<F: NorFlash>(flash: &mut F) -> Option<u32> {
    const {
        let is_aligned = ENTRY.is_multiple_of(F::WRITE_SIZE) && ENTRY.is_multiple_of(F::READ_SIZE);
        assert!(is_aligned && F::ERASE_SIZE.is_multiple_of(ENTRY));
    };
    let first = page(flash, STARTS_PAGES)?;
    let size = F::ERASE_SIZE as u32;
    let begins = [first, first + size];
    let pages = [scan(flash, begins[0])?, scan(flash, begins[1])?];
    let current = usize::from(pages[1].newest > pages[0].newest);
    let number = pages[current].newest.map_or(0, |newest| newest + 1);
    let place = match pages[current].free {
        Some(free) => free,
        None => {
            let other = begins[1 - current];
            flash.erase(other, other + size).ok()?;
            other
        }
    };
    let entry = entry(number);
    flash.write(place, &entry).ok()?;
    let mut written = [0; ENTRY];
    flash.read(place, &mut written).ok()?;
    (written == entry && number < STARTS).then_some(number)
}

fn scan<F: NorFlash>(flash: &mut F, begin: u32) -> Option<Page> {
    let mut page = Page::default();
    for at in (begin..begin + F::ERASE_SIZE as u32).step_by(ENTRY) {
        let mut bytes = [0; ENTRY];
        flash.read(at, &mut bytes).ok()?;
        if bytes == [0xFF; ENTRY] {
            page.free = page.free.or(Some(at));
            continue;
        }
        // Behind everything that is written, whole or not.
        page.free = None;
        let number = u32::from_le_bytes(*bytes.first_chunk()?);
        if bytes == entry(number) {
            page.newest = page.newest.max(Some(number));
        }
    }
    Some(page)
}

/// The number, its complement, and both again.
pub(crate) fn entry(number: u32) -> [u8; ENTRY] {
    let [a, b, c, d] = number.to_le_bytes();
    let [e, f, g, h] = (!number).to_le_bytes();
    [a, b, c, d, e, f, g, h, a, b, c, d, e, f, g, h]
}
