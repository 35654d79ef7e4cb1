//! Links and files that documents name are there.

use std::collections::BTreeMap;

use super::{documents, prose, root, words_of};

/// A heading's anchor, as GitHub and GitLab make it.
pub(super) fn anchors(text: &str) -> Vec<String> {
    let mut anchors: Vec<String> = Vec::new();
    let mut times: BTreeMap<String, u32> = BTreeMap::new();
    for line in prose(text).lines().filter(|line| line.starts_with('#')) {
        let title = line.trim_start_matches('#').trim().to_lowercase();
        let kept = title
            .chars()
            .filter(|c| c.is_alphanumeric() || [' ', '-', '_'].contains(c));
        let anchor: String = kept.collect::<String>().replace(' ', "-");
        let count = times.entry(anchor.clone()).or_default();
        anchors.push(match *count {
            0 => anchor,
            n => format!("{anchor}-{n}"),
        });
        *count += 1;
    }
    anchors
}

/// Targets of the links of a text: what stands between `](` and `)`.
fn links(text: &str) -> Vec<String> {
    let prose = words_of(text);
    let after = prose.split("](").skip(1);
    after
        .filter_map(|rest| Some(rest.split_once(')')?.0.to_owned()))
        .collect()
}

#[test]
fn every_link_leads_somewhere() {
    let documents = documents();
    for (name, text) in &documents {
        for link in links(text) {
            if link.contains("://") || link.starts_with("mailto:") {
                continue;
            }
            let (file, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let target = match file {
                "" => root().join(name),
                file => root().join(name).parent().unwrap().join(file),
            };
            assert!(target.exists(), "{}: {link} is not there", name.display());
            let target = target.canonicalize().unwrap();
            let Some(text) = documents.get(target.strip_prefix(root()).unwrap()) else {
                continue;
            };
            let found = anchor.is_empty() || anchors(text).iter().any(|a| a == anchor);
            assert!(found, "{}: {link}: no such heading", name.display());
        }
    }
}

/// A file that a document names from the repository's root is there, and a test in it.
#[test]
fn every_file_that_is_named_is_there() {
    let tops = [
        "core/",
        "firmware/",
        "host-sim/",
        "tests/",
        "xtask/",
        "docs/",
        "examples/",
        "bench/",
    ];
    for (name, text) in documents() {
        let prose = prose(&text);
        let code = prose.split('`').skip(1).step_by(2);
        for word in code.flat_map(str::split_whitespace) {
            // Evidence is written `tests/file.rs::function`.
            let (word, function) = word.split_once("::").unwrap_or((word, ""));
            let is_path = tops.iter().any(|top| word.starts_with(top));
            // `firmware/src/boards/<board>.x` is a pattern.
            if is_path && !word.contains(['<', '*']) {
                assert!(
                    root().join(word).exists(),
                    "{}: {word} is not there",
                    name.display()
                );
                let names_function = word.ends_with(".rs") && !function.is_empty();
                let source = std::fs::read_to_string(root().join(word)).unwrap_or_default();
                let is_there = source.contains(&format!("fn {function}("));
                assert!(
                    !names_function || is_there,
                    "{}: {word} has no {function}",
                    name.display()
                );
            }
        }
    }
}
