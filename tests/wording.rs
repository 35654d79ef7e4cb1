//! Doc comments stand alone: a reader meets one in the documentation of an item, without the item before it. So none begins
//! as the rest of a sentence that stands elsewhere.

use crate::layering::{root, sources_below};

/// Where there is source code.
const TOPS: [&str; 8] = [
    "bench", "bindings", "core", "examples", "firmware", "host-sim", "tests", "xtask",
];

/// Beginnings that lean on what stands before.
const LEANING: [&str; 5] = ["The same", "Of", "As", "With", "Those"];

/// The text of a doc comment's line, and its marker.
fn doc(line: &str) -> Option<(&str, &str)> {
    let line = line.trim_start();
    let mark = ["///", "//!"].into_iter().find(|mark| line.starts_with(mark))?;
    Some((mark, line[mark.len()..].trim_start()))
}

fn leans(text: &str) -> bool {
    LEANING.iter().any(|beginning| {
        text.strip_prefix(beginning)
            .is_some_and(|rest| !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_'))
    })
}

/// Numbers of the lines at which a doc comment begins that leans on another.
fn leaning(text: &str) -> Vec<usize> {
    let mut before = None;
    let mut found = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let here = doc(line);
        let begins = here.map(|(mark, _)| mark) != before;
        if begins && here.is_some_and(|(_, text)| leans(text)) {
            found.push(number + 1);
        }
        before = here.map(|(mark, _)| mark);
    }
    found
}

#[test]
fn no_doc_comment_leans_on_the_one_before() {
    for top in TOPS {
        let mut wrong = Vec::new();
        for path in sources_below(&root().join(top)) {
            let name = path.strip_prefix(root()).unwrap();
            let found = leaning(&std::fs::read_to_string(&path).unwrap());
            wrong.extend(found.iter().map(|line| format!("{}:{line}", name.display())));
        }
        assert!(
            wrong.is_empty(),
            "doc comments that begin with {LEANING:?}:\n{}",
            wrong.join("\n")
        );
    }
}

#[test]
fn a_comment_that_leans_is_found() {
    let text = "/// The same, down.\nfn a() {}\n/// All of it.\n/// With more.\nfn b() {}\n//! Of a crate.\n//! As\n/// As\nfn c() {}";
    assert_eq!(leaning(text), [1, 6, 8]);
    assert!(!leans("Office hours.") && !leans("The samesake.") && leans("Those who lean."));
    // Plain comments may.
    assert_eq!(leaning("// The same.\nlet x = 1; // Of it.\n"), [0; 0]);
}
