//! Recordings of others on the command line: a clock that was set, other names, units and separators, Parquet.

use std::fmt::Write;
use std::path::Path;

use serde_json::Value;

use crate::host_sim;

const LOG: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../tests/data/driver-logs/guided-probe-clean.csv"
);

/// The rows of the log as numbers, without its heading.
fn rows() -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(LOG).unwrap();
    let lines = text.lines().filter(|line| !line.starts_with('#')).skip(1);
    lines
        .map(|line| line.split(',').map(|field| field.parse().unwrap()).collect())
        .collect()
}

fn identified(directory: &Path, arguments: &[&str]) -> Value {
    let output = host_sim(directory, &[&["identify", "--json"], arguments].concat());
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {said}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// A logger that gets the date in row 5000: every command says where, and what to do; and that is done.
#[test]
fn a_clock_that_was_set_is_refused_with_its_line_and_one_side_is_used() {
    let directory = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(LOG).unwrap();
    let mut set_at = String::new();
    let mut jumped = String::new();
    for (line, content) in (1..).zip(text.lines()) {
        let content = match content.split_once(',') {
            Some((time_s, rest)) if line >= 5000 => {
                let time_s = time_s.parse::<f64>().unwrap() + 1.7e9;
                if line == 5000 {
                    set_at = format!("to {time_s} s");
                }
                format!("{time_s},{rest}")
            }
            _ => content.to_owned(),
        };
        writeln!(jumped, "{content}").unwrap();
    }
    std::fs::write(directory.path().join("log.csv"), jumped).unwrap();
    for arguments in [&["identify", "log.csv"][..], &["drivers", "log.csv", "log.csv"]] {
        let output = host_sim(directory.path(), arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains("log.csv: line 5000: the time goes from "), "{said}");
        assert!(said.contains(&set_at) && said.contains("--to "), "{said}");
    }
    let output = host_sim(
        directory.path(),
        &["convert", "log.csv", "out.csv", "--rate", "100"],
    );
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(
        said.contains("log.csv: channel e_y_m: its time goes from ") && said.contains(&set_at),
        "{said}"
    );
    assert!(!directory.path().join("out.csv").exists());
    let first_s = rows()[0][0];
    let to = format!("{}", first_s + 30.0);
    let of_part = identified(directory.path(), &["log.csv", "--to", &to]);
    let of_whole = identified(directory.path(), &[LOG, "--to", &to]);
    // The mean rate of the shorter record may move the last row of the grid.
    let count = |of: &Value| of["rows"].as_i64().unwrap();
    assert!((count(&of_part) - count(&of_whole)).abs() <= 1 && count(&of_part) > 3000);
}

/// The same drive as a table of another tool: semicolons, units in brackets, another name for the speed.
#[test]
fn names_units_and_separators_of_others_are_read() {
    let directory = tempfile::tempdir().unwrap();
    let degrees = 180.0 / std::f64::consts::PI;
    let mut table =
        String::from("time_s;e_y_m;e_theta_rad;Wheel [deg];guidance_torque_nm;T_d (Nm);Speed [km/h]\n");
    for (k, row) in rows().iter().enumerate() {
        let [time_s, e_y, e_theta, wheel, guidance, torque] = row[..6] else {
            panic!("{row:?}");
        };
        let kmh = if k % 2 == 0 { 72.0 } else { 90.0 };
        writeln!(
            table,
            "{time_s};{e_y};{e_theta};{};{guidance};{torque};{kmh}",
            wheel * degrees
        )
        .unwrap();
    }
    std::fs::write(directory.path().join("bench.csv"), table.replace(';', "\t")).unwrap();
    std::fs::write(directory.path().join("bench2.csv"), table).unwrap();
    let maps = [
        "--map",
        "wheel_angle_rad=Wheel [deg]",
        "--map",
        "driver_torque_nm=T_d (Nm)",
        "--map",
        "speed_m_per_s=Speed",
    ];
    let own = identified(directory.path(), &[LOG]);
    for file in ["bench.csv", "bench2.csv"] {
        let found = identified(directory.path(), &[&[file], &maps[..]].concat());
        let k_hg = |results: &Value| results["parameters"]["k_hg"]["optimum"].as_f64().unwrap();
        assert!((k_hg(&found) / k_hg(&own) - 1.0).abs() < 1e-4, "{file}");
        let reading = found["preflight"]["reading"].to_string();
        assert!(reading.contains("20.0 to 25.0 m/s"), "{file}: {reading}");
    }
    let output = host_sim(
        directory.path(),
        &["identify", "bench.csv", "--map", "speed=Speed"],
    );
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        said.contains("--map speed=Speed: \"speed\" is none of time_s, "),
        "{said}"
    );
    assert!(said.contains("speed_m_per_s"), "{said}");
}

/// As polars writes it by default.
#[test]
fn a_parquet_file_of_polars_is_listed_with_its_units() {
    let directory = tempfile::tempdir().unwrap();
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../tests/data/parquet/polars-zstd.parquet"
    );
    let output = host_sim(directory.path(), &["convert", file, "--json"]);
    let channels: Value = serde_json::from_slice(&output.stdout).unwrap();
    let listed: Vec<(&str, &str, u64)> = channels["channels"]
        .as_array()
        .unwrap()
        .iter()
        .map(|c| {
            (
                c["name"].as_str().unwrap(),
                c["unit"].as_str().unwrap(),
                c["samples"].as_u64().unwrap(),
            )
        })
        .collect();
    assert_eq!(
        listed,
        [
            ("Torque [Nm]", "Nm", 60),
            ("count", "", 60),
            ("gap", "", 54),
            ("stamp", "us", 60)
        ]
    );
}
