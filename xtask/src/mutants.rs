//! What the core's tests would notice: a defect in each of its expressions. All of them take hours.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result, bail, ensure};

use crate::tool::{self, cargo};

/// Tests that must notice a defect in a file of core, or in the files of a folder, beside its own unit tests; the longest
/// name decides. A file without any has all tests, which takes long. What cannot be noticed is in `.cargo/mutants.toml`,
/// with its reason.
const TESTS: &[(&str, &[&str])] = &[
    ("bus/e2e", &["e2e", "edges", "dbc"]),
    ("bus/frame", &["frame", "dbc", "ecu", "e2e"]),
    ("bus/messages", &["dbc", "ecu"]),
    ("bus/messages/inputs", &["dbc", "ecu", "edges"]),
    ("bus/messages/outputs", &["dbc", "ecu", "attacks", "edges"]),
    ("bus/messages/service", &["dbc", "download", "attacks", "edges"]),
    ("bus/slcan", &["slcan"]),
    (
        "controller",
        &["ecu", "probe", "edges", "endurance", "memory", "road"],
    ),
    (
        "controller/config",
        &[
            "params",
            "monitor",
            "schedule",
            "plausibility",
            "probe",
            "law_oracle",
            "laws",
            "road",
        ],
    ),
    ("controller/params", &["params", "stored"]),
    (
        "controller/step",
        &[
            "ecu",
            "probe",
            "edges",
            "endurance",
            "memory",
            "road",
            "motor",
            "coast",
            "forgotten",
            "laws",
        ],
    ),
    (
        "ecu",
        &["ecu", "memory", "probe", "edges", "endurance", "attacks"],
    ),
    ("ecu/another_law", &["another_law"]),
    ("ecu/counting", &["interleaved", "honest", "attacks", "senders"]),
    ("ecu/injection", &["ecu", "memory", "monitor", "edges"]),
    (
        "ecu/receivers",
        &[
            "ecu",
            "memory",
            "edges",
            "endurance",
            "attacks",
            "senders",
            "road",
            "forgotten",
        ],
    ),
    ("estimator", &["estimator"]),
    ("estimator/background", &["probe", "ecu", "attacks"]),
    ("law", &["law_oracle", "laws", "ecu", "road"]),
    ("law/probe", &["probe"]),
    ("law/schedule", &["schedule", "params"]),
    ("law/sine", &["probe"]),
    ("quantity", &["quantity", "law_oracle", "ecu", "probe"]),
    ("safety/actuator", &["edges", "ecu", "motor"]),
    ("safety/coast", &["coast", "forgotten", "onward"]),
    ("safety/envelope", &["envelope"]),
    ("safety/faults", &["faults", "ecu", "dbc", "edges"]),
    ("safety/frozen_torque", &["frozen_torque"]),
    ("safety/hands", &["hands", "road", "ecu"]),
    ("safety/modes", &["modes"]),
    ("safety/monitor", &["monitor", "probe", "coast"]),
    ("safety/motion_history", &["plausibility", "road"]),
    (
        "safety/plausibility",
        &["plausibility", "column", "road", "edges", "ecu", "slow_lies"],
    ),
    ("safety/ramp", &["ramp", "ecu", "endurance"]),
    ("safety/redundant", &["memory", "ecu", "law_oracle"]),
    ("safety/yaw", &["yaw", "senders"]),
    ("service/download", &["download"]),
    ("service/rejections", &["attacks", "dbc"]),
    ("service/stored", &["stored"]),
];

/// What [`TESTS`] has for a file; nothing: all of them.
fn tests_of(file: &str) -> &'static [&'static str] {
    let has = |name: &str| {
        file.strip_prefix(name)
            .is_some_and(|rest| rest == ".rs" || rest.starts_with('/'))
    };
    let found = TESTS.iter().filter(|(name, _)| has(name));
    found
        .max_by_key(|(name, _)| name.len())
        .map_or(&[], |(_, tests)| tests)
}

/// Every file of core, from its root.
fn sources() -> Result<Vec<String>> {
    let output = tool::output(tool::command("git").args(["ls-files", "core/src"]))?;
    let files = output.lines().filter_map(|line| line.strip_prefix("core/src/"));
    Ok(files
        .filter(|file| file.ends_with(".rs") && !file.ends_with("tests.rs"))
        .map(str::to_owned)
        .collect())
}

