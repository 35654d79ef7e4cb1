//! Recordings in other tools' formats, held against those tools in a virtual environment.

use anyhow::Result;

use crate::built::Built;
use crate::tool::{command, root, run};
use crate::venv;

const SCENARIO: &str = "examples/relying-driver.toml";
const DRIVE: &str = "tests/data/driver-logs/guided-passive.csv";
/// Rows of a whole run: enough for every message, and seconds instead of minutes in Python.
const ROWS: usize = 4000;
const FRAMES: usize = 40_000;
/// Packages whose sources hold test files; those of SciPy, pyarrow and canmatrix lie where they are installed.
const PUBLISHED: [(&str, &str); 3] = [
    ("python-can", "4.6.1"),
    ("cantools", "45.1.0"),
    ("asammdf", "8.8.28"),
];

/// Writes with one side and reads with the other, both ways.
pub(crate) fn check(built: Built) -> Result<()> {
    let place = root().join("target/logs");
    std::fs::create_dir_all(&place)?;
    let host_sim = built.host_sim()?;
    let whole = place.join("run");
    run(command(&host_sim)
        .args(["run", SCENARIO, "--bus-log", "--out"])
        .arg(&whole)
        .stdout(std::process::Stdio::null()))?;
    let head = |name: &str, lines: usize| -> Result<_> {
        let text = std::fs::read_to_string(whole.join(name))?;
        let end = text
            .match_indices('\n')
            .nth(lines)
            .map_or(text.len(), |(at, _)| at + 1);
        let short = place.join(name);
        std::fs::write(&short, &text[..end])?;
        Ok(short)
    };
    let (csv, bus) = (head("run.csv", ROWS)?, head("bus.log", FRAMES)?);
    run(command(venv::environment()?)
        .arg("host-sim/log/peers/check.py")
        .args([&host_sim, &place, &csv, &bus])
        .arg(DRIVE))
}

/// Reads the test files that other projects publish, with `host-sim convert` and with these projects' own packages.
pub(crate) fn published(built: Built) -> Result<()> {
    let place = root().join("target/published");
    std::fs::create_dir_all(&place)?;
    let python = venv::environment()?;
    for (name, version) in PUBLISHED {
        let unpacked = place.join(format!("{}-{version}", name.replace('-', "_")));
        if !unpacked.exists() {
            run(command(&python)
                .args("-m pip download -q --disable-pip-version-check --no-deps".split(' '))
                .args(["--no-binary", name, &format!("{name}=={version}"), "-d"])
                .arg(&place))?;
            let archive = unpacked.with_added_extension("tar.gz");
            run(command("tar").arg("xzf").arg(archive).arg("-C").arg(&place))?;
        }
    }
    run(command(&python)
        .arg("host-sim/log/peers/published.py")
        .args([&built.host_sim()?, &place]))
}
