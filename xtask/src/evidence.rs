//! What the core's tests reach, and what they would notice: coverage and mutation. The whole mutation takes hours.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

use crate::tool::{self, cargo, run};

/// Every file of the core, what decides or guards a torque first, with the tests that must notice a defect in it beside its
/// own unit tests. What cannot be noticed is in `.cargo/mutants.toml`, with its reason.
const MUTATED: [(&str, &[&str]); 38] = [
    ("safety/envelope.rs", &["envelope"]),
    ("safety/modes.rs", &["modes"]),
    ("bus/e2e.rs", &["e2e", "edges", "dbc"]),
    ("safety/monitor.rs", &["monitor", "probe"]),
    (
        "safety/plausibility.rs",
        &["plausibility", "column", "road", "edges", "ecu"],
    ),
    (
        "controller/mod.rs",
        &["ecu", "probe", "edges", "endurance", "memory", "road"],
    ),
    (
        "controller/step.rs",
        &["ecu", "probe", "edges", "endurance", "memory", "road", "motor"],
    ),
    (
        "ecu/mod.rs",
        &["ecu", "memory", "probe", "edges", "endurance", "attacks"],
    ),
    (
        "ecu/receivers.rs",
        &[
            "ecu",
            "memory",
            "edges",
            "endurance",
            "attacks",
            "senders",
            "road",
        ],
    ),
    (
        "ecu/counting.rs",
        &["interleaved", "honest", "attacks", "senders", "reference"],
    ),
    ("ecu/injection.rs", &["ecu", "memory", "monitor", "edges"]),
    ("safety/ramp.rs", &["ramp", "ecu", "endurance"]),
    ("safety/redundant.rs", &["memory", "ecu", "law_oracle"]),
    ("service/stored.rs", &["stored"]),
    ("service/download.rs", &["download"]),
    ("safety/actuator.rs", &["edges", "ecu", "motor"]),
    ("safety/faults.rs", &["faults", "ecu", "dbc", "edges"]),
    ("safety/hands.rs", &["road", "ecu"]),
    ("law/mod.rs", &["law_oracle", "ecu", "road"]),
    ("law/schedule.rs", &["schedule", "params"]),
    ("safety/motion_history.rs", &["plausibility", "road"]),
    ("safety/yaw.rs", &["yaw", "senders"]),
    ("law/probe.rs", &["probe"]),
    ("law/sine.rs", &["probe"]),
    ("quantity/mod.rs", &["quantity", "law_oracle", "ecu", "probe"]),
    ("quantity/arithmetic.rs", &["quantity", "law_oracle", "ecu"]),
    (
        "controller/config.rs",
        &[
            "params",
            "monitor",
            "schedule",
            "plausibility",
            "probe",
            "law_oracle",
            "road",
        ],
    ),
    ("controller/params.rs", &["params", "stored"]),
    ("service/rejections.rs", &["attacks", "dbc"]),
    ("estimator/background.rs", &["probe", "ecu", "attacks"]),
    ("estimator/mod.rs", &["estimator"]),
    ("estimator/average.rs", &["estimator"]),
    ("bus/frame.rs", &["frame", "dbc", "ecu", "e2e"]),
    ("bus/slcan.rs", &["slcan"]),
    ("bus/messages/mod.rs", &["dbc", "ecu"]),
    ("bus/messages/inputs.rs", &["dbc", "ecu", "edges"]),
    ("bus/messages/outputs.rs", &["dbc", "ecu", "attacks", "edges"]),
    (
        "bus/messages/service.rs",
        &["dbc", "download", "attacks", "edges"],
    ),
];

