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

/// A drive is a table of another tool too: semicolons, units in brackets, another name for the speed.
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

/// The first command does not compile Parquet: it says how to have it.
#[test]
fn a_parquet_file_is_read_by_a_build_that_has_it() {
    let directory = tempfile::tempdir().unwrap();
    let output = host_sim(directory.path(), &["convert", "x.parquet"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(
        said.contains("--features full"),
        !cfg!(feature = "parquet"),
        "{said}"
    );
}

/// The file has what polars writes by default.
#[cfg(feature = "parquet")]
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

/// A drive of 12 s whose columns are called otherwise: degrees, milliseconds and km/h, by the names' brackets or by nothing.
fn foreign(directory: &Path) {
    let mut text = String::from("clock,lane,Heading,steer,tg,td,v,event\n");
    for k in 0..1200_u32 {
        let x = f64::from(k % 50) * 1e-3;
        writeln!(
            text,
            "{},{x},{},{x},{x},{},198,mark",
            10 * k,
            10.0 * x,
            f64::from(k % 7) * 0.1
        )
        .unwrap();
    }
    std::fs::write(directory.join("rec.csv"), text).unwrap();
}

const NAMES: [&str; 12] = [
    "--time",
    "clock [ms]",
    "--map",
    "e_y_m=lane",
    "--map",
    "e_theta_rad=Heading [deg]",
    "--map",
    "wheel_angle_rad=steer",
    "--map",
    "guidance_torque_nm=tg",
    "--map",
    "driver_torque_nm=td",
];

/// 10 ms, and 0.49 deg, which is 0.008552113334772215 rad.
#[test]
fn one_set_of_options_reads_a_recording_in_every_command() {
    let directory = tempfile::tempdir().unwrap();
    foreign(directory.path());
    let convert = [
        &["convert", "rec.csv", "out.csv", "--from", "1", "--to", "2"],
        &NAMES[..],
    ]
    .concat();
    let output = host_sim(directory.path(), &convert);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.contains("note: 1 channel (event) left out: text"), "{said}");
    let text = std::fs::read_to_string(directory.path().join("out.csv")).unwrap();
    let mut lines = text.lines();
    assert_eq!(
        lines.next(),
        Some("time_s,e_y_m,e_theta_rad,wheel_angle_rad,guidance_torque_nm,driver_torque_nm,v")
    );
    let rows: Vec<Vec<f64>> = lines
        .map(|line| line.split(',').map(|x| x.parse().unwrap()).collect())
        .collect();
    assert_eq!((rows.len(), rows[0][0], rows[100][0]), (101, 1.0, 2.0));
    assert!(
        (rows[49][2] - 0.008_552_113_334_772_215).abs() < 1e-15,
        "{}",
        rows[49][2]
    );

    let found = identified(
        directory.path(),
        &[&["rec.csv", "--map", "speed_kmh=v"], &NAMES[..]].concat(),
    );
    let notes = found["notes"].to_string();
    assert!(
        notes.contains("e_theta_rad is Heading [deg] times 0.01745"),
        "{notes}"
    );
    assert!(
        notes.contains("The speed goes up to 55.0 m/s, which is 198 km/h"),
        "{notes}"
    );

    let drivers = [&["drivers", "rec.csv", "rec.csv"], &NAMES[..]].concat();
    assert_eq!(host_sim(directory.path(), &drivers).status.code(), Some(0));
    for (wrong, says) in [
        (
            "e_theta_rad=Heading [parsec]",
            "rec.csv: channel Heading: its unit \"parsec\" is not known as one of rad",
        ),
        (
            "e_theta_rad=event",
            "rec.csv: there is no channel event: it was left out (text)",
        ),
        ("speed_m_per_s=v*0", "--map speed_m_per_s=v*0: the factor \"0\""),
    ] {
        let output = host_sim(
            directory.path(),
            &[
                "identify",
                "rec.csv",
                "--time",
                "clock [ms]",
                "--map",
                "e_y_m=lane",
                "--map",
                wrong,
            ],
        );
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && said.contains(says), "{said}");
    }
}

/// A name of 70 characters does not fit into a MAT file: what was there stays, and nothing lies beside it.
#[test]
fn a_file_that_cannot_be_written_stays_as_it_was() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(
        directory.path().join("long.csv"),
        format!("time_s,{}\n0,1\n1,2\n", "x".repeat(70)),
    )
    .unwrap();
    std::fs::write(directory.path().join("good.mat"), "good").unwrap();
    let output = host_sim(directory.path(), &["convert", "long.csv", "good.mat", "--force"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.code() == Some(2) && said.contains("at most 63 characters"),
        "{said}"
    );
    assert_eq!(
        std::fs::read_to_string(directory.path().join("good.mat")).unwrap(),
        "good"
    );
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 2);
}

