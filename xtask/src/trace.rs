//! Requirements and what shows them (`docs/requirements.toml`): every piece of evidence has to be there, and everything
//! that the documents list, limits, faults, rows of the campaign, mode transitions and parameters, needs a requirement.
//! The documents' lists are held to the code by tests of their own.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::fs;

use anyhow::{Context, Result, ensure};
use serde::Deserialize;

use crate::tool;

const LIST: &str = "docs/requirements.toml";
const PAGE: &str = "docs/requirements.md";
const CLASSES: [&str; 7] = ["A", "B", "C", "D", "L", "R", "design"];
/// Commands of `cargo xtask` that show something.
const GATES: [&str; 5] = ["gate", "boards", "bench", "coverage", "mutants"];

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct List {
    requirement: Vec<Requirement>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Requirement {
    id: String,
    text: String,
    source: String,
    class: String,
    #[serde(default)]
    covers: Vec<String>,
    evidence: Vec<String>,
}

/// Checks the list, and the page that is made of it; writes the page if `bless`.
pub(crate) fn run(bless: bool) -> Result<()> {
    let list: List = toml::from_str(&read(LIST)?).context(LIST)?;
    let items = items()?;
    let errors = check(&list.requirement, &items, &|path| read(path).ok());
    for error in &errors {
        eprintln!("{LIST}: {error}");
    }
    ensure!(errors.is_empty(), "{} errors in the requirements", errors.len());
    let page = page(&list.requirement);
    if bless {
        fs::write(tool::root().join(PAGE), &page).context(PAGE)?;
    }
    ensure!(
        read(PAGE).is_ok_and(|there| there == page),
        "{PAGE} is not what {LIST} makes: cargo xtask trace --bless"
    );
    let evidence: usize = list.requirement.iter().map(|r| r.evidence.len()).sum();
    println!(
        "{} requirements with {evidence} pieces of evidence cover {} limits, faults, rows, transitions and parameters",
        list.requirement.len(),
        items.len()
    );
    Ok(())
}

fn read(path: &str) -> Result<String> {
    fs::read_to_string(tool::root().join(path)).with_context(|| path.to_owned())
}

/// What needs a requirement, as `kind name`.
fn items() -> Result<BTreeSet<String>> {
    let behaviour = read("docs/explanation/behaviour.md")?;
    let campaign = read("docs/reference/fault-campaign.md")?;
    let mut items = BTreeSet::new();
    for row in table(&behaviour, "| limit | value | source and reason |")? {
        items.insert(format!("limit {}", row[0]));
    }
    for row in table(
        &read("docs/reference/bus.md")?,
        "| bit | fault | class | declared after |",
    )? {
        items.insert(format!("fault {}", row[1]));
    }
    let modes = "| mode | BootPassed | Engage | Faded | Disengage | InputLost | BootRejected | Critical |";
    let events: Vec<&str> = modes.split('|').map(str::trim).skip(2).collect();
    for row in table(&behaviour, modes)? {
        for (next, event) in row[1..].iter().zip(&events) {
            if next != "." {
                items.insert(format!("transition {} {event}", row[0]));
            }
        }
    }
    // Every table of the campaign has names in its first column.
    let rows = campaign
        .lines()
        .filter_map(|line| line.strip_prefix("| `")?.split_once("` | "));
    items.extend(rows.map(|(name, _)| format!("row {name}")));
    let parameters = read("docs/parameters.md")?;
    let rows = parameters
        .lines()
        .filter_map(|line| line.split_once(" | `")?.1.split_once("` | "));
    items.extend(rows.map(|(name, _)| format!("parameter {name}")));
    for kind in ["limit ", "fault ", "transition ", "row ", "parameter "] {
        let count = items.iter().filter(|item| item.starts_with(kind)).count();
        ensure!(
            count > 4,
            "only {count} of {kind}in the documents: has a table moved?"
        );
    }
    Ok(items)
}

/// The rows of the table with this head.
fn table(text: &str, head: &str) -> Result<Vec<Vec<String>>> {
    let (_, rest) = text
        .split_once(head)
        .with_context(|| format!("no document has the table {head}"))?;
    let rows = rest.lines().skip(2).take_while(|line| line.starts_with('|'));
    let cells = |line: &str| {
        line.trim_matches('|')
            .split('|')
            .map(|cell| cell.trim().to_owned())
            .collect()
    };
    Ok(rows.map(cells).collect())
}

/// What is wrong with the list; `file` reads a file of the repository.
fn check(
    requirements: &[Requirement],
    items: &BTreeSet<String>,
    file: &dyn Fn(&str) -> Option<String>,
) -> Vec<String> {
    let mut errors = Vec::new();
    let mut ids = BTreeSet::new();
    for r in requirements {
        let id = &r.id;
        if !ids.insert(id) {
            errors.push(format!("{id} is there twice"));
        }
        if !CLASSES.contains(&r.class.as_str()) {
            errors.push(format!("{id}: class {} is none of {CLASSES:?}", r.class));
        }
        if r.text.is_empty() || r.source.is_empty() || r.evidence.is_empty() {
            errors.push(format!("{id} lacks text, source or evidence"));
        }
        for pattern in &r.covers {
            if !items.iter().any(|item| matches(pattern, item)) {
                errors.push(format!("{id} covers {pattern:?}, which is nowhere"));
            }
        }
        for evidence in &r.evidence {
            if let Err(why) = exists(evidence, items, file) {
                errors.push(format!("{id}: {evidence:?}: {why}"));
            }
        }
    }
    let patterns: Vec<&String> = requirements.iter().flat_map(|r| &r.covers).collect();
    for item in items {
        if !patterns.iter().any(|pattern| matches(pattern, item)) {
            errors.push(format!("no requirement covers {item:?}"));
        }
    }
    errors
}

fn exists(
    evidence: &str,
    items: &BTreeSet<String>,
    file: &dyn Fn(&str) -> Option<String>,
) -> Result<(), &'static str> {
    match evidence.split_once(' ') {
        Some(("row", _)) if items.contains(evidence) => Ok(()),
        Some(("row", _)) => Err("docs/reference/fault-campaign.md has no such row"),
        Some(("gate", name)) if GATES.contains(&name) => Ok(()),
        Some(("gate", _)) => Err("no such gate"),
        Some(("test", place)) => {
            let (path, function) = place
                .split_once("::")
                .ok_or("neither PATH::FUNCTION nor PATH::*")?;
            let text = file(path).ok_or("no such file")?;
            let is_there = match function {
                "*" => text.contains("#[test]"),
                _ => {
                    text.contains(&format!("#[test]\nfn {function}("))
                        || text.contains(&format!("#[test]\n    fn {function}("))
                }
            };
            is_there.then_some(()).ok_or("the file has no such test")
        }
        _ => Err("neither test, row nor gate"),
    }
}

