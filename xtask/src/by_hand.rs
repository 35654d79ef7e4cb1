//! Defects made by hand (`core/tests/mutants.toml`): each is put into a copy of the sources, and the test that is there
//! for it has to fail. A tool that mutates single expressions comes upon few of them.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use crate::tool;

const LIST: &str = "core/tests/mutants.toml";

/// By the file that a defect is put into, and its name: what stands there once, what takes its place, and the test that has to
/// fail.
type List = BTreeMap<PathBuf, BTreeMap<String, [String; 3]>>;

/// Applies each that is [wanted](choose); an error names those that no test noticed.
pub(crate) fn run(words: &[String], base: Option<&str>) -> Result<()> {
    let text = fs::read_to_string(tool::root().join(LIST)).context(LIST)?;
    let list: List = toml::from_str(&text).context(LIST)?;
    ensure!(!list.is_empty(), "{LIST} has no defect");
    let list = choose(list, words, &changed_since(base)?)?;
    let all: usize = list.values().map(BTreeMap::len).sum();
    if all == 0 {
        println!("no file that differs has a defect in {LIST}");
        return Ok(());
    }
    let copy = tool::root().join("target/by-hand");
    copy_sources(&copy)?;
    // First of all the copy as it is: what fails there anyway would notice everything.
    let names = list
        .values()
        .flat_map(BTreeMap::values)
        .map(|[.., name]| name.as_str());
    let names: Vec<&str> = names.collect();
    let said = test(
        &copy,
        &[&["--lib", "--test", "all", "--", "--exact"], &names[..]].concat(),
    )?;
    for name in names {
        ensure!(
            said.contains(&format!("test {name} ... ok")),
            "without a defect {name} does not pass:\n{said}"
        );
    }
    let (mut count, mut survivors, mut broken) = (0, Vec::new(), Vec::new());
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
                println!("{count:>3}/{all} noticed   {defect} ({name})");
            } else if said.contains("error: could not compile") {
                println!("{count:>3}/{all} NO DEFECT {defect}: it does not compile");
                broken.push(defect.as_str());
            } else {
                println!("{count:>3}/{all} SURVIVED  {defect} ({name})");
                survivors.push(defect.as_str());
            }
        }
    }
    ensure!(
        survivors.is_empty() && broken.is_empty(),
        "not noticed: {}; do not compile: {}",
        survivors.join("; "),
        broken.join("; ")
    );
    println!("{count} defects made by hand are noticed");
    Ok(())
}

/// The defects that are asked for: of a file whose path ends in one of the words, or with a word in their name; and of
/// files that differ.
///
/// # Errors
/// A word that no defect fits.
fn choose(mut list: List, words: &[String], differs: &dyn Fn(&Path) -> bool) -> Result<List> {
    let fits = |file: &Path, defect: &str, word: &str| file.ends_with(word) || defect.contains(word);
    for word in words {
        let mut all = list
            .iter()
            .flat_map(|(file, defects)| defects.keys().map(move |defect| (file, defect)));
        if !all.any(|(file, defect)| fits(file, defect, word)) {
            let message = format!("{word}: {LIST} has no such file, and no defect with this in its name");
            return Err(tool::Usage(message).into());
        }
    }
    list.retain(|file, defects| {
        defects.retain(|defect, _| words.is_empty() || words.iter().any(|word| fits(file, defect, word)));
        !defects.is_empty() && differs(file)
    });
    Ok(list)
}

/// Whether a file differs from a commit, branch or tag; any file if there is none.
fn changed_since(base: Option<&str>) -> Result<impl Fn(&Path) -> bool> {
    let names = |base| tool::output(tool::command("git").args(["diff", "--name-only", base, "--"]));
    let changed = base.map(names).transpose()?;
    Ok(move |file: &Path| {
        let changed = changed.as_deref();
        changed.is_none_or(|changed| changed.lines().any(|line| Path::new(line) == file))
    })
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

#[cfg(test)]
mod tests {
    use super::{List, choose};
    use std::path::Path;

    fn chosen(words: &[&str], differs: &dyn Fn(&Path) -> bool) -> anyhow::Result<Vec<String>> {
        let list: List = toml::from_str(
            "['core/src/ecu/mod.rs']\n'a veto' = ['a', 'b', 't']\n\
             ['core/src/law/mod.rs']\n'a sign' = ['a', 'b', 't']\n'a share' = ['a', 'b', 't']\n",
        )?;
        let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
        let chosen = choose(list, &words, differs)?;
        Ok(chosen
            .into_values()
            .flat_map(|defects| defects.into_keys())
            .collect())
    }

    #[test]
    fn defects_are_chosen_by_file_by_name_and_by_what_differs() {
        let any = |_: &Path| true;
        assert_eq!(chosen(&[], &any).unwrap(), ["a veto", "a share", "a sign"]);
        assert_eq!(chosen(&["law/mod.rs"], &any).unwrap(), ["a share", "a sign"]);
        assert_eq!(chosen(&["sign", "veto"], &any).unwrap(), ["a veto", "a sign"]);
        let law = |file: &Path| file == Path::new("core/src/law/mod.rs");
        assert_eq!(chosen(&["mod.rs"], &law).unwrap(), ["a share", "a sign"]);
        assert!(chosen(&["veto"], &law).unwrap().is_empty());
        assert!(
            chosen(&["low/mod.rs"], &any)
                .unwrap_err()
                .is::<crate::tool::Usage>()
        );
    }
}
