//! The command line, in an archive and in the wheel; both tried where nothing of the checkout is on the path.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, bail, ensure};

use super::archive::{self, Entry};
use super::{Part, Release, copy_into};
use crate::built::Built;
use crate::tool::{ALL_FORMATS, EVIDENCE, HOST_SIM, command, llvm, output, root, run};
use crate::{dist, venv, wheel};

/// The archive: both programs, examples, and a page that says what to do first.
pub(super) fn archive(release: &Release) -> Result<()> {
    let (program, evidence) = match release.built {
        // Both with all formats, so that what they share is compiled once.
        Built::ToShip => (
            dist::build("host-sim", ALL_FORMATS)?.join(HOST_SIM),
            dist::build("haptic-evidence", ALL_FORMATS)?.join(EVIDENCE),
        ),
        Built::ForTests | Built::Daily => (
            dist::stripped(&Built::Daily.host_sim()?)?,
            dist::stripped(&Built::Daily.evidence()?)?,
        ),
    };
    let name = format!("haptic-guidance-{}-{}", release.version, release.host);
    let mut entries = vec![
        Entry::read(&program, HOST_SIM)?.program(),
        Entry::read(&evidence, EVIDENCE)?.program(),
        Entry::read(&root().join("xtask/src/release/README.txt"), "README.txt")?,
        Entry::read(&root().join("core/haptic.dbc"), "haptic.dbc")?,
        // A drive to identify.
        Entry::read(
            &root().join("tests/data/driver-logs/guided-probe.csv"),
            "examples/guided-probe.csv",
        )?,
    ];
    for file in fs::read_dir(root().join("examples"))? {
        let file = file?.path();
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        if name.ends_with(".toml") || name.ends_with(".xodr") {
            entries.push(Entry::read(&file, &format!("examples/{name}"))?);
        }
    }
    let archive = release.pack(Part::Program, &name, entries)?;
    let place = release.try_in(Part::Program)?;
    archive::unpack(&archive, &place)?;
    for program in [HOST_SIM, EVIDENCE] {
        old_enough(&place.join(&name).join(program), release)?;
    }
    evaluate(&place.join(&name).join(HOST_SIM), &place)?;
    let evidence = place.join(&name).join(EVIDENCE);
    let reliance: Vec<&str> = "reliance --participants 1 --seeds 1 --out reliance"
        .split(' ')
        .collect();
    alone(&evidence, &place, &reliance, &["reliance/results.json"])
}

/// The wheel, installed by itself into an empty environment: what it depends on is PyPI's.
pub(super) fn wheel(release: &Release) -> Result<()> {
    let wheel = wheel::make(release.built)?;
    wheel::look_at_crates()?;
    copy_into(&wheel, &release.place)?;
    let place = release.try_in(Part::Wheel)?;
    let environment = place.join("environment");
    run(command("python3").args(["-m", "venv"]).arg(&environment))?;
    let programs = environment.join(venv::PROGRAMS);
    run(command(programs.join("python"))
        .args("-m pip install -q --disable-pip-version-check --no-index --no-deps".split(' '))
        .arg(&wheel))?;
    let program = programs.join(HOST_SIM);
    old_enough(&program, release)?;
    evaluate(&program, &place)
}

/// The newest glibc that a program asks for is as old as was promised.
fn old_enough(program: &Path, release: &Release) -> Result<()> {
    if release.built != Built::ToShip || !dist::has_glibc(&release.host) {
        return Ok(());
    }
    let said = output(llvm("llvm-readobj")?.arg("--version-info").arg(program))?;
    let newest = newest_glibc(&said).context("the program asks for no glibc")?;
    println!("needs glibc {}.{}", newest.0, newest.1);
    ensure!(
        newest <= dist::GLIBC,
        "{} needs glibc {newest:?}, not {:?} as promised",
        program.display(),
        dist::GLIBC
    );
    Ok(())
}

/// The newest of versions such as GLIBC_2.17 in what readobj says.
fn newest_glibc(said: &str) -> Option<(u32, u32)> {
    let versions = said.split("GLIBC_").skip(1).filter_map(|rest| {
        let end = rest.find(|c: char| c != '.' && !c.is_ascii_digit())?;
        let mut numbers = rest[..end].split('.').map(str::parse);
        Some((numbers.next()?.ok()?, numbers.next()?.ok()?))
    });
    versions.max()
}

/// The main job.
fn evaluate(program: &Path, place: &Path) -> Result<()> {
    let files = ["results.json", "report.html", "figure9.svg"].map(|file| format!("evaluation/{file}"));
    let arguments = ["evaluate", "--out", "evaluation"];
    alone(program, place, &arguments, &files.each_ref().map(String::as_str))
}

/// Runs a command that leaves files, without the environment of whoever builds.
fn alone(program: &Path, place: &Path, arguments: &[&str], files: &[&str]) -> Result<()> {
    let start = Instant::now();
    let ended = Command::new(program)
        .env_clear()
        .current_dir(place)
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .with_context(|| program.display().to_string())?;
    if !ended.status.success() {
        bail!(
            "{} {}: {}\n{}",
            program.display(),
            arguments.join(" "),
            ended.status,
            String::from_utf8_lossy(&ended.stderr)
        );
    }
    for file in files {
        let file = place.join(file);
        ensure!(
            fs::metadata(&file).is_ok_and(|file| file.len() > 0),
            "{} is missing",
            file.display()
        );
    }
    println!(
        "{} in an empty environment in {:.1} s",
        arguments[0],
        start.elapsed().as_secs_f64()
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::newest_glibc;

    #[test]
    fn versions_are_compared_as_numbers() {
        let said = "  0x0010:   Name: GLIBC_2.2.5  Flags: none\n  Name: GLIBC_2.17  Name: GLIBC_2.9\n Name: GCC_3.0\n";
        assert_eq!(newest_glibc(said), Some((2, 17)));
        assert_eq!(newest_glibc("Name: GLIBC_2.34 "), Some((2, 34)));
        assert_eq!(newest_glibc("Name: GCC_3.0 "), None);
    }
}
