//! How fast the closed loop runs, beside the same loop written in C and in NumPy (`bench/README.md`).
//!
//! Wall-clock time of one core, so a figure of this machine at this moment and held by no golden: the ratios are
//! what travels. Each program's fastest run counts.

use anyhow::{Context, Result};
use serde_json::Value;

use crate::{callgrind, tool};

/// Runs of our loop and of C's; NumPy's is long enough for one.
const REPEAT: &str = "30";

pub(crate) fn run() -> Result<()> {
    tool::ensure(&[
        ("gcc", "gcc"),
        ("valgrind", "valgrind"),
        ("python3", "python3-venv"),
    ])?;
    let ours = callgrind::build_closed_loop()?;
    let c = build_c()?;
    let python = build_venv()?;
    let ours = times_real_time(&ours, &["--repeat", REPEAT])?;
    let c = times_real_time(&c, &["--repeat", REPEAT])?;
    let numpy = times_real_time(&python, &["bench/closed_loop.py", "--duration", "10"])?;
    println!(
        "{:<28}{:>16}{:>12}",
        "one closed loop, one core", "x real time", "ours is"
    );
    for (name, speed) in [
        ("ours (fixed-point ECU)", ours),
        ("C, gcc -O3", c),
        ("NumPy/SciPy", numpy),
    ] {
        println!("{name:<28}{speed:>16.0}{:>11.2}x", ours / speed);
    }
    let counts = callgrind::count()?;
    println!(
        "where our time goes: {} of {} instructions a simulated millisecond are the ECU's (C's ECU is the law and the \
         bus's protection alone)",
        counts.per_step,
        counts.per_simulated_second / 1000
    );
    Ok(())
}

fn build_c() -> Result<String> {
    let program = "target/closed_loop_c";
    tool::run(tool::command("gcc").args(["-O3", "-std=c11", "-o", program, "bench/closed_loop.c", "-lm"]))?;
    Ok(tool::root().join(program).to_string_lossy().into_owned())
}

/// A virtual environment with NumPy and SciPy, made once.
pub(crate) fn build_venv() -> Result<String> {
    let venv = tool::root().join("target/venv");
    let python = venv.join("bin/python");
    let is_ready = |python: &std::path::Path| {
        let mut import = tool::command(&python.to_string_lossy());
        python.exists() && tool::run(import.args(["-c", "import numpy, scipy"])).is_ok()
    };
    if !is_ready(&python) {
        tool::run(tool::command("python3").args(["-m", "venv"]).arg(&venv))?;
        let pip = ["-m", "pip", "install", "-q", "numpy", "scipy"];
        tool::run(tool::command(&python.to_string_lossy()).args(pip))?;
    }
    Ok(python.to_string_lossy().into_owned())
}

fn times_real_time(program: &str, arguments: &[&str]) -> Result<f64> {
    let text = tool::output(tool::command(program).args(arguments))?;
    let report: Value = serde_json::from_str(&text).with_context(|| program.to_owned())?;
    report["times_real_time"]
        .as_f64()
        .with_context(|| format!("{program} names no times_real_time"))
}
