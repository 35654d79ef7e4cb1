//! Times the identification of one log by both methods on one core, and of the same log with camera noise of 10 mm and
//! 1 mrad that has to be estimated, in seconds of that core, as one JSON object on stdout:
//! `cargo run --release -p host-sim --example time_identification -- LOG.csv [REPEATS]`. `bench/identify.py`
//! compares it with SciPy.

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use haptic_analysis::identify::{DriveLog, Options, identify_as_published, identify_with_noise_model};
use rand::SeedableRng;
use rand::rngs::Xoshiro256PlusPlus;
use rand_distr::{Distribution, StandardNormal};

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
    let began = Instant::now();
    // The kernel counts by its ticks of some milliseconds: all repeats together.
    let mean = |work: &dyn Fn()| {
        let start = busy_s(began);
        (0..repeats).for_each(|_| work());
        (busy_s(began) - start) / f64::from(repeats)
    };
    let found = identify_with_noise_model(&log, &options);
    let noise_model_s = mean(&|| drop(black_box(identify_with_noise_model(&log, &options))));
    let noisy = with_camera_noise(&log);
    let noisy_s = mean(&|| drop(black_box(identify_with_noise_model(&noisy, &options))));
    let paper_s = mean(&|| drop(black_box(identify_as_published(&log, &options))));
    println!(
        "{}",
        serde_json::json!({
            "rows": log.len(),
            // Of the largest likelihood, with t_nms as assumed: what SciPy is asked for too.
            "loss": found.starts.first().map(|s| s.loss),
            "t_p": found.starts.first().map(|s| s.to_t_p_s),
            "k_hg": found.parameters.k_hg.optimum,
            "noise_model_seconds": noise_model_s,
            "noise_model_with_camera_noise_seconds": noisy_s,
            "paper_seconds": paper_s,
        })
    );
}

/// Time that this thread has had a core, s, where Linux says it: others on the machine do not count. Else by the clock.
fn busy_s(began: Instant) -> f64 {
    std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok())
        .map_or_else(|| began.elapsed().as_secs_f64(), |ns| 1e-9 * ns)
}

/// The log with white noise on its lane signals.
fn with_camera_noise(log: &DriveLog) -> DriveLog {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    let mut out = log.clone();
    for k in 0..out.len() {
        out.e_y_m[k] += 0.01 * normal();
        out.e_theta_rad[k] += 0.001 * normal();
    }
    out
}
