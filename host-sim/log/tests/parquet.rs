//! Parquet as other tools write it: files of polars 1 and pyarrow, in the compressions and encodings that they choose.
//!
//! All hold the same 60 rows, made as the closures below say; the texts of `label` are no channel.

#![cfg(feature = "parquet")]

use haptic_log::formats::{self, Contents, Format, Reading};

/// Name, unit, and the value at a time.
type Column = (&'static str, &'static str, fn(f64) -> f64);

fn read(name: &str) -> Result<Contents, String> {
    let path = format!(
        "{}/../../tests/data/parquet/{name}.parquet",
        env!("CARGO_MANIFEST_DIR")
    );
    formats::read_bytes(std::fs::read(path).unwrap(), Format::Parquet, Reading::default())
        .map_err(|e| e.to_string())
}

#[test]
fn files_of_polars_and_pyarrow_are_read_in_every_usual_compression() {
    let columns: [Column; 4] = [
        ("Torque [Nm]", "Nm", |k| ((0.07 * k).sin() * 1e3).round() / 1e3),
        ("count", "", |k| (k / 10.0).floor()),
        ("gap", "", |k| {
            if k % 10.0 == 3.0 {
                f64::NAN
            } else {
                (k / 4.0).floor()
            }
        }),
        ("stamp", "us", |k| 1e4 * k),
    ];
    for name in [
        "polars-zstd",
        "pyarrow-gzip-v2",
        "pyarrow-lz4",
        "pyarrow-zstd-delta",
    ] {
        let Contents::Channels(found) = read(name).unwrap() else {
            panic!("{name}: no channels");
        };
        let group = &found.groups[0];
        assert_eq!((group.time_s.len(), group.channels.len()), (60, 4), "{name}");
        assert!(
            (0..60).all(|k| (group.time_s[k] - 0.01 * k as f64).abs() < 1e-12),
            "{name}"
        );
        for (channel, (called, unit, value)) in group.channels.iter().zip(columns) {
            assert_eq!(
                (channel.name.as_str(), channel.unit.as_str()),
                (called, unit),
                "{name}"
            );
            for (k, found) in channel.values.iter().enumerate() {
                let expected = value(k as f64);
                let same = (found - expected).abs() < 1e-9 || found.is_nan() && expected.is_nan();
                assert!(same, "{name}: {called}, row {k}: {found}, not {expected}");
            }
        }
        assert_eq!(found.find("Torque").unwrap().1.name, "Torque [Nm]");
    }
}

#[test]
fn a_compression_that_is_not_read_is_named_with_the_way_out() {
    let error = read("pyarrow-brotli").unwrap_err();
    assert!(error.starts_with("channel time_s: "), "{error}");
    assert!(
        error.contains("BROTLI, which is not read") && error.contains("to_parquet("),
        "{error}"
    );
}
