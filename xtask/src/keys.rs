//! The page of keys of a board's flash, as files to write beside the image (`firmware/src/keys.rs`, `storage.rs` read it).
//!
//! The keys come by chance or from a file, and go into a file that its owner alone reads; no key is printed unless that is asked for.
//!
//! HEX and S19 are written by hand: the crates `ihex` and `srec` would save the sums of their records alone, and `bin_file`, which
//! writes both, brings readers and regular expressions along.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use crc::{CRC_32_ISO_HDLC, Crc};
use serde::{Deserialize, Serialize};

use crate::boards::Board;
use crate::tool::Usage;

/// Where the senders' keys begin in the page; the key for security access is at its beginning.
const SENDERS_AT: usize = 64;
/// Bytes of a record of either format, and of a word of any board's flash.
const RECORD: usize = 16;
/// The example of RFC 4493, which is the key of images for the bench, and its bytes from the last to the first.
const KNOWN: u128 = 0x2b7e_1516_28ae_d2a6_abf7_1588_09cf_4f3c;

/// Which board, which MAC, and where the keys come from and go.
#[derive(Args)]
pub(crate) struct Options {
    /// The board.
    board: Board,
    /// The MAC of new keys.
    #[arg(long, value_enum, default_value = "siphash")]
    mac: Algorithm,
    /// Keys to take in place of new ones: a keys.toml of this command.
    #[arg(long, value_name = "keys.toml", conflicts_with = "mac")]
    from: Option<PathBuf>,
    /// Directory for keys.toml (of new keys), keys.hex, keys.s19 and keys.bin; nothing in it is overwritten.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print the keys too.
    #[arg(long)]
    show: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Algorithm {
    /// SipHash-2-4.
    Siphash,
    /// AES-CMAC.
    AesCmac,
}

/// The keys of one ECU, in hexadecimal.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    /// Which MAC camera and host use.
    mac: Algorithm,
    /// The camera's.
    camera: String,
    /// The host's.
    host: String,
    /// The tester's, for security access (AES-CMAC).
    access: String,
}

/// Makes the page.
pub(crate) fn make(options: &Options) -> Result<()> {
    let Some(address) = options.board.keys_at() else {
        let message = format!(
            "{} is a machine of QEMU, whose flash begins blank: --features keys-siphash or keys-aes",
            options.board.feature()
        );
        return Err(Usage(message).into());
    };
    let keys = match &options.from {
        Some(file) => {
            let text = fs::read_to_string(file).with_context(|| file.display().to_string())?;
            // What the parser says would quote a key.
            toml::from_str(&text).map_err(|_| {
                let what = "not a file of keys: mac, camera, host and access, and nothing else";
                Usage(format!("{}: {what}", file.display()))
            })?
        }
        None => Keys::by_chance(options.mac)?,
    };
    let text = toml::to_string(&keys)?;
    let bytes = page(&keys)?;
    fs::create_dir_all(&options.out).with_context(|| options.out.display().to_string())?;
    let mut files = vec![
        ("keys.hex", intel_hex(address, &bytes).into_bytes()),
        ("keys.s19", s_records(address, &bytes).into_bytes()),
        ("keys.bin", bytes),
    ];
    if options.from.is_none() {
        files.insert(0, ("keys.toml", text.clone().into_bytes()));
    }
    for (name, bytes) in files {
        write(&options.out.join(name), &bytes)?;
    }
    println!(
        "{}: keys for {:#010x} of {}; whoever has these files can command the ECU",
        options.out.display(),
        address,
        options.board.feature()
    );
    if options.show {
        print!("{text}");
    }
    Ok(())
}

/// Writes a new file that others cannot read.
fn write(file: &Path, bytes: &[u8]) -> Result<()> {
    let mut options = fs::OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let opened = options.open(file);
    let written = opened.and_then(|mut opened| opened.write_all(bytes));
    written.with_context(|| file.display().to_string())
}

impl Keys {
    fn by_chance(mac: Algorithm) -> Result<Self> {
        let key = || -> Result<String> {
            let mut bytes = [0; 16];
            getrandom::fill(&mut bytes).context("this computer gives no random bytes")?;
            Ok(format!("{:032x}", u128::from_be_bytes(bytes)))
        };
        Ok(Self {
            mac,
            camera: key()?,
            host: key()?,
            access: key()?,
        })
    }
}

