//! Everything that CI checks. The tests come last, so that a log ends with their results; what failed before
//! them is named before they start. The quick tier is for daily work: what needs no QEMU, no valgrind and no C compiler.

use std::time::Instant;

use anyhow::{Result, bail};

use crate::image::{BOARD, M4F};
use crate::tool::{cargo, ensure, run};
use crate::{
    bench, bindings_agree, boards, by_hand, c_library, evidence, fmu, gate, logs, trace, web, wheel,
};

/// Format, clippy, documentation, unit tests and doctests of the libraries: minutes, and no tool but cargo.
pub(crate) fn run_quick() -> Result<()> {
    let mut failed = check_all(&[
        ("format", &format),
        ("clippy", &clippy),
        ("documentation", &documentation),
    ]);
    for (name, arguments) in [
        ("tests of the libraries", "--workspace --exclude xtask --lib"),
        (
            "tests of the core and the log",
            "-p haptic-core -p haptic-log --tests",
        ),
        ("doctests", "--workspace --exclude xtask --doc"),
    ] {
        let arguments = arguments.split(' ').chain(["--no-fail-fast"]);
        let test = || run(cargo().arg("test").args(arguments.clone()));
        failed.extend(check_all(&[(name, &test)]));
    }
    finish(&failed)
}

fn format() -> Result<()> {
    run(cargo().args(["fmt", "--all", "--check"]))
}

fn clippy() -> Result<()> {
    run(cargo().args(["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"]))
}

/// A link that leads nowhere is an error.
fn documentation() -> Result<()> {
    run(cargo()
        .args(["doc", "--workspace", "--no-deps"])
        .env("RUSTDOCFLAGS", "-D warnings"))
}

/// Runs checks one after the other; the names of those that failed.
fn check_all<'a>(checks: &[(&'a str, &dyn Fn() -> Result<()>)]) -> Vec<&'a str> {
    let mut failed = Vec::new();
    for (name, check) in checks {
        println!("== {name}");
        let begin = Instant::now();
        if let Err(error) = check() {
            eprintln!("error: {name}: {error:#}");
            failed.push(*name);
        }
        println!("== {name}: {} s", begin.elapsed().as_secs());
    }
    failed
}

fn finish(failed: &[&str]) -> Result<()> {
    if !failed.is_empty() {
        bail!("failed: {}", failed.join(", "));
    }
    Ok(())
}

/// Everything.
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
    let mut failed = check_all(&[
        ("format", &format),
        ("clippy", &clippy),
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
        ("documentation", &documentation),
        ("requirements", &|| trace::run(false)),
        ("gate", &gate::run),
        // Compares every frame of a whole run on each of QEMU's boards on the way.
        ("boards", &|| boards::check(false)),
        ("instructions on the host", &|| bench::run(false)),
        ("Python wheel", &|| wheel::build(&wheel::Options::tested())),
        ("C library", &c_library::check),
        ("recordings", &logs::check),
        ("FMUs", &fmu::check),
        ("lab in the browser", &web::check),
        ("bindings agree", &bindings_agree::check),
        ("coverage of the core", &evidence::coverage),
        ("defects made by hand", &by_hand::run),
        ("defects in the last change", &evidence::mutants_of_last_commit),
    ]);
    if !failed.is_empty() {
        eprintln!("== failed: {}; the tests follow", failed.join(", "));
    }
    failed.extend(check_all(&[
        // About ten seconds for each of its targets.
        ("fuzz", &|| {
            run(cargo()
                .args(["test", "-p", "haptic-core", "--test", "fuzz"])
                .env("HAPTIC_FUZZ_BYTES", "60000000"))
        }),
        // Apart, because the log decoder switches on features of serde_json that host-sim does not ship with.
        ("tests of xtask", &|| run(cargo().args(["test", "-p", "xtask"]))),
        // With the doctests of every library.
        ("tests", &|| {
            run(cargo().args(["test", "--workspace", "--exclude", "xtask", "--no-fail-fast"]))
        }),
    ]));
    finish(&failed)
}
