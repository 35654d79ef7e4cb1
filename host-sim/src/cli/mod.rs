//! The command line: options in, tables, files and exit codes out.
//!
//! Exit codes: 0 all is well; 1 a check or a comparison failed; 2 bad input or usage, or a program that is not
//! installed. Results go to stdout, all
//! else (progress, where the files are, what is wrong) to stderr; with `--json` stdout holds one JSON object.
//!
//! One file per subcommand. Not here: anything that a study or a model decides.

mod availability;
mod bus;
mod checkpoint;
mod convert;
mod course;
mod design;
mod drivers;
mod ecu;
mod evaluate;
mod experiment;
mod faults;
mod handover;
mod identify;
mod lab;
mod live;
mod output;
mod parameters;
mod participants;
mod pil;
mod progress;
mod recording;
mod reliance;
mod road;
mod run;
mod series;
mod stability;
mod study;
mod sweep;

use std::fmt::Display;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use serde::Serialize;

/// Closed-loop workbench for the haptic-guidance steering controller.
///
/// Without a subcommand: the evaluation, as `evaluate` with the same options. New here? The tutorial is
/// docs/tutorials/first-evaluation.md, and docs/glossary.md explains every word and symbol.
///
/// Exit codes: 0 all is well, 1 a check or a comparison failed, 2 bad input or usage, or a program that is not
/// installed.
#[derive(Debug, Parser)]
#[command(version, args_conflicts_with_subcommands = true)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    evaluate: evaluate::Arguments,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// The paper's evaluation: 3 drivers, 4 conditions, with and without failure of the guidance
    Evaluate(evaluate::Arguments),
    /// The paper's participants as drivers with a known truth: driven, identified, driven again
    Experiment(experiment::Arguments),
    /// A driver's parameters from a recorded drive, with their uncertainty
    Identify(identify::Arguments),
    /// A recording in another format: CSV, Parquet, MAT, MDF4, MCAP, candump, ASC, BLF; or a list of its channels
    Convert(convert::Arguments),
    /// The lab in the browser: sliders for driver, guidance and failure, and a road to drive yourself
    Lab(lab::Arguments),
    /// Which experiment tells a driver's parameters: probe, course and length for a given error
    Design(design::Arguments),
    /// Several drivers beside each other: what differs between two, and what a group is like
    Drivers(drivers::Arguments),
    /// A road: the lane of an OpenDRIVE file or of a course file, its length, its picture, its centre every metre
    Course(course::Arguments),
    /// One scenario from a TOML file
    Run(run::Arguments),
    /// Every fault by name into the closed loop, every rule checked in every cycle
    Faults(faults::Arguments),
    /// How often guidance leaves for nothing on real roads: many cars, hours of driving, by cause
    Availability(availability::Arguments),
    /// A map over speed and delay: where a driver keeps the lane, alone and with guidance, and how well
    Stability(stability::Arguments),
    /// What a lost input costs if the ECU hands over within 2 s, and if the torque is lost at once: 40 to 120 km/h
    Handover(handover::Arguments),
    /// One scenario with the ECU's image in QEMU, every frame compared with the host's controller
    Pil(pil::Arguments),
    /// The ECU in QEMU on a bus that keeps the time of the wall, for any SLCAN client
    Ecu(ecu::Arguments),
    /// What parameters an ECU on a real bus uses; new ones for it to store
    Parameters(parameters::Arguments),
    /// What goes over the bus of a real ECU as it comes: mode, torques, faults, K_hg; and a recording of it
    Live(live::Arguments),
    /// The worst-case load of the CAN bus, message by message
    Bus(bus::Arguments),
    /// Many drives with varied fields (lists, ranges, distributions), a row of a table each, on threads and shards
    Sweep(sweep::Arguments),
    /// Participants and conditions from one file: the order of each participant, a recording of each session that is never
    /// overwritten, metrics by condition
    Study(study::Arguments),
    /// How well the ECU estimates while it drives how much a driver relies on it (K_hg), against the truth
    Reliance(reliance::Arguments),
}

/// How a command ended that could do its work.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Outcome {
    Good,
    /// A check or a comparison failed.
    Failed,
    /// By a signal.
    Interrupted,
}

/// What shells report of a program that was interrupted: 128 and the signal's number.
const INTERRUPTED: u8 = 130;

/// Why a command could not do its work: a message for people.
#[derive(Debug)]
struct BadInput(String);

impl<E: Display> From<E> for BadInput {
    fn from(error: E) -> Self {
        Self(error.to_string())
    }
}

pub(crate) fn main() -> ExitCode {
    let cli = Cli::parse();
    let result = match cli.command {
        None => evaluate::run(&cli.evaluate),
        Some(Command::Evaluate(arguments)) => evaluate::run(&arguments),
        Some(Command::Experiment(arguments)) => experiment::run(&arguments),
        Some(Command::Identify(arguments)) => identify::run(&arguments),
        Some(Command::Convert(arguments)) => convert::run(&arguments),
        Some(Command::Lab(arguments)) => lab::run(&arguments),
        Some(Command::Design(arguments)) => design::run(&arguments),
        Some(Command::Drivers(arguments)) => drivers::run(&arguments),
        Some(Command::Course(arguments)) => course::run(&arguments),
        Some(Command::Run(arguments)) => run::run(&arguments),
        Some(Command::Faults(arguments)) => faults::run(&arguments),
        Some(Command::Availability(arguments)) => availability::run(&arguments),
        Some(Command::Stability(arguments)) => stability::run(&arguments),
        Some(Command::Handover(arguments)) => handover::run(&arguments),
        Some(Command::Pil(arguments)) => pil::run(&arguments),
        Some(Command::Ecu(arguments)) => ecu::run(&arguments),
        Some(Command::Parameters(arguments)) => parameters::run(&arguments),
        Some(Command::Live(arguments)) => live::run(&arguments),
        Some(Command::Bus(arguments)) => bus::run(&arguments),
        Some(Command::Sweep(arguments)) => sweep::run(&arguments),
        Some(Command::Study(arguments)) => study::run(&arguments),
        Some(Command::Reliance(arguments)) => reliance::run(&arguments),
    };
    match result {
        Ok(Outcome::Good) => ExitCode::SUCCESS,
        Ok(Outcome::Failed) => ExitCode::from(1),
        Ok(Outcome::Interrupted) => ExitCode::from(INTERRUPTED),
        Err(BadInput(message)) => {
            eprintln!("error: {message}");
            ExitCode::from(2)
        }
    }
}

/// One JSON object on stdout.
fn print_json(value: &impl Serialize) -> Result<(), BadInput> {
    print(&serde_json::to_string_pretty(value)?)
}

/// What a reader of the results has to know, on stderr: stdout is the results' own.
fn print_notes(notes: &[String]) {
    for note in notes {
        eprintln!("note: {note}");
    }
}

/// Text on stdout. A reader that has seen enough (`| head`) is no error.
fn print(text: &str) -> Result<(), BadInput> {
    use std::io::{ErrorKind, Write};
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{}", text.trim_end()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}
