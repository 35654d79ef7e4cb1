//! The ECU in QEMU beside the one of the desktop, in the drives of scenarios.

use serde_json::Value;
use std::process::Command;

/// The paper's course at 20 km/h takes ten minutes. The ECU reads a torsion bar, with the observer of the hands' torque in the torque path.
#[test]
fn ten_minutes_behind_a_torsion_bar_are_the_same_to_the_bit() {
    let example = include_str!("../../examples/torsion-bar.toml");
    let slow = example.replacen("condition =", "speed_m_per_s = 5.556\ncondition =", 1);
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("slow.toml");
    std::fs::write(&file, slow).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .args(["ecu", "pil", "--json"])
        .arg(&file)
        .output()
        .unwrap();
    let found: Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr)));
    assert!(found["steps"].as_u64().unwrap() >= 600_000, "{found}");
    assert_eq!(found["mismatches"], 0, "{found}");
}
