//! Defects made by hand (`core/tests/mutants.toml`): each is put into a copy of the sources, and the test that is there
//! for it has to fail. A tool that mutates single expressions comes upon few of them.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use serde::Deserialize;

use crate::tool;

const LIST: &str = "core/tests/mutants.toml";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct List {
    mutant: Vec<Mutant>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Mutant {
    name: String,
    file: PathBuf,
    find: String,
    replace: String,
    test: String,
}

/// Applies each; an error names those that no test noticed.
pub(crate) fn run() -> Result<()> {
    let text = fs::read_to_string(tool::root().join(LIST)).context(LIST)?;
    let list: List = toml::from_str(&text).context(LIST)?;
    ensure!(!list.mutant.is_empty(), "{LIST} has no mutant");
    let copy = tool::root().join("target/by-hand");
    copy_sources(&copy)?;
    // First of all the copy as it is: what fails there anyway would notice everything.
    for mutant in &list.mutant {
        let (said, name) = test(&copy, mutant)?;
        ensure!(
            said.contains(&format!("test {name} ... ok")),
            "without a defect {name} does not pass:\n{said}"
        );
    }
    let mut survivors = Vec::new();
    for mutant in &list.mutant {
        let path = copy.join(&mutant.file);
        let source = fs::read_to_string(&path).with_context(|| mutant.file.display().to_string())?;
        let found = source.matches(&mutant.find).count();
        ensure!(
            found == 1,
            "{LIST}: {:?} stands {found} times in {}, not once",
            mutant.find,
            mutant.file.display()
        );
        fs::write(&path, source.replacen(&mutant.find, &mutant.replace, 1))?;
        let (said, name) = test(&copy, mutant)?;
        fs::write(&path, &source)?;
        let failed = format!("test {name} ... FAILED");
        if said.contains(&failed) {
            println!("killed    {} ({})", mutant.name, mutant.test);
        } else if said.contains("error: could not compile") {
            bail!("{}: the defect does not compile:\n{said}", mutant.name);
        } else {
            println!("SURVIVED  {} ({})", mutant.name, mutant.test);
            survivors.push(mutant.name.as_str());
        }
    }
    ensure!(survivors.is_empty(), "not noticed: {}", survivors.join("; "));
    println!("all {} defects made by hand are noticed", list.mutant.len());
    Ok(())
}

/// What the test of a mutant, `file::function`, prints, and the function.
fn test<'a>(copy: &Path, mutant: &'a Mutant) -> Result<(String, &'a str)> {
    let name = mutant.test.as_str();
    ensure!(name.contains("::"), "{LIST}: {name} is not FILE::TEST");
    let output = tool::cargo()
        .current_dir(copy)
        .args(["test", "-p", "haptic-core", "--all-features", "--test", "all"])
        .args(["--", "--exact", name])
        .env("CARGO_TARGET_DIR", tool::root().join("target/by-hand-build"))
        .output()
        .context("cargo does not start")?;
    let [out, err] = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    Ok((out + &err, name))
}

/// Core with what its tests read, as a workspace of its own.
fn copy_sources(copy: &Path) -> Result<()> {
    let _ = fs::remove_dir_all(copy);
    for place in ["core", "docs", "tests/data", "bindings/c/include"] {
        copy_all(&tool::root().join(place), &copy.join(place))?;
    }
    fs::copy(tool::root().join("Cargo.lock"), copy.join("Cargo.lock"))?;
    let text = fs::read_to_string(tool::root().join("Cargo.toml"))?;
    let mut manifest: toml::Table = text.parse().context("Cargo.toml")?;
    // The workspace without the package that owns the tests across the crates.
    manifest.retain(|key, _| key == "workspace" || key == "profile");
    let workspace = manifest.get_mut("workspace").and_then(toml::Value::as_table_mut);
    let workspace = workspace.context("Cargo.toml: no workspace")?;
    workspace.remove("default-members");
    workspace.insert("members".into(), vec!["core"].into());
    fs::write(copy.join("Cargo.toml"), manifest.to_string())?;
    Ok(())
}

fn copy_all(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from).with_context(|| from.display().to_string())? {
        let entry = entry?;
        let target = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            copy_all(&entry.path(), &target)?;
        } else {
            fs::copy(entry.path(), &target)?;
        }
    }
    Ok(())
}
