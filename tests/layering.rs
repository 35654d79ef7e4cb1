//! The arrows of docs/design.md, checked on the sources: who may import whom.
//!
//! For each crate a table names, for every module, the modules that it may use; an arrow that is not in the
//! table fails, and so does one in the table that nobody uses any more. Imports are read from the text, without
//! comments: `crate::a`, groups such as `crate::{a::b, c}`, and `super::` chains that reach the crate's root.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Modules at the crate's root that use others: name, and whom it may use.
type Arrows = &'static [(&'static str, &'static [&'static str])];

/// Law, envelope, mode machine, bus and monitor do not know each other, but that the bus carries the codes of
/// limits and modes; only the controller and the ECU see them all.
#[rustfmt::skip]
const CORE: Arrows = &[
    ("actuator", &["quantity"]),
    ("background", &["bus", "estimator", "quantity"]),
    // The codes of limits, modes and faults, and the names of the parameters that it carries.
    ("bus", &["envelope", "estimator", "faults", "modes", "params", "quantity", "redundant"]),
    ("config", &["envelope", "estimator", "law", "monitor", "params", "plausibility", "probe", "quantity", "redundant"]),
    ("controller", &["config", "envelope", "faults", "injection", "law", "modes", "plausibility", "probe", "quantity", "ramp", "redundant"]),
    ("download", &["bus", "config", "modes", "params", "stored"]),
    ("ecu", &["actuator", "background", "bus", "config", "controller", "envelope", "estimator", "faults", "injection", "law", "modes", "monitor", "plausibility", "quantity", "redundant"]),
    ("envelope", &["quantity", "redundant"]),
    ("estimator", &["quantity", "sine"]),
    ("faults", &["quantity"]),
    ("injection", &["quantity"]),
    ("law", &["quantity", "redundant"]),
    // Nothing of the rest but how its memory is kept.
    ("monitor", &["redundant"]),
    // A rate of change, the law's input, is all that it takes.
    ("plausibility", &["law", "quantity", "redundant"]),
    ("probe", &["quantity", "redundant", "sine"]),
    ("quantity", &["redundant"]),
    ("ramp", &["quantity", "redundant"]),
    ("stored", &["config", "params"]),
];

/// Models know nothing of the controller or of studies, studies nothing of the command line.
#[rustfmt::skip]
const HOST_SIM: Arrows = &[
    ("closed_loop", &["guidance", "models", "scenario", "trace"]),
    ("ecu_events", &["closed_loop", "models", "report"]),
    ("faults", &["closed_loop", "ecu_events", "guidance", "models", "pil", "report", "scenario"]),
    ("guidance", &["models"]),
    // The vehicle, for what the bus does not carry.
    ("identify", &["models"]),
    ("metrics", &["trace"]),
    ("models", &["input"]),
    ("plot", &["trace"]),
    ("report", &["metrics", "plot", "trace"]),
    ("scenario", &["input", "models"]),
    ("studies", &["closed_loop", "ecu_events", "guidance", "identify", "input", "metrics", "models", "pil", "plot", "report", "scenario", "trace"]),
];

/// Parts of a crate that may not use something from outside it.
const OUTSIDERS: &[(&str, &[&str])] = &[
    ("core/src", &["host_sim", "haptic_firmware", "std", "alloc"]),
    ("firmware/src", &["host_sim"]),
    ("host-sim/src", &["haptic_firmware"]),
    ("host-sim/src/models", &["haptic_core"]),
    ("host-sim/src/metrics", &["haptic_core"]),
    ("host-sim/src/plot", &["haptic_core"]),
];

