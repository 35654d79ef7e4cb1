//! All that is handed on, made, tried and summed: `cargo xtask release`.

mod archive;
mod c;
mod firmware;
pub(crate) mod papers;
mod program;
mod twice;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use clap::{Args, ValueEnum};
use sha2::{Digest, Sha256};

use crate::built::Built;
use crate::tool::{ALL_FORMATS, cargo, output, root, run};
use crate::{dist, fmu, web, wheel};
use archive::Entry;

/// What `cargo xtask release` is asked for.
#[derive(Args)]
pub(crate) struct Options {
    /// Build as the tests are built, which is quick, and try the same files: nothing of it is to be handed on
    #[arg(long)]
    dry_run: bool,
    /// Make only this part; may be given again
    #[arg(long, value_enum, value_name = "PART")]
    only: Vec<Part>,
    /// Make the last commit in two clones at two places; exit code 1 where a file of them differs
    #[arg(long, conflicts_with = "dry_run")]
    twice: bool,
}

/// A part of a release.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Part {
    /// The command line and the program behind the claims, which run where they are unpacked
    Program,
    /// The Python package, with the command line
    Wheel,
    /// Controller, driver and vehicle for FMI 2.0 and 3.0
    Fmu,
    /// The controller as a C library, for this computer and for a Cortex-M4F
    C,
    /// The lab in one file
    Page,
    /// Images of the boards as ELF, HEX and S19, with the linker's maps
    Firmware,
    /// haptic-core as a registry takes it
    Crate,
}

impl Part {
    /// The packages whose dependencies the part carries, their features, and the target they are built for.
    fn carries(self, host: &str) -> (&'static [&'static str], &'static str, String) {
        let (packages, features): (&[&str], _) = match self {
            Self::Program => (&["host-sim", "haptic-evidence"], ALL_FORMATS),
            Self::Wheel => (&wheel::PACKAGES, ALL_FORMATS),
            Self::Fmu => (&["haptic-fmu"], ""),
            Self::C => (&["haptic-c"], ""),
            Self::Page => (&["haptic-web"], ""),
            Self::Firmware => (&["haptic-firmware"], "nucleo-g474re-sensors"),
            Self::Crate => (&["haptic-core"], ""),
        };
        let target = match self {
            Self::Page => web::TARGET,
            Self::Firmware => crate::image::M4F,
            _ => host,
        };
        (packages, features, target.to_owned())
    }

    fn name(self) -> String {
        self.to_possible_value()
            .map(|value| value.get_name().to_owned())
            .unwrap_or_default()
    }
}

/// Where the files of a release lie, and what is known of it.
struct Release {
    place: PathBuf,
    version: String,
    host: String,
    built: Built,
}

impl Release {
    /// Packs a part into an archive whose files all lie in one folder, with licences, notices and bill of materials.
    fn pack(&self, part: Part, name: &str, mut entries: Vec<Entry>) -> Result<PathBuf> {
        entries.extend(self.papers(part)?);
        let file = self.place.join(format!("{name}.tar.gz"));
        archive::pack(&file, name, entries)?;
        Ok(file)
    }

    fn papers(&self, part: Part) -> Result<Vec<Entry>> {
        let (packages, features, target) = part.carries(&self.host);
        papers::of(packages, features, &target)
    }

    /// An empty folder to try a part in.
    fn try_in(&self, part: Part) -> Result<PathBuf> {
        let place = self.place.with_extension(format!("try-{}", part.name()));
        let _ = fs::remove_dir_all(&place);
        fs::create_dir_all(&place).with_context(|| place.display().to_string())?;
        Ok(place)
    }
}

/// Makes what is asked for, and says what it weighs.
pub(crate) fn make(options: &Options) -> Result<()> {
    if options.twice {
        return twice::compare(&options.only);
    }
    let (built, name) = if options.dry_run {
        (Built::Daily, "handed-on-dry-run")
    } else {
        (Built::ToShip, "handed-on")
    };
    let release = Release {
        place: root().join("target").join(name),
        version: version()?,
        host: dist::host()?,
        built,
    };
    let _ = fs::remove_dir_all(&release.place);
    fs::create_dir_all(&release.place).with_context(|| release.place.display().to_string())?;
    let parts: &[Part] = match options.only.as_slice() {
        [] => Part::value_variants(),
        only => only,
    };
    for part in parts {
        let start = Instant::now();
        println!("{}: making", part.name());
        make_part(*part, &release).with_context(|| part.name())?;
        for entry in release.papers(*part)?.into_iter().filter(Entry::is_of_part) {
            let (_, _, target) = part.carries(&release.host);
            let file = format!("{}-{}-{target}-{}", part.name(), release.version, entry.name);
            fs::write(release.place.join(file), entry.bytes)?;
        }
        println!(
            "{}: made and tried in {} s",
            part.name(),
            start.elapsed().as_secs()
        );
    }
    sum(&release.place)?;
    if options.dry_run {
        println!("A dry run: built as the tests are, for this computer alone. Not to be handed on.");
    }
    Ok(())
}

