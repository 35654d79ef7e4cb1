//! Terms are defined before their use.

use std::path::Path;

use super::links::anchors;
use super::{documents, root, words_of};

/// Words that a reader cannot know, and a pattern is one of them where letters do not go on.
const TERMS: [(&str, &str); 14] = [
    ("reliance", "#reliance"),
    ("K_hg", "#k_hg"),
    ("T_d", "#t_d"),
    ("T_h", "#t_h"),
    ("t_p", "#t_p"),
    ("K_d", "#k_d"),
    ("gain_i", "#gain_i"),
    ("probe", "#probe"),
    ("remnant", "#remnant"),
    ("handover", "#handover"),
    ("lane preview", "#lane-preview"),
    ("envelope", "#envelope"),
    ("lock-step", "#lock-step"),
    ("e_theta", "#e_y-and-e_theta"),
];

/// Where a term stands for the first time as a word of its own.
fn first(text: &str, term: &str) -> Option<usize> {
    let part = |c: char| c.is_alphanumeric() || c == '_' || c == '-' || c == '/' || c == '.';
    let lower = text.to_lowercase();
    let places = lower
        .match_indices(&term.to_lowercase())
        .map(|(at, _)| at)
        .collect::<Vec<_>>();
    places.into_iter().find(|&at| {
        let before = lower[..at].chars().next_back();
        let after = lower[at + term.len()..].chars().next();
        !before.is_some_and(part) && !after.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == '-')
    })
}

/// The first time that a document uses a term, it leads to the glossary.
#[test]
fn a_term_is_defined_before_its_use() {
    let glossary = std::fs::read_to_string(root().join("docs/glossary.md")).unwrap();
    let headings = anchors(&glossary);
    let mut wrong = Vec::new();
    for (name, text) in documents() {
        // All but the first: one line a change, a table made by a tool, and the titles of pages.
        let own = [
            "docs/glossary.md",
            "CHANGELOG.md",
            "docs/requirements.md",
            "docs/SUMMARY.md",
        ];
        if own.iter().any(|own| name == Path::new(own)) {
            continue;
        }
        let text = words_of(&text);
        for (term, anchor) in TERMS {
            assert!(
                headings.iter().any(|a| a == &anchor[1..]),
                "docs/glossary.md: no {anchor}"
            );
            let Some(at) = first(&text, term) else { continue };
            let link = text[at..]
                .split("](")
                .nth(1)
                .and_then(|rest| rest.split(')').next());
            let inside = !text[at..]
                .split("](")
                .next()
                .unwrap_or("")
                .contains([']', '\n', '[']);
            if !inside || !link.is_some_and(|link| link.contains("glossary.md")) {
                let line: String = text[at..].chars().take(40).collect();
                wrong.push(format!("{}: {term}: {:?}", name.display(), line));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "not defined before its use:\n{}",
        wrong.join("\n")
    );
}
