//! The arrows of docs/design.md, checked on the sources: who may import whom.
//!
//! Between crates Cargo holds them, and a table here the manifests. Inside core a table names, for every room and every
//! module of a room, whom it may use; an arrow that is not in the table fails, and so does one that nobody uses. Imports are
//! read from the text, without comments: `crate::a`, groups such as `crate::{a::b, c}`, and `super::` chains.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

#[path = "../xtask/src/lines.rs"]
#[allow(dead_code, reason = "what prints the table is for xtask")]
mod lines;

/// Who uses others: name, and whom it may use.
type Arrows = &'static [(&'static str, &'static [&'static str])];

/// Parts of core, each a room or a module of a room. Law, envelope, mode machine, bus and monitor do not know each other, but
/// that the bus carries the codes of limits and modes; only the controller and the ECU see them all.
#[rustfmt::skip]
const CORE: Arrows = &[
    // The request that it carries, the codes of limits, modes and faults, the estimator's reading, and the parameters' names.
    ("bus", &["controller::inputs", "controller::params", "estimator", "quantity", "safety::envelope", "safety::faults", "safety::modes"]),
    (
        "controller",
        &["controller::config", "controller::injection", "controller::inputs", "observer", "quantity", "safety::envelope", "safety::faults", "safety::modes", "safety::redundant"],
    ),
    ("controller::config", &["controller::params", "estimator", "law", "law::probe", "law::schedule", "observer", "quantity", "safety::envelope", "safety::monitor", "safety::plausibility", "safety::redundant"]),
    ("controller::injection", &["quantity"]),
    ("controller::inputs", &["lane", "quantity", "safety::faults", "safety::redundant"]),
    (
        "controller::memory",
        &["law", "law::activity", "law::probe", "quantity", "safety::coast", "safety::envelope", "safety::faults", "safety::frozen_torque", "safety::hands", "safety::modes", "safety::motion_history", "safety::plausibility", "safety::ramp", "safety::redundant"],
    ),
    (
        "controller::step",
        &["controller", "controller::config", "controller::injection", "controller::inputs", "controller::memory", "lane", "law", "law::activity", "law::probe", "observer", "quantity", "safety::coast", "safety::envelope", "safety::faults", "safety::hands", "safety::modes", "safety::plausibility", "safety::ramp", "safety::redundant"],
    ),
    (
        "ecu",
        &["bus", "controller", "controller::config", "controller::injection", "controller::inputs", "estimator", "lane", "observer", "quantity", "safety::actuator", "safety::envelope", "safety::faults", "safety::modes", "safety::monitor", "safety::plausibility", "safety::redundant"],
    ),
    ("estimator", &["bus", "law::sine", "quantity"]),
    // The input that bus, law and checks share.
    ("lane", &["quantity", "safety::redundant"]),
    ("law", &["lane", "quantity", "safety::redundant"]),
    ("law::activity", &["law", "quantity"]),
    ("law::probe", &["law::sine", "quantity", "safety::redundant"]),
    ("law::schedule", &["quantity", "safety::redundant"]),
    ("observer", &["quantity", "safety::redundant"]),
    ("quantity", &["safety::redundant"]),
    ("safety::actuator", &["quantity"]),
    ("safety::coast", &["lane", "quantity", "safety::redundant"]),
    ("safety::envelope", &["quantity", "safety::redundant"]),
    ("safety::faults", &["quantity"]),
    ("safety::frozen_torque", &["quantity"]),
    ("safety::hands", &["quantity", "safety::redundant"]),
    // Nothing of the rest but how its memory is kept.
    ("safety::monitor", &["safety::redundant"]),
    ("safety::motion_history", &["quantity"]),
    ("safety::plausibility", &["lane", "quantity", "safety::motion_history", "safety::redundant", "safety::yaw"]),
    ("safety::ramp", &["quantity", "safety::redundant"]),
    ("safety::yaw", &["quantity", "safety::redundant"]),
    ("service::download", &["bus", "controller::config", "controller::params", "safety::faults", "safety::modes", "service::stored"]),
    ("service::rejections", &["bus"]),
    ("service::stored", &["controller::config", "controller::params"]),
];

/// Rooms of core whose modules stand by themselves, and have arrows of their own.
const APART: [&str; 4] = ["controller", "law", "safety", "service"];

