//! Tables of others at their edges: what is read, and what is left out in words. The files `kinds` were made with pyarrow, SciPy and
//! asammdf; unless it is said otherwise, the numbers are those that pyarrow, SciPy, asammdf or Python's csv read in the same file.

#![cfg(all(feature = "mdf", feature = "parquet"))]

use std::path::Path;

use haptic_log::formats::{self, Contents, Format, Reading};
use haptic_log::recording::{Group, Recording, Series, Term};

fn read_timed(name: &str, time: Option<&str>) -> Result<Recording, String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/data/tables")
        .join(name);
    let time: Option<Term> = time.map(|time| time.parse().unwrap());
    let reading = Reading {
        time: time.as_ref(),
        only: None,
    };
    of(formats::read_bytes(
        std::fs::read(&path).unwrap(),
        Format::from_path(&path).unwrap(),
        reading,
    ))
}

fn read(name: &str) -> Recording {
    read_timed(name, None).unwrap()
}

fn csv(text: &str) -> Result<Recording, String> {
    of(formats::read_bytes(text.into(), Format::Csv, Reading::default()))
}

fn of(read: Result<Contents, haptic_log::recording::RecordingError>) -> Result<Recording, String> {
    match read.map_err(|e| e.to_string())? {
        Contents::Channels(recording) => Ok(recording),
        Contents::Frames(_) => Err("frames".into()),
    }
}

/// The values of a channel.
fn values<'a>(recording: &'a Recording, name: &str) -> &'a [f64] {
    &recording.find(name).unwrap().1.values
}

fn names(recording: &Recording) -> Vec<String> {
    recording.table().into_iter().map(|line| line.name).collect()
}

fn notes(recording: &Recording) -> Vec<String> {
    recording.notes.iter().map(ToString::to_string).collect()
}

fn same(found: &[f64], expected: &[f64]) -> bool {
    let equal = |(a, b): (&f64, &f64)| a == b || a.is_nan() && b.is_nan();
    found.len() == expected.len() && found.iter().zip(expected).all(equal)
}

#[test]
fn a_conversion_with_texts_and_a_default_converts_the_numbers() {
    let found = read("partial.mf4");
    let torque = values(&found, "driver_torque_nm");
    assert_eq!(
        (torque.len(), torque[1], torque[199]),
        (200, 0.001_000_000_000_000_112, 0.199_000_000_000_000_07)
    );
    assert_eq!(found.find("driver_torque_nm").unwrap().1.unit, "N.m");
}

#[test]
fn floats_of_16_bits_are_numbers() {
    let found = read("half.mf4");
    let torque = values(&found, "torque_half");
    assert_eq!(
        [torque[0], torque[1], torque[50], torque[199]],
        [1.0, 1.000_976_562_5, 1.049_804_687_5, 1.199_218_75]
    );
}

#[test]
fn rows_behind_the_cycle_count_are_left_out_and_counted() {
    let found = read("cycles.mf4");
    let torque = values(&found, "torque");
    assert_eq!((torque.len(), torque[119]), (120, 119.0));
    assert_eq!(
        notes(&found),
        ["80 rows left out: behind the 120 rows that its group has, the first in a group without a name"]
    );
}

#[test]
fn formulas_and_arrays_of_mdf_are_left_out_by_name() {
    for (file, name, why) in [
        ("algebraic.mf4", "speed_m_per_s", "formula"),
        ("array.mf4", "lane_coeffs", "array"),
    ] {
        let found = read(file);
        assert_eq!(names(&found), ["x"]);
        assert_eq!(notes(&found), [format!("1 channel ({name}) left out: {why}")]);
        let error = found.find(name).unwrap_err().to_string();
        assert_eq!(
            error,
            format!("there is no channel {name}: it was left out ({why})")
        );
    }
}

/// Ranges by the standard: 0 to 4 is -1, 5 to 9 is 2.5, all else 7 (asammdf's own evaluation is off by a code). A code with a
/// name alone stays a code.
#[test]
fn kinds_of_mdf_are_read_or_named() {
    let found = read("kinds.mf4");
    let ranges: Vec<f64> = (0..20)
        .map(|k| {
            if k < 5 {
                -1.0
            } else if k < 10 {
                2.5
            } else {
                7.0
            }
        })
        .collect();
    assert_eq!(values(&found, "ranges"), ranges);
    assert_eq!(values(&found, "sna"), (0..20).map(f64::from).collect::<Vec<_>>());
    assert_eq!(
        values(&found, "half"),
        (0..20).map(|k| 0.25 * f64::from(k)).collect::<Vec<_>>()
    );
    let holes: Vec<f64> = (0..20)
        .map(|k| if k % 6 == 2 { f64::NAN } else { 1.5 * f64::from(k) })
        .collect();
    assert!(
        same(values(&found, "holes"), &holes),
        "{:?}",
        values(&found, "holes")
    );
    assert_eq!(
        values(&found, "count"),
        (0..20).map(f64::from).collect::<Vec<_>>()
    );
    assert_eq!(
        values(&found, "level"),
        (0..20).map(|k| 0.5 * f64::from(k)).collect::<Vec<_>>()
    );
    assert_eq!(notes(&found), ["1 channel (word) left out: text"]);
}

