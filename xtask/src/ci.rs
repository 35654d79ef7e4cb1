//! Everything that CI checks, as stages: `cargo xtask ci --list` prints them.
//!
//! All tests are one shape of compilation, [`tool::SHAPE`], and what else needs a program of the workspace takes it from there.
//! After it is built two stages run at a time, because most leave one of two cores idle. What a stage prints goes to
//! `target/ci/STAGE.log`, and to the terminal where it fails.

use std::collections::VecDeque;
use std::fs::{self, File};
use std::io::Write as _;
use std::process::Command;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use clap::Args;

use crate::boards::Board;
use crate::built::Built;
use crate::image::{BOARD, Image, M4F, build_command, elf_of};
use crate::tool::{self, SHAPE, cargo, command, root, run};
use crate::{
    bench, bindings_agree, boards, by_hand, c_library, coverage, diagnosis, evidence, fmu, gate, logs,
    mutants, policy, profiles, python, site, trace, venv, web, wheel,
};

/// Which stages run.
#[derive(Args)]
pub(crate) struct Options {
    /// Also what a release needs, which takes hours
    #[arg(long)]
    full: bool,
    /// Only this stage; may be given again
    #[arg(long, value_name = "STAGE")]
    only: Vec<String>,
    /// Print the stages, and run none
    #[arg(long)]
    list: bool,
    /// Run the stages one after the other, in this process, on the terminal
    #[arg(long, hide = true)]
    here: bool,
}

/// When a stage has its turn.
#[derive(Clone, Copy, PartialEq, Eq)]
enum When {
    /// First, one after the other: what others need.
    Before,
    /// Meanwhile: it needs nothing of that, and the build leaves a part of a core idle.
    Meanwhile,
    /// Two at a time.
    Beside,
    /// For a release alone.
    Full,
}

struct Stage {
    name: &'static str,
    what: &'static str,
    when: When,
    run: fn() -> Result<()>,
}

/// Stages, one line each: name, when, what, and how it is run.
macro_rules! stages {
    ($($name:literal $when:ident $what:literal: $run:expr;)*) => {
        &[$(Stage { name: $name, what: $what, when: When::$when, run: $run }),*]
    };
}

/// In this order. Long ones begin early, so that none is left alone at the end.
const STAGES: &[Stage] = stages! {
    "format" Before "cargo fmt": format;
    "build" Before "every library, program and test, once": build;
    "tests" Beside "every test of the workspace and its documents": tests;
    "boards" Beside "QEMU's boards: lints, frames compared one by one, figures":
        || boards::check(boards::Scope::Qemu, Built::ForTests, false);
    // Not beside the begin of the tests: cargo would let them wait for its lock.
    "clippy" Beside "lints of the workspace": clippy;
    "page" Beside "the lab, in a headless Chromium": || web::check(Built::ForTests);
    "python" Beside "the Python package, its README and its examples": || python::check(Built::ForTests);
    "gate" Meanwhile "no panic, no wrap and no float in the torque path": gate::run;
    "images" Meanwhile "the images that tests start in QEMU": images;
    "recordings" Beside "files of other tools, read and written by these tools":
        || logs::check(Built::ForTests);
    "diagnosis" Beside "a workshop's tester of other makers against an image in QEMU; its PDX file":
        || diagnosis::check(Built::ForTests);
    "documentation" Beside "cargo doc without a warning": documentation;
    "fmu" Beside "the FMUs, judged by FMPy": || fmu::check(Built::ForTests);
    "c" Beside "the C library and its header, on the host and in QEMU": || c_library::check(Built::ForTests);
    "bindings-agree" Beside "the same frames from every binding": || bindings_agree::check(Built::ForTests);
    "requirements" Beside "every requirement has its evidence": || trace::run();
    "evidence" Beside "the documents' tables of figures are those that were measured": evidence::check;
    "xtask" Beside "tests of xtask itself": xtask_tests;
    "dependencies" Beside "licences, bans and sources of dependencies": policy::dependencies;
    "workflows" Beside "the workflows of hosted CI": policy::workflows;
    "evidence-stale" Full "no figure is older than the code that it judges": evidence::stale;
    "published" Full "test files of python-can, cantools, asammdf, SciPy, pyarrow and canmatrix":
        || logs::published(Built::ForTests);
    "all-boards" Full "the same of all boards, the real ones' images among them":
        || boards::check(boards::Scope::All, Built::ForTests, false);
    "wheel" Full "the wheel as it is handed on, installed and tested":
        || wheel::build(&wheel::Options::tested());
    "fmu-shipped" Full "the FMUs as they are handed on": || fmu::check(Built::ToShip);
    "c-shipped" Full "the C library as it is handed on": || c_library::check(Built::ToShip);
    "page-shipped" Full "the page as it is handed on": || web::check(Built::ToShip);
    "site" Full "documents, lab and interfaces as one site, in which no link leads nowhere":
        || site::build(&site::Options::default());
    "same-bits" Full "an evaluation in every profile: the same bytes": profiles::check;
    "instructions" Full "instructions of a step on the host, against xtask/golden.json": || bench::run(false);
    "coverage" Full "every line and branch of core": coverage::check;
    "defects-by-hand" Full "defects made by hand in core: each is noticed": || by_hand::run(&[], None);
    "mutants" Full "a defect in every expression of core: each is noticed": || mutants::check(&[], None);
    "fuzz" Full "a million inputs for every reader, a thousand million bytes for the ECU": fuzz;
    "campaign" Full "every fault, 500 seeds, in the paper's world and four real ones": campaign;
    "sanitised" Full "core, log and C library with AddressSanitizer": sanitised;
    "speed" Full "the benchmarks, against C, NumPy and SciPy": speed;
};