/// The studies of a crate, each a module with what is its own. What two of them need belongs to the engine, to the statistics or to
/// another module that is none of these.
#[rustfmt::skip]
const STUDIES: Arrows = &[
    ("host-sim/column/src/study", &["assist", "hands", "reading", "sensors"]),
    ("host-sim/batch/src", &["adaptation", "bus_load", "compare", "course", "design", "design_guidance", "evaluate", "experiment", "identify", "run", "stability", "study", "sweep"]),
    ("host-sim/evidence/src", &["availability", "estimates", "handover", "real_drives", "reliance", "vehicle"]),
];

/// Modules that use each other.
const CIRCLES: [&str; 1] = ["host-sim/sim: models::torsion_bar::exact and models::torsion_bar::plant"];

/// What only the engine of the studies uses: threads, and runs side by side.
const ENGINES_OWN: [&str; 2] = ["rayon", "haptic_vectorised"];
/// Files with runs of two kinds for a case (with the failure and without, with guidance and by hand), which ask the engine's groups for
/// them.
const SIDE_BY_SIDE: [&str; 2] = [
    "evidence/src/availability/drive.rs",
    "batch/src/sweep/vectorised.rs",
];

/// Which of our packages each package of the workspace may depend on, without its tests.
#[rustfmt::skip]
const PACKAGES: Arrows = &[
    ("core", &[]),
    ("core/diag", &["haptic-core"]),
    ("core/secoc", &["haptic-core"]),
    ("firmware", &["haptic-core", "haptic-diag", "haptic-lockstep", "haptic-secoc"]),
    ("firmware/lockstep", &["haptic-core", "haptic-secoc"]),
    ("host-sim/log", &[]),
    ("host-sim/input", &["haptic-core"]),
    ("host-sim/road", &["haptic-input"]),
    ("host-sim/sim", &["haptic-core", "haptic-input", "haptic-log", "haptic-road"]),
    ("host-sim/column", &["haptic-core", "haptic-engine", "haptic-sim"]),
    ("host-sim/vectorised", &["haptic-core", "haptic-log", "haptic-sim"]),
    ("host-sim/metrics", &["haptic-log"]),
    ("host-sim/vehicle", &["haptic-log"]),
    ("host-sim/recording", &["haptic-log"]),
    ("host-sim/analysis", &["haptic-log", "haptic-recording"]),
    ("host-sim/engine", &["haptic-analysis", "haptic-log", "haptic-sim", "haptic-vectorised", "haptic-vehicle"]),
    ("host-sim/batch", &["haptic-analysis", "haptic-core", "haptic-engine", "haptic-log", "haptic-metrics", "haptic-secoc", "haptic-sim", "haptic-vectorised", "haptic-vehicle"]),
    ("host-sim/pil", &["haptic-core", "haptic-diag", "haptic-lockstep", "haptic-secoc"]),
    ("host-sim/campaign", &["haptic-core", "haptic-lockstep", "haptic-log", "haptic-sim", "haptic-pil"]),
    ("host-sim/report", &["haptic-analysis", "haptic-batch", "haptic-column", "haptic-log", "haptic-metrics", "haptic-sim", "haptic-vehicle"]),
    // Beside these the command line's own parts, of host-sim.
    ("host-sim/evidence", &["haptic-analysis", "haptic-batch", "haptic-campaign", "haptic-core", "haptic-log", "haptic-report", "haptic-sim", "haptic-vectorised", "haptic-vehicle"]),
    ("bindings/c", &["haptic-core"]),
    // Driver and vehicle are the simulator's.
    ("bindings/fmu", &["haptic-core", "haptic-sim"]),
    // The loop and the identification in a page.
    ("bindings/web", &["haptic-analysis", "haptic-core", "haptic-log", "haptic-metrics", "haptic-sim"]),
    // The parts that Python hands out; no injector, no serial port, no charts.
    ("bindings/python", &["haptic-analysis", "haptic-batch", "haptic-core", "haptic-log", "haptic-metrics", "haptic-sim"]),
];

/// The simulator, and what of it stands in crates of their own.
const SIM: [&str; 3] = ["host-sim/input/src", "host-sim/road/src", "host-sim/sim/src"];

/// What the simulator may not touch: it runs in a browser and in somebody else's process.
const NOT_IN_SIM: [&str; 6] = ["fs", "thread", "time", "env", "process", "net"];

/// Parts of a crate that may not use something from outside it.
const OUTSIDERS: &[(&str, &[&str])] = &[
    ("core/src", &["std", "alloc"]),
    ("host-sim/sim/src/models", &["haptic_core"]),
];

