//! The functional mock-up unit: binary and description in one archive, checked by FMPy.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::tool::{cargo, command, output, root, run};
use crate::wheel;

/// Builds `target/dist/HapticController.fmu` and has FMPy judge it.
pub(crate) fn check() -> Result<()> {
    let fmu = build()?;
    let python = wheel::python()?;
    let python = python.to_string_lossy();
    run(command(&python).args(["-m", "pip", "install", "-q", "fmpy"]))?;
    run(command(&python).arg("bindings/fmu/check.py").arg(&fmu))?;
    println!("{}", fmu.display());
    Ok(())
}

fn build() -> Result<PathBuf> {
    run(cargo().args(["build", "--release", "-p", "haptic-fmu"]))?;
    let release = root().join("target/release");
    let describe = release.join("model-description");
    let description = output(&mut command(&describe.to_string_lossy()))?;
    let stage = root().join("target/fmu");
    let binaries = stage.join("binaries/linux64");
    std::fs::create_dir_all(&binaries).with_context(|| binaries.display().to_string())?;
    std::fs::write(stage.join("modelDescription.xml"), description)?;
    std::fs::copy(
        release.join("libhaptic_fmu.so"),
        binaries.join("HapticController.so"),
    )?;
    let dist = root().join("target/dist");
    std::fs::create_dir_all(&dist)?;
    let fmu = dist.join("HapticController.fmu");
    archive(&stage, &fmu)?;
    Ok(fmu)
}

/// An FMU is a zip archive; Python, which checks it, can write one.
fn archive(stage: &Path, fmu: &Path) -> Result<()> {
    let _ = std::fs::remove_file(fmu);
    run(command("python3")
        .current_dir(stage)
        .args(["-m", "zipfile", "-c"])
        .arg(fmu)
        .args(["modelDescription.xml", "binaries/"]))
}
