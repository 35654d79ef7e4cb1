//! The lanes' side of the comparison with `closed_loop.c`: drives of the evaluation's course with eight delays and three
//! reliances, side by side on one core, with every check of the ECU on. Prints one JSON object with the peers' field names.
//! The first drive is the peers' own.
//!
//!     cargo run --release --example lanes -p haptic-guidance -- --repeat 5

use std::time::Instant;

use haptic_sim::lanes::{LANES, Width, drive};
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::scenario::{Condition, Scenario};

const USAGE: &str =
    "usage: lanes [--width widest|avx2|portable] [--repeat N], the fastest of N rounds is timed";

fn main() {
    let (mut repeat, mut width) = (1, Width::Widest);
    let mut arguments = std::env::args().skip(1);
    while let Some(option) = arguments.next() {
        match (option.as_str(), arguments.next().as_deref()) {
            ("--repeat", Some(n)) if n.parse::<u32>().is_ok_and(|n| n > 0) => repeat = n.parse().unwrap_or(1),
            ("--width", Some("widest")) => width = Width::Widest,
            ("--width", Some("avx2")) => width = Width::Avx2,
            ("--width", Some("portable")) => width = Width::Portable,
            _ => {
                eprintln!("{USAGE}");
                std::process::exit(2);
            }
        }
    }
    let scenarios = drives();
    let _built = scenarios[0].course().centreline();
    let mut wall_seconds = f64::INFINITY;
    let (mut steps, mut peak_m) = (0, 0.0);
    for _ in 0..repeat {
        let start = Instant::now();
        let mut driven = 0;
        drive(&scenarios, width, |number, run| {
            let run = run.expect("the evaluation's drives are nominal");
            driven += u64::from(run.steps);
            let samples = &run.trace.samples;
            let from = samples.partition_point(|s| s.s_m < 1080.0);
            let in_window = samples[from..].iter().take_while(|s| s.s_m <= 1740.0);
            let peak = in_window.map(|s| s.lateral_error_m.abs()).fold(0.0, f64::max);
            if number == 0 {
                peak_m = peak;
            }
        });
        wall_seconds = wall_seconds.min(start.elapsed().as_secs_f64());
        steps = driven;
    }
    let simulated_seconds = steps as f64 * 1e-3;
    println!(
        "{}",
        serde_json::json!({
            "program": "haptic-guidance, lanes",
            "sensors": "paper",
            "lanes": LANES,
            "simulated_seconds": simulated_seconds,
            "wall_seconds": wall_seconds,
            "times_real_time": simulated_seconds / wall_seconds,
            "steps": steps,
            "peak_lateral_error_m": peak_m,
        })
    );
}

/// Of the paper's driver and two others, with delays of 0.1 to 0.45 s.
fn drives() -> Vec<Scenario> {
    let conditions = [Condition::Mid, Condition::High, Condition::Low];
    let delays = (0..8).map(|i| 0.1 + 0.05 * f64::from(i));
    let pairs = delays.flat_map(|t_p| conditions.map(|condition| (t_p, condition)));
    let scenario = |(t_p, condition)| {
        let driver = DriverParameters {
            t_p,
            ..DriverParameters::default()
        };
        let builder = Scenario::builder().driver(driver).condition(condition);
        builder.build().expect("every value is in its range")
    };
    pairs.map(scenario).collect()
}