/// The command line's own: nothing beside `cli` uses them.
const COMMAND_LINE: &[&str] = &["clap", "indicatif", "ctrlc"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn sources(dir: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(dir).unwrap_or_else(|e| panic!("{}: {e}", dir.display())) {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|x| x == "rs") {
            found.push(path);
        }
    }
    assert!(!found.is_empty(), "no sources in {}", dir.display());
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

/// The first names after a `::`: one, or those of a group.
fn heads(after: &[String]) -> Vec<&str> {
    if after.first().is_none_or(|token| token != "{") {
        return after.first().map(String::as_str).into_iter().collect();
    }
    let (mut depth, mut at_head, mut heads) = (0, true, Vec::new());
    for token in after {
        match token.as_str() {
            "{" => depth += 1,
            "}" if depth == 1 => break,
            "}" => depth -= 1,
            "," if depth == 1 => at_head = true,
            name if depth == 1 && at_head => {
                heads.push(name);
                at_head = false;
            }
            _ => {}
        }
    }
    heads
}

/// Modules at the crate's root that a source names; `depth` is how far below the root it lies.
fn uses(text: &str, depth: usize) -> BTreeSet<String> {
    let tokens = tokens(text);
    let mut used = BTreeSet::new();
    let mut supers = 0;
    for (i, token) in tokens.iter().enumerate() {
        if token == "super" {
            supers += 1;
        } else if token != "::" {
            supers = 0;
        }
        let to_root = token == "crate" || (token == "super" && supers >= depth);
        if to_root && tokens.get(i + 1).is_some_and(|next| next == "::") {
            used.extend(heads(&tokens[i + 2..]).into_iter().map(String::from));
        }
    }
    used
}

/// Every arrow between modules at the root of a crate.
fn arrows(src: &str) -> BTreeMap<String, BTreeSet<String>> {
    let src = root().join(src);
    let all = sources(&src);
    let module = |path: &Path| {
        let below = path.strip_prefix(&src).unwrap().with_extension("");
        let parts: Vec<_> = below
            .iter()
            .map(|part| part.to_str().unwrap().to_owned())
            .collect();
        parts.into_iter().filter(|part| part != "mod").collect::<Vec<_>>()
    };
    let modules: BTreeSet<_> = all.iter().map(|path| module(path)[0].clone()).collect();
    let mut arrows: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for path in &all {
        let place = module(path);
        if ["lib", "main"].contains(&place[0].as_str()) {
            continue;
        }
        let used = uses(&std::fs::read_to_string(path).unwrap(), place.len());
        let used = used
            .into_iter()
            .filter(|name| *name != place[0] && modules.contains(name));
        arrows.entry(place[0].clone()).or_default().extend(used);
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

/// The command line (`cli`) stands above all: it speaks to the library by the crate's name.
#[test]
fn the_simulator_has_the_arrows_of_its_table_and_no_others() {
    let mut found = arrows("host-sim/src");
    found.remove("cli");
    assert_eq!(found, as_written(HOST_SIM));
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
    let src = root().join("host-sim/src");
    for path in sources(&src) {
        if path.starts_with(src.join("cli")) || path == src.join("main.rs") {
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
    let at = |depth, text: &str| uses(text, depth).into_iter().collect::<Vec<_>>();
    assert_eq!(at(1, "use crate::law::Law; // crate::monitor"), ["law"]);
    assert_eq!(
        at(
            2,
            "use crate::{\n    bus::{Frame, e2e},\n    modes,\n    law::Law as L,\n};"
        ),
        ["bus", "law", "modes"]
    );
    assert_eq!(at(2, "let x = crate::params::Params::PAPER;"), ["params"]);
    // In `models/driver.rs`, `super` is models and `super::super` the root.
    assert_eq!(at(2, "use super::plant::Plant;"), [""; 0]);
    assert_eq!(
        at(2, "use super::super::{studies, cli::Output};"),
        ["cli", "studies"]
    );
    // In `trace.rs`, `super` is the root.
    assert_eq!(at(1, "use super::metrics;"), ["metrics"]);
    assert_eq!(at(1, "use supercrate::metrics; use std::fs;"), [""; 0]);
}