/// The programs below host-sim.
const COMMANDS: [&str; 4] = [
    "src/cli",
    "src/main.rs",
    "evidence/src/cli",
    "evidence/src/main.rs",
];

/// The command line's own: nothing beside [`COMMANDS`] uses them.
const COMMAND_LINE: &[&str] = &["clap", "indicatif", "ctrlc", "terminal_size"];

pub(crate) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn sources(dir: &Path) -> Vec<PathBuf> {
    let found = sources_below(dir);
    assert!(!found.is_empty(), "no sources in {}", dir.display());
    found
}

pub(crate) fn sources_below(dir: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(dir).unwrap_or_else(|e| panic!("{}: {e}", dir.display())) {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources_below(&path));
        } else if path.extension().is_some_and(|x| x == "rs") {
            found.push(path);
        }
    }
    found
}

/// A source as words and signs, without comments.
fn tokens(text: &str) -> Vec<String> {
    let mut tokens = Vec::new();
    for line in text.lines() {
        let mut code = line.split("//").next().unwrap_or("").chars().peekable();
        while let Some(first) = code.next() {
            if first.is_alphanumeric() || first == '_' {
                let mut word = String::from(first);
                while let Some(next) = code.next_if(|c| c.is_alphanumeric() || *c == '_') {
                    word.push(next);
                }
                tokens.push(word);
            } else if first == ':' && code.next_if_eq(&':').is_some() {
                tokens.push("::".into());
            } else if !first.is_whitespace() {
                tokens.push(first.into());
            }
        }
    }
    tokens
}

/// The paths that a tree of imports names: `a::b` one, `{a::b, c}` two.
fn paths(tree: &[String]) -> Vec<Vec<&str>> {
    let (mut paths, mut stem, mut stems) = (Vec::new(), Vec::new(), Vec::new());
    let mut ended = true;
    for (i, token) in tree.iter().enumerate() {
        let after_colons = i == 0 || tree[i - 1] == "::";
        match token.as_str() {
            "::" => {}
            "{" if after_colons => {
                stems.push(stem.clone());
                ended = true;
            }
            "," | "}" if !stems.is_empty() => {
                if !std::mem::replace(&mut ended, true) {
                    paths.push(stem);
                }
                stem = stems.last().cloned().unwrap_or_default();
                if token == "}" {
                    stems.pop();
                }
                if stems.is_empty() {
                    return paths;
                }
            }
            name if after_colons || (!stems.is_empty() && ended) => {
                stem.push(name);
                ended = false;
            }
            _ if stems.is_empty() => break,
            // ` as other`.
            _ => {}
        }
    }
    if !ended {
        paths.push(stem);
    }
    paths
}

/// Paths from the crate's root that the source of the module `place` names.
fn uses(text: &str, place: &[String]) -> BTreeSet<Vec<String>> {
    let tokens = tokens(text);
    let mut used = BTreeSet::new();
    let mut above: Option<&[String]> = None;
    for (i, token) in tokens.iter().enumerate() {
        above = match token.as_str() {
            "crate" => Some(&[]),
            "super" => Some(above.unwrap_or(place)).map(|at| &at[..at.len().saturating_sub(1)]),
            "::" => above,
            _ => None,
        };
        let Some(above) = above.filter(|_| token != "::") else {
            continue;
        };
        let next = |n: usize| tokens.get(i + n).map(String::as_str);
        if next(1) != Some("::") || next(2) == Some("super") {
            continue;
        }
        for path in paths(&tokens[i + 2..]) {
            let path = path.into_iter().map(String::from);
            used.insert(above.iter().cloned().chain(path).collect());
        }
    }
    used
}

/// The part that a path leads to: a room, or a module of a room whose modules stand by themselves.
fn part(path: &[String], modules: &BTreeSet<Vec<String>>) -> Option<String> {
    let apart = path.first().is_some_and(|room| APART.contains(&room.as_str()));
    let known = |length: usize| path.get(..length).filter(|head| modules.contains(*head));
    let module = if apart { known(2) } else { None };
    module.or(known(1)).map(|head| head.join("::"))
}

