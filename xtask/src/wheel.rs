//! The Python wheel: built by maturin, looked at, and tried in a virtual environment of its own.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;

use crate::tool::{cargo, command, output, root, run};
use crate::venv;

/// What `cargo xtask wheel` is asked for.
#[derive(Debug, Args)]
pub(crate) struct Options {
    /// Install the wheel into a fresh virtual environment and run its tests, its README and its examples there.
    #[arg(long)]
    test: bool,
    /// Print how many steps of the ECU a second of Python can drive.
    #[arg(long)]
    bench: bool,
}

impl Options {
    /// The wheel, built and tested.
    pub(crate) const fn tested() -> Self {
        Self {
            test: true,
            bench: false,
        }
    }
}

/// What a wheel must not link: the fault injector, serial ports, charts, the command line.
const NOT_IN_A_WHEEL: [&str; 10] = [
    "haptic-campaign",
    "haptic-pil",
    "haptic-report",
    "host-sim",
    "serial2",
    "plotters",
    "kuva",
    "resvg",
    "clap",
    "indicatif",
];
const LARGEST_MB: f64 = 5.0;
const MATURIN: &str = "maturin>=1.9,<2";

/// Builds the wheel, and tries it if asked to.
pub(crate) fn build(options: &Options) -> Result<()> {
    let wheel = make()?;
    let megabytes = std::fs::metadata(&wheel)?.len() as f64 / 1e6;
    println!("{}: {megabytes:.2} MB", wheel.display());
    if megabytes > LARGEST_MB {
        bail!("the wheel is larger than {LARGEST_MB} MB");
    }
    look_at_crates()?;
    if options.test || options.bench {
        let python = install(&wheel)?;
        if options.test {
            run(command(&python.to_string_lossy()).args(["-m", "pytest", "bindings/python"]))?;
        }
        if options.bench {
            run(command(&python.to_string_lossy()).arg("bindings/python/bench.py"))?;
        }
    }
    Ok(())
}

/// The interpreter of an environment that has the wheel, built anew.
pub(crate) fn installed() -> Result<PathBuf> {
    install(&make()?)
}

fn make() -> Result<PathBuf> {
    let tools = root().join("target/python/tools");
    venv::environment_of(&tools, &[MATURIN])?;
    let dist = root().join("target/dist");
    let wheels = || {
        let files = std::fs::read_dir(&dist).into_iter().flatten().flatten();
        files
            .map(|file| file.path())
            .filter(|path| path.extension().is_some_and(|x| x == "whl"))
    };
    // One of another version would be taken for this one.
    for old in wheels() {
        std::fs::remove_file(&old).with_context(|| old.display().to_string())?;
    }
    let maturin = tools.join("bin/maturin");
    run(command(&maturin.to_string_lossy())
        .args("build --profile dist -m bindings/python/Cargo.toml --out".split(' '))
        .arg(&dist))?;
    wheels().next().context("maturin left no wheel")
}

/// What is linked.
pub(crate) fn look_at_crates() -> Result<()> {
    let tree = [
        "tree",
        "-p",
        "haptic-python",
        "-e",
        "normal",
        "--prefix",
        "none",
        "-f",
    ];
    let linked = output(cargo().args(tree).arg("{p} {f}"))?;
    let names: std::collections::BTreeSet<&str> =
        linked.lines().filter_map(|line| line.split(' ').next()).collect();
    println!("{} crates are linked", names.len());
    let wrong: Vec<&str> = NOT_IN_A_WHEEL
        .into_iter()
        .filter(|name| names.contains(name))
        .collect();
    if !wrong.is_empty() {
        bail!("the wheel links {}", wrong.join(", "));
    }
    if linked.contains("fault-injection") {
        bail!("the wheel links the fault injector");
    }
    println!("Not linked: {}, fault injection", NOT_IN_A_WHEEL.join(", "));
    Ok(())
}

/// An environment with the wheel, nothing of an older one, and what its tests need.
fn install(wheel: &Path) -> Result<PathBuf> {
    let python = venv::environment_of(&root().join("target/python/wheel"), &venv::PACKAGES)?;
    let fresh = ["-m", "pip", "install", "-q", "--force-reinstall", "--no-deps"];
    run(command(&python.to_string_lossy()).args(fresh).arg(wheel))?;
    Ok(python)
}
