//! The Python wheel: built by maturin, looked at, and tried in a virtual environment of its own.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;

use crate::built::Built;
use crate::release::papers;
use crate::tool::{ALL_FORMATS, HOST_SIM, cargo, command, output, root, run};
use crate::{dist, venv};

/// What `cargo xtask wheel` is asked for.
#[derive(Debug, Args)]
pub(crate) struct Options {
    /// Build what is handed on: optimised, with Parquet, and for every Linux since glibc 2.17
    #[arg(long)]
    dist: bool,
    /// Install the wheel into a fresh virtual environment and run its tests, its README and its examples there.
    #[arg(long)]
    test: bool,
    /// Print how many steps of the ECU a second of Python can drive.
    #[arg(long)]
    bench: bool,
}

impl Options {
    /// The wheel that is handed on, built and tested.
    pub(crate) const fn tested() -> Self {
        Self {
            dist: true,
            test: true,
            bench: false,
        }
    }
}

/// What the module must not link, because it lives in somebody else's process: the fault injector, serial ports, charts, the
/// command line. This lies beside the module as a program of its own.
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
const LARGEST_MB: f64 = 20.0;
/// What maturin packs into a wheel beside the module: its folder `scripts` is installed among the programs.
const DATA: &str = "bindings/python/haptic_guidance._native.data";

/// What a wheel is made of: the module, and the program beside it.
pub(crate) const PACKAGES: [&str; 2] = ["haptic-python", "host-sim"];

/// Builds the wheel, and tries it if asked to.
pub(crate) fn build(options: &Options) -> Result<()> {
    let wheel = make(match (options.dist, options.test || options.bench) {
        (true, _) => Built::ToShip,
        (false, true) => Built::ForTests,
        (false, false) => Built::Daily,
    })?;
    let megabytes = std::fs::metadata(&wheel)?.len() as f64 / 1e6;
    println!("{}: {megabytes:.2} MB", wheel.display());
    if megabytes > LARGEST_MB {
        bail!("the wheel is larger than {LARGEST_MB} MB");
    }
    look_at_crates()?;
    if options.test || options.bench {
        let python = install(&wheel)?;
        if options.test {
            run(command(&python).args(["-m", "pytest", "bindings/python"]))?;
        }
        if options.bench {
            run(command(&python).arg("bindings/python/bench.py"))?;
        }
    }
    Ok(())
}

/// The interpreter of an environment that has the wheel, built anew.
pub(crate) fn installed() -> Result<PathBuf> {
    install(&make(Built::ToShip)?)
}

/// Builds the wheel with the command line in it. The daily one is without Parquet, so that nothing is compiled that the first command has.
pub(crate) fn make(built: Built) -> Result<PathBuf> {
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
    let packed = pack(&dist, built);
    // What stays would be in a wheel of maturin alone, however old it is.
    let _ = std::fs::remove_dir_all(root().join(DATA));
    packed?;
    wheels().next().context("maturin left no wheel")
}

fn pack(dist: &Path, built: Built) -> Result<()> {
    let scripts = root().join(DATA).join("scripts");
    std::fs::create_dir_all(&scripts).with_context(|| scripts.display().to_string())?;
    let program = scripts.join(HOST_SIM);
    let mut maturin = command(dist::tools()?.join("maturin"));
    maturin
        .args("build -m bindings/python/Cargo.toml --out".split(' '))
        .arg(dist);
    if built == Built::ToShip {
        let built = dist::build("host-sim", ALL_FORMATS)?.join(HOST_SIM);
        std::fs::copy(built, &program)?;
        let host = dist::host()?;
        let documents = root().join(DATA).join("data/share/doc/haptic-guidance");
        std::fs::create_dir_all(&documents)?;
        for paper in papers::of(&PACKAGES, ALL_FORMATS, &host)? {
            std::fs::write(documents.join(paper.name), paper.bytes)?;
        }
        maturin.args(["--profile", "dist", "--target", &host]);
        if dist::has_glibc(&host) {
            maturin.args(["--compatibility", "manylinux2014"]);
        }
        dist::prepare(&mut maturin)?;
    } else {
        std::fs::copy(dist::stripped(&Built::Daily.host_sim()?)?, &program)?;
        maturin.args(["--profile", "release"]);
        if built == Built::Daily {
            maturin.arg("--no-default-features");
        }
        if cfg!(target_os = "linux") {
            // No promise to other computers.
            maturin.args(["--compatibility", "linux"]);
        }
    }
    run(&mut maturin)
}

/// What is linked.
pub(crate) fn look_at_crates() -> Result<()> {
    let tree = "tree -p haptic-python -e normal --prefix none -f".split(' ');
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
    run(command(&python).args(fresh).arg(wheel))?;
    Ok(python)
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use super::*;

    /// Each package that is compiled, with its features: one name may stand for several versions.
    fn features(of: &str) -> BTreeMap<String, BTreeSet<String>> {
        let tree = format!("tree --offline --no-dedupe -e normal,build --prefix none {of} -f");
        let tree = output(cargo().args(tree.split(' ')).arg("{p}: {f}")).unwrap();
        let mut all: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for line in tree.lines() {
            let (package, features) = line.split_once(": ").unwrap_or((line.trim_end_matches(':'), ""));
            let package = package.trim_end_matches(" (proc-macro)").to_owned();
            all.entry(package).or_default().insert(features.to_owned());
        }
        all
    }

    /// A package with other features would be compiled once more, and all that use it too.
    #[test]
    fn what_the_first_command_has_compiled_is_not_compiled_for_xtask_and_wheel() {
        let first = features("-p host-sim");
        for later in ["-p xtask", "-p haptic-python --no-default-features"] {
            let mut shared = 0;
            for (package, features) in features(later) {
                if let Some(there) = first.get(&package) {
                    assert!(
                        features.is_subset(there),
                        "{later}: {package}: {features:?}, not {there:?}"
                    );
                    shared += 1;
                }
            }
            assert!(shared > 30, "{later}: {shared} packages");
        }
    }
}