/// What every module of a crate but its root names of the crate, as paths from the root, without unit tests.
fn named(src: &str) -> BTreeMap<Vec<String>, BTreeSet<Vec<String>>> {
    let src = root().join(src);
    let mut named = BTreeMap::new();
    for path in sources(&src) {
        let below = path.strip_prefix(&src).unwrap().with_extension("");
        let parts = below.iter().map(|part| part.to_str().unwrap().to_owned());
        let place: Vec<_> = parts.filter(|part| part != "mod").collect();
        let is_root = place
            .first()
            .is_none_or(|room| ["lib", "main"].contains(&room.as_str()));
        if is_root || path.ends_with("tests.rs") {
            continue;
        }
        let text = std::fs::read_to_string(path).unwrap();
        // A module of tests in another file ends nothing.
        let text = text.replace("#[cfg(test)]\nmod tests;", "");
        let (product, _) = text.split_once("#[cfg(test)]").unwrap_or((&text, ""));
        named.insert(place.clone(), uses(product, &place));
    }
    named
}

/// Every arrow between the parts of a crate, without unit tests.
fn arrows(src: &str) -> BTreeMap<String, BTreeSet<String>> {
    let named = named(src);
    let modules: BTreeSet<_> = named.keys().cloned().collect();
    let mut arrows: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (place, used) in &named {
        let from = part(place, &modules).unwrap();
        let used = used.iter().filter_map(|path| part(path, &modules));
        let used = used.filter(|to| *to != from);
        arrows.entry(from.clone()).or_default().extend(used);
    }
    arrows.retain(|_, used| !used.is_empty());
    arrows
}

fn as_written(arrows: Arrows) -> BTreeMap<String, BTreeSet<String>> {
    let set = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    arrows
        .iter()
        .map(|(from, to)| ((*from).to_owned(), set(to)))
        .collect()
}

#[test]
fn the_core_has_the_arrows_of_its_table_and_no_others() {
    assert_eq!(arrows("core/src"), as_written(CORE));
}

/// Two modules that use each other are one. A module and what lies below it are.
#[test]
fn no_two_modules_of_a_crate_use_each_other() {
    let mut circles = BTreeSet::new();
    for (place, _) in PACKAGES {
        let named = named(&format!("{place}/src"));
        let module = |path: &[String]| {
            let heads = (1..=path.len()).rev().map(|length| path[..length].to_vec());
            heads.into_iter().find(|head| named.contains_key(head))
        };
        let uses = |from: &Vec<String>, to: &Vec<String>| {
            named[from].iter().any(|path| module(path).as_ref() == Some(to))
        };
        for one in named.keys() {
            let others = named
                .keys()
                .filter(|other| one < other && !other.starts_with(one));
            for other in others.filter(|other| uses(one, other) && uses(other, one)) {
                circles.insert(format!("{place}: {} and {}", one.join("::"), other.join("::")));
            }
        }
    }
    assert_eq!(circles, CIRCLES.map(String::from).into());
}

#[test]
fn no_study_is_used_by_another_module() {
    for (src, studies) in STUDIES {
        let there = |study: &&str| {
            root().join(src).join(study).is_dir() || root().join(src).join(format!("{study}.rs")).exists()
        };
        assert!(studies.iter().all(there), "{src} has not all of {studies:?}");
        let mut used = arrows(src);
        // What a program shows belongs to the program.
        used.retain(|from, _| !["cli", "reports"].contains(&from.as_str()));
        for to in used.values_mut() {
            to.retain(|to| studies.contains(&to.as_str()));
        }
        used.retain(|_, to| !to.is_empty());
        assert_eq!(used, BTreeMap::new());
    }
}

#[test]
fn only_the_engine_of_the_studies_has_threads_and_runs_side_by_side() {
    let host_sim = root().join("host-sim");
    let both = STUDIES.iter().flat_map(|(src, _)| sources(&root().join(src)));
    for path in both {
        let below = path.strip_prefix(&host_sim).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let (product, _) = text
            .split_once("#[cfg(test)]\nmod tests {")
            .unwrap_or((&text, ""));
        let own = tokens(product);
        let uses = |name: &&&str| own.iter().any(|token| token == **name);
        let hits: Vec<_> = ENGINES_OWN.iter().filter(uses).collect();
        let may = SIDE_BY_SIDE.contains(&below.to_str().unwrap());
        assert!(may || hits.is_empty(), "{} uses {hits:?}", path.display());
    }
}

