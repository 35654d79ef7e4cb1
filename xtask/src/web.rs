//! The lab in the browser: WebAssembly and page in one file, tried in a headless Chromium.

use std::path::{Path, PathBuf};
use std::process::Stdio;

use anyhow::{Context, Result, bail};

use crate::built::Built;
use crate::tool::{cargo, command, ensure, exists, output, root, run};
use crate::{dist, venv};

pub(crate) const TARGET: &str = "wasm32-unknown-unknown";
const LARGEST_BYTES: u64 = 1_000_000;
const PAGE: &str = "target/dist/haptic-lab.html";
/// Two scenarios that the page's test drives too, and the example whose column the second has.
const SCENARIOS: [&str; 3] = [
    "bindings/web/probe.toml",
    "bindings/web/bar.toml",
    "examples/torsion-bar.toml",
];
/// It carries axe-core, which finds what keeps people out of a page; its own dependencies drive browsers.
const AXE: [&str; 2] = ["--no-deps", "axe-playwright-python==0.1.8"];

/// Builds `target/dist/haptic-lab.html`, and tries it.
pub(crate) fn check(built: Built) -> Result<()> {
    pack(built)?;
    try_it(built)
}

/// The page in one file.
pub(crate) fn pack(built: Built) -> Result<PathBuf> {
    let wasm = build(built)?;
    let page = root().join(PAGE);
    std::fs::create_dir_all(root().join("target/dist"))?;
    run(command("python3")
        .arg("bindings/web/pack.py")
        .arg(&wasm)
        .arg(&page)
        .stdout(Stdio::null()))?;
    let bytes = std::fs::metadata(&page)?.len();
    println!("{}: {bytes} bytes", page.display());
    if built == Built::ToShip && bytes > LARGEST_BYTES {
        bail!("the page has {bytes} bytes, more than {LARGEST_BYTES}");
    }
    Ok(page)
}

fn build(built: Built) -> Result<PathBuf> {
    let profile = match built {
        Built::ForTests | Built::Daily => "release",
        Built::ToShip => "page",
    };
    let mut build = cargo();
    build.args("build -p haptic-web --target".split(' '));
    build.args([TARGET, "--profile", profile]);
    if built == Built::ToShip {
        build.env("RUSTFLAGS", dist::remapped()?.join(" "));
    }
    run(&mut build).with_context(|| format!("rustup target add {TARGET} brings what is missing"))?;
    Ok(root()
        .join("target")
        .join(TARGET)
        .join(profile)
        .join("haptic_web.wasm"))
}

/// The page under its test, beside the command line; and every step of it before axe-core, with a picture.
fn try_it(built: Built) -> Result<()> {
    let place = root().join("target/web");
    let host_sim = built.host_sim()?;
    let [probe, bar, example] = SCENARIOS;
    for (arguments, out) in [
        (["run", probe].as_slice(), "run"),
        (&["run", bar], "bar"),
        (&["evaluate"], "evaluation"),
    ] {
        run(command(&host_sim)
            .args(arguments)
            .arg("--out")
            .arg(place.join(out))
            .stdout(Stdio::null())
            .stderr(Stdio::null()))?;
    }
    let python = venv::environment_of(&root().join("target/python/page"), &AXE)?;
    let find = "import axe_playwright_python as a; print(a.__path__[0] + '/axe.min.js')";
    let axe = output(command(&python).args(["-c", find]))?;
    let results = |out: &str| place.join(out).join("results.json");
    let log = |out: &str| place.join(out).join("run.csv");
    let report = output(
        browser("bindings/web/test.js")?
            .args([probe.into(), log("run"), results("run")])
            .args([bar.into(), log("bar"), results("bar")])
            .args([results("evaluation"), example.into()])
            .args(["--axe", axe.trim()])
            .arg(place.join("pictures")),
    )?;
    println!("{}", report.trim_end());
    if report.contains("FAILED") || report.matches("ok ").count() < 50 {
        bail!("the page's test did not pass");
    }
    Ok(())
}

/// A headless Chromium that runs a script in the page and prints what it returns.
fn browser(script: &str) -> Result<std::process::Command> {
    if !exists("chromium") {
        ensure(&[("chromium", "chromium")])?;
    }
    let mut browser = command("python3");
    browser.args(["bindings/web/browser.py", PAGE, script]);
    Ok(browser)
}

/// What the ECU in WebAssembly sends on a bus.
pub(crate) fn replayed(bus: &Path, built: Built) -> Result<String> {
    pack(built)?;
    let sent = output(browser("bindings/web/agree.js")?.arg(bus))?;
    Ok(sent.trim_end().to_owned())
}