/// Whether a pattern, in which a `*` stands for anything, fits.
fn matches(pattern: &str, text: &str) -> bool {
    match pattern.split_once('*') {
        None => pattern == text,
        Some((head, tail)) => text.strip_prefix(head).is_some_and(|rest| {
            (0..=rest.len())
                .filter(|at| rest.is_char_boundary(*at))
                .any(|at| matches(tail, &rest[at..]))
        }),
    }
}

fn page(requirements: &[Requirement]) -> String {
    let mut page = String::from(
        "# Requirements\n\nMade of [requirements.toml](requirements.toml) by `cargo xtask trace --bless`; do not edit. `cargo \
         xtask trace` fails on\nevidence that is not there, and on a limit, fault, row of the campaign, mode transition or \
         parameter that no\nrequirement covers.\n\n| identifier | requirement | class | source | covers | evidence \
         |\n|---|---|---|---|---|---|\n",
    );
    let list = |items: &[String]| {
        items
            .iter()
            .map(|item| format!("`{item}`"))
            .collect::<Vec<_>>()
            .join("<br>")
    };
    for r in requirements {
        let _ = writeln!(
            page,
            "| {} | {} | {} | {} | {} | {} |",
            r.id,
            r.text,
            r.class,
            r.source,
            list(&r.covers),
            list(&r.evidence)
        );
    }
    page
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(covers: &[&str], evidence: &[&str]) -> Vec<String> {
        let list = |items: &[&str]| items.iter().map(|item| (*item).to_owned()).collect();
        let requirement = Requirement {
            id: "X-1".into(),
            text: "text".into(),
            source: "source".into(),
            class: "C".into(),
            covers: list(covers),
            evidence: list(evidence),
        };
        let items = ["limit wind-up", "row panic"].map(str::to_owned).into();
        check(&[requirement], &items, &|path| {
            (path == "a.rs").then(|| "#[test]\nfn b() {}\nfn c() {}".to_owned())
        })
    }

    #[test]
    fn everything_covered_and_shown_is_well() {
        let none: [String; 0] = [];
        assert_eq!(
            errors(
                &["limit *", "row panic"],
                &["test a.rs::b", "test a.rs::*", "row panic", "gate gate"]
            ),
            none
        );
    }

    #[test]
    fn what_is_missing_is_named() {
        let all = ["limit wind-up", "row panic"];
        for (evidence, why) in [
            ("test a.rs::c", "no such test"),
            ("test b.rs::b", "no such file"),
            ("test a.rs", "neither"),
            ("row hang", "no such row"),
            ("gate none", "no such gate"),
            ("somebody says so", "neither"),
        ] {
            let errors = errors(&all, &[evidence]);
            assert!(errors.len() == 1 && errors[0].contains(why), "{errors:?}");
        }
        assert!(errors(&all, &[])[0].contains("lacks"));
        assert!(
            errors(&["limit wind-up"], &["gate gate"])[0].contains("no requirement covers \"row panic\"")
        );
        assert!(errors(&["limit *", "row *", "fault x"], &["gate gate"])[0].contains("nowhere"));
    }

    #[test]
    fn a_star_stands_for_anything() {
        assert!(
            matches("row *-once", "row a-once")
                && matches("transition * Critical", "transition Boot Critical")
        );
        assert!(!matches("row *-once", "row once") && !matches("row a", "row ab"));
    }
}
