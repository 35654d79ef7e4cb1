//! The command line's tests, one program: a module a subject. `cargo test -p host-sim documents::` runs one of them.

mod adaptation;
mod cli;
mod compare;
mod course;
mod design_guidance;
mod documents;
mod file_fields;
mod processor;
mod recordings;
mod study;
mod sweep;
mod unguided;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{Mutex, PoisonError};

/// Commands of the program behind `cargo xtask`: the documents speak of both programs, and what they print is read alike.
const EVIDENCE: [&str; 7] = [
    "faults",
    "availability",
    "eps",
    "handover",
    "reliance",
    "validate",
    "real-drives",
];

/// The program that has a command.
fn program(command: Option<&str>) -> Command {
    if command.is_some_and(|command| EVIDENCE.contains(&command)) {
        let name = format!("evidence{}", std::env::consts::EXE_SUFFIX);
        return Command::new(built(Path::new(&name), &["-p", "haptic-evidence"]));
    }
    Command::new(env!("CARGO_BIN_EXE_host-sim"))
}

/// Runs the program in a directory.
fn host_sim(directory: &Path, arguments: &[&str]) -> Output {
    program(arguments.first().copied())
        .args(arguments)
        .current_dir(directory)
        .output()
        .unwrap()
}

/// A program beside the command line's, built of what Cargo is told if it is not there as the sources are. Cargo builds it with the whole
/// workspace, but not with the tests of one package.
fn built(name: &Path, what: &[&str]) -> PathBuf {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let program = Path::new(env!("CARGO_BIN_EXE_host-sim")).with_file_name(name);
    let _one = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    if !is_up_to_date(&program) {
        let mut cargo = Command::new(env!("CARGO"));
        cargo.arg("build").args(what);
        if !cfg!(debug_assertions) {
            cargo.arg("--release");
        }
        let output = cargo.output().unwrap();
        assert!(
            output.status.success(),
            "{what:?}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
    program
}

/// Whether a program was built from the sources that are there.
fn is_up_to_date(program: &Path) -> bool {
    let changed = |path: &Path| path.metadata().and_then(|file| file.modified()).ok();
    let built = changed(program);
    let listed = std::fs::read_to_string(program.with_extension("d")).unwrap_or_default();
    let sources = listed.split_once(": ").map_or("", |(_, sources)| sources);
    !sources.is_empty()
        && sources.split_whitespace().all(|source| {
            let source = changed(Path::new(source));
            source.is_some() && source <= built
        })
}
