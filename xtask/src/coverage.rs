//! What the core's tests reach: coverage of its lines and branches.

use std::collections::BTreeMap;
use std::fs;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::tool::{self, cargo, run};

/// Line, region and branch coverage of `core/` by its own tests; less than all lines and branches is an error. A region is
/// missed too where a `?` has an error that cannot come: no error.
pub(crate) fn check() -> Result<()> {
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