/// A key that is worth one; the error names its field, never its value.
fn key(name: &str, text: &str) -> Result<[u8; 16]> {
    let refuse = |why: &str| Usage(format!("{name}: {why}"));
    if text.len() != 32 || !text.bytes().all(|byte| byte.is_ascii_hexdigit()) {
        return Err(refuse("a key has 16 bytes, 32 hexadecimal digits").into());
    }
    let number = u128::from_str_radix(text, 16)?;
    let bytes = number.to_be_bytes();
    if number == KNOWN || number.swap_bytes() == KNOWN {
        return Err(refuse("the bench's key, which everybody knows").into());
    }
    let mut different = bytes;
    different.sort_unstable();
    let different = different.chunk_by(|a, b| a == b).count();
    let steps = bytes.windows(2).map(|pair| pair[1].wrapping_sub(pair[0]));
    let is_row = steps.clone().all(|step| Some(step) == steps.clone().next());
    // Of 16 random bytes fewer than ten differ once in 10^9 keys.
    if different < 10 || is_row {
        return Err(refuse("too regular for a key: take random bytes").into());
    }
    Ok(bytes)
}

/// The page from its first byte on, as far as it is not blank.
fn page(keys: &Keys) -> Result<Vec<u8>> {
    let camera = key("camera", &keys.camera)?;
    let host = key("host", &keys.host)?;
    let access = key("access", &keys.access)?;
    if camera == host || camera == access || host == access {
        return Err(Usage("camera, host and access: three different keys".to_owned()).into());
    }
    let code: u32 = match keys.mac {
        Algorithm::Siphash => 1,
        Algorithm::AesCmac => 2,
    };
    let crc = Crc::<u32>::new(&CRC_32_ISO_HDLC);
    let senders = [&code.to_le_bytes()[..], &camera, &host].concat();
    let mut page = [&access[..], &crc.checksum(&access).to_le_bytes()].concat();
    page.resize(SENDERS_AT, 0xFF);
    page.extend_from_slice(&senders);
    page.extend_from_slice(&crc.checksum(&senders).to_le_bytes());
    page.resize(page.len().next_multiple_of(RECORD), 0xFF);
    Ok(page)
}

/// A record's bytes in hexadecimal behind its mark.
fn record(mark: &str, bytes: &[u8], checksum: u8) -> String {
    let bytes = bytes.iter().chain([&checksum]);
    let digits: String = bytes.map(|byte| format!("{byte:02X}")).collect();
    format!("{mark}{digits}\n")
}

fn sum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, byte| sum.wrapping_add(*byte))
}

/// Intel's format: the upper half of the address in a record of its own.
fn intel_hex(address: u32, bytes: &[u8]) -> String {
    let line = |record_bytes: Vec<u8>| {
        let checksum = sum(&record_bytes).wrapping_neg();
        record(":", &record_bytes, checksum)
    };
    let [high, higher, ..] = address.to_be_bytes();
    let mut text = line(vec![2, 0, 0, 4, high, higher]);
    for (at, chunk) in (address..).step_by(RECORD).zip(bytes.chunks(RECORD)) {
        let [.., low, lower] = at.to_be_bytes();
        text += &line([&[chunk.len() as u8, low, lower, 0], chunk].concat());
    }
    text + &line(vec![0, 0, 0, 1])
}

