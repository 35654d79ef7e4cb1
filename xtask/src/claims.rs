//! The program `evidence`, built and started: what claims rest on, by commands with options of their own.

use std::ffi::OsString;
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::{Args, Subcommand};

use crate::tool::{cargo, root};

/// The commands of the program.
#[derive(Subcommand)]
pub(crate) enum Claim {
    /// Every fault by name, every rule checked in every cycle (`cargo xtask faults --help`).
    Faults(Passed),
    /// How often guidance leaves for nothing on real roads, by cause (`cargo xtask availability --help`).
    Availability(Passed),
    /// How often an EPS with limits of its own would fault behind our ECU (`cargo xtask eps --help`).
    Eps(Passed),
    /// What a lost input costs, with a handover and without (`cargo xtask handover --help`).
    Handover(Passed),
    /// How well the ECU estimates K_hg while it drives (`cargo xtask reliance --help`).
    Reliance(Passed),
    /// How right the estimates of `identify` are, on drivers with a known truth (`cargo xtask validate --help`).
    Validate(Passed),
    /// Recordings of real people below a directory: read or refused, half against half (`cargo xtask real-drives --help`).
    RealDrives(Passed),
}

/// What the command itself understands.
#[derive(Args)]
#[command(disable_help_flag = true)]
pub(crate) struct Passed {
    /// Options of the command
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "OPTION")]
    options: Vec<OsString>,
}

impl Claim {
    /// Runs it where the caller stands, in the shape of daily work; its exit code.
    pub(crate) fn run(&self) -> Result<ExitCode> {
        let (name, passed) = match self {
            Self::Faults(passed) => ("faults", passed),
            Self::Availability(passed) => ("availability", passed),
            Self::Eps(passed) => ("eps", passed),
            Self::Handover(passed) => ("handover", passed),
            Self::Reliance(passed) => ("reliance", passed),
            Self::Validate(passed) => ("validate", passed),
            Self::RealDrives(passed) => ("real-drives", passed),
        };
        // An interrupt is the program's, which says what it keeps.
        ctrlc::set_handler(|| ())?;
        let status = cargo()
            .args("run --release -q -p haptic-evidence --manifest-path".split(' '))
            .arg(root().join("Cargo.toml"))
            .arg("--")
            .arg(name)
            .args(&passed.options)
            // The name under which its help calls it.
            .env("HAPTIC_BY_XTASK", "1")
            .current_dir(std::env::current_dir()?)
            .status()
            .context("cargo run -p haptic-evidence")?;
        let code = status.code().and_then(|code| u8::try_from(code).ok());
        Ok(ExitCode::from(code.unwrap_or(1)))
    }
}