/// Line, region and branch coverage of `core/` by its own tests; less than all lines and branches is an error. A region is
/// missed too where a `?` has an error that cannot come: no error.
pub(crate) fn coverage() -> Result<()> {
    let place = tool::root().join("target/coverage");
    let profiles = place.join("profiles");
    // What an earlier run left would count as covered.
    let _ = fs::remove_dir_all(&profiles);
    let mut test = cargo();
    test.args(["test", "-p", "haptic-core", "--tests", "--all-features"])
        .env("CARGO_TARGET_DIR", &place)
        // Branches are counted by an option that the compiler calls unstable; for a report alone that is no risk.
        .env("RUSTC_BOOTSTRAP", "1")
        .env("RUSTFLAGS", "-C instrument-coverage -Z coverage-options=branch")
        .env("LLVM_PROFILE_FILE", profiles.join("%p-%m.profraw"))
        // Optimised code has no regions of its own for what was folded away.
        .env("CARGO_PROFILE_DEV_OPT_LEVEL", "0");
    run(&mut test)?;
    let listed = tool::output(test.args(["--no-run", "--message-format=json"]))?;
    let tests: Vec<String> = listed
        .lines()
        .filter_map(|line| serde_json::from_str::<Value>(line).ok())
        .filter_map(|message| message["executable"].as_str().map(str::to_owned))
        .collect();
    let data = place.join("core.profdata");
    let raw: Vec<_> = fs::read_dir(&profiles)
        .with_context(|| profiles.display().to_string())?
        .flatten()
        .map(|entry| entry.path())
        .collect();
    run(tool::llvm("llvm-profdata")?
        .args(["merge", "-sparse", "-o"])
        .arg(&data)
        .args(raw))?;
    let report = |command: &str| -> Result<std::process::Command> {
        let mut cov = tool::llvm("llvm-cov")?;
        cov.arg(command)
            .arg(format!("-instr-profile={}", data.display()))
            .arg("--ignore-filename-regex=/tests/|\\.cargo|rustc|library")
            .args(tests.iter().flat_map(|test| ["-object", test]));
        Ok(cov)
    };
    run(&mut report("report")?)?;
    let export = tool::output(report("export")?.args(["-skip-functions", "-skip-expansions"]))?;
    let export: Value = serde_json::from_str(&export)?;
    let lines = &export["data"][0]["totals"]["lines"];
    let [count, covered] = ["count", "covered"].map(|figure| lines[figure].as_u64());
    ensure!(
        count.is_some() && count == covered,
        "lines: {covered:?} of {count:?} are covered; where not: llvm-cov show"
    );
    let missed = missed_branches(&export)?;
    ensure!(
        missed.is_empty(),
        "branches that go one way only: {}",
        missed.join(", ")
    );
    println!("every line and every branch of core/ is covered");
    Ok(())
}

/// Branches that all tests together take one way only. The totals of llvm-cov are of one copy of a function, which the unit
/// tests have one of, and the other tests another.
fn missed_branches(export: &Value) -> Result<Vec<String>> {
    let mut taken: BTreeMap<String, [u64; 2]> = BTreeMap::new();
    for file in export["data"][0]["files"].as_array().context("no files")? {
        for branch in file["branches"].as_array().context("no branches")? {
            let number = |place: usize| branch[place].as_u64().unwrap_or(0);
            let name = file["filename"].as_str().unwrap_or_default();
            let ways = taken
                .entry(format!("{name}:{}:{}", number(0), number(1)))
                .or_default();
            ways[0] += number(4);
            ways[1] += number(5);
        }
    }
    let one_way = taken.into_iter().filter(|(_, ways)| ways.contains(&0));
    Ok(one_way.map(|(place, _)| place).collect())
}

/// A defect in each expression of the core, or of some of its files, or only in lines that differ from `base`; an error
/// names those that no test notices.
pub(crate) fn mutants(files: &[String], base: Option<&str>) -> Result<()> {
    if !tool::exists("cargo-mutants") {
        bail!("cargo-mutants is missing: cargo install cargo-mutants");
    }
    let known = |file: &&String| MUTATED.iter().any(|(name, _)| name == file);
    if let Some(file) = files.iter().find(|file| !known(file)) {
        let names: Vec<&str> = MUTATED.iter().map(|(name, _)| *name).collect();
        bail!(
            "{file}: no file of core/src that is mutated; there are {}",
            names.join(", ")
        );
    }
    let wanted = |file: &str| files.is_empty() || files.iter().any(|wanted| wanted == file);
    mutate(&wanted, base)
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

fn mutate(wanted: &dyn Fn(&str) -> bool, base: Option<&str>) -> Result<()> {
    let files = || MUTATED.iter().filter(|(file, _)| wanted(file));
    let mut survivors = Vec::new();
    for (file, tests) in files() {
        let Some((place, mut command)) = command_for(file, base)? else {
            continue;
        };
        // Only those that must notice it, and the file's own unit tests.
        let stem = file.trim_end_matches(".rs").rsplit('/').next().unwrap_or(file);
        let modules = tests.iter().copied().chain([stem]);
        command
            .args(["--", "--"])
            .args(modules.map(|module| format!("{module}::")));
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
