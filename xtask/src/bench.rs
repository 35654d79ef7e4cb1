//! What the controller costs: counted instructions and bytes, the same on every machine.
//!
//! On the target: QEMU with `-icount`, over a whole run of the lock-step comparison; a step is every
//! `Ecu::receive` of a tick and `Ecu::step`. On the host: callgrind. Wall-clock time is `speed`'s.

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::golden::{self, Figure};
use crate::{callgrind, image, size, tool};

pub(crate) fn run(bless: bool) -> Result<()> {
    tool::ensure(&[("qemu-system-arm", "qemu-system-arm"), ("valgrind", "valgrind")])?;
    let size = size::of(&image::build("steering-ecu")?)?;
    let [worst, mean, stack] = on_target()?;
    let host = callgrind::count()?;
    let figure = |name, unit, value, tolerance_percent| Figure {
        name,
        unit,
        value,
        tolerance_percent,
    };
    golden::check(
        &[
            // Paths of the machine's crate cache are in panic messages.
            figure("steering_ecu_flash", "B", size.flash, 1),
            figure("steering_ecu_ram", "B", size.ram, 1),
            figure("target_step_worst", "instructions", worst, 1),
            figure("target_step_mean", "instructions", mean, 1),
            // Its budget, 8192 B, is held by the guard below it: a run beyond would have faulted.
            figure("target_stack", "B", stack, 5),
            // The C library picks its memcpy, sine and cosine by the processor.
            figure("host_step_mean", "instructions", host.per_step, 5),
            figure(
                "host_simulated_second",
                "instructions",
                host.per_simulated_second,
                5,
            ),
        ],
        bless,
    )
}

/// Instructions of the worst and of the mean step in QEMU, and bytes of stack, over paper-course.
fn on_target() -> Result<[u64; 3]> {
    let text = tool::output(tool::cargo().args([
        "run",
        "--release",
        "-p",
        "host-sim",
        "--",
        "pil",
        "--count",
        "--json",
    ]))?;
    let report: Value = serde_json::from_str(&text).context("host-sim pil --json")?;
    let steps = report["steps"].as_u64().unwrap_or(0);
    println!(
        "target: {steps} steps in lock step, {} mismatches",
        report["mismatches"]
    );
    ensure!(steps > 10_000, "host-sim pil stepped only {steps} times");
    let instructions = &report["instructions"];
    let worst = instructions["worst"]
        .as_u64()
        .context("host-sim pil counted no instructions")?;
    let mean = instructions["mean"]
        .as_f64()
        .context("host-sim pil counted no mean")?;
    let stack = report["stack_bytes"]
        .as_u64()
        .context("host-sim pil measured no stack")?;
    Ok([worst, mean.round() as u64, stack])
}