/// Cargo refuses what a manifest does not name, so the manifests are the arrows.
#[test]
fn the_packages_have_the_arrows_of_their_table_and_no_others() {
    for (place, allowed) in PACKAGES {
        let text = std::fs::read_to_string(root().join(place).join("Cargo.toml")).unwrap();
        let mut in_dependencies = false;
        let mut found = BTreeSet::new();
        for line in text.lines() {
            if let Some(section) = line.strip_prefix('[') {
                in_dependencies = section.ends_with("dependencies]") && !section.contains("dev-dependencies");
            } else if in_dependencies && line.starts_with("haptic-") {
                let end = line.find(['.', ' ', '=']).unwrap();
                found.insert(&line[..end]);
            }
        }
        assert_eq!(found, allowed.iter().copied().collect(), "{place}/Cargo.toml");
    }
}

/// What no product image has: faults to inject, and a step with another law.
#[test]
fn only_campaign_and_simulators_ask_for_more_than_the_product() {
    for (place, _) in PACKAGES {
        let text = std::fs::read_to_string(root().join(place).join("Cargo.toml")).unwrap();
        let (product, _) = text.split_once("[dev-dependencies]").unwrap_or((&text, ""));
        let asks = |feature: &str| product.contains(&format!("features = [\"{feature}\"]"));
        assert_eq!(asks("fault-injection"), *place == "host-sim/campaign", "{place}");
        let simulates = ["host-sim/sim", "host-sim/batch"].contains(place);
        assert_eq!(asks("another-law"), simulates, "{place}");
    }
}

/// A check that knew a law would share its mistakes.
#[test]
fn safety_knows_no_law() {
    for (module, used) in CORE {
        let room = module.split("::").next();
        let laws: Vec<_> = used.iter().filter(|used| used.starts_with("law")).collect();
        assert!(
            room != Some("safety") || laws.is_empty(),
            "{module} may use {laws:?}"
        );
    }
}

#[test]
fn the_simulator_has_no_file_no_thread_and_no_clock() {
    for path in SIM.iter().flat_map(|src| sources(&root().join(src))) {
        // Tests run on a host, and compare with documents.
        if path.ends_with("tests.rs") {
            continue;
        }
        let tokens = tokens(&std::fs::read_to_string(&path).unwrap());
        for three in tokens.windows(3) {
            let hit = three[0] == "std" && three[1] == "::" && NOT_IN_SIM.contains(&three[2].as_str());
            assert!(!hit, "{} uses std::{}", path.display(), three[2]);
        }
    }
}

#[test]
fn no_part_uses_a_crate_that_it_must_not_know() {
    for (place, forbidden) in OUTSIDERS {
        for path in sources(&root().join(place)) {
            let tokens = tokens(&std::fs::read_to_string(&path).unwrap());
            let named = |name: &&&str| tokens.windows(2).any(|pair| pair[0] == **name && pair[1] == "::");
            let hits: Vec<_> = forbidden.iter().filter(named).collect();
            assert!(hits.is_empty(), "{} must not use {hits:?}", path.display());
        }
    }
}

#[test]
fn only_the_command_line_reads_options_and_writes_to_the_terminal() {
    let src = root().join("host-sim");
    for path in sources(&src) {
        let below = path.strip_prefix(&src).unwrap();
        let library = below.components().any(|part| part.as_os_str() == "src")
            && !COMMANDS.iter().any(|at| below.starts_with(at));
        if !library {
            continue;
        }
        let tokens = tokens(&std::fs::read_to_string(&path).unwrap());
        for pair in tokens.windows(2) {
            let [name, next] = [pair[0].as_str(), pair[1].as_str()];
            let command_line = next == "::" && COMMAND_LINE.contains(&name);
            let prints = next == "!" && ["print", "println", "eprint", "eprintln"].contains(&name);
            assert!(!command_line && !prints, "{} uses {name}", path.display());
        }
    }
}

/// The reader itself, on imports in every form.
#[test]
fn imports_are_read_in_every_form() {
    let at = |place: &[&str], text: &str| {
        let place: Vec<_> = place.iter().map(|&part| part.to_owned()).collect();
        let used = uses(text, &place);
        used.into_iter().map(|path| path.join("::")).collect::<Vec<_>>()
    };
    assert_eq!(at(&["a"], "use crate::law::Law; // crate::monitor"), ["law::Law"]);
    assert_eq!(
        at(
            &["a", "b"],
            "use crate::{\n    bus::{Frame, e2e::{self, Check}},\n    modes,\n    law::Law as L,\n};"
        ),
        [
            "bus::Frame",
            "bus::e2e::Check",
            "bus::e2e::self",
            "law::Law",
            "modes"
        ]
    );
    assert_eq!(
        at(&["a"], "let x = crate::params::Params::PAPER;"),
        ["params::Params::PAPER"]
    );
    // In `models/driver.rs`, `super` is models and `super::super` the root.
    let driver = ["models", "driver"];
    assert_eq!(at(&driver, "use super::plant::Plant;"), ["models::plant::Plant"]);
    assert_eq!(
        at(&driver, "use super::super::{studies, cli::Output};"),
        ["cli::Output", "studies"]
    );
    // In `trace.rs`, `super` is the root.
    assert_eq!(at(&["trace"], "use super::metrics;"), ["metrics"]);
    assert_eq!(at(&["trace"], "use supercrate::metrics; use std::fs;"), [""; 0]);
    assert_eq!(
        at(&["trace"], "pub(super) fn f(x: crate::log::Log, y: u8) {}"),
        ["log::Log"]
    );
}