/// A defect in each expression of the core, or of some of its files, or only in lines that differ from `base`; an error
/// names those that no test notices.
pub(crate) fn check(files: &[String], base: Option<&str>) -> Result<()> {
    if !tool::exists("cargo-mutants") {
        bail!("cargo-mutants is missing: cargo install cargo-mutants");
    }
    let sources = sources()?;
    if let Some(file) = files.iter().find(|file| !sources.contains(file)) {
        let message = format!("{file}: no file of core/src; there are {}", sources.join(", "));
        return Err(tool::Usage(message).into());
    }
    let wanted = sources
        .iter()
        .filter(|file| files.is_empty() || files.contains(file));
    mutate(wanted, base)
}

/// `cargo mutants` for a file; None where it does not differ from `base`.
fn command_for(file: &str, base: Option<&str>) -> Result<Option<(PathBuf, std::process::Command)>> {
    let source = format!("core/src/{file}");
    let place = tool::root().join("target/mutants").join(file.replace('/', "-"));
    fs::create_dir_all(&place)?;
    let mut command = cargo();
    command
        .args(["mutants", "--package", "haptic-core", "--no-shuffle"])
        .args(["-f", &source])
        .arg("--output")
        .arg(&place)
        .args(["--cargo-arg=--lib", "--cargo-arg=--test=all"])
        // Each file is tried in a copy of the sources; what they depend on is built once.
        .env("CARGO_TARGET_DIR", tool::root().join("target/mutants/build"));
    if let Some(base) = base {
        let difference = tool::output(tool::command("git").args(["diff", base, "--", &source]))?;
        if difference.is_empty() {
            return Ok(None);
        }
        let path = place.join("changed.diff");
        fs::write(&path, difference)?;
        command.arg("--in-diff").arg(path);
    }
    Ok(Some((place, command)))
}

fn mutate<'a>(files: impl Iterator<Item = &'a String>, base: Option<&str>) -> Result<()> {
    let mut survivors = Vec::new();
    for file in files {
        let Some((place, mut command)) = command_for(file, base)? else {
            continue;
        };
        let tests = tests_of(file);
        if !tests.is_empty() {
            // Only those that must notice it, and the file's own unit tests.
            let stem = file.trim_end_matches(".rs").rsplit('/').next().unwrap_or(file);
            let modules = tests.iter().copied().chain([stem]);
            command
                .args(["--", "--"])
                .args(modules.map(|module| format!("{module}::")));
        }
        println!("== {file}");
        // A difference that holds nothing to mutate leaves the lists of an earlier run alone.
        let _ = fs::remove_dir_all(place.join("mutants.out"));
        let status = command.status()?;
        // 2 and 3: some were missed, or ran into a time limit.
        ensure!(
            matches!(status.code(), Some(0 | 2 | 3)),
            "cargo mutants: {status}"
        );
        for outcome in ["missed.txt", "timeout.txt"] {
            let path = place.join("mutants.out").join(outcome);
            // A file, or a difference, that holds nothing to mutate leaves no list.
            if !path.exists() {
                continue;
            }
            let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
            survivors.extend(text.lines().map(str::to_owned));
        }
    }
    println!("\n{} survivors", survivors.len());
    for survivor in &survivors {
        println!("  {survivor}");
    }
    ensure!(survivors.is_empty(), "no test notices these defects");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{TESTS, sources, tests_of};

    #[test]
    fn the_longest_name_decides_and_a_file_without_one_has_all_tests() {
        assert_eq!(tests_of("law/probe.rs"), ["probe"]);
        assert_eq!(tests_of("law/mod.rs"), ["law_oracle", "laws", "ecu", "road"]);
        assert_eq!(tests_of("safety/envelope.rs"), ["envelope"]);
        assert!(tests_of("safety/envelopes.rs").is_empty());
    }

    #[test]
    fn every_name_has_a_file_and_every_test_is_there() {
        let sources = sources().unwrap();
        let program = crate::tool::root().join("core/tests");
        for (name, tests) in TESTS {
            let is_there = sources.iter().any(|file| {
                file.strip_prefix(name)
                    .is_some_and(|rest| rest == ".rs" || rest.starts_with('/'))
            });
            assert!(is_there, "core/src/{name}: no such file or folder");
            for test in *tests {
                let file = program.join(test).with_extension("rs");
                assert!(file.exists(), "{name}: {} is not there", file.display());
            }
        }
    }
}
