//! The lanes' side of the comparison with `closed_loop.c`: drives of the evaluation's course with eight delays and three
//! reliances, side by side on one core, with every check of the ECU on. Prints one JSON object with the peers' field names.
//! The first drive is the peers' own.
//!
//! `--beside` adds to each drive what a study has beside the paper, and `--alone` drives them all one by one with the
//! shipping ECU too, in turn with the lanes: `over_one_by_one` is how many times as fast the lanes are, with what they hand
//! back driven alone.
//!
//!     cargo run --release --example lanes -p haptic-guidance -- --repeat 5
//!     cargo run --release --example lanes -p haptic-guidance -- --beside wind --alone

use cpu_time::ThreadTime;
use haptic_sim::models::disturbances::SensorErrors;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::models::nonlinear::WorldParameters;
use haptic_sim::scenario::{Condition, Scenario, ScenarioBuilder};
use haptic_sim::simulation::{Run, simulate};
use haptic_sim::worlds::WORLDS;
use haptic_vectorised::{BATCH, Event, Options, Width, run_batch};

const USAGE: &str = "usage: lanes [--width widest|avx2|portable] [--repeat N] [--alone] \
    [--beside probe|sensors|wind|everything], the fastest of N rounds is timed";

/// What the command line asks for: rounds, width, whether the drives run one by one too, and what they have beside the paper's world.
fn asked() -> (u32, Width, bool, Beside) {
    let (mut repeat, mut width, mut alone, mut beside) = (1, Width::Widest, false, Beside::Nothing);
    let mut arguments = std::env::args().skip(1);
    while let Some(option) = arguments.next() {
        if option == "--alone" {
            alone = true;
            continue;
        }
        match (option.as_str(), arguments.next().as_deref()) {
            ("--repeat", Some(n)) if n.parse::<u32>().is_ok_and(|n| n > 0) => repeat = n.parse().unwrap_or(1),
            ("--width", Some("widest")) => width = Width::Widest,
            ("--width", Some("avx2")) => width = Width::Avx2,
            ("--width", Some("portable")) => width = Width::Portable,
            ("--beside", Some("probe")) => beside = Beside::Probe,
            ("--beside", Some("sensors")) => beside = Beside::Sensors,
            ("--beside", Some("wind")) => beside = Beside::Wind,
            ("--beside", Some("everything")) => beside = Beside::Everything,
            _ => {
                eprintln!("{USAGE}");
                std::process::exit(2);
            }
        }
    }
    (repeat, width, alone, beside)
}

fn main() {
    let (repeat, width, alone, beside) = asked();
    let scenarios = drives(beside);
    let _built = scenarios[0].course().centreline();
    let (mut processor_seconds, mut alone_seconds) = (f64::INFINITY, f64::INFINITY);
    let (mut steps, mut peak_m, mut rejected) = (0, 0.0, 0);
    for _ in 0..repeat {
        let start = ThreadTime::now();
        (steps, rejected) = (0, 0);
        let options = Options {
            width,
            ..Options::default()
        };
        run_batch(&scenarios, options, |number, event| {
            let given_back;
            let run = match event {
                Event::Steps(_) => return,
                Event::Ended(run) => run,
                Event::Rejected(_) => {
                    rejected += 1;
                    given_back = simulate(&scenarios[number]);
                    &given_back
                }
            };
            steps += u64::from(run.steps);
            if number == 0 {
                peak_m = peak(run);
            }
        });
        processor_seconds = processor_seconds.min(start.elapsed().as_secs_f64());
        let is_nominal = beside != Beside::Nothing || rejected == 0;
        assert!(is_nominal, "the evaluation's drives are nominal");
        if alone {
            let start = ThreadTime::now();
            let driven: u64 = scenarios
                .iter()
                .map(|scenario| u64::from(simulate(scenario).steps))
                .sum();
            assert_eq!(driven, steps, "lanes drive what is driven alone");
            alone_seconds = alone_seconds.min(start.elapsed().as_secs_f64());
        }
    }
    let simulated_seconds = steps as f64 * 1e-3;
    println!(
        "{}",
        serde_json::json!({
            "program": "haptic-guidance, lanes",
            "sensors": "paper",
            "lanes": BATCH,
            "simulated_seconds": simulated_seconds,
            "processor_seconds": processor_seconds,
            "times_real_time": simulated_seconds / processor_seconds,
            "steps": steps,
            "peak_lateral_error_m": peak_m,
            "drives": scenarios.len(),
            "rejected": rejected,
            "over_one_by_one": alone.then(|| alone_seconds / processor_seconds),
        })
    );
}

/// Largest lateral error in the evaluation's window, m.
fn peak(run: &Run) -> f64 {
    let samples = &run.trace.samples;
    let from = samples.partition_point(|s| s.s_m < 1080.0);
    let in_window = samples[from..].iter().take_while(|s| s.s_m <= 1740.0);
    in_window.map(|s| s.lateral_error_m.abs()).fold(0.0, f64::max)
}

/// What a drive has beside the paper's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Beside {
    Nothing,
    Probe,
    /// Sensors with gains, biases and noise.
    Sensors,
    /// Gusts, friction and a motor with a lag, on the paper's tyres.
    Wind,
    /// The world `everything` of `cargo xtask availability`, each car another.
    Everything,
}

impl Beside {
    fn add(self, builder: ScenarioBuilder, number: u64) -> ScenarioBuilder {
        match self {
            Self::Nothing => builder,
            Self::Probe => builder.probe(true),
            Self::Sensors => builder.seed(number).sensor_errors(SensorErrors {
                torque_bias_nm: 0.05,
                angle_bias_rad: 1.0_f64.to_radians(),
                speed_gain: 1.01,
                yaw_rate_noise_rad_per_s: 0.002,
                lane_noise_m: 0.01,
                heading_noise_rad: 0.0005,
                ..SensorErrors::default()
            }),
            Self::Wind => builder.seed(number).world(WorldParameters {
                gust_sd_n: 100.0,
                friction_nm: 0.2,
                motor_lag_s: 0.005,
                ..WorldParameters::default()
            }),
            Self::Everything => {
                let kind = WORLDS.iter().find(|kind| kind.name == "everything");
                let kind = kind.expect("there is a world of this name");
                let builder = builder.seed(number).world(kind.parameters());
                builder.tolerances(kind.tolerances(number))
            }
        }
    }
}

/// Drives of the paper's driver and two others, with delays of 0.1 to 0.45 s.
fn drives(beside: Beside) -> Vec<Scenario> {
    let conditions = [Condition::Mid, Condition::High, Condition::Low];
    let delays = (0..8).map(|i| 0.1 + 0.05 * f64::from(i));
    let pairs = delays.flat_map(|t_p| conditions.map(|condition| (t_p, condition)));
    let scenario = |(number, (t_p, condition))| {
        let driver = DriverParameters {
            t_p,
            ..DriverParameters::default()
        };
        let builder = Scenario::builder().driver(driver).condition(condition);
        let builder = beside.add(builder, number);
        builder.build().expect("every value is in its range")
    };
    (0..).zip(pairs).map(scenario).collect()
}