fn make_part(part: Part, release: &Release) -> Result<()> {
    match part {
        Part::Program => program::archive(release),
        Part::Wheel => program::wheel(release),
        Part::Fmu => {
            for unit in fmu::build(release.built)? {
                copy_into(&unit, &release.place)?;
            }
            Ok(())
        }
        Part::C => c::library(release),
        Part::Page => {
            let page = web::pack(release.built)?;
            let name = format!("haptic-lab-{}.html", release.version);
            fs::copy(page, release.place.join(name))?;
            Ok(())
        }
        Part::Firmware => firmware::images(release),
        Part::Crate => {
            // With its verification: what is packed builds by itself. A dry run may be of what is not committed yet.
            let mut package = cargo();
            package.args(["package", "-q", "-p", "haptic-core"]);
            if release.built != Built::ToShip {
                package.arg("--allow-dirty");
            }
            run(&mut package)?;
            let name = format!("haptic-core-{}.crate", release.version);
            copy_into(&root().join("target/package").join(name), &release.place)
        }
    }
}

fn copy_into(file: &Path, place: &Path) -> Result<()> {
    let name = file.file_name().context("a file's name")?;
    fs::copy(file, place.join(name)).with_context(|| file.display().to_string())?;
    Ok(())
}

/// The workspace's version, which the citation has to name too.
fn version() -> Result<String> {
    let metadata = output(cargo().args("metadata --no-deps --format-version 1 --locked".split(' ')))?;
    let metadata: serde_json::Value = serde_json::from_str(&metadata).context("cargo metadata")?;
    let packages = metadata["packages"].as_array().context("packages")?;
    let host_sim = packages
        .iter()
        .find(|package| package["name"] == "host-sim")
        .context("no host-sim")?;
    let version = host_sim["version"].as_str().context("a version")?;
    let citation = fs::read_to_string(root().join("CITATION.cff")).context("CITATION.cff")?;
    ensure!(
        citation.lines().any(|line| line == format!("version: {version}")),
        "CITATION.cff names another version than Cargo.toml, {version}"
    );
    if host_sim["repository"]
        .as_str()
        .is_some_and(|url| url.contains("example.org"))
    {
        eprintln!(
            "note: the repository in Cargo.toml is a placeholder, and so it stands in the wheel and the crate"
        );
    }
    Ok(version.to_owned())
}

/// Writes SHA256SUMS, as sha256sum reads it, and prints every file with its size.
fn sum(place: &Path) -> Result<()> {
    let mut files: Vec<PathBuf> = fs::read_dir(place)?
        .map(|entry| Ok(entry?.path()))
        .collect::<Result<_>>()?;
    files.sort();
    let mut sums = String::new();
    for file in files {
        let bytes = fs::read(&file).with_context(|| file.display().to_string())?;
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let digest: String = Sha256::digest(&bytes)
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect();
        sums.push_str(&format!("{digest}  {name}\n"));
        println!("{:>12} bytes  {name}", bytes.len());
    }
    fs::write(place.join(SUMS), sums)?;
    println!("{}", place.display());
    Ok(())
}

const SUMS: &str = "SHA256SUMS";

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use crate::tool::{cargo, output};

    /// What a registry shows of a package; only the controller goes to one.
    #[test]
    fn every_manifest_says_what_it_is_and_only_core_is_published() {
        let said = output(cargo().args("metadata --no-deps --format-version 1 --locked".split(' '))).unwrap();
        let metadata: Value = serde_json::from_str(&said).unwrap();
        let packages = metadata["packages"].as_array().unwrap();
        assert!(packages.len() > 15, "{}", packages.len());
        for package in packages {
            let name = &package["name"];
            for field in ["description", "license", "repository", "rust_version"] {
                assert!(package[field].is_string(), "{name}: no {field}");
            }
            let has_readme = package["readme"].is_string();
            assert!(has_readme, "{name}: no README.md");
            for list in ["keywords", "categories"] {
                let count = package[list].as_array().unwrap().len();
                assert!((1..=5).contains(&count), "{name}: {count} {list}");
            }
            let is_published = package["publish"].is_null();
            assert_eq!(is_published, name == "haptic-core", "{name}");
        }
    }
}
