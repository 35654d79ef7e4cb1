//! How fast the closed loop runs, beside the same loop written in C and in NumPy (`bench/README.md`).
//!
//! Processor time of one core, so a figure of this machine at this moment and held by no golden: the ratios are
//! what travels. The programs run in turn, several rounds in one run; a round gives a ratio of what ran beside each
//! other, and the median of the rounds counts.

use anyhow::{Context, Result};
use clap::Args;
use serde::Serialize;
use serde_json::Value;

use crate::{callgrind, tool, venv};

/// Runs of a loop within a round; the fastest of them counts.
const REPEAT: &str = "5";

/// C's options for the drive that ours makes.
const SAME_DRIVE: [&str; 8] = ["--t-p", "0.1", "--k-d", "3", "--k-hg", "0.5", "--repeat", REPEAT];

/// What `cargo xtask bench speed` is asked for.
#[derive(Debug, Args)]
pub(crate) struct Options {
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    /// Rounds, each with every program once.
    #[arg(long, default_value_t = 9, value_parser = clap::value_parser!(u32).range(1..=1000))]
    rounds: u32,
}

/// The figures.
#[derive(Debug, Serialize)]
struct Figures {
    ours_x_real_time: f64,
    c_x_real_time: f64,
    numpy_x_real_time: f64,
    /// (a) Our world with C's kind of ECU over C.
    like_for_like_ratio: f64,
    /// (b) Our world with the shipping ECU over C's world with the shipping ECU.
    same_ecu_ratio: f64,
    /// (c) The lanes with every check over C, of one core, with the widest instructions of the machine.
    lanes_ratio: f64,
    lanes_x_real_time: f64,
    /// The lanes with AVX2 at most, and with what every machine has, over C.
    lanes_avx2_ratio: f64,
    lanes_portable_ratio: f64,
    /// The whole of ours over the whole of C, whose ECU is the law and the bus's protection alone.
    whole_ratio: f64,
    rounds: u32,
}

pub(crate) fn run(options: &Options) -> Result<()> {
    tool::ensure(&[("gcc", "gcc"), ("python3", "python3-venv")])?;
    let ours = callgrind::build_closed_loop()?;
    let c = build_c("target/closed_loop_c", &[])?;
    let c_with_ours = build_c_with_the_shipping_ecu()?;
    let python = python()?;
    let lanes = callgrind::build("lanes")?;
    let [mut full, mut light, mut peer, mut peer_with_ours, mut numpy] = [const { Vec::new() }; 5];
    let mut by_width = [const { Vec::new() }; 3];
    for _ in 0..options.rounds {
        full.push(times_real_time(&ours, &["--repeat", REPEAT])?);
        peer.push(times_real_time(&c, &SAME_DRIVE)?);
        for (speeds, width) in by_width.iter_mut().zip(["widest", "avx2", "portable"]) {
            speeds.push(times_real_time(&lanes, &["--width", width, "--repeat", REPEAT])?);
        }
        light.push(times_real_time(&ours, &["--ecu", "c", "--repeat", REPEAT])?);
        peer_with_ours.push(times_real_time(&c_with_ours, &SAME_DRIVE)?);
        numpy.push(times_real_time(
            &python,
            &["bench/closed_loop.py", "--duration", "2"],
        )?);
    }
    let ratio = |a: &[f64], b: &[f64]| median(a.iter().zip(b).map(|(a, b)| a / b).collect());
    let figures = Figures {
        ours_x_real_time: median(full.clone()),
        c_x_real_time: median(peer.clone()),
        numpy_x_real_time: median(numpy),
        like_for_like_ratio: ratio(&light, &peer),
        same_ecu_ratio: ratio(&full, &peer_with_ours),
        lanes_ratio: ratio(&by_width[0], &peer),
        lanes_x_real_time: median(by_width[0].clone()),
        lanes_avx2_ratio: ratio(&by_width[1], &peer),
        lanes_portable_ratio: ratio(&by_width[2], &peer),
        whole_ratio: ratio(&full, &peer),
        rounds: options.rounds,
    };
    if options.json {
        println!("{}", serde_json::to_string_pretty(&figures)?);
    } else {
        print(&figures);
    }
    Ok(())
}

fn print(figures: &Figures) {
    println!(
        "one closed loop on one core, times real time (median of {} rounds)",
        figures.rounds
    );
    for (name, speed) in [
        ("ours (shipping ECU)", figures.ours_x_real_time),
        ("C, gcc -O3 (law and protection alone)", figures.c_x_real_time),
        ("NumPy/SciPy", figures.numpy_x_real_time),
        ("ours in lanes (all of them together)", figures.lanes_x_real_time),
    ] {
        println!("  {name:<58}{speed:>10.0}");
    }
    println!("ours over the peer, above 1: ours is faster");
    for (name, ratio) in [
        (
            "(a) our world with C's kind of ECU, over C",
            figures.like_for_like_ratio,
        ),
        (
            "(b) our world over C's, both with the shipping ECU",
            figures.same_ecu_ratio,
        ),
        ("(c) lanes with every check, over C", figures.lanes_ratio),
        ("    the same with AVX2 at most", figures.lanes_avx2_ratio),
        (
            "    the same with what every machine has",
            figures.lanes_portable_ratio,
        ),
        ("the whole of ours over the whole of C", figures.whole_ratio),
    ] {
        println!("  {name:<58}{ratio:>10.2}");
    }
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

fn times_real_time(program: &str, arguments: &[&str]) -> Result<f64> {
    let text = tool::output(tool::command(program).args(arguments))?;
    let report: Value = serde_json::from_str(&text).with_context(|| program.to_owned())?;
    report["times_real_time"]
        .as_f64()
        .with_context(|| format!("{program} names no times_real_time"))
}

#[cfg(test)]
mod tests {
    use super::median;

    #[test]
    fn a_median_is_the_middle_or_between_the_two() {
        assert_eq!(median(vec![3.0, 1.0, 9.0]), 3.0);
        assert_eq!(median(vec![4.0, 1.0, 2.0, 9.0]), 3.0);
    }
}
