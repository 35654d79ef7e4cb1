//! What a large sweep costs: `bench/sweep.toml`, drives of 200 s, with more and more of them, and on one thread and on two.
//!
//! Times of this machine at this moment, held by no golden. What travels are the ratios: how the processor's time grows with the
//! number of drives, and what a second thread gives.

use std::fs;
use std::path::Path;
use std::process::{Child, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use clap::Args;

use crate::tool;

const SPEC: &str = "bench/sweep.toml";
const OUT: &str = "target/bench-sweep";
/// Simulated time of a drive of the specification.
const DRIVE_S: f64 = 200.0;
/// Drives of a round that compares one thread with two: a few seconds.
const ROUND: u32 = 2000;
/// How often the running sweep is looked at. What it used after the last look is not counted.
const LOOK: Duration = Duration::from_millis(10);
/// Clock ticks of `/proc/PID/stat` in a second: a constant of Linux's interface.
const TICKS_PER_S: f64 = 100.0;

/// What `cargo xtask bench sweep` is asked for.
#[derive(Debug, Args)]
pub(crate) struct Options {
    /// Numbers of drives, each a sweep of its own on every core.
    #[arg(long, value_delimiter = ',', default_value = "1000,10000", value_parser = clap::value_parser!(u32).range(8..))]
    drives: Vec<u32>,
    /// Rounds that compare one thread with two; their median counts. 0: none.
    #[arg(long, default_value_t = 5)]
    rounds: u32,
}

/// What one sweep took.
struct Cost {
    wall_s: f64,
    processor_s: f64,
    /// Most memory in use at once, in MB.
    memory_mb: f64,
}

pub(crate) fn run(options: &Options) -> Result<()> {
    ensure!(
        cfg!(target_os = "linux"),
        "memory and processor time are read from Linux's /proc"
    );
    tool::run(tool::cargo().args(["build", "--profile", "dist", "-q", "-p", "host-sim"]))?;
    println!(
        "{:>9}{:>10}{:>14}{:>12}{:>18}{:>12}{:>16}{:>12}",
        "drives",
        "wall, s",
        "processor, s",
        "drives/s",
        "x real time, core",
        "memory, MB",
        "Parquet, B/row",
        "CSV, B/row"
    );
    let mut per_drive = Vec::new();
    for &drives in &options.drives {
        let cost = sweep(drives, None)?;
        let bytes = |file: &str| -> Result<f64> {
            let path = tool::root().join(OUT).join(file);
            Ok(fs::metadata(&path)
                .with_context(|| path.display().to_string())?
                .len() as f64
                / f64::from(drives))
        };
        println!(
            "{drives:>9}{:>10.1}{:>14.1}{:>12.1}{:>18.0}{:>12.0}{:>16.1}{:>12.1}",
            cost.wall_s,
            cost.processor_s,
            f64::from(drives) / cost.wall_s,
            f64::from(drives) * DRIVE_S / cost.processor_s,
            cost.memory_mb,
            bytes("drives.parquet")?,
            bytes("drives.csv")?,
        );
        per_drive.push(cost.processor_s / f64::from(drives));
    }
    if let [first, .., last] = per_drive[..] {
        println!(
            "A drive of the last costs {:.2} times one of the first, in processor time.",
            last / first
        );
    }
    if options.rounds > 0 {
        let mut ratios = Vec::new();
        for _ in 0..options.rounds {
            let alone = sweep(ROUND, Some(1))?.wall_s;
            ratios.push(alone / sweep(ROUND, Some(2))?.wall_s);
        }
        ratios.sort_by(f64::total_cmp);
        println!(
            "Two threads are {:.2} times as fast as one ({ROUND} drives, median of {} rounds, {:.2} to {:.2}).",
            ratios[ratios.len() / 2],
            ratios.len(),
            ratios[0],
            ratios[ratios.len() - 1]
        );
    }
    Ok(())
}

/// One sweep from its first drive, its result left in [`OUT`].
fn sweep(drives: u32, threads: Option<u32>) -> Result<Cost> {
    let out = tool::root().join(OUT);
    // Finished chunks would not be driven again.
    let _ = fs::remove_dir_all(&out);
    fs::create_dir_all(&out)?;
    let spec = fs::read_to_string(tool::root().join(SPEC))?;
    ensure!(spec.contains("samples = 1000\n"), "{SPEC}: samples is not 1000");
    // Beside the directory of the sweep, which takes no foreign file.
    let varied = tool::root().join(format!("{OUT}.toml"));
    fs::write(
        &varied,
        spec.replace("samples = 1000\n", &format!("samples = {drives}\n")),
    )?;
    let mut command = tool::command("target/dist/host-sim");
    command
        .arg("sweep")
        .args([varied.as_path(), Path::new("--out"), &out])
        .args(threads.map(|n| format!("--threads={n}")))
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let start = Instant::now();
    let mut child = command.spawn().context("target/dist/host-sim")?;
    let mut cost = Cost {
        wall_s: 0.0,
        processor_s: 0.0,
        memory_mb: 0.0,
    };
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break status;
        }
        if let Some((processor_s, memory_mb)) = usage(&child) {
            (cost.processor_s, cost.memory_mb) = (processor_s, memory_mb);
        }
        thread::sleep(LOOK);
    };
    cost.wall_s = start.elapsed().as_secs_f64();
    ensure!(status.success(), "host-sim sweep {}: {status}", varied.display());
    Ok(cost)
}

/// Processor time until now, in s, and the largest memory so far, in MB; `None` once the process has ended.
fn usage(child: &Child) -> Option<(f64, f64)> {
    let read = |file: &str| fs::read_to_string(format!("/proc/{}/{file}", child.id())).ok();
    let stat = read("stat")?;
    // The name in brackets may hold spaces; user and system time are the 14th and 15th field of all.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let mut ticks = || fields.next()?.parse::<f64>().ok();
    let processor_s = (ticks()? + ticks()?) / TICKS_PER_S;
    let status = read("status")?;
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: f64 = peak.trim().trim_end_matches(" kB").parse().ok()?;
    Some((processor_s, kib * 1.024e-3))
}
