//! Recordings in files: what is written is read again, and a damaged file is refused or read, never more.

#![cfg(feature = "formats")]

use std::path::Path;

use haptic_log::candump::CandumpFrame;
use haptic_log::formats::{self, Contents, Format, Reading};
use haptic_log::recording::{Group, Recording, Series};

fn series(name: &str, unit: &str, values: impl Iterator<Item = f64>) -> Series {
    Series {
        name: name.into(),
        unit: unit.into(),
        source: "bench".into(),
        values: values.collect(),
    }
}

fn recording() -> Recording {
    let time_s: Vec<f64> = (0..300).map(|k| f64::from(k) * 0.005).collect();
    let channels = vec![
        series("Torque", "N.m", time_s.iter().map(|t| (7.0 * t).sin())),
        series(
            "Angle",
            "deg",
            time_s.iter().map(|t| if *t < 1.0 { t / 3.0 } else { f64::NAN }),
        ),
    ];
    Recording::of(Group::new(time_s, channels))
}

fn frames() -> Vec<CandumpFrame> {
    let frame = |k: u32| CandumpFrame {
        line: 0,
        time_s: f64::from(k) * 1e-3,
        id: if k.is_multiple_of(7) {
            0x1234_5678
        } else {
            0x100 + k % 5
        },
        extended: k.is_multiple_of(7),
        data: (0..k as u8 % 9).collect(),
    };
    (0..2000).map(frame).collect()
}

const TABLES: &[&str] = &[
    "csv",
    "mat",
    "mf4",
    #[cfg(feature = "parquet")]
    "parquet",
];
const BUSES: &[&str] = &["log", "asc", "blf"];

fn written(extension: &str) -> Vec<u8> {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join(format!("x.{extension}"));
    if BUSES.contains(&extension) {
        formats::write_frames(&path, &frames()).unwrap();
    } else {
        formats::write(&path, recording()).unwrap();
    }
    std::fs::read(path).unwrap()
}

fn read(bytes: Vec<u8>, extension: &str) -> Result<Contents, String> {
    let format = Format::from_path(Path::new(&format!("x.{extension}"))).unwrap();
    formats::read_bytes(bytes, format, Reading::default()).map_err(|e| e.to_string())
}

#[test]
fn what_is_written_is_read_again() {
    let expected = recording();
    for extension in TABLES {
        let Contents::Channels(found) = read(written(extension), extension).unwrap() else {
            panic!("{extension}: no channels");
        };
        let (found, expected) = (&found.groups[0], &expected.groups[0]);
        assert_eq!(found.time_s, expected.time_s, "{extension}");
        for (a, b) in found.channels.iter().zip(&expected.channels) {
            assert_eq!((&a.name, &a.unit), (&b.name, &b.unit), "{extension}");
            let bits = |s: &Series| {
                s.values
                    .iter()
                    .map(|v| if v.is_nan() { 1 } else { v.to_bits() })
                    .collect::<Vec<_>>()
            };
            assert_eq!(bits(a), bits(b), "{extension}: {}", a.name);
            // A text has no place for who measured.
            assert_eq!(a.source, if *extension == "csv" { "" } else { "bench" });
        }
        assert_eq!(found.channels.len(), 2, "{extension}");
    }
    for extension in BUSES {
        let Contents::Frames(found, _) = read(written(extension), extension).unwrap() else {
            panic!("{extension}: no frames");
        };
        let plain = |f: &CandumpFrame| ((f.time_s * 1e6).round() as i64, f.id, f.extended, f.data.clone());
        let (found, sent): (Vec<_>, Vec<_>) = (
            found.iter().map(plain).collect(),
            frames().iter().map(plain).collect(),
        );
        assert_eq!(found, sent, "{extension}");
    }
}

#[test]
fn no_even_grid_spans_a_clock_that_was_set() {
    let mut jumped = recording();
    for time_s in &mut jumped.groups[0].time_s[100..] {
        *time_s += 1.7e9;
    }
    let error = jumped.resampled(100.0, None).unwrap_err().to_string();
    assert!(
        error.starts_with("channel Torque: its time goes from 0.495 to 1700000000.5 s"),
        "{error}"
    );
    let error = recording().resampled(2e7, None).unwrap_err().to_string();
    assert!(error.contains("give a lower --rate"), "{error}");
    assert_eq!(recording().resampled(100.0, None).unwrap().time_s.len(), 100);
}

/// Every tenth length, and twelve hundred files with bytes overwritten, some of them sizes and links: each is read or refused in one
/// sentence.
#[test]
fn a_damaged_file_is_read_or_refused_in_one_sentence() {
    let mut state = 1_u64;
    let mut random = move |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    let mut refused = 0;
    for extension in TABLES.iter().chain(BUSES) {
        let whole = written(extension);
        let mut files: Vec<Vec<u8>> = (0..whole.len().min(3000))
            .step_by(10)
            .map(|length| whole[..length].to_vec())
            .collect();
        for _ in 0..1200 {
            let mut bytes = whole.clone();
            let near = if random(2) == 0 {
                bytes.len()
            } else {
                bytes.len().min(600)
            };
            for _ in 0..=random(4) {
                let value = [0, 1, 0x7F, 0xFF, random(256) as u8][random(5)];
                let at = random(near);
                bytes[at] = value;
            }
            files.push(bytes);
        }
        for bytes in files {
            if let Err(sentence) = read(bytes, extension) {
                refused += 1;
                assert!(
                    !sentence.is_empty() && !sentence.contains('\n'),
                    "{extension}: {sentence:?}"
                );
            }
        }
    }
    assert!(refused > 1000, "only {refused} files were found to be damaged");
}

/// Big-endian and signed, as in the example of Vector's DBC format: a 12-bit number that begins at bit 3 of byte 0
/// (start 3, Motorola) in 0A BC is ABC; signed it is ABC - 1000 in hexadecimal.
#[test]
fn signals_of_both_byte_orders_are_decoded() {
    let dbc = "VERSION \"\"\n\nBU_: A\n\nBO_ 256 M: 8 A\n SG_ Big : 3|12@0+ (1,0) [0|0] \"\" A\n \
               SG_ Signed : 3|12@0- (0.5,1) [0|0] \"deg\" A\n SG_ Little : 16|16@1- (1,0) [0|0] \"\" A\n";
    let frame = CandumpFrame {
        line: 1,
        time_s: 0.5,
        id: 256,
        extended: false,
        data: vec![0x0A, 0xBC, 0xFE, 0xFF],
    };
    let found = formats::dbc::channels(std::slice::from_ref(&frame), dbc).unwrap();
    let values: Vec<f64> = found.groups[0].channels.iter().map(|c| c.values[0]).collect();
    assert_eq!(
        values,
        [f64::from(0xABC), 0.5 * f64::from(0xABC - 0x1000) + 1.0, -2.0]
    );
    assert_eq!(found.groups[0].channels[1].unit, "deg");
    let short = CandumpFrame {
        data: vec![0x0A],
        ..frame
    };
    let error = formats::dbc::channels(&[short], dbc).unwrap_err().to_string();
    assert_eq!(error, "line 1: frame 100 has 1 bytes, too few for Big");
}
