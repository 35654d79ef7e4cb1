//! How fast the closed loop runs, beside the same loop in C, NumPy, numba and JAX (`bench/README.md`).
//!
//! Processor time of one core, so a figure of this machine at this moment and held by no golden: the ratios are
//! what travels. The programs run in turn, several rounds in one run; a round gives a ratio of what ran beside each
//! other, and the median of the rounds counts.

use std::collections::BTreeMap;

use anyhow::{Context, Result};
use clap::Args;
use serde_json::{Map, Value};

use crate::{callgrind, dist, tool, venv};

/// Runs of a loop within a round; the fastest of them counts.
const REPEAT: &str = "5";

/// C's options for the drive that ours makes.
const SAME_DRIVE: [&str; 8] = ["--t-p", "0.1", "--k-d", "3", "--k-hg", "0.5", "--repeat", REPEAT];

/// What is compared: the key of `--json` before `_ratio`, what is shown, and which program is held against which.
const RATIOS: [(&str, &str, &str, &str); 11] = [
    (
        "like_for_like",
        "our world with C's kind of ECU, over C",
        "ours_light",
        "c",
    ),
    (
        "like_for_like_native",
        "our world with C's kind of ECU, over C, both for this processor (-march=native)",
        "ours_light_native",
        "c_native",
    ),
    (
        "same_ecu",
        "our world over C's, both with the shipping ECU",
        "ours",
        "c_with_ours",
    ),
    ("lanes", "lanes with every check, over C", "lanes", "c"),
    ("lanes_avx2", "lanes with AVX2 at most, over C", "lanes_avx2", "c"),
    (
        "lanes_portable",
        "lanes with what every machine has, over C",
        "lanes_portable",
        "c",
    ),
    (
        "lanes_over_c_native",
        "lanes over C with -march=native",
        "lanes",
        "c_native",
    ),
    (
        "lanes_avx2_over_numba",
        "lanes with AVX2 at most, over numba",
        "lanes_avx2",
        "numba",
    ),
    (
        "lanes_avx2_over_jax",
        "lanes with AVX2 at most, over JAX",
        "lanes_avx2",
        "jax",
    ),
    ("whole", "the whole of ours over the whole of C", "ours", "c"),
    ("numpy", "ours over NumPy and SciPy", "ours", "numpy"),
];

/// The page that shows the figures, between two marks.
const PAGE: &str = "docs/explanation/speed.md";
const MARKS: [&str; 2] = [
    "<!-- measured: cargo xtask bench speed --write -->\n",
    "<!-- measured ends -->",
];

/// What `cargo xtask bench speed` is asked for.
#[derive(Debug, Args)]
pub(crate) struct Options {
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    /// Write the ratios into docs/explanation/speed.md, with this processor and the commit
    #[arg(long, conflicts_with = "json")]
    write: bool,
    /// Rounds, each with every program once.
    #[arg(long, default_value_t = 9, value_parser = clap::value_parser!(u32).range(1..=1000))]
    rounds: u32,
}

/// A loop to time.
struct Program {
    /// Its key in [`RATIOS`], and in `--json` before `_x_real_time`.
    key: &'static str,
    shown: &'static str,
    program: String,
    arguments: Vec<&'static str>,
}

pub(crate) fn run(options: &Options) -> Result<()> {
    tool::ensure(&[("gcc", "gcc"), ("python3", "python3-venv")])?;
    let programs = programs()?;
    let mut speeds: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for _ in 0..options.rounds {
        for program in &programs {
            speeds
                .entry(program.key)
                .or_default()
                .push(times_real_time(program)?);
        }
    }
    let ratio = |over: &str, under: &str| {
        let rounds = speeds[over].iter().zip(&speeds[under]);
        median(rounds.map(|(over, under)| over / under).collect())
    };
    if options.json {
        let mut figures = Map::from_iter([("rounds".into(), options.rounds.into())]);
        for program in &programs {
            let speed = median(speeds[program.key].clone());
            figures.insert(format!("{}_x_real_time", program.key), speed.into());
        }
        for (key, _, over, under) in RATIOS {
            figures.insert(format!("{key}_ratio"), ratio(over, under).into());
        }
        println!("{}", serde_json::to_string_pretty(&figures)?);
        return Ok(());
    }
    let mut table = "| one core of its processor | times real time |\n|---|---|\n".to_owned();
    for program in &programs {
        let speed = median(speeds[program.key].clone());
        table += &format!("| {} | {speed:.0} |\n", program.shown);
    }
    println!("{table}");
    let mut table = "| above 1: ours is faster | ratio |\n|---|---|\n".to_owned();
    for (_, shown, over, under) in RATIOS {
        table += &format!("| {} | {:.2} |\n", shown, ratio(over, under));
    }
    let (rounds, at) = (options.rounds, dist::commit());
    table += &format!("\n{}; medians of {rounds} rounds, at commit {at}.\n", processor());
    print!("{table}");
    if options.write {
        let page = tool::root().join(PAGE);
        let text = std::fs::read_to_string(&page).context(PAGE)?;
        std::fs::write(page, between(&text, &table)?).context(PAGE)?;
    }
    Ok(())
}

/// A page with a table between its marks.
fn between(page: &str, table: &str) -> Result<String> {
    let missing = || format!("{PAGE}: {} is missing", MARKS.concat());
    let (before, rest) = page.split_once(MARKS[0]).with_context(missing)?;
    let (_, after) = rest.split_once(MARKS[1]).with_context(missing)?;
    Ok([before, MARKS[0], table, MARKS[1], after].concat())
}

