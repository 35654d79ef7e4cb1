//! Recordings in files: what is written is read again, and a damaged file is refused or read, never more.

#![cfg(feature = "formats")]

use std::cell::Cell;
use std::path::Path;

use haptic_log::bus::{BusFrame, Form};
use haptic_log::formats::{self, BusLog, Contents, Format, Reading};
use haptic_log::notes::Notes;
use haptic_log::recording::{Group, Recording, Series};
use proptest::prelude::*;

#[path = "../../../core/tests/cases.rs"]
mod cases;

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

fn frames() -> Vec<BusFrame> {
    let frame = |k: u32| BusFrame {
        line: 0,
        time_s: f64::from(k) * 1e-3,
        bus: ["can0", "can3"][k as usize % 2].into(),
        id: if k.is_multiple_of(7) {
            0x1234_5678
        } else {
            0x100 + k % 5
        },
        extended: k.is_multiple_of(7),
        form: match k % 3 {
            0 => Form::Fd {
                switched: k.is_multiple_of(2),
                passive: k.is_multiple_of(5),
            },
            _ => Form::Classic,
        },
        sent: k.is_multiple_of(4),
        data: (0..if k.is_multiple_of(9) { 64 } else { k as u8 % 9 }).collect(),
    };
    (0..2000).map(frame).collect()
}

const TABLES: &[&str] = &[
    "csv",
    "mat",
    #[cfg(feature = "mdf")]
    "mf4",
    #[cfg(feature = "parquet")]
    "parquet",
];
const BUSES: &[&str] = &["log", "asc", "blf"];

fn written(extension: &str) -> Vec<u8> {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join(format!("x.{extension}"));
    if BUSES.contains(&extension) {
        formats::write_frames(&path, &BusLog::of_frames(frames(), Notes::default())).unwrap();
    } else {
        formats::write(&path, recording()).unwrap();
    }
    std::fs::read(path).unwrap()
}

fn read(bytes: Vec<u8>, extension: &str) -> Result<Contents, String> {
    let format = Format::from_path(Path::new(&format!("x.{extension}"))).unwrap();
    let contents = formats::read_bytes(bytes, format, Reading::default()).map_err(|e| e.to_string())?;
    if let Contents::Frames(log) = &contents {
        log.each(&mut |_| Ok(())).map_err(|e| e.to_string())?;
    }
    Ok(contents)
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
        let Contents::Frames(log) = read(written(extension), extension).unwrap() else {
            panic!("{extension}: no frames");
        };
        let (found, notes) = log.frames().unwrap();
        assert!(notes.is_empty(), "{extension}: {notes:?}");
        // candump numbers its interfaces from 0, the others their channels from 1; candump -L says no direction.
        let of = |f: &BusFrame| {
            let is_text = *extension == "log";
            let bus = if is_text {
                f.bus.clone()
            } else {
                format!("can{}", f.bus.parse::<u8>().unwrap() - 1)
            };
            (
                (f.time_s * 1e6).round() as i64,
                f.id,
                f.extended,
                f.form,
                bus,
                !is_text && f.sent,
                f.data.clone(),
            )
        };
        let sent = |f: BusFrame| {
            let bus = if *extension == "log" {
                f.bus
            } else {
                (f.bus[3..].parse::<u8>().unwrap() + 1).to_string()
            };
            of(&BusFrame { bus, ..f })
        };
        let (found, sent): (Vec<_>, Vec<_>) = (
            found.iter().map(of).collect(),
            frames().into_iter().map(sent).collect(),
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
    let refused = Cell::new(0);
    for extension in TABLES.iter().chain(BUSES) {
        let whole = written(extension);
        let is_judged = |bytes: Vec<u8>| {
            if let Err(sentence) = read(bytes, extension) {
                refused.update(|count| count + 1);
                prop_assert!(!sentence.is_empty() && !sentence.contains('\n'), "{sentence:?}");
            }
            Ok(())
        };
        for length in (0..whole.len().min(3000)).step_by(10) {
            is_judged(whole[..length].to_vec()).unwrap();
        }
        let value = || prop_oneof![4 => prop::sample::select(&[0_u8, 1, 0x7F, 0xFF]), 1 => any::<u8>()];
        let damage = |below: usize| prop::collection::vec((0..below, value()), 1..=4);
        let damages = prop_oneof![damage(whole.len()), damage(whole.len().min(600))];
        println!("{extension}:");
        cases::cases(1, 1200, &damages, |damages| {
            let mut bytes = whole.clone();
            damages.into_iter().for_each(|(at, value)| bytes[at] = value);
            is_judged(bytes)
        });
    }
    assert!(
        refused.get() > 1000,
        "only {refused:?} files were found to be damaged"
    );
}
