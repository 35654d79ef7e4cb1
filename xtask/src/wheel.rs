//! The Python wheel: built by maturin, looked at, and tried in a virtual environment of its own.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;

use crate::tool::{cargo, command, output, root, run};

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
    "haptic-target",
    "haptic-report",
    "host-sim",
    "serialport",
    "plotters",
    "kuva",
    "resvg",
    "clap",
    "indicatif",
];
const LARGEST_MB: f64 = 5.0;
const MATURIN: &str = "maturin>=1.9,<2";
/// The tests, and the packages that the examples and the tests' peers need.
const TEST_PACKAGES: [&str; 12] = [
    "pytest",
    "mypy",
    "pandas",
    "pyarrow",
    "matplotlib",
    "cantools",
    "distributed",
    "commonroad-vehicle-models",
    "gymnasium>=1.1",
    "tqdm",
    "nbclient",
    "ipykernel",
];

/// Builds the wheel, and tries it if asked to.
pub(crate) fn build(options: &Options) -> Result<()> {
    let wheel = make()?;
    look_at(&wheel)?;
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
pub(crate) fn python() -> Result<PathBuf> {
    install(&make()?)
}

fn make() -> Result<PathBuf> {
    let tools = root().join("target/python/tools");
    let python = environment(&tools)?;
    if !tools.join("bin/maturin").exists() {
        run(command(&python.to_string_lossy()).args(["-m", "pip", "install", "-q", MATURIN]))?;
    }
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
        .args(["build", "--release", "-m", "bindings/python/Cargo.toml", "--out"])
        .arg(&dist))?;
    wheels().next().context("maturin left no wheel")
}

/// Size, and what is linked.
fn look_at(wheel: &Path) -> Result<()> {
    let megabytes = std::fs::metadata(wheel)?.len() as f64 / 1e6;
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
    println!("{}: {megabytes:.2} MB of {} crates", wheel.display(), names.len());
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
    if megabytes > LARGEST_MB {
        bail!("the wheel is larger than {LARGEST_MB} MB");
    }
    println!("Not linked: {}, fault injection", NOT_IN_A_WHEEL.join(", "));
    Ok(())
}

/// A virtual environment with the wheel, nothing of an older one, and what its tests need.
fn install(wheel: &Path) -> Result<PathBuf> {
    let place = root().join("target/python/test");
    let python = environment(&place)?;
    let name = python.to_string_lossy();
    run(command(&name)
        .args(["-m", "pip", "install", "-q"])
        .args(TEST_PACKAGES))?;
    let fresh = ["-m", "pip", "install", "-q", "--force-reinstall", "--no-deps"];
    run(command(&name).args(fresh).arg(wheel))?;
    Ok(python)
}

/// The interpreter of a virtual environment, made if it is not there.
pub(crate) fn environment(place: &Path) -> Result<PathBuf> {
    let python = place.join("bin/python");
    if !python.exists() {
        run(command("python3").args(["-m", "venv"]).arg(place))
            .context("Python 3 with venv is needed: apt-get install python3-venv")?;
    }
    Ok(python)
}
