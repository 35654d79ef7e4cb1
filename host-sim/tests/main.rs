//! The command line's tests, one program: a module a subject. `cargo test -p host-sim documents::` runs one of them.

mod adaptation;
mod cli;
mod compare;
mod course;
mod design_guidance;
mod documents;
mod file_fields;
mod recordings;
mod study;
mod sweep;
mod unguided;

use std::path::Path;
use std::process::{Command, Output};

/// Runs the program in a directory.
fn host_sim(directory: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .args(arguments)
        .current_dir(directory)
        .output()
        .unwrap()
}
