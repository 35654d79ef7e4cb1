//! A release made twice, in clones of the last commit at two places: what differs cannot be rebuilt by others.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};

use super::{Part, SUMS};
use crate::tool::{cargo, command, root, run};

/// Prints what differs; an error if anything does.
pub(super) fn compare(only: &[Part]) -> Result<()> {
    // Of different length too: a path that gets into a file would shift what follows.
    let places = ["target/twice/one", "target/twice/the-other/place"].map(|place| root().join(place));
    for place in &places {
        let _ = fs::remove_dir_all(place);
        fs::create_dir_all(place.parent().context("a parent")?)?;
        run(command("git").args(["clone", "-q", "."]).arg(place))?;
        let mut release = cargo();
        release
            .current_dir(place)
            .args(["run", "-q", "--release", "-p", "xtask", "--", "release"])
            .env_remove("CARGO_TARGET_DIR");
        for part in only {
            release.args(["--only", &part.name()]);
        }
        run(&mut release)?;
    }
    let [one, other] = places;
    let (one, other) = (sums(&one)?, sums(&other)?);
    ensure!(!one.is_empty(), "nothing was made");
    let mut differing = Vec::new();
    for name in one
        .keys()
        .chain(other.keys().filter(|name| !one.contains_key(*name)))
    {
        let is_same = one.get(name) == other.get(name);
        println!("{}  {name}", if is_same { "same   " } else { "DIFFERS" });
        if !is_same {
            differing.push(name.as_str());
        }
    }
    ensure!(
        differing.is_empty(),
        "made twice, these differ: {}",
        differing.join(", ")
    );
    Ok(())
}

/// Digests by the names of files.
fn sums(clone: &Path) -> Result<BTreeMap<String, String>> {
    let file = clone.join("target/handed-on").join(SUMS);
    let text = fs::read_to_string(&file).with_context(|| file.display().to_string())?;
    let lines = text.lines().filter_map(|line| line.split_once("  "));
    Ok(lines
        .map(|(digest, name)| (name.to_owned(), digest.to_owned()))
        .collect())
}