/// The linker optimises all crates at the level of the last one. Below 3 it makes no vector instructions, and sweeps take almost
/// five times as long.
#[test]
fn what_is_handed_on_is_optimised() {
    let text = std::fs::read_to_string(root().join("Cargo.toml")).unwrap();
    let manifest: toml::Table = text.parse().unwrap();
    let package = |profile: &str| {
        manifest["profile"][profile]["package"]
            .as_table()
            .unwrap()
            .clone()
    };
    let (daily, handed_on) = (package("release"), package("dist"));
    let level = |of: &toml::Value| of["opt-level"].as_integer();
    // Boards' images, and what is never handed on.
    let left = ["xtask", "haptic-campaign", "haptic-firmware"];
    let lower = daily
        .iter()
        .filter(|(name, of)| level(of) != Some(3) && !left.contains(&name.as_str()));
    let lower: Vec<_> = lower.map(|(name, _)| name).collect();
    assert!(lower.iter().any(|name| *name == "host-sim"), "{lower:?}");
    for name in lower {
        assert_eq!(
            handed_on.get(name).and_then(level),
            Some(3),
            "profile.dist.package.{name}"
        );
    }
}

/// Who a crate grows for is asked where it passes its budget, not file by file.
#[test]
fn every_crate_keeps_within_its_budget_of_lines() {
    let over = lines::by_crate(root()).unwrap();
    let over: Vec<_> = over.iter().filter(|(_, lines, budget)| lines > budget).collect();
    assert!(
        over.is_empty(),
        "crate, lines, budget: make them fewer, or give the reason with a larger budget in xtask/src/lines.rs: {over:#?}"
    );
    let budgeted = lines::BUDGETS.map(|(place, _)| place);
    let without: Vec<_> = PACKAGES
        .iter()
        .filter(|(place, _)| !budgeted.contains(place))
        .collect();
    assert!(without.is_empty(), "no budget: {without:?}");
}

#[test]
fn the_documents_keep_within_their_budget_of_words() {
    let words = lines::words(&root().join("docs")).unwrap();
    assert!(
        words <= lines::WORDS,
        "{words} words in docs/: {} at most",
        lines::WORDS
    );
    // Bars and dashes are no words; a number is one.
    assert_eq!(
        lines::of_document("# A title\n\n| a | 0.5 \u{b1} 1 |\n|---|---|\n- `b` c.\n"),
        7
    );
}

/// Counted by hand: what is left out stands beside what is not.
#[test]
fn lines_are_counted_without_tests_comments_and_blanks() {
    let text = "//! Header.\n\nuse a::b;\n/// A word.\nfn f() {\n    // Why.\n    g(); // counted\n}\n";
    assert_eq!(lines::of_source(text), 4);
    let tested = "#[cfg(test)]\nmod tests;\n\n#[cfg(test)]\n#[path = \"x.rs\"]\nmod tests {\n    fn f() {\n    }\n}\nfn h() {}\n";
    assert_eq!(lines::of_source(tested), 1);
    let with_a_text = "#[cfg(test)]\nmod tests {\n    const T: &str = r\"\nfn g() {}\nuse a;\n\";\n    fn f() {}\n}\nfn h() {}\n";
    assert_eq!(lines::of_source(with_a_text), 1);
    let elsewhere = "#[cfg(test)]\n#[path = \"x.rs\"]\nmod tests;\nfn h() {}\nfn i() {}\n";
    assert_eq!(lines::of_source(elsewhere), 2);
    let inside = "impl A {\n    #[cfg(test)]\n    fn only(\n        x: u8,\n    ) -> u8 {\n        x\n    }\n    fn kept() {}\n}\n";
    assert_eq!(lines::of_source(inside), 3);
}
