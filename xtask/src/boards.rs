//! The boards: what each is to the tools, that every one builds, and how an image gets onto a real one.

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};

use crate::image::{self, M4F};
use crate::tool::{self, cargo, run};
use crate::{frames, size};

/// A board, by the feature that chooses it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Board {
    /// QEMU, Cortex-M4F.
    Mps2An386,
    /// QEMU, Cortex-M7.
    Mps2An500,
    /// ST NUCLEO-G474RE.
    NucleoG474re,
}

impl Board {
    const fn feature(self) -> &'static str {
        match self {
            Self::Mps2An386 => "mps2-an386",
            Self::Mps2An500 => "mps2-an500",
            Self::NucleoG474re => "nucleo-g474re",
        }
    }

    /// probe-rs's name of the chip; None where there is nothing to flash.
    const fn chip(self) -> Option<&'static str> {
        match self {
            Self::Mps2An386 | Self::Mps2An500 => None,
            Self::NucleoG474re => Some("STM32G474RETx"),
        }
    }
}

/// What goes onto which board.
#[derive(Args)]
pub(crate) struct Options {
    /// The board.
    board: Board,
    /// The image: steering-ecu or lockstep.
    #[arg(long, default_value = "steering-ecu")]
    image: String,
}

/// Every board without a warning, its images linked, and what they take of its memory.
pub(crate) fn check() -> Result<()> {
    for board in Board::value_variants() {
        let features = board.feature();
        let package = ["clippy", "--release", "-p", "haptic-firmware", "--bins", "--lib"];
        run(cargo()
            .args(package)
            .args(["--target", M4F, "--features", features])
            .args(["--", "-D", "warnings"]))
        .with_context(|| features.to_owned())?;
    }
    println!("{:<16}{:<14}{:>10}{:>10}", "board", "image", "flash, B", "RAM, B");
    for board in Board::value_variants() {
        let board = board.feature();
        for bin in ["steering-ecu", "lockstep"] {
            let elf = image::elf_of(&mut image::build_command(bin, M4F, board))?;
            let size = size::of(&elf)?;
            let frame = frames::largest(&elf)?;
            println!(
                "{board:<16}{bin:<14}{:>10}{:>10}{frame:>18}",
                size.flash, size.ram
            );
        }
    }
    Ok(())
}

/// Writes an image to a board and starts it.
pub(crate) fn flash(options: &Options) -> Result<()> {
    let chip = chip(options)?;
    let elf = image::elf_of(&mut image::build_command(
        &options.image,
        M4F,
        options.board.feature(),
    ))?;
    run(tool::command("probe-rs")
        .args(["download", "--verify", "--chip", chip])
        .arg(elf))?;
    run(tool::command("probe-rs").args(["reset", "--chip", chip]))
}

/// Writes an image to a board, starts it and prints its log until interrupted.
pub(crate) fn run_on(options: &Options) -> Result<()> {
    let chip = chip(options)?;
    let elf = image::elf_of(&mut image::build_command(
        &options.image,
        M4F,
        options.board.feature(),
    ))?;
    run(tool::command("probe-rs").args(["run", "--chip", chip]).arg(elf))
}

/// The chip to flash, if all that flashing needs is there.
fn chip(options: &Options) -> Result<&'static str> {
    let board = options.board.feature();
    let Some(chip) = options.board.chip() else {
        bail!("{board} is a machine of QEMU, with nothing to flash: cargo xtask qemu");
    };
    if !tool::exists("probe-rs") {
        bail!("probe-rs is missing: cargo install probe-rs-tools, or https://probe.rs/docs/getting-started");
    }
    Ok(chip)
}
