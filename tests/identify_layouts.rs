//! Recordings in other people's layouts: those in tests/data/layouts, which tests/tools/make_layouts.py made of simulated drives, and
//! what can be wrong with them. The drivers are known: K_hg = 0.3, t_p = 0.2 s.

use std::path::{Path, PathBuf};

use haptic_analysis::identify::{
    DriveLog, Layout, Mapping, Options, Recording, identify_with_noise_model, open_mapped,
};

fn recording(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data/layouts")
        .join(name)
}

fn read(path: &Path, layout: &str, manual: bool, maps: &[&str]) -> Result<(DriveLog, Vec<String>), String> {
    let layout = Layout::named(layout).unwrap();
    let maps: Vec<Mapping> = maps.iter().map(|map| map.parse().unwrap()).collect();
    let how = Recording {
        manual,
        ..Recording::default()
    };
    open_mapped(path, Some(&layout), &maps, &how).map_err(|e| e.to_string())
}

/// The recording of 160 s with other text in it.
fn spoiled(
    edit: impl Fn(&[String], usize, &mut Vec<String>),
    cut: Option<usize>,
) -> Result<DriveLog, String> {
    let text = std::fs::read_to_string(recording("openlka.csv")).unwrap();
    let mut lines = text
        .lines()
        .map(|line| line.split(',').map(String::from).collect::<Vec<_>>());
    let heading = lines.next().unwrap();
    let mut out = heading.join(",") + "\n";
    for (k, mut row) in lines.enumerate() {
        edit(&heading, k, &mut row);
        out += &(row.join(",") + "\n");
    }
    out.truncate(cut.unwrap_or(out.len()));
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("spoiled.csv");
    std::fs::write(&path, out).unwrap();
    read(&path, "openlka", false, &[]).map(|(log, _)| log)
}

/// Scales a column.
fn times(column: &str, factor: f64) -> impl Fn(&[String], usize, &mut Vec<String>) {
    let column = column.to_owned();
    move |heading, _, row| {
        let i = heading.iter().position(|name| *name == column).unwrap();
        row[i] = (row[i].parse::<f64>().unwrap() * factor).to_string();
    }
}

#[test]
fn what_is_shared_and_by_hand_is_told_apart_and_nothing_is_claimed_at_ten_hertz() {
    let path = recording("openlka.csv");
    let (shared, notes) = read(&path, "openlka", false, &[]).unwrap();
    assert!(
        (shared.dt_s - 0.1).abs() < 1e-4 && shared.len() == 1600,
        "{} {}",
        shared.dt_s,
        shared.len()
    );
    assert!(shared.driver_torque_nm[..990].iter().all(|t| t.is_finite()));
    assert!(shared.driver_torque_nm[1010..].iter().all(|t| t.is_nan()));
    assert!(
        notes.iter().any(|n| n.contains("OpenLKA") && n.contains("MIT")),
        "{notes:?}"
    );
    assert!(
        shared
            .findings
            .iter()
            .any(|f| f[0] == "by hand" && f[1] == "60.0 s"),
        "{:?}",
        shared.findings
    );
    // Ten rows a second tell nothing for certain; the optimum is the driver's all the same.
    let fit = identify_with_noise_model(&shared, &Options::default());
    assert!(fit.refuted.is_empty(), "{:?}", fit.refuted);
    assert!(fit.parameters.list().iter().all(|(.., p)| !p.identified));
    assert!(
        fit.assumed
            .iter()
            .any(|a| a.contains("0.100 s apart, so nothing is called identified")),
        "{:?}",
        fit.assumed
    );
    let k_hg = fit.parameters.k_hg.optimum.unwrap();
    assert!((k_hg - 0.3).abs() < 0.1, "{k_hg}");
    let (by_hand, _) = read(&path, "openlka", true, &[]).unwrap();
    assert!(by_hand.driver_torque_nm[..990].iter().all(|t| t.is_nan()));
}

