//! Virtual environments of Python, each made once.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::tool::{command, root, run};

/// What the tests of the package, its examples, and the peers of recordings, FMUs and diagnosis need.
#[rustfmt::skip]
pub(crate) const PACKAGES: [&str; 25] = [
    "asammdf", "can-isotp", "canmatrix", "cantools", "commonroad-vehicle-models", "cryptography",
    "distributed", "fmpy", "gymnasium>=1.1", "ipykernel", "matplotlib", "mcap", "mypy", "nbclient", "numpy",
    "odxtools", "pandas", "pdoc", "pyarrow", "pyserial", "pytest", "python-can", "scipy", "tqdm",
    "udsoncan",
];

/// The interpreter of the environment that all checks share, made where it is not there.
pub(crate) fn environment() -> Result<PathBuf> {
    environment_of(&root().join("target/python/checks"), &PACKAGES)
}

/// Where an environment has its programs.
pub(crate) const PROGRAMS: &str = if cfg!(windows) { "Scripts" } else { "bin" };

/// The interpreter of an environment with these packages.
pub(crate) fn environment_of(place: &Path, packages: &[&str]) -> Result<PathBuf> {
    let python = place
        .join(PROGRAMS)
        .join("python")
        .with_extension(std::env::consts::EXE_EXTENSION);
    if !python.exists() {
        run(command("python3").args(["-m", "venv"]).arg(place))
            .context("Python 3 with venv is needed: apt-get install python3-venv")?;
    }
    let installed = place.join("packages.txt");
    let list = packages.join("\n");
    if std::fs::read_to_string(&installed).is_ok_and(|there| there == list) {
        return Ok(python);
    }
    run(command(&python)
        .args("-m pip install -q --disable-pip-version-check".split(' '))
        .args(packages))?;
    std::fs::write(&installed, list)?;
    Ok(python)
}
