//! `host-sim ecu COMMAND`: the ECU itself, in QEMU or on a board, and its bus.

mod bus;
mod cost;
mod diag;
mod keys;
mod live;
mod parameters;
mod pil;
mod run;

use std::path::PathBuf;

use clap::builder::NonEmptyStringValueParser;
use clap::{Args, Subcommand};
use haptic_batch::files::load_scenario;
use haptic_pil::PilError;
use haptic_sim::input::InputError;
use haptic_sim::scenario::Scenario;

use super::{BadInput, Outcome};

#[derive(Debug, Args)]
struct Bus {
    /// The way to the bus: a CAN interface (can0), the serial port of an SLCAN adapter (/dev/ttyUSB0), or
    /// tcp:HOST:PORT
    #[arg(long, value_name = "IFACE", value_parser = NonEmptyStringValueParser::new())]
    can: String,
    /// Print the result as one JSON object
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
struct ScenarioArgument {
    /// Scenario file (TOML, see docs/files.md); default: medium reliance on paper-course
    #[arg(value_name = "SCENARIO.toml")]
    scenario: Option<PathBuf>,
}

impl ScenarioArgument {
    fn load(&self) -> Result<Scenario, InputError> {
        self.scenario
            .as_deref()
            .map_or_else(|| Ok(Scenario::default()), load_scenario)
    }
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// The ECU in QEMU on a bus in real time, for any SLCAN client
    Run(run::Arguments),
    /// One scenario with the ECU's image in QEMU or on a board, every frame compared with the desktop's
    Pil(pil::Arguments),
    /// What goes over the bus of a real ECU as it comes: mode, torques, faults, K_hg; and a recording of it
    Live(live::Arguments),
    /// What parameters an ECU on a real bus uses; new ones for it to store
    Parameters(parameters::Arguments),
    /// What a workshop's tester asks of an ECU: stored faults, readings, parameters (UDS)
    Diag(diag::Arguments),
    /// Instructions of a scenario's steps in QEMU without authentication, with each MAC, and under floods
    Cost(cost::Arguments),
    /// The worst-case load of the CAN bus, message by message
    Bus(bus::Arguments),
}

pub(super) fn run(command: &Command) -> Result<Outcome, BadInput> {
    match command {
        Command::Run(arguments) => run::run(arguments),
        Command::Pil(arguments) => pil::run(arguments),
        Command::Live(arguments) => live::run(arguments),
        Command::Parameters(arguments) => parameters::run(arguments),
        Command::Diag(arguments) => diag::run(arguments),
        Command::Cost(arguments) => cost::run(arguments),
        Command::Bus(arguments) => bus::run(arguments),
    }
}

/// An ECU that cannot be built, started or heard is a check that failed, and a tool that is missing is bad usage.
fn failed(error: PilError) -> Result<Outcome, BadInput> {
    if matches!(error, PilError::Missing(_)) {
        return Err(error.into());
    }
    eprintln!("error: {error}");
    Ok(Outcome::Failed)
}
