//! Times the identification of one log by both methods on one core, as one JSON object on stdout:
//! `cargo run --release -p host-sim --example time_identification -- LOG.csv [REPEATS]`. `bench/identify.py`
//! compares it with SciPy.

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use haptic_analysis::identify::{DriveLog, Options, identify_as_published, identify_with_noise_model};

fn main() {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().unwrap_or_default();
    let repeats: u32 = arguments.next().and_then(|n| n.parse().ok()).unwrap_or(10);
    let log = match DriveLog::open(Path::new(&path), true) {
        Ok(log) => log,
        Err(e) => {
            eprintln!("error: {e}");
            std::process::exit(2);
        }
    };
    let options = Options {
        manual: log.guidance_torque_nm.iter().all(|&t| t == 0.0),
        ..Options::default()
    };
    let fastest = |work: &dyn Fn()| {
        (0..repeats)
            .map(|_| {
                let start = Instant::now();
                work();
                start.elapsed().as_secs_f64()
            })
            .fold(f64::INFINITY, f64::min)
    };
    let found = identify_with_noise_model(&log, &options);
    let noise_model_s = fastest(&|| drop(black_box(identify_with_noise_model(&log, &options))));
    let paper_s = fastest(&|| drop(black_box(identify_as_published(&log, &options))));
    println!(
        "{}",
        serde_json::json!({
            "rows": log.len(),
            "loss": found.loss_history.last(),
            "t_p": found.parameters.t_p.optimum,
            "k_hg": found.parameters.k_hg.optimum,
            "noise_model_seconds": noise_model_s,
            "paper_seconds": paper_s,
        })
    );
}
