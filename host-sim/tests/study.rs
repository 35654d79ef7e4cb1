//! `host-sim study` as a laboratory treats it: killed at any instant, run again, a person's drive brought in. Nothing recorded
//! changes.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

const STUDY: &str = "
name = \"reliance\"
[scenario]
course = \"course.toml\"
[[condition]]
name = \"manual\"
scenario = { condition = \"manual\" }
[[condition]]
name = \"guided\"
[[participant]]
name = \"P01\"
published = 2
[[participant]]
name = \"P02\"
driver = { t_p_s = 0.2, remnant_sd_nm = 0.05 }
[[participant]]
name = \"anna\"
person = true
";
const COURSE: &str =
    "lane_width_m = 3.6\n[[segment]]\nlength_m = 150\n[[segment]]\nlength_m = 300\ncurvature_per_m = 0.002\n";
/// What a person might leave: the lab writes the same columns.
const PERSON: &str = "course = \"course.toml\"\nseed = 9\n[driver]\nt_p_s = 0.25\nremnant_sd_nm = 0.1\n";

fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    command.args(arguments).current_dir(folder);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn host_sim(folder: &Path, arguments: &[&str]) -> Output {
    command(folder, arguments).output().unwrap()
}

fn done(folder: &Path, arguments: &[&str]) -> String {
    let output = host_sim(folder, arguments);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {error}");
    String::from_utf8(output.stdout).unwrap()
}

fn refused(folder: &Path, arguments: &[&str], says: &str) {
    let output = host_sim(folder, arguments);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.code() == Some(2) && error.contains(says),
        "{arguments:?}: {error}"
    );
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [
        ("study.toml", STUDY),
        ("course.toml", COURSE),
        ("person.toml", PERSON),
    ] {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

/// Every file below a directory, by its path.
fn files(below: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(below).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path));
        } else {
            found.insert(path.clone(), fs::read(&path).unwrap());
        }
    }
    found
}

/// The files below a directory, by their paths from there.
fn contents(below: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let from = |(path, bytes): (PathBuf, Vec<u8>)| (path.strip_prefix(below).unwrap().to_owned(), bytes);
    files(below).into_iter().map(from).collect()
}

#[test]
fn killed_at_any_instant_it_leaves_the_sessions_of_an_undisturbed_one() {
    let folder = folder();
    let at = folder.path();
    done(at, &["study", "study.toml", "--out", "whole"]);
    for kill in 0..8 {
        let mut child = command(at, &["study", "study.toml", "--out", "killed"])
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(10 + 25 * kill));
        // A child that was done before is one kill less.
        let _ = child.kill();
        child.wait().unwrap();
    }
    done(at, &["study", "study.toml", "--out", "killed"]);
    let whole = contents(&at.join("whole/sessions"));
    assert_eq!(whole.len(), 12, "four sessions of three files");
    let mut killed = contents(&at.join("killed/sessions"));
    // What a kill leaves of a session under way is in a hidden directory and is no session.
    killed.retain(|path, _| !path.to_string_lossy().contains(".unfinished"));
    assert!(killed == whole);
    for name in ["sessions.csv", "results.json"] {
        assert_eq!(
            fs::read(at.join("killed").join(name)).unwrap(),
            fs::read(at.join("whole").join(name)).unwrap()
        );
    }
}

#[test]
fn a_stored_scenario_drives_the_session_again() {
    let folder = folder();
    let at = folder.path();
    done(at, &["study", "study.toml", "--out", "out"]);
    let session = at.join("out/sessions/P02/1-guided");
    done(&session, &["run", "scenario.toml", "--out", "again"]);
    let again = fs::read(session.join("again/run.csv")).unwrap();
    assert!(again == fs::read(session.join("drive.csv")).unwrap());
}

#[test]
fn a_persons_drive_comes_in_once() {
    let folder = folder();
    let at = folder.path();
    done(at, &["run", "person.toml", "--out", "person"]);
    let import = "anna/guided=person/run.csv";
    let arguments = ["study", "study.toml", "--out", "out", "--import", import];
    refused(
        at,
        &[
            "study",
            "study.toml",
            "--out",
            "out",
            "--import",
            "anna/manual=person/run.csv",
        ],
        "anna/manual: person/run.csv: driven with guidance",
    );
    let printed = done(at, &arguments);
    assert!(
        printed.contains("1 sessions wait for a person: --import anna/manual=FILE.csv"),
        "{printed}"
    );
    let before = files(&at.join("out/sessions"));
    refused(
        at,
        &arguments,
        "anna/2-guided is recorded already, and nothing recorded is overwritten",
    );
    let json = done(at, &["study", "study.toml", "--out", "out", "--json"]);
    assert!(files(&at.join("out/sessions")) == before);
    let results: serde_json::Value = serde_json::from_str(&json).unwrap();
    let sources: Vec<_> = results["sessions"]
        .as_array()
        .unwrap()
        .iter()
        .map(|session| session["recorded"]["source"].as_str().unwrap_or("-"))
        .collect();
    assert_eq!(
        sources,
        [
            "simulated",
            "simulated",
            "simulated",
            "simulated",
            "-",
            "imported"
        ]
    );
    // Another study in the same place is refused, and nothing is driven.
    fs::write(
        at.join("other.toml"),
        STUDY.replace("t_p_s = 0.2,", "t_p_s = 0.3,"),
    )
    .unwrap();
    refused(
        at,
        &["study", "other.toml", "--out", "out"],
        "P02/1-guided: recorded with another scenario or seed",
    );
    assert!(files(&at.join("out/sessions")) == before);
    refused(
        at,
        &["study", "study.toml", "--import", "anna"],
        "no PARTICIPANT/CONDITION=FILE",
    );
}
