//! Requirements and what shows them (`docs/requirements.toml`): every piece of evidence has to be there, and everything
//! that the documents list, limits, faults, rows of the campaign, mode transitions and parameters, needs a requirement.
//! The documents' lists are held to the code by tests of their own.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use serde::Deserialize;

use crate::tool;

/// What a stage of `cargo xtask ci` says last of itself.
pub(crate) const PROCESSOR_TIME: &str = "processor time: ";

const LIST: &str = "docs/requirements.toml";
const CLASSES: [&str; 7] = ["A", "B", "C", "D", "L", "R", "design"];
/// Commands of `cargo xtask` that show something, and the stage of `cargo xtask ci` that is each.
const GATES: [(&str, &str); 5] = [
    ("gate", "gate"),
    ("boards", "boards"),
    ("bench", "instructions"),
    ("coverage", "coverage"),
    ("mutants", "mutants"),
];
/// The tests that drive every row of the campaign, those on a target apart.
const CAMPAIGN: [&str; 2] = [
    "tests/faults.rs::every_fault_with_a_few_seeds_breaks_no_rule_and_no_handover_is_worse_than_a_drop",
    "tests/faults_in_qemu.rs::*",
];

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

fn list() -> Result<List> {
    toml::from_str(&read(LIST)?).context(LIST)
}

/// Checks the list.
pub(crate) fn run() -> Result<()> {
    let list = list()?;
    let items = items()?;
    let errors = check(&list.requirement, &items, &|path| read(path).ok());
    for error in &errors {
        eprintln!("{LIST}: {error}");
    }
    ensure!(errors.is_empty(), "{} errors in the requirements", errors.len());
    let evidence: usize = list.requirement.iter().map(|r| r.evidence.len()).sum();
    println!(
        "{} requirements with {evidence} pieces of evidence cover {} limits, faults, rows, transitions and parameters",
        list.requirement.len(),
        items.len()
    );
    Ok(())
}

/// Judges every requirement by what a run of `cargo xtask ci` left in its logs, and writes that as JUnit's XML beside
/// them. A requirement is met if all its evidence ran and passed; evidence of `--full` alone that did not run is named.
pub(crate) fn by_execution(logs: &Path) -> Result<()> {
    let list = list()?;
    let log = |stage: &str| fs::read_to_string(logs.join(format!("{stage}.log"))).ok();
    let tests = log("tests").context("target/ci/tests.log: no run of cargo xtask ci")?;
    let tests = outcomes(&tests);
    let verdicts: Vec<Vec<(&str, Option<bool>)>> = list
        .requirement
        .iter()
        .map(|r| {
            let judged = |evidence: &'_ String| outcome(evidence, &tests, &log);
            r.evidence.iter().map(|e| (e.as_str(), judged(e))).collect()
        })
        .collect();
    let path = logs.join("requirements.xml");
    fs::write(&path, junit(&list.requirement, &verdicts)).with_context(|| path.display().to_string())?;
    let mut unmet = 0;
    for (r, verdicts) in list.requirement.iter().zip(&verdicts) {
        let failed = named(verdicts, Some(false));
        if !failed.is_empty() {
            unmet += 1;
            eprintln!("{}: {failed} failed, or did not run", r.id);
        }
    }
    let open = verdicts.iter().filter(|v| v.iter().any(|(_, ran)| ran.is_none()));
    println!(
        "{} requirements: {unmet} not met; {} of the others wait for a stage of --full; {}",
        list.requirement.len(),
        open.count(),
        path.display()
    );
    ensure!(unmet == 0, "{unmet} requirements are not met");
    Ok(())
}

/// Whether each test that a log of `cargo test` names passed; where a name stands for several, all of them.
fn outcomes(log: &str) -> BTreeMap<&str, bool> {
    let mut outcomes = BTreeMap::new();
    for line in log.lines() {
        if let Some((name, outcome)) = line
            .strip_prefix("test ")
            .and_then(|line| line.split_once(" ... "))
        {
            let passed = outcomes.entry(name).or_insert(true);
            *passed &= outcome.starts_with("ok");
        }
    }
    outcomes
}

/// Whether a piece of evidence ran and passed; none if its stage is one of `--full` and did not run.
fn outcome(
    evidence: &str,
    tests: &BTreeMap<&str, bool>,
    log: &dyn Fn(&str) -> Option<String>,
) -> Option<bool> {
    match evidence.split_once(' ') {
        Some(("gate", name)) => {
            let (_, stage) = GATES.iter().find(|(gate, _)| *gate == name)?;
            // The last line of a stage that failed is its error.
            let last = log(stage)?.lines().last().map(str::to_owned)?;
            Some(last.starts_with(PROCESSOR_TIME))
        }
        Some(("test", place)) => Some(passed(place, tests)),
        _ => Some(CAMPAIGN.iter().all(|place| passed(place, tests))),
    }
}