/// Motorola's format with addresses of 32 bits.
fn s_records(address: u32, bytes: &[u8]) -> String {
    let line = |mark: &str, body: &[u8]| {
        let record_bytes = [&[body.len() as u8 + 1], body].concat();
        let checksum = !sum(&record_bytes);
        record(mark, &record_bytes, checksum)
    };
    let mut text = line("S0", &[0, 0]);
    for (at, chunk) in (address..).step_by(RECORD).zip(bytes.chunks(RECORD)) {
        text += &line("S3", &[&at.to_be_bytes(), chunk].concat());
    }
    text + &line("S7", &[0; 4])
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: &str = "11f0c3a5988724b6d00e5f6a7b8c9d13";
    const HOST: &str = "22f0c3a5988724b6d00e5f6a7b8c9d13";
    const ACCESS: &str = "33f0c3a5988724b6d00e5f6a7b8c9d13";

    const ACCESS_CRC: u32 = 0xE9D9_1656;
    const SENDERS_CRC: u32 = 0xFFBF_E52E;

    fn keys(camera: &str) -> Keys {
        Keys {
            mac: Algorithm::AesCmac,
            camera: camera.into(),
            host: HOST.into(),
            access: ACCESS.into(),
        }
    }

    /// CRC-32 by zlib.
    #[test]
    fn the_page_is_what_the_firmware_reads() {
        let page = page(&keys(CAMERA)).unwrap();
        assert_eq!(page.len(), 112);
        assert_eq!(page[..4], [0x33, 0xF0, 0xC3, 0xA5]);
        assert_eq!(page[16..20], ACCESS_CRC.to_le_bytes());
        assert_eq!(page[20..64], [0xFF; 44]);
        assert_eq!(page[64..70], [2, 0, 0, 0, 0x11, 0xF0]);
        assert_eq!(page[84], 0x22);
        assert_eq!(page[100..104], SENDERS_CRC.to_le_bytes());
        assert_eq!(page[104..], [0xFF; 8]);
    }

    #[test]
    fn weak_keys_are_refused_and_not_shown() {
        let known = format!("{KNOWN:032x}");
        let turned = format!("{:032x}", KNOWN.swap_bytes());
        for weak in [
            "",
            "11f0c3a5988724b6d00e5f6a7b8c9d",
            "11f0c3a5988724b6d00e5f6a7b8c9dzz",
            "00000000000000000000000000000000",
            "000102030405060708090a0b0c0d0e0f",
            "f0e1d2c3b4a5968778695a4b3c2d1e0f",
            "11f011f011f011f011f011f011f011f0",
            &known,
            &turned,
            HOST,
            ACCESS,
        ] {
            let error = page(&keys(weak)).unwrap_err().to_string();
            assert!(error.contains("camera"), "{error}");
            assert!(weak.is_empty() || !error.contains(weak), "{error}");
        }
        let [one, other] = [(); 2].map(|()| Keys::by_chance(Algorithm::Siphash).unwrap());
        assert!(page(&one).is_ok() && one.camera != other.camera && one.camera != one.host);
    }

    /// Examples of either format's description.
    #[test]
    fn records_have_their_sums() {
        let data: Vec<u8> = (0..16).map(|k| 0x10 * (k % 4)).collect();
        let hex = intel_hex(0x0807_D800, &data);
        assert!(hex.starts_with(":020000040807EB\n:10D8000000102030"), "{hex}");
        assert!(hex.ends_with(":00000001FF\n"), "{hex}");
        for line in hex.lines() {
            let bytes = (1..line.len())
                .step_by(2)
                .map(|at| u8::from_str_radix(&line[at..at + 2], 16).unwrap());
            assert_eq!(bytes.fold(0_u8, u8::wrapping_add), 0, "{line}");
        }
        let text = s_records(0x0807_D800, &data);
        assert!(text.starts_with("S0030000FC\nS3150807D80000102030"), "{text}");
        assert!(text.ends_with("S70500000000FA\n"), "{text}");
        for line in text.lines() {
            let bytes = (2..line.len())
                .step_by(2)
                .map(|at| u8::from_str_radix(&line[at..at + 2], 16).unwrap());
            assert_eq!(bytes.fold(0_u8, u8::wrapping_add), 0xFF, "{line}");
        }
    }

    /// The fifth page from the end of the flash, of which an image has all but nine pages.
    #[test]
    fn the_page_lies_behind_the_image_and_the_pages_of_codes_and_starts() {
        for (board, map, page) in [
            (
                Board::NucleoG474re,
                include_str!("../../firmware/src/boards/nucleo_g474re.x"),
                2,
            ),
            (
                Board::SamE54Xpro,
                include_str!("../../firmware/src/boards/sam_e54_xpro.x"),
                8,
            ),
        ] {
            let line = map.lines().find(|line| line.contains("FLASH :")).unwrap();
            let (origin, length) = line.split_once(", LENGTH = ").unwrap();
            let origin = u32::from_str_radix(origin.split("0x").nth(1).unwrap(), 16).unwrap();
            let length: u32 = length.trim_end_matches('K').parse().unwrap();
            assert_eq!(board.keys_at(), Some(origin + (length + 4 * page) * 1024));
        }
        assert_eq!(Board::Mps2An386.keys_at(), None);
    }
}
