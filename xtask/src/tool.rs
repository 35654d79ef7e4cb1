//! Running other programs, finding them, and saying which one is missing.

use std::ffi::OsStr;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

/// The workspace's root.
pub(crate) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("xtask lies in the workspace")
}

/// Cargo, in the workspace's root.
pub(crate) fn cargo() -> Command {
    command(std::env::var("CARGO").unwrap_or_else(|_| "cargo".into()))
}

/// A program, in the workspace's root.
pub(crate) fn command(program: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new(program);
    command.current_dir(root());
    command
}

/// How everything that is tested is built: one profile and one set of features, so that nothing is compiled twice.
pub(crate) const SHAPE: [&str; 8] = [
    "--release",
    "--workspace",
    "--exclude",
    "xtask",
    "--exclude",
    "xtask-log",
    "--features",
    ALL_FORMATS,
];

/// What the command line can read, write and draw beyond what the first command builds.
pub(crate) const ALL_FORMATS: &str = "host-sim/full";

/// The command line's file.
pub(crate) const HOST_SIM: &str = if cfg!(windows) { "host-sim.exe" } else { "host-sim" };
/// The file of the program behind `cargo xtask faults`.
pub(crate) const EVIDENCE: &str = if cfg!(windows) { "evidence.exe" } else { "evidence" };

/// Runs a program whose output the user sees.
pub(crate) fn run(command: &mut Command) -> Result<()> {
    let status = command.status().with_context(|| describe(command))?;
    if !status.success() {
        bail!("{}: {status}", describe(command));
    }
    Ok(())
}

/// Runs a program and returns what it prints.
pub(crate) fn output(command: &mut Command) -> Result<String> {
    let output = command
        .stderr(Stdio::inherit())
        .output()
        .with_context(|| describe(command))?;
    if !output.status.success() {
        bail!("{}: {}", describe(command), output.status);
    }
    String::from_utf8(output.stdout).with_context(|| describe(command))
}

/// What the user has to put right: a wrong argument, or a tool or a device that is not there. Exit code 2.
#[derive(Debug)]
pub(crate) struct Usage(pub(crate) String);

impl std::fmt::Display for Usage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Usage {}

fn describe(command: &Command) -> String {
    let arguments = command.get_args().map(|a| a.to_string_lossy());
    [command.get_program().to_string_lossy()]
        .into_iter()
        .chain(arguments)
        .collect::<Vec<_>>()
        .join(" ")
}

/// Files and folders in a folder, and in those in it.
pub(crate) fn below(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let path = entry?.path();
        if path.is_dir() {
            found.extend(below(&path)?);
        }
        found.push(path);
    }
    Ok(found)
}

/// A program of rustup's component `llvm-tools`.
pub(crate) fn llvm(name: &str) -> Result<Command> {
    let sysroot = output(command("rustc").args(["--print", "sysroot"]))?;
    let libraries = PathBuf::from(sysroot.trim()).join("lib/rustlib");
    let path = std::fs::read_dir(&libraries)
        .with_context(|| libraries.display().to_string())?
        .flatten()
        .map(|target| target.path().join("bin").join(name))
        .find(|path| path.is_file());
    match path {
        Some(path) => Ok(command(path)),
        None => bail!("{name} is missing: rustup component add llvm-tools"),
    }
}

/// Whether a program is on the path.
pub(crate) fn exists(program: &str) -> bool {
    let probe = Command::new(program)
        .arg("--version")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    !matches!(probe, Err(e) if e.kind() == ErrorKind::NotFound)
}

/// Sees to it that programs are there: installs the Debian packages of those that are not, as root or with a
/// `sudo` that asks nothing.
///
/// # Errors
/// In one line, what is missing and what would install it.
pub(crate) fn ensure(programs: &[(&str, &str)]) -> Result<()> {
    let missing = || {
        programs
            .iter()
            .filter(|(program, _)| !exists(program))
            .collect::<Vec<_>>()
    };
    let wanted = missing();
    if wanted.is_empty() {
        return Ok(());
    }
    let packages: Vec<&str> = wanted.iter().map(|(_, package)| *package).collect();
    let is_root = output(command("id").arg("-u")).is_ok_and(|id| id.trim() == "0");
    if exists("apt-get") && (is_root || can_sudo()) {
        let apt = |arguments: &[&str]| {
            let mut apt = if is_root {
                command("apt-get")
            } else {
                command("sudo")
            };
            if !is_root {
                apt.args(["-n", "apt-get"]);
            }
            run(apt.env("DEBIAN_FRONTEND", "noninteractive").args(arguments))
        };
        eprintln!("installing {}", packages.join(" "));
        // An index that is a little old often still installs, so its failure alone is no reason to stop.
        let _ = apt(&["update", "-qq"]);
        let install = ["install", "-y", "-qq", "--no-install-recommends"];
        let _ = apt(&[&install, packages.as_slice()].concat());
    }
    let names: Vec<&str> = missing().iter().map(|(program, _)| *program).collect();
    if !names.is_empty() {
        bail!(
            "missing {}: apt-get install {}",
            names.join(", "),
            packages.join(" ")
        );
    }
    Ok(())
}

fn can_sudo() -> bool {
    let probe = Command::new("sudo")
        .args(["-n", "true"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    probe.is_ok_and(|status| status.success())
}
