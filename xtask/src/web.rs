//! The lab in the browser: WebAssembly and page in one file, tried in a headless Chromium.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

use crate::tool::{Built, cargo, command, ensure, exists, output, root, run};

const TARGET: &str = "wasm32-unknown-unknown";
const LARGEST_BYTES: u64 = 1_000_000;
/// What the page's test drives too.
const SCENARIO: &str = "speed = 60\ncondition = \"mid\"\n[driver]\nt_p = 0.3\n";
/// Milliseconds of the page's own clock: the machine's speed does not matter.
const BUDGET_MS: u32 = 60_000;

/// Builds `target/dist/haptic-lab.html`, and tries it.
pub(crate) fn check(built: Built) -> Result<()> {
    let wasm = build(built)?;
    let page = root().join("target/dist/haptic-lab.html");
    std::fs::create_dir_all(root().join("target/dist"))?;
    run(command("python3")
        .arg("bindings/web/pack.py")
        .arg(&wasm)
        .arg(&page))?;
    let bytes = std::fs::metadata(&page)?.len();
    if built == Built::ToShip && bytes > LARGEST_BYTES {
        bail!("the page has {bytes} bytes, more than {LARGEST_BYTES}");
    }
    try_it(&wasm, built)
}

fn build(built: Built) -> Result<PathBuf> {
    let profile = match built {
        Built::ForTests => "release",
        Built::ToShip => "page",
    };
    run(cargo().args([
        "build",
        "--profile",
        profile,
        "-p",
        "haptic-web",
        "--target",
        TARGET,
    ]))
    .with_context(|| format!("rustup target add {TARGET} brings what is missing"))?;
    Ok(root()
        .join("target")
        .join(TARGET)
        .join(profile)
        .join("haptic_web.wasm"))
}

/// The page with its test in it: what the test writes into the page, and a picture of it.
fn try_it(wasm: &Path, built: Built) -> Result<()> {
    let place = root().join("target/web");
    std::fs::create_dir_all(&place)?;
    let scenario = place.join("scenario.toml");
    std::fs::write(&scenario, SCENARIO)?;
    run(command(&built.host_sim()?.to_string_lossy())
        .arg("run")
        .arg(&scenario)
        .arg("--out")
        .arg(place.join("run"))
        .stdout(Stdio::null()))?;
    let page = place.join("test.html");
    let report = report(wasm, &page, "bindings/web/test.js", &place.join("run/run.csv"))?;
    println!("{}", report.trim_end());
    let picture = place.join("lab.png");
    run(chromium()?
        .arg(format!("--screenshot={}", picture.display()))
        .arg(&page))?;
    println!("{}", picture.display());
    if report.contains("FAILED") || report.matches("ok ").count() < 5 {
        bail!("the page's test did not pass");
    }
    Ok(())
}

/// A headless Chromium with the page's own clock.
fn chromium() -> Result<Command> {
    if !exists("chromium") {
        ensure(&[("chromium", "chromium")])?;
    }
    let mut chromium = command("chromium");
    chromium
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--window-size=1200,1500",
        ])
        .arg(format!("--virtual-time-budget={BUDGET_MS}"))
        .stderr(Stdio::null());
    Ok(chromium)
}

/// What a script in the page reports; `expected` is a text that it is given.
fn report(wasm: &Path, page: &Path, script: &str, expected: &Path) -> Result<String> {
    run(command("python3")
        .args([
            Path::new("bindings/web/pack.py"),
            wasm,
            page,
            Path::new(script),
            expected,
        ])
        .stdout(Stdio::null()))?;
    let dom = output(chromium()?.arg("--dump-dom").arg(page))?;
    let report = dom
        .split_once("<pre id=\"report\"")
        .and_then(|(_, rest)| rest.split_once("</pre>")?.0.split_once('>'));
    match report.and_then(|(_, report)| report.strip_suffix("end")) {
        Some(report) => Ok(report.to_owned()),
        None => bail!("{script} did not come to its end in the page"),
    }
}

/// What the ECU in WebAssembly sends on a bus.
pub(crate) fn replayed(bus: &Path, built: Built) -> Result<String> {
    let place = root().join("target/web");
    std::fs::create_dir_all(&place)?;
    report(
        &build(built)?,
        &place.join("agree.html"),
        "bindings/web/agree.js",
        bus,
    )
}
