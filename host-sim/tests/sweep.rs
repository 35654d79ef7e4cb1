//! `host-sim sweep` as a cluster treats it: killed at any instant, in parts, on several threads. The table is the same
//! bytes in the end.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use crate::host_sim;

const SWEEP: &str = "
samples = 200
design = \"sobol\"
limit = 0.3

[scenario.failure]
kind = \"torque\"
[scenario.course]
name = \"one curve\"
lane_width_m = 3.6
segment = [{ length_m = 60.0 }, { length_m = 140.0, curvature_per_m = 0.003 }]

[vary]
\"driver.t_p_s\" = { uniform = [0.1, 0.5] }
\"driver.remnant_sd_nm\" = { uniform = [0.0, 0.1] }
place = { uniform = [50, 120], fields = [\"failure.time_s\"], over = \"speed_m_per_s\" }
speed_m_per_s = { uniform = [11, 22] }
";

fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    command
        .arg("sweep")
        .arg("sweep.toml")
        .args(arguments)
        .current_dir(folder);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn sweep(folder: &Path, arguments: &[&str]) -> Output {
    let output = command(folder, arguments).output().unwrap();
    assert!(
        output.status.success(),
        "{arguments:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    output
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("sweep.toml"), SWEEP).unwrap();
    folder
}

fn files(folder: &Path, out: &str) -> Vec<Vec<u8>> {
    let names = [
        "drives.csv",
        #[cfg(feature = "parquet")]
        "drives.parquet",
        "summary.json",
        "sweep.toml",
    ];
    names
        .map(|name| fs::read(folder.join(out).join(name)).unwrap())
        .to_vec()
}

#[test]
fn killed_twenty_times_in_three_shards_it_gives_the_table_of_an_undisturbed_one() {
    let folder = folder();
    let at = folder.path();
    sweep(at, &["--out", "whole", "--threads", "1"]);
    let mut state: u64 = 1;
    for kill in 0..20 {
        let shard = format!("{}/3", kill % 3 + 1);
        let mut child = command(at, &["--out", "killed", "--threads", "2", "--shard", &shard])
            .spawn()
            .unwrap();
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        std::thread::sleep(Duration::from_millis(5 + (state >> 33) % 150));
        // SIGKILL; a child that was done before is one kill less.
        let _ = child.kill();
        child.wait().unwrap();
    }
    for shard in ["1/3", "2/3", "3/3"] {
        sweep(at, &["--out", "killed", "--shard", shard]);
    }
    assert_eq!(files(at, "killed"), files(at, "whole"));
    let left = fs::read_dir(at.join("killed/chunks")).unwrap();
    let left = left.filter(|entry| entry.as_ref().unwrap().path().extension().is_some());
    assert_eq!(left.count(), 0, "what kills left is tidied up");
}

#[test]
fn a_row_is_driven_again_by_one_command() {
    let folder = folder();
    let at = folder.path();
    let table = sweep(at, &["--out", "out", "--threads", "2"]);
    // The line that it prints does what it says, wherever the table lies.
    let table = String::from_utf8_lossy(&table.stdout).into_owned();
    let (_, line) = table
        .split_once("host-sim sweep ")
        .expect("a line to drive a row again");
    let line: Vec<&str> = line.lines().next().unwrap().split_whitespace().collect();
    let again = host_sim(at, &[&["sweep"], &line[..]].concat());
    assert_eq!(again.status.code(), Some(0));
    assert!(String::from_utf8_lossy(&again.stderr).contains("The same bits as in the table"));

    let csv = fs::read_to_string(at.join("out/drives.csv")).unwrap();
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), 201);
    let peak = rows[0]
        .iter()
        .position(|name| *name == "peak_lateral_error_m")
        .unwrap();
    let output = sweep(at, &["--out", "out", "--replay", "17", "--replay-out", "drive"]);
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains(rows[18][peak]), "{text}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("The same bits as in the table"));
    // The scenario that it wrote is one that `run` takes, and gives the same peak.
    let run = host_sim(at, &["run", "drive/scenario.toml", "--json"]);
    let json: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(
        json["peak_lateral_error_m"].as_f64().unwrap().to_string(),
        rows[18][peak]
    );
    // Another row in the table's place is noticed.
    let refused = command(at, &["--replay", "200"]).output().unwrap();
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("--replay = 200 is outside 0 to 199"));
}

#[test]
fn shards_that_begin_together_all_drive() {
    let folder = folder();
    for round in ["a", "b", "c"] {
        let shard = |i: u32| command(folder.path(), &["--out", round, "--shard", &format!("{i}/4")]).spawn();
        let children: Vec<_> = (1..=4).map(|i| shard(i).unwrap()).collect();
        for child in children {
            let output = child.wait_with_output().unwrap();
            assert!(
                output.status.success(),
                "{}",
                String::from_utf8_lossy(&output.stderr)
            );
        }
        assert!(folder.path().join(round).join("drives.csv").exists());
    }
}
