//! How long one fit of a recorded drive takes, beside `scipy.optimize.least_squares` on the same problem
//! (`bench/identify.py`, which fails if the two do not reach the same loss).
//!
//! Time that one core was busy with it, the mean of ten fits, held by no golden; see `speed`. Asked are 30 ms, and 100 ms where
//! the camera's noise is estimated.

use anyhow::{Context, Result};
use serde_json::Value;

use crate::{speed, tool};

/// Where the drives are recorded: participant 5 of the paper, 186 s on the built-in course, at 120 Hz.
const OUT: &str = "target/bench-identify";

pub(crate) fn run() -> Result<()> {
    tool::ensure(&[("python3", "python3-venv")])?;
    let python = speed::python()?;
    tool::output(
        tool::cargo()
            .args("run --profile dist -q -p host-sim -- experiment".split(' '))
            .args([
                "--participant",
                "5",
                "--probe",
                "0.2",
                "--json",
                "--out",
                OUT,
                "--logs",
            ]),
    )?;
    println!(
        "{:<16}{:>8}{:>12}{:>18}{:>12}{:>10}{:>14}{:>14}",
        "one fit", "rows", "ours, ms", "camera noise, ms", "SciPy, ms", "faster", "loss, ours", "loss, SciPy"
    );
    for name in ["guided", "manual"] {
        let log = format!("{OUT}/logs/participant-05-{name}.csv");
        let text = tool::output(tool::command(&python).args(["bench/identify.py", &log]))?;
        let report: Value = serde_json::from_str(&text).context("bench/identify.py")?;
        let figure = |key: &str| {
            report[key]
                .as_f64()
                .with_context(|| format!("bench/identify.py names no {key}"))
        };
        println!(
            "{name:<16}{:>8}{:>12.1}{:>18.1}{:>12.0}{:>9.0}x{:>14.6}{:>14.6}",
            figure("rows")?,
            1000.0 * figure("seconds")?,
            1000.0 * figure("with_camera_noise_seconds")?,
            1000.0 * figure("scipy_seconds")?,
            figure("times_faster")?,
            figure("loss")?,
            figure("scipy_loss")?,
        );
    }
    Ok(())
}
