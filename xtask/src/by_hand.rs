//! Defects made by hand (`core/tests/mutants.toml`): each is put into a copy of the sources, and the test that is there
//! for it has to fail. A tool that mutates single expressions comes upon few of them.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};

use crate::tool;

const LIST: &str = "core/tests/mutants.toml";

/// By the file that a defect is put into, and its name: what stands there once, what takes its place, and the test that has to
/// fail.
type List = BTreeMap<PathBuf, BTreeMap<String, [String; 3]>>;

/// Applies each; an error names those that no test noticed.
pub(crate) fn run() -> Result<()> {
    let text = fs::read_to_string(tool::root().join(LIST)).context(LIST)?;
    let list: List = toml::from_str(&text).context(LIST)?;
    ensure!(!list.is_empty(), "{LIST} has no defect");
    let copy = tool::root().join("target/by-hand");
    copy_sources(&copy)?;
    // First of all the copy as it is: what fails there anyway would notice everything.
    let said = test(&copy, &["--lib", "--test", "all"])?;
    for [.., name] in list.values().flat_map(BTreeMap::values) {
        ensure!(
            said.contains(&format!("test {name} ... ok")),
            "without a defect {name} does not pass:\n{said}"
        );
    }
    let (mut count, mut survivors) = (0, Vec::new());
    for (file, defects) in &list {
        for (defect, [find, replace, name]) in defects {
            count += 1;
            let path = copy.join(file);
            let source = fs::read_to_string(&path).with_context(|| file.display().to_string())?;
            let found = source.matches(find).count();
            ensure!(
                found == 1,
                "{LIST}, {defect:?}: {find:?} stands {found} times in {}, not once",
                file.display()
            );
            fs::write(&path, source.replacen(find, replace, 1))?;
            let program: &[&str] = if name.contains("::tests::") {
                &["--lib"]
            } else {
                &["--test", "all"]
            };
            let said = test(&copy, &[program, &["--", "--exact", name]].concat())?;
            fs::write(&path, &source)?;
            if said.contains(&format!("test {name} ... FAILED")) {
                println!("killed    {defect} ({name})");
            } else if said.contains("error: could not compile") {
                bail!("{defect}: the defect does not compile:\n{said}");
            } else {
                println!("SURVIVED  {defect} ({name})");
                survivors.push(defect.as_str());
            }
        }
    }
    ensure!(survivors.is_empty(), "not noticed: {}", survivors.join("; "));
    println!("all {count} defects made by hand are noticed");
    Ok(())
}

/// What the tests print.
fn test(copy: &Path, which: &[&str]) -> Result<String> {
    let output = tool::cargo()
        .current_dir(copy)
        .args(["test", "-p", "haptic-core", "--all-features"])
        .args(which)
        .env("CARGO_TARGET_DIR", tool::root().join("target/by-hand-build"))
        .output()
        .context("cargo does not start")?;
    let [out, err] = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    Ok(out + &err)
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
