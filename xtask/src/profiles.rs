//! The profiles compute the same bits: a whole evaluation, and the fit of a recorded drive, in each.

use std::fs;

use anyhow::{Context, Result, ensure};

use crate::tool::{cargo, command, root, run};

const PROFILES: [(&str, &str); 3] = [("release", "release"), ("dev", "debug"), ("dist", "dist")];
const DRIVE: &str = "tests/data/driver-logs/guided-probe.csv";
/// What of the files is compared: every number, and every figure.
const FILES: [(&str, &[&str]); 2] = [
    ("evaluate", &["results.json", "figure8.svg", "figure9.svg"]),
    ("identify", &["results.json"]),
];

pub(crate) fn check() -> Result<()> {
    let place = root().join("target/same-bits");
    let _ = fs::remove_dir_all(&place);
    for (profile, folder) in PROFILES {
        run(cargo().args(["build", "-q", "-p", "host-sim", "--profile", profile]))?;
        let program = root().join("target").join(folder).join("host-sim");
        let host_sim = |arguments: &[&str]| {
            let out = place.join(profile).join(arguments[0]);
            run(command(&program)
                .args(arguments)
                .arg("--out")
                .arg(out)
                .stdout(std::process::Stdio::null()))
        };
        host_sim(&["evaluate"])?;
        host_sim(&["identify", DRIVE])?;
    }
    for (what, files) in FILES {
        for file in files {
            let read = |profile: &str| {
                let path = place.join(profile).join(what).join(file);
                fs::read(&path).with_context(|| path.display().to_string())
            };
            let first = read(PROFILES[0].0)?;
            for (profile, _) in &PROFILES[1..] {
                ensure!(
                    read(profile)? == first,
                    "{what}: {file} of {profile} differs from that of release"
                );
            }
            println!(
                "{what}: {file}, {} bytes, the same in {} profiles",
                first.len(),
                PROFILES.len()
            );
        }
    }
    Ok(())
}