/// Without a time that is named, `time_s` decides; the longest vector of longer.mat is none of the drive.
#[test]
fn the_time_decides_which_vectors_of_matlab_are_channels() {
    let both = read("both.mat");
    assert_eq!(names(&both), ["speed"]);
    assert_eq!(values(&both, "speed")[999], -0.535_603_334_614_291_3);
    assert_eq!(
        notes(&both),
        ["1 channel (lane20hz) left out: other length than the 1000 values of the time"]
    );
    let longer = read_timed("longer.mat", Some("t")).unwrap();
    assert_eq!(names(&longer), ["speed", "torque"]);
    assert_eq!(values(&longer, "torque")[999], -0.844_469_696_288_772_3);
    assert_eq!(longer.groups[0].time_s[999], 9.99);
    let error = longer.find("calib").unwrap_err().to_string();
    assert!(
        error.contains("it was left out (other length than the 1000"),
        "{error}"
    );
    let kinds = read_timed("kinds.mat", Some("t [s]")).unwrap();
    assert_eq!(names(&kinds), ["torque"]);
    assert_eq!(
        notes(&kinds),
        [
            "3 channels (z, names, cube) left out: array, cell, object or complex numbers",
            "1 channel (note) left out: text",
            "1 channel (big) left out: array of more than 16 rows and columns",
            "1 channel (info) left out: struct",
            "1 channel (gain) left out: a single value, or none",
            "1 channel (slow) left out: other length than the 20 values of the time",
        ]
    );
    let seconds = |time| read_timed("longer.mat", Some(time)).map(|found| found.groups[0].time_s[999]);
    assert_eq!(seconds("t [ms]"), Ok(0.009_99));
    assert!(
        seconds("t [m]")
            .unwrap_err()
            .contains("its unit \"m\" is not known as one of s")
    );
}

