//! Our side of the comparison with `closed_loop.c` and `closed_loop.py`: the simulator's loop with the shipping
//! controller behind its bus, one run of the evaluation's course, timed. Prints one JSON object with the peers'
//! field names. The road is built outside the time, as theirs is.
//!
//!     cargo run --release --example closed_loop -p haptic-guidance -- --repeat 20

use std::time::Instant;

use haptic_sim::scenario::Scenario;
use haptic_sim::simulation::{Run, simulate};

/// One run. A function of its own so that callgrind can count what is below it.
#[inline(never)]
fn one_run(scenario: &Scenario) -> Run {
    simulate(scenario)
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let repeat = match (
        arguments.next().as_deref(),
        arguments.next().map(|n| n.parse::<u32>()),
    ) {
        (None, None) => 1,
        (Some("--repeat"), Some(Ok(n @ 1..))) => n,
        _ => {
            eprintln!("usage: closed_loop [--repeat N], the fastest of N runs is timed");
            std::process::exit(2);
        }
    };
    let scenario = Scenario::default();
    let _built = scenario.course().centreline();
    let mut wall_seconds = f64::INFINITY;
    let mut steps = 0;
    for _ in 0..repeat {
        let start = Instant::now();
        let run = one_run(&scenario);
        wall_seconds = wall_seconds.min(start.elapsed().as_secs_f64());
        assert!(!run.diverged(), "a run that diverged is no measure");
        steps = run.steps;
    }
    let simulated_seconds = f64::from(steps) * 1e-3;
    println!(
        "{}",
        serde_json::json!({
            "program": "haptic-guidance",
            "sensors": "paper",
            "simulated_seconds": simulated_seconds,
            "wall_seconds": wall_seconds,
            "times_real_time": simulated_seconds / wall_seconds,
            "steps": steps,
        })
    );
}
