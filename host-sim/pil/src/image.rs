//! Builds the lock-step image and finds its ELF.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::PilError;
use super::qemu::Machine;

const TARGET: &str = "thumbv7em-none-eabihf";

/// Builds the image with cargo, from the checkout that this program is run in or lies in, and returns its ELF: a copy,
/// which no build for another machine overwrites.
///
/// # Errors
/// The sources, cargo or the Rust target are missing, or the build fails.
pub fn build(machine: Machine) -> Result<PathBuf, PilError> {
    let root = checkout().ok_or_else(|| {
        PilError::Missing(
            "the firmware's sources (firmware/Cargo.toml) are neither above the working directory nor above this \
             program: run it from a checkout of the repository"
                .into(),
        )
    })?;
    let copies = root.join("target/pil");
    let io = |error: std::io::Error| PilError::Failed(format!("{}: {error}", copies.display()));
    fs::create_dir_all(&copies).map_err(io)?;
    // Held until the copy is made, so that another program's build does not come between.
    let lock = File::create(copies.join("lock")).map_err(io)?;
    lock.lock().map_err(io)?;
    let elf = build_locked(&root, machine)?;
    let copy = copies.join(format!("lockstep-{machine}"));
    // Renamed into place: a machine may be reading the last one.
    let fresh = copies.join(format!("lockstep-{machine}.new"));
    fs::copy(elf, &fresh).map_err(io)?;
    fs::rename(fresh, &copy).map_err(io)?;
    Ok(copy)
}

/// The nearest checkout above the working directory, else above this program. Found when it is asked for: a path
/// from the build would be that of another checkout once this one is moved or copied.
#[must_use]
pub fn checkout() -> Option<PathBuf> {
    let starts = [std::env::current_dir(), std::env::current_exe()];
    let above = |start: PathBuf| {
        let root = start
            .ancestors()
            .find(|a| a.join("firmware/Cargo.toml").is_file());
        root.map(Path::to_path_buf)
    };
    starts.into_iter().flatten().find_map(above)
}

fn build_locked(root: &Path, machine: Machine) -> Result<PathBuf, PilError> {
    // The cargo that runs this program, so that both use one toolchain.
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(&cargo)
        .current_dir(root)
        .args(["build", "--profile", "firmware"])
        .args(["-p", "haptic-firmware", "--bin", "lockstep"])
        .args(["--target", TARGET, "--features", machine.name()])
        .arg("--message-format=json-render-diagnostics")
        .stderr(Stdio::piped())
        .output()
        .map_err(|e| match e.kind() {
            std::io::ErrorKind::NotFound => PilError::Missing(
                "cargo is missing, which builds the target's image: see https://rustup.rs".into(),
            ),
            _ => PilError::Failed(format!("cargo does not start: {e}")),
        })?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr);
        if text.contains("can't find crate for `core`") {
            return Err(PilError::Missing(format!(
                "the Rust target is missing: rustup target add {TARGET}"
            )));
        }
        return Err(PilError::Failed(format!(
            "the lock-step image does not build:\n{text}"
        )));
    }
    String::from_utf8_lossy(&output.stdout)
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        .find_map(|message| message["executable"].as_str().map(PathBuf::from))
        .ok_or_else(|| PilError::Failed("cargo names no executable for the lock-step image".into()))
}
