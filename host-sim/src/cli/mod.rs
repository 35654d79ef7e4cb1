//! The command line: options in, tables, files and exit codes out.
//!
//! Exit codes: 0 all is well; 1 a check or a comparison failed; 2 bad input or usage, or a program that is not
//! installed. Results go to stdout, all else (progress, where the files are, what is wrong) to stderr; with `--json`
//! stdout holds one JSON object.
//!
//! What `haptic-evidence` needs too is public. One file per command; their groups in `--help` are in `names`. Not here: anything that a study or a model decides.

mod assist;
pub mod checkpoint;
mod compare;
mod convert;
mod course;
mod design;
mod design_guidance;
mod drivers;
mod ecu;
mod evaluate;
mod experiment;
mod identify;
mod identify_vehicle;
mod lab;
mod names;
pub mod output;
pub mod participants;
pub mod progress;
pub mod recording;
pub mod results;
mod road;
mod run;
mod series;
mod stability;
mod study;
mod sweep;

use std::ffi::OsString;
use std::fmt::Display;
use std::path::Path;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use haptic_log::near::did_you_mean;
use serde::Serialize;

pub use names::signed;
pub use output::FileArguments;

/// Closed-loop workbench for the haptic-guidance steering controller
#[derive(Debug, Parser)]
#[command(version, override_usage = "host-sim [COMMAND]", after_help = AFTER_HELP)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    files: FileArguments,
}

const AFTER_HELP: &str = "\
`host-sim` alone is `host-sim evaluate`. `host-sim COMMAND --help` explains a
command and its options.

New here? The tutorial is docs/tutorials/first-evaluation.md;
docs/glossary.md explains words and symbols.

`cargo xtask --help` lists what the claims rest on: faults, availability,
handover, reliance, validate and real-drives.

Exit codes: 0 all is well, 1 a check or a comparison failed, 2 bad input or
usage, or a program that is not installed, 130 interrupted.";

/// The first paragraph of each is its line in the program's `--help`, which `names` groups.
#[derive(Debug, Subcommand)]
enum Command {
    /// Three drivers, four conditions, with and without a failure
    ///
    /// What fails is the guidance.
    Evaluate(evaluate::Arguments),
    /// The 14 participants as known drivers: driven, identified
    ///
    /// The identified drivers drive again.
    Experiment(experiment::Arguments),
    /// One scenario from a TOML file
    Run(run::Arguments),
    /// Many drives with varied fields, a row of a table each
    ///
    /// Fields vary by lists, ranges and distributions; threads and shards share the drives.
    Sweep(sweep::Arguments),
    /// Every law against every driver, each law tuned first
    ///
    /// On roads, at speeds, with seeds and failures; and laws that adapt with drivers who adapt to them: small gain, equilibria, swings.
    Compare(compare::Arguments),
    /// Gains of the guidance for a population of drivers
    ///
    /// They are judged on held-out drives.
    DesignGuidance(design_guidance::Arguments),
    /// Guidance beside power assist, through a torsion bar
    ///
    /// Overlay or offset: what the hands feel, margins, what a sudden loss costs.
    Assist(assist::Arguments),
    /// The hands' torque through a torsion bar, by the sensor
    ///
    /// How late and how wrong an observer tells it, by the steps and the rate of the angle.
    DriverTorque(assist::SensorArguments),
    /// A road from a file: its lane, length, picture and centre
    Course(course::Arguments),
    /// A map over speed and delay: where a driver keeps the lane
    ///
    /// Alone, and guided.
    Stability(stability::Arguments),
    /// The lab in the browser: sliders, and a road to drive yourself
    Lab(lab::Arguments),
    /// A driver's parameters from a recorded drive
    ///
    /// With their uncertainty.
    Identify(identify::Arguments),
    /// A vehicle's parameters from a recorded drive
    ///
    /// Ratio, understeer, tyres, and inertia, damping and friction of the column, with their uncertainty.
    IdentifyVehicle(identify_vehicle::Arguments),
    /// Several drivers beside each other
    ///
    /// What differs between two, what a group is like.
    Drivers(drivers::Arguments),
    /// Which experiment tells a driver's parameters well enough
    ///
    /// Probe, course and length, for a given error.
    Design(design::Arguments),
    /// Participants and conditions of one file, in balanced order
    ///
    /// Each session leaves a recording that is never overwritten; the metrics come by condition.
    Study(study::Arguments),
    /// A recording in another format, or the list of its channels
    ///
    /// CSV, Parquet, MAT, MDF4, candump, ASC, BLF.
    Convert(convert::Arguments),
    /// The ECU and its bus: run, pil, live, parameters, diag, bus
    ///
    /// In QEMU or on a board.
    #[command(subcommand)]
    Ecu(ecu::Command),
}

