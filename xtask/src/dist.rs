//! How what is handed on is built: for an old glibc, and to the same bytes in whatever folder.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};

use crate::tool::{self, command, output, root, run};
use crate::venv;

/// The oldest glibc that what is handed on runs with: that of the wheels called manylinux2014.
pub(crate) const GLIBC: (u32, u32) = (2, 17);
/// Zig links against the glibc that it is told; Cargo's plugin for it knows which of the compiler's options Zig does not.
const TOOLS: [&str; 3] = [
    "maturin>=1.9,<2",
    "cargo-zigbuild>=0.24,<0.25",
    "ziglang>=0.17,<0.18",
];

/// The compiler's name of this computer.
pub(crate) fn host() -> Result<String> {
    let said = output(command("rustc").arg("-vV"))?;
    let host = said.lines().find_map(|line| line.strip_prefix("host: "));
    Ok(host.context("rustc -vV names no host")?.to_owned())
}

/// Whether Zig links: elsewhere there is no glibc.
pub(crate) fn has_glibc(host: &str) -> bool {
    host.ends_with("-linux-gnu")
}

/// The folder of programs of an environment that has maturin, Zig and Cargo's plugin for it.
pub(crate) fn tools() -> Result<PathBuf> {
    let place = root().join("target/python/tools");
    venv::environment_of(&place, &TOOLS)?;
    Ok(place.join(venv::PROGRAMS))
}

/// Builds a package for this computer, in the profile `dist`; the directory of its libraries and programs.
pub(crate) fn build(package: &str, features: &str) -> Result<PathBuf> {
    let host = host()?;
    let mut build = tool::cargo();
    prepare(&mut build)?;
    run(build
        .args(["build", "--profile", "dist", "--target", &host])
        .args(["-p", package, "--features", features]))?;
    Ok(root().join("target").join(host).join("dist"))
}

/// Lets a command of Cargo or maturin build to the same bytes wherever and whenever: without symbols, without this machine's
/// folders, with the last commit's time for its own, and for the old glibc.
pub(crate) fn prepare(build: &mut Command) -> Result<()> {
    build
        .env("RUSTFLAGS", remapped()?.join(" "))
        .env("CARGO_PROFILE_DIST_STRIP", "symbols")
        .env("CARGO_PROFILE_DIST_DEBUG", "none")
        .env("SOURCE_DATE_EPOCH", commit_time()?.to_string());
    let host = host()?;
    if has_glibc(&host) {
        let name = host.to_uppercase().replace('-', "_");
        build.env(format!("CARGO_TARGET_{name}_LINKER"), linker(&host)?);
    }
    Ok(())
}

/// A script that has Zig link. Commands of the plugin and of maturin do it too, but each names a linker of its own, and for another
/// linker Cargo compiles everything anew.
fn linker(host: &str) -> Result<PathBuf> {
    let tools = tools()?;
    let (major, minor) = GLIBC;
    let processor = host.split('-').next().unwrap_or_default();
    let text = format!(
        "#!/bin/sh\nPATH=\"{0}:$PATH\" exec \"{0}/cargo-zigbuild\" zig cc -- -target {processor}-linux-gnu.{major}.{minor} \"$@\"\n",
        tools.display()
    );
    let script = root().join("target/python/zig-cc");
    if std::fs::read_to_string(&script).is_ok_and(|there| there == text) {
        return Ok(script);
    }
    std::fs::write(&script, text).with_context(|| script.display().to_string())?;
    run(command("chmod").arg("+x").arg(&script))?;
    Ok(script)
}

/// A copy of a program without symbols, where the profile of the tests leaves them.
pub(crate) fn stripped(file: &Path) -> Result<PathBuf> {
    let copy = file.with_extension("stripped");
    std::fs::copy(file, &copy).with_context(|| file.display().to_string())?;
    if cfg!(target_os = "linux") {
        run(tool::llvm("llvm-strip")?.arg(&copy))?;
    }
    Ok(copy)
}

/// The compiler's options that put names in the place of this machine's folders.
pub(crate) fn remapped() -> Result<[String; 2]> {
    let [crates, here] = [crates()?, root().to_owned()].map(|folder| folder.display().to_string());
    Ok([
        format!("--remap-path-prefix={crates}=/crates"),
        format!("--remap-path-prefix={here}=/haptic-guidance"),
    ])
}

/// Where Cargo keeps the sources of dependencies.
pub(crate) fn crates() -> Result<PathBuf> {
    let home = match std::env::var_os("CARGO_HOME") {
        Some(home) => PathBuf::from(home),
        None => Path::new(&std::env::home_dir().context("no home directory")?).join(".cargo"),
    };
    Ok(home.join("registry/src"))
}

/// The commit that is built, for an image to say; a plus where the checkout has changes.
pub(crate) fn commit() -> String {
    let said =
        output(command("git").args(["describe", "--always", "--exclude=*", "--abbrev=12", "--dirty=+"]));
    said.map_or("nobody said".to_owned(), |commit| commit.trim().to_owned())
}

/// Seconds since 1970 of the last commit; outside of git those of 1980, the first year of a zip archive.
pub(crate) fn commit_time() -> Result<u64> {
    let said = output(command("git").args(["log", "-1", "--format=%ct"])).unwrap_or_default();
    Ok(said.trim().parse().unwrap_or(315_532_800))
}