/// The name of this machine's processor, where it says it.
fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text
        .lines()
        .find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    name.map_or("a processor that does not say its name".into(), |(_, name)| {
        name.to_owned()
    })
}

/// Builds all that is timed.
fn programs() -> Result<Vec<Program>> {
    let ours = callgrind::build_closed_loop(callgrind::For::EveryMachine)?;
    let ours_native = callgrind::build_closed_loop(callgrind::For::ThisMachine)?;
    let lanes = callgrind::build("lanes", callgrind::For::EveryMachine)?;
    let c = build_c("target/closed_loop_c", &[])?;
    let c_native = build_c("target/closed_loop_c_native", &["-march=native"])?;
    let packages = ["numpy", "scipy", "numba", "jax"];
    let python = venv::environment_of(&tool::root().join("target/python/speed"), &packages)?;
    let python = python.to_string_lossy().into_owned();
    let once = ["--repeat", REPEAT];
    let lanes_of = |width| [["--width", width], once].concat();
    let many = |library| [&["bench/many.py", library, "--copies", "10"], once.as_slice()].concat();
    let program = |key, shown, program: &str, arguments: &[&'static str]| Program {
        key,
        shown,
        program: program.into(),
        arguments: arguments.into(),
    };
    // What is compared runs one after the other: a processor's clock drifts.
    Ok(vec![
        program("ours", "ours (shipping ECU)", &ours, &once),
        program(
            "c_with_ours",
            "C with the shipping ECU",
            &build_c_with_the_shipping_ecu()?,
            &SAME_DRIVE,
        ),
        program(
            "ours_light",
            "ours with C's kind of ECU",
            &ours,
            &[["--ecu", "c"], once].concat(),
        ),
        program("c", "C, gcc -O3 (law and protection alone)", &c, &SAME_DRIVE),
        program(
            "lanes",
            "ours in lanes (all of them together)",
            &lanes,
            &lanes_of("widest"),
        ),
        program("c_native", "C, gcc -O3 -march=native", &c_native, &SAME_DRIVE),
        program(
            "ours_light_native",
            "ours with C's kind of ECU, for this processor",
            &ours_native,
            &[["--ecu", "c"], once].concat(),
        ),
        program(
            "lanes_portable",
            "ours in lanes, with what every machine has",
            &lanes,
            &lanes_of("portable"),
        ),
        program(
            "lanes_avx2",
            "ours in lanes, with AVX2 at most",
            &lanes,
            &lanes_of("avx2"),
        ),
        program(
            "numba",
            "numba, 240 drives (no frames, no checks)",
            &python,
            &many("numba"),
        ),
        program(
            "jax",
            "JAX, 240 drives (no frames, no checks)",
            &python,
            &many("jax"),
        ),
        program(
            "numpy",
            "NumPy and SciPy",
            &python,
            &["bench/closed_loop.py", "--duration", "2"],
        ),
    ])
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() % 2 {
        1 => values[middle],
        _ => f64::midpoint(values[middle - 1], values[middle]),
    }
}

fn build_c(program: &str, more: &[&str]) -> Result<String> {
    let base = ["-O3", "-std=c11", "-o", program, "bench/closed_loop.c"];
    tool::run(tool::command("gcc").args(base).args(more).arg("-lm"))?;
    Ok(tool::root().join(program).to_string_lossy().into_owned())
}

/// C's world around the static library of the shipping ECU.
fn build_c_with_the_shipping_ecu() -> Result<String> {
    tool::run(tool::cargo().args(["build", "--profile", "dist", "-p", "haptic-c"]))?;
    let include = ["-DSHIPPING_ECU", "-Ibindings/c/include"];
    let libraries = ["target/dist/libhaptic_guidance.a", "-lpthread", "-ldl", "-lgcc_s"];
    build_c(
        "target/closed_loop_c_shipping",
        &[include.as_slice(), libraries.as_slice()].concat(),
    )
}

/// An interpreter with NumPy and SciPy.
pub(crate) fn python() -> Result<String> {
    let python = venv::environment_of(&tool::root().join("target/venv"), &["numpy", "scipy"])?;
    Ok(python.to_string_lossy().into_owned())
}

fn times_real_time(program: &Program) -> Result<f64> {
    let text = tool::output(tool::command(&program.program).args(&program.arguments))?;
    let report: Value = serde_json::from_str(&text).with_context(|| program.shown)?;
    report["times_real_time"]
        .as_f64()
        .with_context(|| format!("{} names no times_real_time", program.shown))
}

#[cfg(test)]
mod tests {
    use super::{between, median};

    #[test]
    fn a_table_is_put_between_its_marks() {
        let page = "A\n<!-- measured: cargo xtask bench speed --write -->\nold\n<!-- measured ends -->\nB\n";
        assert_eq!(between(page, "new\n").unwrap(), page.replace("old", "new"));
        assert!(between("A\n", "").is_err());
    }

    #[test]
    fn a_median_is_the_middle_or_between_the_two() {
        assert_eq!(median(vec![3.0, 1.0, 9.0]), 3.0);
        assert_eq!(median(vec![4.0, 1.0, 2.0, 9.0]), 3.0);
    }
}
