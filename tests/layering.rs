//! The arrows of docs/design.md, checked on the sources: who may import whom.

use std::path::{Path, PathBuf};

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
    found
}

/// Non-comment lines of the sources below `dir` that contain `needle`.
fn mentions(dir: &str, needle: &str) -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut hits = Vec::new();
    for path in sources(&root.join(dir)) {
        for (n, line) in std::fs::read_to_string(&path).unwrap().lines().enumerate() {
            let code = line.split("//").next().unwrap_or("");
            if code.contains(needle) {
                hits.push(format!("{}:{}: {}", path.display(), n + 1, line.trim()));
            }
        }
    }
    hits
}

#[test]
fn the_core_knows_neither_host_nor_firmware() {
    for needle in ["host_sim", "haptic_firmware", "std::", "extern crate alloc"] {
        assert_eq!(
            mentions("core/src", needle),
            Vec::<String>::new(),
            "core must not mention {needle}"
        );
    }
}

/// Inside the core, only the controller's step and the ECU see the law, the envelope and the bus at once.
#[test]
fn the_blocks_of_the_core_do_not_know_each_other() {
    let blocks = [
        ("law.rs", "law"),
        ("envelope.rs", "envelope"),
        ("modes.rs", "modes"),
        ("bus/", "bus"),
        ("monitor.rs", ""),
    ];
    for (place, _) in blocks {
        for (other_place, other) in blocks {
            // The bus carries the codes of limits and modes, so it may name them.
            if place == other_place || (place == "bus/" && ["envelope", "modes"].contains(&other)) {
                continue;
            }
            let needle = format!("crate::{other}");
            // The monitor uses nothing of the rest but the way memory is guarded.
            let needle = if place == "monitor.rs" { "crate::" } else { &needle };
            if other.is_empty() {
                continue;
            }
            let hits: Vec<_> = mentions("core/src", needle)
                .into_iter()
                .filter(|hit| {
                    hit.split(':')
                        .next()
                        .unwrap()
                        .contains(&format!("core/src/{place}"))
                        && !hit.contains("use crate::vital::vital;")
                })
                .collect();
            assert_eq!(hits, Vec::<String>::new(), "{place} must not use {needle}");
        }
    }
}

/// In the simulator, models know nothing of the controller or of studies, and studies nothing of the command
/// line.
#[test]
fn the_layers_of_the_simulator_look_downward_only() {
    let above = [
        (
            "models",
            vec![
                "haptic_core",
                "crate::guidance",
                "crate::closed_loop",
                "crate::scenario",
                "crate::studies",
            ],
        ),
        (
            "guidance",
            vec!["crate::closed_loop", "crate::scenario", "crate::studies"],
        ),
        ("studies", vec!["clap", "indicatif", "println!"]),
    ];
    for (layer, forbidden) in above {
        for needle in forbidden {
            let hits = mentions(&format!("host-sim/src/{layer}"), needle);
            assert_eq!(hits, Vec::<String>::new(), "{layer} must not use {needle}");
        }
    }
}
