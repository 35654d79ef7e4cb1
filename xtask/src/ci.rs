//! Everything that CI checks. The tests come last, so that a log ends with their results; what failed before
//! them is named before they start.

use anyhow::{Result, bail};

use crate::image::{BOARD, M4F};
use crate::tool::{cargo, ensure, run};
use crate::{bench, bindings_agree, boards, c_library, gate, wheel};

pub(crate) fn run_all() -> Result<()> {
    ensure(&[
        ("qemu-system-arm", "qemu-system-arm"),
        ("valgrind", "valgrind"),
        ("gcc", "gcc"),
        ("arm-none-eabi-gcc", "gcc-arm-none-eabi"),
        ("arm-none-eabi-gcc", "libnewlib-arm-none-eabi"),
        ("g++", "g++"),
        // For the examples of the documents.
        ("python3", "python3"),
        ("python3", "python3-venv"),
    ])?;
    let target_features = format!("{BOARD},gate,broken,bench");
    let checks: [(&str, &dyn Fn() -> Result<()>); 9] = [
        ("format", &|| run(cargo().args(["fmt", "--all", "--check"]))),
        ("clippy", &|| {
            run(cargo().args(["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"]))
        }),
        ("clippy of the images", &|| {
            let package = ["clippy", "--release", "-p", "haptic-firmware", "--bins", "--lib"];
            let target = [
                "--target",
                M4F,
                "--features",
                &target_features,
                "--",
                "-D",
                "warnings",
            ];
            run(cargo().args(package).args(target))
        }),
        ("gate", &gate::run),
        // Compares every frame of a whole run on each of QEMU's boards on the way.
        ("boards", &|| boards::check(false)),
        ("instructions on the host", &|| bench::run(false)),
        ("Python wheel", &|| wheel::build(&wheel::Options::tested())),
        ("C library", &c_library::check),
        ("bindings agree", &bindings_agree::check),
    ];
    let mut failed = Vec::new();
    for (name, check) in checks {
        println!("== {name}");
        if let Err(error) = check() {
            eprintln!("error: {name}: {error:#}");
            failed.push(name);
        }
    }
    if !failed.is_empty() {
        eprintln!("== failed: {}; the tests follow", failed.join(", "));
    }
    println!("== fuzz");
    // About ten seconds for each of its targets.
    let fuzz = run(cargo()
        .args(["test", "-p", "haptic-core", "--test", "fuzz"])
        .env("HAPTIC_FUZZ_BYTES", "60000000"));
    println!("== tests");
    // Apart, because the log decoder switches on features of serde_json that host-sim does not ship with.
    let of_xtask = run(cargo().args(["test", "-p", "xtask"]));
    run(cargo().args(["test", "--workspace", "--exclude", "xtask", "--no-fail-fast"]))?;
    of_xtask?;
    fuzz?;
    if !failed.is_empty() {
        bail!("failed: {}", failed.join(", "));
    }
    Ok(())
}
