//! The documents do what they say: their examples run, their links lead somewhere, their terms are defined before their
//! use, their numbers are those of today. What a writer has to know is in `examples`.

mod examples;
mod links;
mod numbers;
mod passages;
mod terms;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Crates whose README is checked; the bindings' are checked by their own tools.
const CRATES: [&str; 20] = [
    "core",
    "firmware",
    "firmware/lockstep",
    "host-sim",
    "host-sim/input",
    "host-sim/road",
    "host-sim/sim",
    "host-sim/column",
    "host-sim/vectorised",
    "host-sim/log",
    "host-sim/recording",
    "host-sim/analysis",
    "host-sim/engine",
    "host-sim/batch",
    "host-sim/campaign",
    "host-sim/evidence",
    "host-sim/pil",
    "host-sim/report",
    "xtask",
    "xtask/log",
];

/// A directory's names in the directory that examples run in.
const LENT: [&str; 5] = ["examples", "tests", "core", "docs", "bench"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("..")
        .canonicalize()
        .unwrap()
}

/// Every document of the repository: name from the root, and text.
fn documents() -> BTreeMap<PathBuf, String> {
    let mut folders = vec![root().join("docs"), root().join("bench")];
    let mut found: Vec<PathBuf> = markdown(&root());
    found.extend(CRATES.iter().flat_map(|name| markdown(&root().join(name))));
    while let Some(folder) = folders.pop() {
        found.extend(markdown(&folder));
        let entries = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().path());
        folders.extend(entries.filter(|path| path.is_dir()));
    }
    let read = |path: PathBuf| {
        let text = std::fs::read_to_string(&path).unwrap();
        (path.strip_prefix(root()).unwrap().to_owned(), text)
    };
    found.into_iter().map(read).collect()
}

fn markdown(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    entries
        .filter(|path| path.extension().is_some_and(|e| e == "md"))
        .collect()
}

/// The text without its blocks, which hold no links and no headings.
fn prose(text: &str) -> String {
    let mut inside = false;
    let mut lines = String::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            inside = !inside;
        } else if !inside {
            lines.push_str(line);
            lines.push('\n');
        }
    }
    lines
}

/// Text without code in backticks and without headings, which may name what the text then defines.
fn words_of(text: &str) -> String {
    let prose = prose(text);
    let lines = prose.lines().filter(|line| !line.starts_with('#'));
    let text = lines.collect::<Vec<_>>().join("\n");
    text.split('`').step_by(2).collect::<Vec<_>>().join("_")
}

/// Where the commands of one document run: its own place, with the repository's folders in it.
fn place() -> tempfile::TempDir {
    let place = tempfile::tempdir().unwrap();
    for name in LENT {
        std::os::unix::fs::symlink(root().join(name), place.path().join(name)).unwrap();
    }
    place
}

fn run(program: &mut Command, place: &Path, what: &str) -> (Option<i32>, String, String) {
    let output = program.current_dir(place).output();
    let output = output.unwrap_or_else(|e| panic!("{what}: {e}"));
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}
