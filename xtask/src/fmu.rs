//! The functional mock-up units: one binary and two descriptions for each model, checked by FMPy.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use anyhow::{Context, Result};

use crate::built::Built;
use crate::tool::{below, cargo, command, exists, output, root, run};
use crate::{dist, python};

/// A relying driver on the paper's course, as bindings/fmu/check.py couples it.
const SCENARIO: &str = "speed_m_per_s = 16.666666666666668\ncondition = \"mid\"\n[driver]\nt_p_s = 0.3\n";
const WINDOWS: &str = "x86_64-pc-windows-gnu";
const LINKER: &str = "x86_64-w64-mingw32-gcc";

/// Builds every model for FMI 2.0 (`NAME.fmu`) and 3.0 (`NAME.fmi3.fmu`) into `target/dist`, and has FMPy judge them: alone, and
/// the three together against `host-sim run`.
pub(crate) fn check(built: Built) -> Result<()> {
    let fmus = build(built)?;
    let run_directory = root().join("target/fmu/run");
    let scenario = root().join("target/fmu/coupled.toml");
    std::fs::write(&scenario, SCENARIO)?;
    run(command(built.host_sim()?)
        .arg("run")
        .arg(&scenario)
        .arg("--out")
        .arg(&run_directory)
        .stdout(std::process::Stdio::null()))?;
    run(python::with_package(built)?
        .arg("bindings/fmu/check.py")
        .arg(root().join("target/dist"))
        .arg(run_directory.join("run.csv")))?;
    for fmu in fmus {
        println!("{}", fmu.display());
    }
    Ok(())
}

/// The binaries that can be built here, with where each standard wants them and the extension.
fn binaries(native: &Path) -> Result<Vec<(PathBuf, [&'static str; 2], &'static str)>> {
    let linux = (native.join("libhaptic_fmu.so"), ["linux64", "x86_64-linux"], "so");
    let mut made = vec![linux];
    let targets = output(command("rustup").args(["target", "list", "--installed"])).unwrap_or_default();
    if targets.lines().any(|line| line == WINDOWS) && exists(LINKER) {
        run(cargo()
            .args([
                "build",
                "--profile",
                "dist",
                "-p",
                "haptic-fmu",
                "--lib",
                "--target",
                WINDOWS,
            ])
            .env("RUSTFLAGS", dist::remapped()?.join(" ")))?;
        let dll = root().join("target").join(WINDOWS).join("dist/haptic_fmu.dll");
        made.push((dll, ["win64", "x86_64-windows"], "dll"));
    } else {
        println!(
            "Without binaries for Windows: rustup target add {WINDOWS}; apt-get install gcc-mingw-w64-x86-64-win32"
        );
    }
    Ok(made)
}

pub(crate) fn build(built: Built) -> Result<Vec<PathBuf>> {
    let native = built.package("haptic-fmu")?;
    let binaries = binaries(&native)?;
    let describe = native.join("model-description");
    let models = output(&mut command(&describe))?;
    let dist = root().join("target/dist");
    std::fs::create_dir_all(&dist)?;
    let mut fmus = Vec::new();
    for model in models.lines() {
        for (standard, version, ending) in [(0, "2", "fmu"), (1, "3", "fmi3.fmu")] {
            // Other stages build and read the same units meanwhile: each has its folder, and a unit appears whole.
            let stage = root()
                .join("target/fmu")
                .join(format!("{model}-{version}-{}", std::process::id()));
            for (binary, places, extension) in &binaries {
                let place = stage.join("binaries").join(places[standard]);
                std::fs::create_dir_all(&place).with_context(|| place.display().to_string())?;
                std::fs::copy(binary, place.join(format!("{model}.{extension}")))
                    .with_context(|| binary.display().to_string())?;
            }
            let description = output(command(&describe).args([model, version]))?;
            std::fs::write(stage.join("modelDescription.xml"), description)?;
            let fmu = dist.join(format!("{model}.{ending}"));
            let whole = stage.join("unit.zip");
            archive(&stage, &whole)?;
            std::fs::rename(&whole, &fmu).with_context(|| fmu.display().to_string())?;
            std::fs::remove_dir_all(&stage)?;
            fmus.push(fmu);
        }
    }
    Ok(fmus)
}

/// An FMU is a zip archive; Python, which checks it, can write one.
fn archive(stage: &Path, fmu: &Path) -> Result<()> {
    // Times of files and of their folders are in the archive, in the local time of whoever packs.
    let time = SystemTime::UNIX_EPOCH + Duration::from_secs(dist::commit_time()?);
    for path in below(stage)? {
        File::open(&path)
            .and_then(|file| file.set_modified(time))
            .with_context(|| path.display().to_string())?;
    }
    run(command("python3")
        .current_dir(stage)
        .env("TZ", "UTC")
        .args(["-m", "zipfile", "-c"])
        .arg(fmu)
        .args(["modelDescription.xml", "binaries/"]))
}