/// Runs what is asked for; an error names the stages that failed.
pub(crate) fn check(options: &Options) -> Result<()> {
    if options.list {
        for stage in STAGES {
            let when = if stage.when == When::Full { "--full" } else { "" };
            println!("{:<16} {when:<7} {}", stage.name, stage.what);
        }
        return Ok(());
    }
    for name in &options.only {
        if STAGES.iter().all(|stage| stage.name != name) {
            return Err(tool::Usage(format!(
                "--only {name}: no such stage; cargo xtask ci --list names them"
            ))
            .into());
        }
    }
    let is_wanted = |stage: &&Stage| match options.only.as_slice() {
        [] => options.full || stage.when != When::Full,
        only => only.iter().any(|name| name == stage.name),
    };
    let wanted: Vec<&Stage> = STAGES.iter().filter(is_wanted).collect();
    if options.here || wanted.len() == 1 {
        let ended = wanted.iter().try_for_each(|stage| (stage.run)());
        if let Some(seconds) = processor_time_s() {
            println!("{}{seconds:.0} s", trace::PROCESSOR_TIME);
        }
        return ended;
    }
    let begin = Instant::now();
    // A log of an earlier run is none of this one's.
    for stage in STAGES {
        let _ = fs::remove_file(log_of(stage.name));
    }
    let packages = std::thread::spawn(prepare);
    let mut failed: Vec<&str> = Vec::new();
    let (meanwhile, wanted): (Vec<&Stage>, Vec<&Stage>) = wanted
        .into_iter()
        .partition(|stage| stage.when == When::Meanwhile);
    let (before, beside): (Vec<&Stage>, Vec<&Stage>) =
        wanted.into_iter().partition(|stage| stage.when == When::Before);
    let run_all = |stages: &[&'static Stage]| {
        let failing = stages.iter().filter(|stage| !in_its_own_process(stage, begin));
        failing.map(|stage| stage.name).collect::<Vec<_>>()
    };
    std::thread::scope(|scope| {
        let meanwhile = scope.spawn(|| run_all(&meanwhile));
        failed.extend(run_all(&before));
        failed.extend(meanwhile.join().unwrap_or_default());
    });
    if failed.contains(&"build") {
        bail!("failed: build");
    }
    packages
        .join()
        .map_err(|_| anyhow::anyhow!("the installation panicked"))??;
    failed.extend(two_at_a_time(beside, begin));
    print_count();
    if options.only.is_empty()
        && let Err(error) = trace::by_execution(&logs())
    {
        println!("{error:#}");
        failed.push("requirements, by what ran");
    }
    println!("{} s in all", begin.elapsed().as_secs());
    ensure!(failed.is_empty(), "failed: {}", failed.join(", "));
    Ok(())
}

/// Runs stages in order, two at a time, and returns the names of those that failed.
fn two_at_a_time(stages: Vec<&'static Stage>, begin: Instant) -> Vec<&'static str> {
    let queue = Mutex::new(VecDeque::from(stages));
    let failed = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while let Some(stage) = { queue.lock().ok().and_then(|mut queue| queue.pop_front()) } {
                    if !in_its_own_process(stage, begin) {
                        failed
                            .lock()
                            .map(|mut failed| failed.push(stage.name))
                            .unwrap_or_default();
                    }
                }
            });
        }
    });
    failed.into_inner().unwrap_or_default()
}

