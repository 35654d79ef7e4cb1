//! Builds the bare-metal images and finds their ELF files.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};
use clap::ValueEnum;

use crate::dist;
use crate::tool::{self, cargo, output, root};

/// The reference board's core, with floating-point hardware.
pub(crate) const M4F: &str = "thumbv7em-none-eabihf";
/// A core without: every float operation is a call that can be seen.
pub(crate) const M3: &str = "thumbv7m-none-eabi";
/// The reference board.
pub(crate) const BOARD: &str = "mps2-an386";

/// What goes onto a board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Image {
    /// The product.
    SteeringEcu,
    /// The controller of the product, driven tick by tick by a simulator.
    Lockstep,
}

impl Image {
    pub(crate) const fn bin(self) -> &'static str {
        match self {
            Self::SteeringEcu => "steering-ecu",
            Self::Lockstep => "lockstep",
        }
    }
}

/// The command that builds `bin` of the firmware as it is shipped. Where the sensors are wired to the board, by the
/// profile without fat LTO: with it the vendor's driver of the converters keeps a panic on the torque path, which
/// nothing reaches.
pub(crate) fn build_command(bin: &str, target: &str, features: &str) -> Command {
    command_of("build", bin, target, features)
}

fn command_of(subcommand: &str, bin: &str, target: &str, features: &str) -> Command {
    let profile = if features.split(',').any(|feature| feature.ends_with("-sensors")) {
        "firmware-thin"
    } else {
        "firmware"
    };
    let mut command = cargo();
    command
        .args([subcommand, "--profile", profile])
        .args(["-p", "haptic-firmware", "--bin", bin])
        .args(["--target", target, "--features", features])
        .arg("--message-format=json-render-diagnostics");
    command
}

/// Builds an image to the same bytes in whatever folder; its ELF, and the linker's map.
pub(crate) fn with_map(bin: &str, features: &str) -> Result<(PathBuf, String)> {
    // Not absolute, because it is among the options that Cargo makes names of symbols from. One for each image: what is built
    // already is not linked again.
    let map = format!("target/{bin}-{}.map", features.replace(',', "-"));
    let mut command = command_of("rustc", bin, M4F, features);
    command
        .env("HAPTIC_COMMIT", dist::commit())
        .args(remapped()?)
        .args(["--", "-C", &format!("link-arg=-Map={map}")]);
    let elf = elf_of(&mut command)?;
    let text = std::fs::read_to_string(root().join(&map)).context("the linker's map")?;
    let here = format!("{}/", root().display());
    let sysroot = output(tool::command("rustc").args(["--print", "sysroot"]))?;
    Ok((elf, text.replace(&here, "").replace(sysroot.trim(), "rust")))
}

/// Options of Cargo that leave this machine's folders out of what is built for a board, beside the options of
/// `.cargo/config.toml`.
pub(crate) fn remapped() -> Result<[String; 2]> {
    let flags = toml::Value::from(dist::remapped()?.to_vec());
    Ok(["--config".to_owned(), format!("target.{M4F}.rustflags={flags}")])
}

/// Runs a build command, whose messages the user sees, and returns its ELF.
pub(crate) fn elf_of(command: &mut Command) -> Result<PathBuf> {
    let output = command
        .stderr(Stdio::inherit())
        .output()
        .context("cargo does not start")?;
    if !output.status.success() {
        bail!("the image does not build");
    }
    String::from_utf8_lossy(&output.stdout)
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        .find_map(|message| message["executable"].as_str().map(PathBuf::from))
        .context("cargo names no executable")
}
