//! What the claims about the controller and the identification rest on: campaigns, and studies of drivers whose truth is
//! known. `cargo xtask` starts this program from a checkout, and a release has it beside `host-sim`; the first command of the workbench does
//! not compile it.
//!
//! A file below `cli` is a command, a file below `reports` what it shows. Not here: the campaign itself
//! (`haptic-campaign`), the engine that drives (`haptic-batch`), and the figures that documents keep (`cargo xtask evidence`).

mod cli;
mod reports;

use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use host_sim::cli::{FileArguments, signed, status};

use cli::{availability, eps, faults, handover, real_drives, reliance, validate};

/// What the claims about controller and identification rest on
#[derive(Debug, Parser)]
#[command(version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    files: FileArguments,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Every fault by name, every rule checked in every cycle
    ///
    /// In the closed loop.
    Faults(faults::Arguments),
    /// How often guidance leaves for nothing on real roads, by cause
    ///
    /// Many cars drive for hours.
    Availability(availability::Arguments),
    /// How often an EPS with limits of its own would fault behind our ECU
    Eps(eps::Arguments),
    /// What a lost input costs, with a handover and without
    ///
    /// At every instant of bends, at 40 to 130 km/h.
    Handover(handover::Arguments),
    /// How well the ECU estimates K_hg while it drives
    ///
    /// K_hg says how much a driver relies on it.
    Reliance(reliance::Arguments),
    /// How right the estimates of `identify` are
    ///
    /// On drivers with a known truth.
    Validate(validate::Arguments),
    /// Recordings of real people: read or refused, half against half
    ///
    /// A driver that is fitted to one half of each drive predicts the other.
    RealDrives(real_drives::Arguments),
}

fn main() -> ExitCode {
    haptic_log::guard::keep_guarded_panics_quiet();
    let name = match std::env::var_os("HAPTIC_BY_XTASK") {
        Some(_) => "cargo xtask",
        None => "evidence",
    };
    let parsed = Cli::command()
        .bin_name(name)
        .mut_subcommands(signed)
        .try_get_matches();
    let cli = match parsed.and_then(|matches| Cli::from_arg_matches(&matches)) {
        Ok(cli) => cli,
        Err(error) => error.exit(),
    };
    status(cli.files.choose().and_then(|()| match &cli.command {
        Command::Faults(arguments) => faults::run(arguments),
        Command::Availability(arguments) => availability::run(arguments),
        Command::Eps(arguments) => eps::run(arguments),
        Command::Handover(arguments) => handover::run(arguments),
        Command::Reliance(arguments) => reliance::run(arguments),
        Command::Validate(arguments) => validate::run(arguments),
        Command::RealDrives(arguments) => real_drives::run(arguments),
    }))
}