/// Runs a stage with its output in its log; says how long it took, and where it failed what it printed.
fn in_its_own_process(stage: &Stage, begin: Instant) -> bool {
    let since = || clock(begin.elapsed());
    println!("{} {}: {}", since(), stage.name, stage.what);
    let start = Instant::now();
    let log = log_of(stage.name);
    let ended = run_logged(stage.name, &log);
    let seconds = start.elapsed().as_secs();
    match ended {
        Ok(()) => {
            let text = fs::read_to_string(&log).unwrap_or_default();
            let time = text
                .lines()
                .rev()
                .find_map(|line| line.strip_prefix(trace::PROCESSOR_TIME));
            let time = time
                .map(|time| format!(", {time} of processor time"))
                .unwrap_or_default();
            println!("{} {}: passed in {seconds} s{time}", since(), stage.name);
        }
        Err(error) => {
            let text = fs::read_to_string(&log).unwrap_or_default();
            let lines: Vec<&str> = text.lines().collect();
            let tail = &lines[lines.len().saturating_sub(50)..];
            println!(
                "{} {}: FAILED after {seconds} s: {error:#}\n{}--- the end of {}\n{}\n--- {}",
                since(),
                stage.name,
                failures(&text),
                log.display(),
                tail.join("\n"),
                stage.name
            );
            return false;
        }
    }
    true
}

/// What `cargo test` says of the tests that failed, of every target: its sections from `failures:` to the target's result.
fn failures(log: &str) -> String {
    let mut inside = false;
    let mut said = String::new();
    for line in log.lines() {
        inside = line == "failures:" || inside && !line.starts_with("test result: ");
        if inside {
            said += line;
            said.push('\n');
        }
    }
    said
}

/// Where each stage leaves its log.
pub(crate) fn logs() -> std::path::PathBuf {
    root().join("target/ci")
}

fn log_of(name: &str) -> std::path::PathBuf {
    logs().join(format!("{name}.log"))
}

fn run_logged(name: &str, log: &std::path::Path) -> Result<()> {
    fs::create_dir_all(logs())?;
    let file = File::create(log).with_context(|| log.display().to_string())?;
    let this = std::env::current_exe().context("the path of xtask")?;
    run(Command::new(this)
        .current_dir(root())
        .args(["ci", "--here", "--only", name])
        .stderr(file.try_clone()?)
        .stdout(file))
}

/// Processor time of this process and of those that it waited for, where Linux says it: its fields 14 to 17 of `stat`,
/// in hundredths of a second.
fn processor_time_s() -> Option<f64> {
    let stat = fs::read_to_string("/proc/self/stat").ok()?;
    let (_, fields) = stat.rsplit_once(')')?;
    let ticks = fields.split_whitespace().skip(11).take(4);
    Some(ticks.filter_map(|ticks| ticks.parse::<f64>().ok()).sum::<f64>() / 100.0)
}

fn clock(elapsed: Duration) -> String {
    format!("{:>3}:{:02}", elapsed.as_secs() / 60, elapsed.as_secs() % 60)
}

/// Tests of Rust and of Python that passed and failed, as one line.
fn print_count() {
    let (mut passed, mut failed) = (0, 0);
    for name in ["tests", "xtask", "python"] {
        let text = fs::read_to_string(log_of(name)).unwrap_or_default();
        for line in text
            .lines()
            .filter(|line| line.starts_with("test result:") || line.contains(" passed"))
        {
            let words: Vec<&str> = line
                .split([' ', ';', ',', '.'])
                .filter(|word| !word.is_empty())
                .collect();
            for pair in words.windows(2) {
                match (pair[0].parse::<u64>(), pair[1]) {
                    (Ok(count), "passed") => passed += count,
                    (Ok(count), "failed") => failed += count,
                    _ => {}
                }
            }
        }
    }
    let _ = writeln!(std::io::stdout(), "{passed} passed, {failed} failed");
}

/// Packages of Debian and of Python that stages need, while the workspace is built.
fn prepare() -> Result<()> {
    tool::ensure(&TOOLS)?;
    venv::environment().map(drop)
}

/// Programs, and the packages of Debian that bring them.
const TOOLS: [(&str, &str); 9] = [
    ("qemu-system-arm", "qemu-system-arm"),
    ("gcc", "gcc"),
    ("g++", "g++"),
    ("arm-none-eabi-gcc", "gcc-arm-none-eabi"),
    ("arm-none-eabi-gcc", "libnewlib-arm-none-eabi"),
    ("python3", "python3"),
    ("python3", "python3-venv"),
    ("chromium", "chromium"),
    ("valgrind", "valgrind"),
];

fn format() -> Result<()> {
    run(cargo().args(["fmt", "--all", "--check"]))
}

fn build() -> Result<()> {
    run(cargo().arg("build").args(SHAPE).arg("--all-targets"))
}