/// Groups of one name whose channels have one name become names of their own; others keep theirs.
#[test]
fn groups_of_mdf_with_the_same_channels_are_told_apart() {
    let series = |name: &str, value: f64| Series {
        name: name.into(),
        values: vec![value; 3],
        ..Series::default()
    };
    let group = |name: &str, channels: Vec<Series>| Group {
        name: name.into(),
        ..Group::new(vec![0.0, 1.0, 2.0], channels)
    };
    let groups = vec![
        group("", vec![series("a", 1.0), series("b", 1.5)]),
        group("", vec![series("a", 2.0)]),
        group("ECU", vec![series("a", 3.0)]),
        group("ECU", vec![series("c", 4.0)]),
    ];
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("x.mf4");
    formats::write(&path, groups.into()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let found = of(formats::read_bytes(bytes, Format::Mdf4, Reading::default())).unwrap();
    assert_eq!(names(&found), ["group_1.a", "b", "group_2.a", "ECU.a", "c"]);
    for (name, value) in [("group_1.a", 1.0), ("group_2.a", 2.0), ("ECU.a", 3.0), ("c", 4.0)] {
        assert_eq!(values(&found, name), [value; 3], "{name}");
    }
    // A table has every channel by a name of its own.
    let text = String::from_utf8(formats::to_csv(found).unwrap()).unwrap();
    assert!(
        text.starts_with("time_s,group_1.a,b,group_2.a,ECU.a,c\n"),
        "{text}"
    );
}

/// MATLAB's own workspace of functions is a variable without a name.
#[test]
fn a_variable_of_matlab_without_a_name_is_counted() {
    fn element(kind: u8, contents: &[u8]) -> Vec<u8> {
        let mut bytes = vec![kind, 0, 0, 0];
        bytes.extend((contents.len() as u32).to_le_bytes());
        bytes.extend_from_slice(contents);
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes
    }
    let variable = |name: &str, values: [f64; 2]| {
        let numbers: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        let parts = [
            element(6, &[6, 0, 0, 0, 0, 0, 0, 0]),
            element(5, &[2, 0, 0, 0, 1, 0, 0, 0]),
            element(1, name.as_bytes()),
            element(9, &numbers),
        ];
        element(14, &parts.concat())
    };
    let mut file = vec![b' '; 124];
    file.extend([0, 1, b'I', b'M']);
    file.extend(variable("time_s", [0.0, 1.0]));
    file.extend(variable("", [5.0, 6.0]));
    file.extend(variable("torque", [7.0, 8.0]));
    let found = of(formats::read_bytes(file, Format::Mat, Reading::default())).unwrap();
    assert_eq!(names(&found), ["torque"]);
    assert_eq!(values(&found, "torque"), [7.0, 8.0]);
    assert_eq!(notes(&found), ["1 channel left out: without a name, in byte 208"]);
}

/// pandas reads whole numbers of more than 64 bits as texts, and with them the whole column.
#[test]
fn large_and_small_numbers_are_written_with_an_exponent() {
    let numbers = [16_366_960_556_931_777_377.0, -1.9e218, 3e-300, 1e15, 0.1, -0.0];
    let time_s = (0..6).map(f64::from).collect();
    let series = Series {
        name: "a".into(),
        values: numbers.to_vec(),
        ..Series::default()
    };
    let text = formats::to_csv(Recording::of(Group::new(time_s, vec![series]))).unwrap();
    let text = String::from_utf8(text).unwrap();
    let written: Vec<&str> = text.lines().skip(1).map(|line| &line[2..]).collect();
    let expected = [
        "1.6366960556931777e19",
        "-1.9e218",
        "3e-300",
        "1000000000000000",
        "0.1",
        "-0",
    ];
    assert_eq!(written, expected);
    assert_eq!(values(&csv(&text).unwrap(), "a"), numbers);
}

/// Two columns of one name are no channel, for neither is known to be the one that is meant.
#[test]
fn a_column_that_is_there_twice_is_refused_where_it_is_asked_for() {
    let found = csv("time_s,a,b,a\n0,1,2,3\n1,1,2,3\n").unwrap();
    assert_eq!(
        found.find("a").unwrap_err().to_string(),
        "channel a is there twice"
    );
    assert_eq!(names(&found), ["a", "b", "a"]);
    assert_eq!(values(&found, "b"), [2.0, 2.0]);
    assert_eq!(
        formats::to_csv(found).unwrap_err().to_string(),
        "channel a is there twice"
    );
    let twice = csv("time_s,a,time_s\n0,1,0\n1,1,1\n").unwrap_err();
    assert_eq!(twice, "channel time_s is there twice");
    // Who names the time means the first one, and the recording says so.
    let time = "t".parse().unwrap();
    let reading = Reading {
        time: Some(&time),
        ..Reading::default()
    };
    let found = of(formats::read_bytes(
        "t,a,t\n5,1,0\n6,2,1\n".into(),
        Format::Csv,
        reading,
    ))
    .unwrap();
    assert_eq!(
        (&found.groups[0].time_s[..], names(&found)),
        (&[5.0, 6.0][..], vec!["a".to_owned()])
    );
    assert!(
        notes(&found)[0].contains("first of this name"),
        "{:?}",
        notes(&found)
    );
    // Their units tell them apart, and stand in the heading once.
    let text = "time_s,a [m],a [deg]\n0,1,2\n1,1,2\n";
    assert_eq!(formats::to_csv(csv(text).unwrap()).unwrap(), text.as_bytes());
}

#[test]
fn decimals_halves_and_structs_of_parquet_are_numbers() {
    let found = read("decimal.parquet");
    assert_eq!(values(&found, "decimal_torque_nm")[1], 0.01);
    assert_eq!(values(&found, "decimal_torque_nm")[2999], -0.99);
    assert_eq!(values(&found, "half_torque_nm")[1], 0.010_002_136_230_468_75);
    assert_eq!(
        notes(&found),
        ["1 channel (decimal_torque_nm) converted: decimal to float"]
    );
    let found = read("structs.parquet");
    assert_eq!(names(&found), ["lane.e_y", "lane.e_theta"]);
    assert_eq!(values(&found, "lane.e_y")[2999], -0.989_524_711_713_764_8);
}

#[test]
fn kinds_of_parquet_are_read_or_named() {
    let found = read_timed("kinds.parquet", Some("stamp")).unwrap();
    // 2025-11-10 10:00 UTC, 20 rows a second.
    let time_s = &found.groups[0].time_s;
    assert!(
        time_s
            .iter()
            .enumerate()
            .all(|(k, t)| (t - 1_762_768_800.0 - 0.05 * k as f64).abs() < 1e-6),
        "{time_s:?}"
    );
    let each = |value: fn(i32) -> f64| (0..20).map(value).collect::<Vec<_>>();
    assert!(same(values(&found, "small"), &each(|k| f64::from(k - 5) / 100.0)));
    assert!(same(
        values(&found, "wide"),
        &each(|k| if k % 4 == 0 {
            f64::NAN
        } else {
            f64::from(k - 5) / 1000.0
        })
    ));
    let half = values(&found, "half");
    assert!(
        half[0].is_nan() && half[1] == -0.899_902_343_75 && half[4] == -0.600_097_656_25,
        "{half:?}"
    );
    assert!(same(
        values(&found, "pose.x"),
        &each(|k| if k == 3 { f64::NAN } else { 0.5 * f64::from(k) })
    ));
    let y = each(|k| {
        if [3, 4].contains(&k) {
            f64::NAN
        } else {
            f64::from(2 * k)
        }
    });
    assert!(same(values(&found, "pose.at.y"), &y));
    assert_eq!(values(&found, "clock")[1], 36_000_050_000.0);
    assert_eq!(
        notes(&found),
        [
            "2 channels (small, wide) converted: decimal to float",
            "1 channel (points.list.element) left out: array",
            "1 channel (mode) left out: text or bytes",
            "1 channel (day) left out: date without a time of day",
        ]
    );
}

#[test]
fn csv_of_others_has_as_many_rows_as_python_counts() {
    for (file, rows, name, there) in [
        ("none.csv", 1500, "e_y_m", 1480),
        ("lonecr.csv", 40, "e_y_m", 40),
        ("cr.csv", 1500, "e_theta_rad", 1500),
        ("sep.csv", 1500, "e_y_m", 1500),
    ] {
        let found = read(file);
        assert_eq!(found.groups[0].time_s.len(), rows, "{file}");
        let samples = found
            .table()
            .into_iter()
            .find(|line| line.name == name)
            .map(|line| line.samples);
        assert_eq!(samples, Some(there), "{file}");
        assert_eq!(notes(&found), [""; 0], "{file}");
    }
    let found = read_timed("iso.csv", Some("time")).unwrap();
    // `date -u -d '2025-11-10 10:00:14.990' +%s.%N`
    assert_eq!(found.groups[0].time_s[1499], 1_762_768_814.99);
    assert_eq!(
        notes(&found),
        ["1 channel (time) converted: date and time as text, to seconds since 1970, UTC if no zone is said"]
    );
}

#[test]
fn texts_among_numbers_leave_their_column_out_with_the_line() {
    let text = "time_s,mode,torque,flag,comma\n0,on,1.5,True,\"1,5\"\n# pause\n0.1,off,none,False,\"2,5\"\n0.2,on,bad,True,\"3,5\"\n";
    let found = csv(text).unwrap();
    assert_eq!(names(&found), ["flag"]);
    assert_eq!(values(&found, "flag"), [1.0, 0.0, 1.0]);
    let error = |name| found.find(name).unwrap_err().to_string();
    assert_eq!(error("mode"), "there is no channel mode: it was left out (text)");
    assert_eq!(
        error("torque"),
        "line 5: torque is \"bad\", which is not a number"
    );
    let comma = "line 2: comma is \"1,5\", which is not a number: the decimal sign is a point";
    assert_eq!(error("comma"), comma);
    let nothing = csv("time_s,mode\n0,on\n1,off\n").unwrap_err();
    assert_eq!(
        nothing,
        "there is no channel with a number in it (1 channel (mode) left out: text)"
    );
}

/// No stamps that wrap, repeat, stand still or are deltas are taken as they are, whatever the format.
#[test]
fn stamps_that_do_not_grow_are_refused() {
    let table = |stamp: fn(u32) -> f64| {
        (0..900)
            .map(|k| format!("{},{k}\n", stamp(k)))
            .collect::<String>()
    };
    for (stamp, says) in [
        (
            (|k| f64::from(k % 600) * 0.1) as fn(u32) -> f64,
            "line 602: the time goes from 59.900000000000006 to 0 s",
        ),
        (|k| f64::from(k / 10), "line 3: the time goes from 0 to 0 s"),
        (|_| 5.0, "line 3: the time goes from 5 to 5 s"),
        (
            |k| 0.01 + f64::from(k % 3) * 1e-5,
            "line 4: the time goes from 0.01001 to 0.01002 s",
        ),
    ] {
        let text = format!("time_s,a\n{}", table(stamp));
        match csv(&text) {
            Err(error) if says.starts_with("line 4") => assert!(error.contains("from row to row"), "{error}"),
            Err(error) => assert!(error.starts_with(says), "{error}"),
            Ok(_) => panic!("{says}"),
        }
    }
}
