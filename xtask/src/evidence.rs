//! What the core's tests reach, and what they would notice: coverage and mutation. Both take minutes, so CI does not run
//! them.

use std::fs;

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

use crate::tool::{self, cargo, run};

/// What decides or guards a torque, with the tests that must notice a defect in it.
const MUTATED: [(&str, &[&str]); 14] = [
    ("envelope.rs", &["envelope"]),
    ("modes.rs", &["modes"]),
    ("bus/e2e.rs", &["e2e", "edges"]),
    ("monitor.rs", &["monitor", "probe"]),
    ("plausibility.rs", &["plausibility"]),
    ("controller.rs", &["ecu", "probe", "edges", "endurance"]),
    ("ecu.rs", &["ecu", "memory", "probe", "edges", "endurance"]),
    ("ecu/receivers.rs", &["ecu", "memory", "edges", "endurance"]),
    ("ramp.rs", &["ramp", "ecu", "endurance"]),
    ("redundant.rs", &["memory"]),
    ("stored.rs", &["stored"]),
    ("download.rs", &["download"]),
    ("actuator.rs", &["edges", "ecu"]),
    ("faults.rs", &["faults", "ecu", "dbc", "edges"]),
];

/// Line and region coverage of `core/` by its own tests; less than all of it is an error.
pub(crate) fn coverage() -> Result<()> {
    let place = tool::root().join("target/coverage");
    let profiles = place.join("profiles");
    // What an earlier run left would count as covered.
    let _ = fs::remove_dir_all(&profiles);
    let mut test = cargo();
    test.args(["test", "-p", "haptic-core", "--tests", "--all-features"])
        .env("CARGO_TARGET_DIR", &place)
        .env("RUSTFLAGS", "-C instrument-coverage")
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
    run(report("report")?.arg("--show-branch-summary=false"))?;
    let summary: Value = serde_json::from_str(&tool::output(report("export")?.arg("-summary-only"))?)?;
    let totals = &summary["data"][0]["totals"];
    for kind in ["lines", "regions"] {
        let [count, covered] = ["count", "covered"].map(|figure| totals[kind][figure].as_u64());
        ensure!(
            count.is_some() && count == covered,
            "{kind}: {covered:?} of {count:?} are covered; where not: llvm-cov show"
        );
    }
    println!("every line and region of core/ is covered");
    Ok(())
}

/// A defect in each expression of what guards a torque, or only in those that differ from `base`; those that no test
/// notices are printed, and are an error where only a difference was tried.
pub(crate) fn mutants(base: Option<&str>) -> Result<()> {
    if !tool::exists("cargo-mutants") {
        bail!("cargo-mutants is missing: cargo install cargo-mutants");
    }
    let all = tool::root().join("target/mutants");
    fs::create_dir_all(&all)?;
    let mut survivors = Vec::new();
    for (file, tests) in MUTATED {
        let source = format!("core/src/{file}");
        let place = all.join(file.replace('/', "-"));
        fs::create_dir_all(&place)?;
        let mut command = cargo();
        command
            .args(["mutants", "--package", "haptic-core", "--no-shuffle"])
            .args(["-f", &source])
            .arg("--output")
            .arg(&place)
            .args(tests.iter().map(|test| format!("--cargo-arg=--test={test}")));
        if let Some(base) = base {
            let difference = tool::output(tool::command("git").args(["diff", base, "--", &source]))?;
            if difference.is_empty() {
                continue;
            }
            let path = place.join("changed.diff");
            fs::write(&path, difference)?;
            command.arg("--in-diff").arg(path);
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
            if base.is_some() && !path.exists() {
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
    ensure!(
        base.is_none() || survivors.is_empty(),
        "no test notices these defects in the changed lines"
    );
    Ok(())
}