/// How a command ended that could do its work.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// All is well.
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
pub struct BadInput(pub String);

impl<E: Display> From<E> for BadInput {
    fn from(error: E) -> Self {
        Self(error.to_string())
    }
}

/// The program `host-sim`.
pub fn main() -> ExitCode {
    let mut arguments: Vec<OsString> = std::env::args_os().collect();
    if arguments.len() == 1 {
        arguments.push("evaluate".into());
    }
    let parsed = names::grouped(Cli::command())
        .try_get_matches_from(&arguments)
        .and_then(|matches| Cli::from_arg_matches(&matches));
    let result = match parsed {
        Ok(cli) => cli.files.choose().and_then(|()| run(&cli.command)),
        Err(error) => match names::explain(&error, &arguments) {
            Some(sentence) => Err(BadInput(sentence)),
            None => error.exit(),
        },
    };
    status(result)
}

/// How the program ends; what is wrong goes to stderr.
pub fn status(result: Result<Outcome, BadInput>) -> ExitCode {
    match result {
        Ok(Outcome::Good) => ExitCode::SUCCESS,
        Ok(Outcome::Failed) => ExitCode::from(1),
        Ok(Outcome::Interrupted) => ExitCode::from(INTERRUPTED),
        Err(BadInput(message)) => {
            let words: Vec<String> = std::env::args_os()
                .map(|word| word.to_string_lossy().into_owned())
                .collect();
            eprintln!("error: {}", names::as_written(message, &words));
            ExitCode::from(2)
        }
    }
}

fn run(command: &Command) -> Result<Outcome, BadInput> {
    match command {
        Command::Evaluate(arguments) => evaluate::run(arguments),
        Command::Experiment(arguments) => experiment::run(arguments),
        Command::Run(arguments) => run::run(arguments),
        Command::Sweep(arguments) => sweep::run(arguments),
        Command::Compare(arguments) => compare::run(arguments),
        Command::Assist(arguments) => assist::run(arguments),
        Command::DriverTorque(arguments) => assist::sensors(arguments),
        Command::DesignGuidance(arguments) => design_guidance::run(arguments),
        Command::Course(arguments) => course::run(arguments),
        Command::Stability(arguments) => stability::run(arguments),
        Command::Lab(arguments) => lab::run(arguments),
        Command::Identify(arguments) => identify::run(arguments),
        Command::IdentifyVehicle(arguments) => identify_vehicle::run(arguments),
        Command::Drivers(arguments) => drivers::run(arguments),
        Command::Design(arguments) => design::run(arguments),
        Command::Study(arguments) => study::run(arguments),
        Command::Convert(arguments) => convert::run(arguments),
        Command::Ecu(command) => ecu::run(command),
    }
}

/// One JSON object on stdout.
fn print_json(value: &impl Serialize) -> Result<(), BadInput> {
    print(&serde_json::to_string_pretty(value)?)
}

/// The values of the names, all if there is no name.
///
/// # Errors
/// A name that there is not.
pub fn chosen<T>(
    option: &str,
    names: &[String],
    all: &'static [T],
    name_of: fn(&T) -> &'static str,
) -> Result<Vec<&'static T>, BadInput> {
    let known: Vec<&str> = all.iter().map(name_of).collect();
    if let Some(name) = names.iter().find(|name| !known.contains(&name.as_str())) {
        let near = did_you_mean(name, known.iter().copied());
        let known = known.join(", ");
        return Err(BadInput(format!(
            "{option}: there is no {name}{near}; there are {known}"
        )));
    }
    let wanted = |one: &&'static T| names.is_empty() || names.iter().any(|name| name == name_of(one));
    Ok(all.iter().filter(wanted).collect())
}

/// What to say of a file.
fn in_file<E: Display>(path: &Path) -> impl Fn(E) -> BadInput {
    move |error| BadInput(format!("{}: {error}", path.display()))
}

/// What a reader of the results has to know, on stderr: stdout is the results' own.
fn print_notes<N: Display>(notes: impl IntoIterator<Item = N>) {
    for note in notes {
        eprintln!("note: {note}");
    }
}

/// How long a line on stdout may be: the terminal's width, or where there is no terminal what `COLUMNS` says.
pub fn width() -> Option<usize> {
    let terminal = terminal_size::terminal_size_of(std::io::stdout()).map(|(width, _)| width.0.into());
    let asked = || std::env::var("COLUMNS").ok()?.parse().ok();
    terminal.or_else(asked).filter(|width| *width > 0)
}

/// Text on stdout. A reader that has seen enough (`| head`) is no error.
///
/// # Errors
/// Those of the stream.
pub fn print(text: &str) -> Result<(), BadInput> {
    use std::io::{ErrorKind, Write};
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{}", text.trim_end()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}