#[test]
fn the_other_layouts_are_read_or_say_what_their_recordings_lack() {
    let (log, notes) = read(&recording("openpilot.csv"), "openpilot", false, &[]).unwrap();
    assert_eq!(log.len(), 300);
    assert!(notes.iter().any(|n| n.contains("untested")), "{notes:?}");
    let sadc = recording("sadc.csv");
    let error = read(&sadc, "sadc", true, &[]).unwrap_err();
    assert!(error.contains("time_s is not given"), "{error}");
    let (log, _) = read(&sadc, "sadc", true, &["time_s=frame_nr*0.05"]).unwrap();
    assert_eq!(log.len(), 240);
    for (file, layout, lacks) in [
        ("udacity.csv", "udacity", "lack the lane"),
        (
            "cognitive-driver-model.mat",
            "cognitive-driver-model",
            "lack the driver's torque and the lane",
        ),
    ] {
        let error = read(&recording(file), layout, true, &[]).unwrap_err();
        assert!(
            error.contains("240 rows of 1") && error.contains(lacks),
            "{error}"
        );
    }
}

#[test]
fn a_file_that_is_cut_says_so_and_one_that_lacks_a_column_is_refused() {
    let nothing = |_: &[String], _: usize, _: &mut Vec<String>| {};
    // The last row is cut in its fields: it is left out, and said to be.
    let log = spoiled(nothing, Some(60_000)).unwrap();
    let is_said = |f: &[String; 3]| f[0] == "1 row" && f[2] == "cut";
    assert!(log.findings.iter().any(is_said), "{:?}", log.findings);
    let text = std::fs::read_to_string(recording("openlka.csv")).unwrap();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("lacks.csv");
    std::fs::write(&path, text.replacen("op_left_laneline", "left", 1)).unwrap();
    let error = read(&path, "openlka", false, &[]).unwrap_err();
    assert!(error.contains("there is no channel op_left_laneline"), "{error}");
}

#[test]
fn the_wrong_torque_column_counts_and_swapped_units_are_refused() {
    let error = read(
        &recording("openlka.csv"),
        "openlka",
        false,
        &["driver_torque_nm=steer_torque_driver"],
    );
    assert!(
        error
            .unwrap_err()
            .contains("steer_torque_driver: it is decoded wrongly")
    );
    let wrong = |heading: &[String], _: usize, row: &mut Vec<String>| {
        let at = |wanted: &str| heading.iter().position(|name| name == wanted).unwrap();
        row[at("op_state_steer_torque")] = row[at("steer_torque_driver")].clone();
    };
    let error = spoiled(wrong, None).unwrap_err();
    assert!(
        error.contains("driver_torque_nm is") && error.contains("outside -10 to 10"),
        "{error}"
    );
    for (column, factor, says) in [
        ("op_state_steer_torque", 100.0, "are these counts"),
        ("latOutput", 300.0, "share of the largest torque"),
        ("op_state_steer_angle", 0.0174533, "is the angle in radians"),
        ("op_state_steer_angle", -1.0, "is a sign swapped"),
        ("vEgo", 3.6001, "speed_m_per_s outside 8 to 60"),
        ("op_right_laneline", 100.0, "lane_width_m outside 2.2 to 6"),
        ("op_right_laneline", -1.0, "lane_width_m outside 2.2 to 6"),
    ] {
        let error = spoiled(times(column, factor), None).unwrap_err();
        assert!(error.contains(says), "{column} times {factor}: {error}");
    }
}

#[test]
fn time_that_runs_backwards_is_refused_and_two_drives_are_cut_at_their_joint() {
    let back = |_: &[String], k: usize, row: &mut Vec<String>| {
        if k >= 300 {
            row[0] = (90.0 + 0.1 * k as f64).to_string();
        }
    };
    let error = spoiled(back, None).unwrap_err();
    assert!(
        error.contains("line 302: the time goes from 129.9") && error.contains("must grow"),
        "{error}"
    );
    let glued = |heading: &[String], k: usize, row: &mut Vec<String>| {
        let speed = heading.iter().position(|name| name == "vEgo").unwrap();
        if k >= 300 {
            row[speed] = "25.0".into();
        }
    };
    let log = spoiled(glued, None).unwrap();
    assert!(log.driver_torque_nm[297..=303].iter().all(|t| t.is_nan()));
    assert!(log.driver_torque_nm[..296].iter().all(|t| t.is_finite()));
    assert!(
        log.findings
            .iter()
            .any(|f| f[0].contains("two drives in one file")),
        "{:?}",
        log.findings
    );
}