#[test]
fn what_is_mistyped_or_empty_is_answered_with_what_is_meant() {
    let directory = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(directory.path().join(name), text).unwrap();
    write("condition.toml", "condition = 'hihg'\n");
    write("table.toml", "[drivr]\nk_hg = 0.3\n");
    write("field.toml", "[driver]\nk_gh = 0.3\n");
    write("both.toml", "speed_kmh = 60\nspeed_m_per_s = 16\n");
    write("empty", "");
    write("x.csv", "time_s\n0\n");
    for (arguments, says) in [
        (&["run", "condition.toml"][..], "did you mean high?"),
        (&["run", "table.toml"], "did you mean driver?"),
        (&["run", "field.toml"], "did you mean k_hg?"),
        (
            &["run", "both.toml"],
            "one of speed_m_per_s, speed_kmh and a table [speed]",
        ),
        (
            &["run", "empty"],
            "empty: it is empty; an empty scenario ends in .toml",
        ),
        (
            &["faults", "--rows", "driver-torque-frozn"],
            "did you mean driver-torque-frozen?",
        ),
        (&["faults", "--world", "breaking"], "did you mean braking?"),
        (&["identify", "x.csv", "--fix", "k_gh=1"], "did you mean k_hg?"),
        (
            &["identify", "x.csv", "--estimate", "t_nm"],
            "did you mean t_nms?",
        ),
        (
            &["identify", "x.csv", "--layout", "openpilt"],
            "did you mean openpilot?",
        ),
        (
            &["identify", "x.csv", "--map", "e_theta=Heading"],
            "did you mean e_theta_rad?",
        ),
        (
            &[
                "validate",
                "--corruptions",
                "1",
                "--only",
                "lame noise 10 mm, 1 mrad",
            ],
            "did you mean lane noise 10 mm, 1 mrad?",
        ),
        (
            &["validate", "--changes", "1", "--only", "K_d stps by half"],
            "did you mean K_d steps by half?",
        ),
    ] {
        let output = host_sim(directory.path(), arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(
            output.status.code() == Some(2) && said.contains(says),
            "{arguments:?}: {said}"
        );
    }
}

/// e_y and e_theta of a simulator's own offset, heading error and curvature, held against those of the simulated run: the lane is
/// taken as an arc, and the heading error is that of the movement, which differs by the side slip.
#[test]
fn a_driving_simulators_own_signals_make_the_drivers_points() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(
        directory.path().join("drive.toml"),
        "seed = 5\n[driver]\nremnant_sd_nm = 0.1\n",
    )
    .unwrap();
    let layout = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../examples/layouts/driving-simulator.toml"
    );
    host_sim(directory.path(), &["run", "drive.toml", "--out", "run"]);
    let output = host_sim(
        directory.path(),
        &["convert", "run/run.csv", "points.csv", "--layout", layout],
    );
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let columns = |file: &str| {
        let text = std::fs::read_to_string(directory.path().join(file)).unwrap();
        let mut lines = text.lines();
        let names: Vec<String> = lines.next().unwrap().split(',').map(str::to_owned).collect();
        let place = |name: &str| names.iter().position(|own| own == name).unwrap();
        let wanted = [place("e_y_m"), place("e_theta_rad")];
        let row = |line: &str| wanted.map(|i| line.split(',').nth(i).unwrap().parse::<f64>().unwrap());
        lines.map(row).collect::<Vec<_>>()
    };
    let (truth, found) = (columns("run/run.csv"), columns("points.csv"));
    assert_eq!(truth.len(), found.len());
    let worst = |i: usize| {
        truth
            .iter()
            .zip(&found)
            .map(|(a, b)| (a[i] - b[i]).abs())
            .fold(0.0, f64::max)
    };
    let largest = |i: usize| truth.iter().map(|a| a[i].abs()).fold(0.0, f64::max);
    assert!(
        worst(0) < 0.002 && largest(0) > 0.1,
        "{} of {} m",
        worst(0),
        largest(0)
    );
    assert!(
        worst(1) < 0.01 && largest(1) > 0.05,
        "{} of {} rad",
        worst(1),
        largest(1)
    );
}
