//! Python: one virtual environment with all that tests and examples need, and the package in it.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};

use crate::tool::{Built, command, root, run};
use crate::wheel;

/// What the tests of the package, its examples, and the peers of recordings and FMUs need.
pub(crate) const PACKAGES: [&str; 18] = [
    "asammdf",
    "cantools",
    "commonroad-vehicle-models",
    "distributed",
    "fmpy",
    "gymnasium>=1.1",
    "ipykernel",
    "matplotlib",
    "mcap",
    "mypy",
    "nbclient",
    "numpy",
    "pandas",
    "pyarrow",
    "pytest",
    "python-can",
    "scipy",
    "tqdm",
];

/// The package's tests but those of the wheel that is handed on, and what it may not link.
pub(crate) fn check(built: Built) -> Result<()> {
    wheel::look_at_crates()?;
    run(with_package(built)?.args([
        "-m",
        "pytest",
        "bindings/python",
        "--ignore",
        "bindings/python/tests/test_wheel.py",
    ]))
}

/// The interpreter of the environment that all checks share, made where it is not there.
pub(crate) fn environment() -> Result<PathBuf> {
    environment_of(&root().join("target/python/checks"), &PACKAGES)
}

/// The interpreter of an environment with these packages.
pub(crate) fn environment_of(place: &Path, packages: &[&str]) -> Result<PathBuf> {
    let python = place.join("bin/python");
    if !python.exists() {
        run(command("python3").args(["-m", "venv"]).arg(place))
            .context("Python 3 with venv is needed: apt-get install python3-venv")?;
    }
    let installed = place.join("packages.txt");
    let list = packages.join("\n");
    if std::fs::read_to_string(&installed).is_ok_and(|there| there == list) {
        return Ok(python);
    }
    run(command(&python.to_string_lossy())
        .args(["-m", "pip", "install", "-q", "--disable-pip-version-check"])
        .args(packages))?;
    std::fs::write(&installed, list)?;
    Ok(python)
}

/// Copies a file so that another stage, which imports the package meanwhile, finds the old one or the new one, whole.
fn put(from: &Path, to: &Path) -> Result<()> {
    let beside = to.with_extension(format!("new-{}", std::process::id()));
    std::fs::copy(from, &beside).with_context(|| from.display().to_string())?;
    std::fs::rename(&beside, to).with_context(|| to.display().to_string())
}

/// An interpreter that finds the package: that of the other tests' build beside its sources, or the installed wheel.
pub(crate) fn with_package(built: Built) -> Result<Command> {
    if built == Built::ToShip {
        return Ok(command(&wheel::installed()?.to_string_lossy()));
    }
    let library = built.package("haptic-python")?.join("lib_native.so");
    let place = root().join("target/python/package");
    let package = place.join("haptic_guidance");
    std::fs::create_dir_all(&package)?;
    for entry in std::fs::read_dir(root().join("bindings/python/python/haptic_guidance"))? {
        let file = entry?.path();
        if let (true, Some(name)) = (file.is_file(), file.file_name()) {
            put(&file, &package.join(name))?;
        }
    }
    put(&library, &package.join("_native.abi3.so"))?;
    let mut python = command(&environment()?.to_string_lossy());
    python.env("PYTHONPATH", place);
    Ok(python)
}