fn passed(place: &str, tests: &BTreeMap<&str, bool>) -> bool {
    let names = names(place);
    let is_named = |test: &str| names.iter().flatten().any(|name| matches(name, test));
    let mut ran = tests.iter().filter(|(test, _)| is_named(test)).peekable();
    ran.peek().is_some() && ran.all(|(_, passed)| *passed)
}

/// What `cargo test` calls the test at `PATH::FUNCTION`: by its file's module, in a module `tests` of it, or bare where
/// the file is a program of its own.
fn names(place: &str) -> Option<[String; 3]> {
    let (path, function) = place.split_once("::")?;
    let (_, file) = path.split_once("/src/").or_else(|| path.split_once("tests/"))?;
    let module = file
        .trim_end_matches(".rs")
        .trim_end_matches("/mod")
        .replace('/', "::");
    let inner = format!("{module}::tests::{function}");
    Some(
        [format!("{module}::{function}"), inner, function.to_owned()].map(|name| {
            // Anything of a module is nothing that is bare.
            if name == "*" { module.clone() } else { name }
        }),
    )
}

fn named(verdicts: &[(&str, Option<bool>)], outcome: Option<bool>) -> String {
    let those = verdicts.iter().filter(|(_, ran)| *ran == outcome);
    those
        .map(|(evidence, _)| *evidence)
        .collect::<Vec<_>>()
        .join(", ")
}

fn junit(requirements: &[Requirement], verdicts: &[Vec<(&str, Option<bool>)>]) -> String {
    let escaped = |text: &str| {
        text.replace('&', "&amp;")
            .replace('<', "&lt;")
            .replace('"', "&quot;")
    };
    let mut cases = String::new();
    let (mut failures, mut skipped) = (0, 0);
    for (r, verdicts) in requirements.iter().zip(verdicts) {
        let (failed, waits) = (named(verdicts, Some(false)), named(verdicts, None));
        let inside = if !failed.is_empty() {
            failures += 1;
            format!(
                "<failure message=\"failed, or did not run: {}\"/>",
                escaped(&failed)
            )
        } else if !waits.is_empty() {
            skipped += 1;
            format!("<skipped message=\"did not run: {}\"/>", escaped(&waits))
        } else {
            String::new()
        };
        let (id, text) = (escaped(&r.id), escaped(&r.text));
        let _ = writeln!(
            cases,
            "  <testcase classname=\"{id}\" name=\"{text}\">{inside}</testcase>"
        );
    }
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuite name=\"requirements\" tests=\"{}\" failures=\"{failures}\" \
         skipped=\"{skipped}\">\n{cases}</testsuite>\n",
        requirements.len()
    )
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
    // One entry of a list for each group of faults, with the names in backticks.
    for group in campaign.split("\n- *").skip(1) {
        let group = group.split("\n\n").next().unwrap_or("");
        let names = group.split('`').skip(1).step_by(2);
        items.extend(names.map(|name| format!("row {name}")));
    }
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
        Some(("gate", name)) if GATES.iter().any(|(gate, _)| *gate == name) => Ok(()),
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

/// The list as a table of a page.
pub(crate) fn page() -> Result<String> {
    let mut page = String::from(
        "| identifier | requirement | class | source | covers | evidence |\n|---|---|---|---|---|---|\n",
    );
    let in_lines = |items: &[String]| {
        items
            .iter()
            .map(|item| format!("`{item}`"))
            .collect::<Vec<_>>()
            .join("<br>")
    };
    for r in list()?.requirement {
        let _ = writeln!(
            page,
            "| {} | {} | {} | {} | {} | {} |",
            r.id,
            r.text,
            r.class,
            r.source,
            in_lines(&r.covers),
            in_lines(&r.evidence)
        );
    }
    Ok(page)
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
    fn evidence_is_what_ran_and_passed() {
        let log = "test ecu::a ... ok\ntest ecu::b ... FAILED\ntest safety::hands::tests::c ... ok\ntest d ... ok\n";
        let tests = outcomes(log);
        let stage = |name: &str| match name {
            "gate" => Some("well\nprocessor time: 3 s\n".to_owned()),
            "boards" => Some("processor time: 3 s\nerror: no board\n".to_owned()),
            _ => None,
        };
        for (evidence, expected) in [
            ("test core/tests/ecu.rs::a", Some(true)),
            ("test core/tests/ecu.rs::b", Some(false)),
            ("test core/tests/ecu.rs::*", Some(false)),
            ("test core/src/safety/hands.rs::c", Some(true)),
            ("test firmware/tests/power_loss.rs::d", Some(true)),
            ("test core/tests/ecu.rs::e", Some(false)),
            ("row panic", Some(false)),
            ("gate gate", Some(true)),
            ("gate boards", Some(false)),
            ("gate coverage", None),
        ] {
            assert_eq!(outcome(evidence, &tests, &stage), expected, "{evidence}");
        }
        let campaign = CAMPAIGN[0].replace("tests/faults.rs", "faults");
        let campaign = format!("test {campaign} ... ok\ntest faults_in_qemu::a ... ok\n");
        assert_eq!(outcome("row panic", &outcomes(&campaign), &stage), Some(true));
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
