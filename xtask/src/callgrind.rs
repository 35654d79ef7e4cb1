//! Instructions on the host, counted by valgrind's callgrind: the same run after run, whatever else runs.

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::tool;

/// Instructions of our closed loop.
pub(crate) struct Counts {
    /// One control step: every `Ecu::receive` of a tick and `Ecu::step`.
    pub(crate) per_step: u64,
    /// One simulated second of the whole loop: plant, driver, road, bus and controller.
    pub(crate) per_simulated_second: u64,
}

pub(crate) fn count() -> Result<Counts> {
    let program = build_closed_loop(For::EveryMachine)?;
    // Of several `--toggle-collect` callgrind obeys the first alone.
    let (received, _) = collect(&program, "haptic_core::ecu::Ecu::receive")?;
    let (stepped, run) = collect(&program, "haptic_core::ecu::Ecu::step")?;
    let steps = run["steps"].as_u64().context("closed_loop names no steps")?;
    let (all, run) = collect(&program, "*closed_loop*one_run*")?;
    let seconds = run["simulated_seconds"]
        .as_f64()
        .context("closed_loop names no seconds")?;
    Ok(Counts {
        per_step: (received + stepped) / steps,
        per_simulated_second: (all as f64 / seconds).round() as u64,
    })
}

/// Which processors a program is compiled for.
#[derive(Debug, Clone, Copy)]
pub(crate) enum For {
    EveryMachine,
    ThisMachine,
}

/// Builds `bench/closed_loop.rs` and returns the program.
pub(crate) fn build_closed_loop(processor: For) -> Result<String> {
    build("closed_loop", processor)
}

/// Builds a program of `bench/` and returns it.
pub(crate) fn build(example: &str, processor: For) -> Result<String> {
    let mut cargo = tool::cargo();
    cargo.args("build --profile dist -p haptic-guidance --example".split(' '));
    cargo.arg(example).arg("--message-format=json-render-diagnostics");
    if let For::ThisMachine = processor {
        cargo.env("RUSTFLAGS", "-C target-cpu=native");
        cargo.args(["--target-dir", "target/native"]);
    }
    Ok(crate::image::elf_of(&mut cargo)?.to_string_lossy().into_owned())
}

/// Runs the program under callgrind, counting only inside the function named; returns the count and what the
/// program printed.
fn collect(program: &str, function: &str) -> Result<(u64, Value)> {
    let mut command = tool::command("valgrind");
    command.args(["--tool=callgrind", "--callgrind-out-file=/dev/null"]);
    command.arg(format!("--toggle-collect={function}"));
    let output = command
        .args([program, "--repeat", "1"])
        .output()
        .context("valgrind")?;
    let log = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "valgrind: {}\n{log}", output.status);
    let count: u64 = log
        .lines()
        .find_map(|line| line.split_once("Collected : ")?.1.trim().parse().ok())
        .with_context(|| format!("callgrind collected nothing:\n{log}"))?;
    ensure!(count > 0, "callgrind saw no call of {function}: is it inlined?");
    Ok((
        count,
        serde_json::from_slice(&output.stdout).context("closed_loop's JSON")?,
    ))
}
