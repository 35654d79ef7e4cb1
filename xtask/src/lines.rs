//! How long the code is: lines by crate, and the most that each crate may have; and how long the documents are.
//!
//! Counted are the Rust sources below each place, without blank lines, without comments, and without tests: directories
//! `tests`, files `tests.rs` and `*_tests.rs`, and what stands below `#[cfg(test)]`, to the closing brace at the same
//! indentation, as rustfmt leaves it. `cargo xtask lines` prints the table; a test (tests/layering.rs) holds it.

use std::path::Path;
use std::{fs, io};

/// A crate by its place, and the lines that it may have. One grows where another shrinks, or with the reason in the commit.
#[rustfmt::skip]
pub(crate) const BUDGETS: [(&str, usize); 30] = [
    ("bench", 420),
    ("bindings/c", 400),
    ("bindings/fmu", 1_700),
    ("bindings/python", 2_230),
    ("bindings/web", 630),
    ("core", 7_660),
    ("core/diag", 1_400),
    ("core/secoc", 840),
    ("examples", 200),
    ("firmware", 3_160),
    ("firmware/lockstep", 200),
    ("host-sim", 3_510),
    ("host-sim/analysis", 7_420),
    ("host-sim/batch", 8_850),
    ("host-sim/campaign", 4_150),
    ("host-sim/column", 1_660),
    ("host-sim/engine", 1_290),
    ("host-sim/evidence", 7_670),
    ("host-sim/input", 370),
    ("host-sim/log", 5_800),
    ("host-sim/metrics", 560),
    ("host-sim/pil", 2_360),
    ("host-sim/recording", 2_210),
    ("host-sim/report", 6_530),
    ("host-sim/road", 2_490),
    ("host-sim/sim", 6_930),
    ("host-sim/vectorised", 2_790),
    ("host-sim/vehicle", 1_670),
    ("xtask", 7_070),
    ("xtask/log", 100),
];

/// Words that the documents below `docs/` may have: runs of characters between spaces that hold a letter or a digit, in text, tables and
/// examples alike, so that no bar of a table counts.
pub(crate) const WORDS: usize = 45_000;

/// Every crate with its lines and its budget, from the checkout's root.
pub(crate) fn by_crate(root: &Path) -> io::Result<Vec<(&'static str, usize, usize)>> {
    let count = |(place, budget)| Ok((place, of_crate(&root.join(place))?, budget));
    BUDGETS.into_iter().map(count).collect()
}

/// Lines of code of a crate.
fn of_crate(place: &Path) -> io::Result<usize> {
    let mut lines = 0;
    for entry in fs::read_dir(place)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if path.is_dir() {
            // A crate within the crate counts for itself.
            let apart = path.join("Cargo.toml").exists() || matches!(&*name, "tests" | "target");
            lines += if apart { 0 } else { of_crate(&path)? };
        } else if name.ends_with(".rs") && name != "tests.rs" && !name.ends_with("_tests.rs") {
            lines += of_source(&fs::read_to_string(&path)?);
        }
    }
    Ok(lines)
}

/// Lines of code of a source.
pub(crate) fn of_source(text: &str) -> usize {
    let mut lines = 0;
    // Within a test: how far its attribute is indented, and whether its first line was seen, which may be all of it. A text within it may
    // begin where it begins.
    let mut test: Option<(usize, bool)> = None;
    for line in text.lines() {
        let code = line.trim_start();
        let indent = line.len() - code.len();
        if code.is_empty() || code.starts_with("//") {
            continue;
        }
        if let Some((at, is_inside)) = test {
            let ends = code == "}" || !is_inside && code.ends_with([';', '}']);
            test = (indent != at || !ends).then_some((at, is_inside || !code.starts_with("#[")));
        } else if code.starts_with("#[cfg(test)]") {
            test = Some((indent, false));
        } else {
            lines += 1;
        }
    }
    lines
}

/// Words of the Markdown files below a directory.
pub(crate) fn words(place: &Path) -> io::Result<usize> {
    let mut words = 0;
    for entry in fs::read_dir(place)? {
        let path = entry?.path();
        if path.is_dir() {
            words += self::words(&path)?;
        } else if path.extension().is_some_and(|extension| extension == "md") {
            words += of_document(&fs::read_to_string(&path)?);
        }
    }
    Ok(words)
}

/// Words of a document.
pub(crate) fn of_document(text: &str) -> usize {
    let is_word = |run: &&str| run.contains(char::is_alphanumeric);
    text.split_whitespace().filter(is_word).count()
}

/// Prints the table.
pub(crate) fn print(root: &Path) -> io::Result<()> {
    println!("{:<20} {:>7} {:>7}", "crate", "lines", "budget");
    let crates = by_crate(root)?;
    for (place, lines, budget) in &crates {
        println!("{place:<20} {lines:>7} {budget:>7}");
    }
    let sum = |of: fn(&(&str, usize, usize)) -> usize| crates.iter().map(of).sum::<usize>();
    println!("{:<20} {:>7} {:>7}", "all", sum(|c| c.1), sum(|c| c.2));
    let words = words(&root.join("docs"))?;
    println!("{:<20} {words:>7} {WORDS:>7}", "words in docs");
    Ok(())
}
