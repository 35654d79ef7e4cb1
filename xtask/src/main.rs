//! The one door for builds, tests, QEMU, sizes and benchmarks: `cargo xtask --help`.
//!
//! It only runs tools and looks at what they say. Exit codes: 0 well, 1 a check failed, 2 bad usage.

mod bench;
mod bindings_agree;
mod boards;
mod built;
mod by_hand;
mod c_library;
mod callgrind;
mod ci;
mod claims;
mod code;
mod coverage;
mod diagnosis;
mod dist;
mod evidence;
mod fmu;
mod gate;
mod golden;
mod identify;
mod image;
mod keys;
mod lines;
mod logs;
mod longest;
mod mutants;
mod policy;
mod profiles;
mod python;
mod qemu;
mod release;
mod seal;
mod site;
mod size;
mod speed;
mod tool;
mod trace;
mod venv;
mod web;
mod wheel;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::built::Built;

/// The one door for builds, tests, QEMU, sizes and benchmarks.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Everything that CI checks, in stages, two at a time. Installs the tools it needs where it may.
    Ci(ci::Options),
    /// Proves on the linked image that the controller has no panic path and no float.
    Gate,
    /// Instructions of a control step: on the host, against xtask/golden.json; in QEMU; or cycles, on a board.
    #[command(args_conflicts_with_subcommands = true)]
    Bench {
        /// In QEMU, the board's instructions; on a real one, the log of the product with its cycles (needs probe-rs).
        board: Option<boards::Board>,
        /// Write the host's figures into the golden file.
        #[arg(long, conflicts_with = "board")]
        bless: bool,
        #[command(subcommand)]
        what: Option<Bench>,
    },
    /// Line, region and branch coverage of the core by its tests: all lines and branches, or exit code 1.
    Coverage,
    /// Figures that documents show (docs/evidence.toml): measures those that are named, keeps them in docs/evidence/ with
    /// their commit, seeds and rule, and writes the tables. Without a name: lists them.
    Evidence(evidence::Options),
    /// A defect in every expression of the core (needs cargo-mutants; an hour or more). One that no test notices is
    /// printed, and is exit code 1; what cannot be noticed is listed in .cargo/mutants.toml with its reason.
    Mutants {
        /// Only these files, such as ecu/receivers.rs; with --by-hand also defects with this in their name
        #[arg(value_name = "FILE")]
        files: Vec<String>,
        /// Only in lines that differ from this commit, branch or tag; with --by-hand in files that do
        #[arg(long, value_name = "BASE")]
        in_diff: Option<String>,
        /// Instead, the defects made by hand of core/tests/mutants.toml: exit code 1 if one is not noticed.
        #[arg(long)]
        by_hand: bool,
    },
    /// Every board: builds without a warning, no panic and no float in its torque path; flash, RAM, stack and
    /// instructions against xtask/golden.json.
    Boards {
        /// Write the figures into the golden file.
        #[arg(long)]
        bless: bool,
    },
    /// Writes an image to a board (needs probe-rs).
    Flash(boards::Options),
    /// Writes an image to a board, runs it and prints its log (needs probe-rs).
    Run(boards::Options),
    /// Makes the page of keys of a board's flash, by chance or from a file: HEX, S19 and bytes, to write beside the image.
    Keys(keys::Options),
    /// Compares every frame of a board with this host's controller: QEMU's, or a real one behind a CAN adapter.
    Hil(boards::Hil),
    /// Builds the C library into target/dist/c for the host and a Cortex-M4F, holds its header to C99 and C++ and to the
    /// library's parameters, and runs its example natively and in QEMU.
    C,
    /// Builds the FMUs of controller, driver and vehicle (FMI 2.0 and 3.0 co-simulation) into target/dist, and has FMPy check
    /// them, alone and coupled.
    Fmu,
    /// Builds the lab for a browser into target/dist/haptic-lab.html, and tries it in a headless Chromium.
    Web,
    /// Recordings: what `host-sim convert` writes is read by pandas, scipy, asammdf, python-can and mcap, and the other way.
    Logs,
    /// Python, C and the command line on one run of the bus: a table of the frames that differ, or exit code 1.
    BindingsAgree,
    /// Builds the Python wheel into target/dist, and says what it weighs and links.
    Wheel(wheel::Options),
    /// Makes all that is handed on into target/handed-on, and tries it: command line, wheel, FMUs, C library, page, images of the
    /// boards, haptic-core for a registry; checksums, bills of materials, notices of licences.
    Release(release::Options),
    /// Writes an image's CRC-32 into its ELF, which the product looks for at every start. `flash` and `run` do it too.
    Seal {
        /// The ELF of steering-ecu, changed in place.
        elf: PathBuf,
    },
    /// Requirements (docs/requirements.toml): exit code 1 if evidence is missing, or something has no requirement.
    Trace {
        /// Print the requirements as a table in Markdown, as the book has them, and check nothing.
        #[arg(long, conflicts_with = "ran")]
        page: bool,
        /// Judge every requirement by what ran in the last `cargo xtask ci`; JUnit's XML in target/ci/requirements.xml.
        #[arg(long)]
        ran: bool,
    },
    #[command(flatten)]
    Claim(claims::Claim),
    /// Lines of code by crate, without tests, comments and blanks, and words in docs/, beside the budget of each (a test holds it).
    Lines,
    /// Documents, lab and interfaces (Rust, Python) as a site of static files in target/site. Exit code 1 if a
    /// link of the documents leads nowhere.
    Site(site::Options),
    /// Runs an image in QEMU and prints its log.
    Qemu(qemu::Options),
    /// Decodes a log that `host-sim ecu pil` left behind.
    Log {
        /// The log, as the image wrote it.
        file: PathBuf,
        /// The image that wrote it; the lock-step image if not given.
        #[arg(long)]
        elf: Option<PathBuf>,
    },
}