/// What tests, boards and the comparison in lock step would each wait for.
fn images() -> Result<()> {
    for board in [BOARD, Board::Mps2An500.feature()] {
        for (image, features) in [
            (Image::SteeringEcu, ",bench"),
            (Image::SteeringEcu, ""),
            (Image::Lockstep, ",bench"),
            (Image::Lockstep, ""),
        ] {
            elf_of(&mut build_command(
                image.bin(),
                M4F,
                &format!("{board}{features}"),
            ))?;
        }
    }
    Ok(())
}

/// Tests of the workspace, with the doctests of every library.
fn tests() -> Result<()> {
    tool::ensure(&TOOLS)?;
    run(cargo().arg("test").args(SHAPE).arg("--no-fail-fast"))
}

/// Apart, because the log decoder switches on features of serde_json that host-sim does not ship with.
fn xtask_tests() -> Result<()> {
    run(cargo().args(["test", "--release", "-p", "xtask"]))
}

fn clippy() -> Result<()> {
    let lints = ["clippy", "--release", "--workspace", "--all-targets"];
    run(cargo().args(lints).args(["--", "-D", "warnings"]))?;
    // The reference board's images, those that break themselves too.
    boards::lint(&format!("{BOARD},gate,broken,bench"))
}

/// A link that leads nowhere is an error.
fn documentation() -> Result<()> {
    run(cargo()
        .args(["doc", "--release", "--workspace", "--no-deps"])
        .env("RUSTDOCFLAGS", "-D warnings"))
}

fn fuzz() -> Result<()> {
    run(cargo()
        .args(["test", "--release", "-p", "haptic-core", "fuzz::"])
        .env("HAPTIC_FUZZ_BYTES", "1000000000"))?;
    run(cargo()
        .args(["test", "--release", "-p", "haptic-diag", "noise"])
        .env("PROPTEST_CASES", "10000"))?;
    run(cargo()
        .args(["test", "--release", "-p", "haptic-secoc", "noise"])
        .env("HAPTIC_FUZZ_INPUTS", "10000000"))?;
    run(cargo()
        .args("test --release -p haptic-guidance --test fuzz_readers".split(' '))
        .env("HAPTIC_FUZZ_INPUTS", "1000000"))
}

fn campaign() -> Result<()> {
    let evidence = Built::ForTests.evidence()?;
    let seeds = ["faults", "--seeds", "500"];
    // The paper's drivers in the paper's world, then those who keep the lane in a real one.
    run(command(&evidence).args(seeds))?;
    for world in ["calibrated", "everything", "braking", "camera"] {
        run(command(&evidence).args(seeds).args(["--world", world]))?;
    }
    Ok(())
}

/// AddressSanitizer is an option that the compiler calls unstable; for a test alone that is no risk.
fn sanitised() -> Result<()> {
    let target = "x86_64-unknown-linux-gnu";
    run(cargo()
        .args("test --release -p haptic-core -p haptic-log --lib --tests".split(' '))
        .args(["--target", target])
        .env("RUSTC_BOOTSTRAP", "1")
        .env("RUSTFLAGS", "-Zsanitizer=address")
        .env("CARGO_TARGET_DIR", root().join("target/sanitised")))
}

fn speed() -> Result<()> {
    let this = std::env::current_exe().context("the path of xtask")?;
    for what in ["speed", "identify"] {
        run(Command::new(&this).current_dir(root()).args(["bench", what]))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{STAGES, When, failures};

    #[test]
    fn the_failures_of_every_target_are_found_in_a_log() {
        let log = "\
running 2 tests
test a ... ok

test result: ok. 2 passed; 0 failed
running 2 tests
test b ... FAILED

failures:

---- b stdout ----
panicked at b.rs:1

failures:
    b

test result: FAILED. 1 passed; 1 failed
running 1 test
test result: ok. 1 passed; 0 failed
failures:
    c
test result: FAILED. 0 passed; 1 failed
";
        assert_eq!(
            failures(log),
            "failures:\n\n---- b stdout ----\npanicked at b.rs:1\n\nfailures:\n    b\n\nfailures:\n    c\n"
        );
    }

    #[test]
    fn the_hosted_ci_has_a_job_for_each_stage() {
        let workflow = std::fs::read_to_string(crate::tool::root().join(".github/workflows/ci.yml")).unwrap();
        let listed: Vec<&str> = workflow
            .lines()
            .filter_map(|line| line.trim().strip_prefix("- stage: "))
            .collect();
        // What is built first is built in each job.
        let wanted: Vec<&str> = STAGES
            .iter()
            .filter(|stage| stage.when != When::Full && !["build", "images"].contains(&stage.name))
            .map(|stage| stage.name)
            .collect();
        assert_eq!(listed, wanted);
    }
}
