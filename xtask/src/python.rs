//! The Python package: tested as the other tests build it, or as the wheel that is handed on.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result};

use crate::built::Built;
use crate::tool::{command, root, run};
use crate::venv::environment;
use crate::wheel;

/// The package's tests but those of the wheel that is handed on, and what it may not link.
pub(crate) fn check(built: Built) -> Result<()> {
    wheel::look_at_crates()?;
    run(with_package(built)?
        .args("-m pytest bindings/python --ignore bindings/python/tests/test_wheel.py".split(' ')))
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
        return Ok(command(wheel::installed()?));
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
    let mut python = command(environment()?);
    python.env("PYTHONPATH", place);
    Ok(python)
}