#[derive(Subcommand)]
enum Bench {
    /// Simulated seconds per wall second on one core: our closed loop, the same in C and in NumPy.
    Speed(speed::Options),
    /// The identification of a recorded drive: ours and SciPy's, to the same loss.
    Identify,
}

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Ci(options) => ci::check(&options),
        Command::Gate => gate::run(),
        Command::Coverage => coverage::check(),
        Command::Evidence(options) => evidence::run(&options),
        Command::Mutants {
            files,
            in_diff,
            by_hand,
        } => {
            let check = if by_hand { by_hand::run } else { mutants::check };
            check(&files, in_diff.as_deref())
        }
        Command::Boards { bless } => boards::check(boards::Scope::All, Built::ToShip, bless),
        Command::Flash(options) => boards::flash(options.board, options.image),
        Command::Run(options) => boards::run_on(options.board, options.image),
        Command::Keys(options) => keys::make(&options),
        Command::Hil(options) => boards::hil(&options),
        Command::C => c_library::check(Built::ToShip),
        Command::Fmu => fmu::check(Built::ToShip),
        Command::Web => web::check(Built::ToShip),
        Command::Logs => logs::check(Built::ToShip),
        Command::BindingsAgree => bindings_agree::check(Built::ToShip),
        Command::Wheel(options) => wheel::build(&options),
        Command::Release(options) => release::make(&options),
        Command::Bench {
            what: Some(Bench::Speed(options)),
            ..
        } => speed::run(&options),
        Command::Bench {
            what: Some(Bench::Identify),
            ..
        } => identify::run(),
        Command::Bench {
            board: Some(board), ..
        } => boards::bench(board),
        Command::Bench { bless, .. } => bench::run(bless),
        Command::Qemu(options) => return ended(qemu::run(&options)),
        Command::Claim(claim) => return ended(claim.run()),
        Command::Trace { ran: true, .. } => trace::by_execution(&ci::logs()),
        Command::Trace { page: true, .. } => trace::page().map(|page| print!("{page}")),
        Command::Trace { .. } => trace::run(),
        Command::Lines => lines::print(tool::root()).map_err(Into::into),
        Command::Site(options) => site::build(&options),
        Command::Seal { elf } => seal::seal(&elf).map(|crc| println!("sealed with {crc:#010x}")),
        Command::Log { file, elf } => qemu::print_log(&file, elf),
    };
    ended(result.map(|()| ExitCode::SUCCESS))
}

fn ended(result: anyhow::Result<ExitCode>) -> ExitCode {
    result.unwrap_or_else(|error| {
        eprintln!("error: {error:#}");
        ExitCode::from(if error.is::<tool::Usage>() { 2 } else { 1 })
    })
}
