//! The law that ships on the ECU beside the paper's, in fixed point, against that of `haptic_sim::laws` in f64; and that nothing
//! honest makes the monitor refuse it.

use haptic_core::controller::params::{DRIVER_ACTIVITY, Params};
use haptic_core::safety::faults::Fault;
use haptic_sim::guidance::{OverBus, OwnLaw};
use haptic_sim::kind::Make;
use haptic_sim::laws::LAWS;
use haptic_sim::models::disturbances::SensorErrors;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::scenario::GuidanceParameters;
use haptic_sim::{Action, Scenario, Simulation};

fn scenario(controller: Params, kmh: f64, errors: SensorErrors, seed: u64) -> Scenario {
    let guidance = GuidanceParameters {
        controller,
        ..GuidanceParameters::default()
    };
    let driver = DriverParameters {
        remnant_sd_nm: 0.1,
        ..DriverParameters::default()
    };
    let builder = Scenario::builder().guidance(guidance).driver(driver).seed(seed);
    builder.speed_kmh(kmh).sensor_errors(errors).build().unwrap()
}

const ACTIVITY: Params = Params {
    law: DRIVER_ACTIVITY,
    ..Params::PAPER
};

/// The same drive twice: the ECU with its own law, and the same ECU with the law in f64 in its place. The largest differences of torque
/// and lateral error.
fn apart(params: Params, kmh: f64) -> [f64; 2] {
    let shipping = scenario(params, kmh, SensorErrors::default(), 3);
    let paper = scenario(Params::PAPER, kmh, SensorErrors::default(), 3);
    let kind = LAWS.iter().find(|kind| kind.name == "driver_activity").unwrap();
    let Make::Part(make) = kind.make else { panic!() };
    let values = [params.k_1, params.activity_lambda_min, 0.5];
    let law = make(&paper, &values).unwrap();
    let own = Simulation::with(&paper, OwnLaw::new(&paper, law)).run();
    let ecu = Simulation::with(&shipping, OverBus::new(shipping.setup())).run();
    assert_eq!(own.trace.samples.len(), ecu.trace.samples.len());
    let pairs = || own.trace.samples.iter().zip(&ecu.trace.samples);
    let most = |of: fn(&haptic_log::trace::Sample) -> f64| {
        pairs().map(|(a, b)| (of(a) - of(b)).abs()).fold(0.0, f64::max)
    };
    [most(|s| s.guidance_torque_nm), most(|s| s.lateral_error_m)]
}

/// The law in f64 looks at each column sample, the ECU's at every fifth or so, 10 ms later.
#[test]
fn the_law_on_the_ecu_is_that_in_f64() {
    for kmh in [60.0, 90.0] {
        let [torque, error] = apart(ACTIVITY, kmh);
        println!("{kmh} km/h: {:.1} mN.m, {:.2} mm", torque * 1e3, error * 1e3);
        assert!(torque < 0.03 && error < 3e-3, "{kmh}: {torque} {error}");
    }
}

/// Each is driven for the whole course; the monitor's verdict would latch.
#[test]
fn the_monitor_refuses_no_honest_law() {
    let camera = SensorErrors {
        lane_noise_m: 0.01,
        heading_noise_rad: 1e-3,
        ..SensorErrors::default()
    };
    let cases = [
        ("as it is", SensorErrors::default()),
        ("camera noise", camera),
        (
            "a late camera",
            SensorErrors {
                camera_latency_s: 0.1,
                camera_jitter_s: 0.01,
                ..camera
            },
        ),
        (
            "blinks",
            SensorErrors {
                dropout_rate_per_s: 0.1,
                dropout_duration_s: 0.3,
                ..camera
            },
        ),
        (
            "lines beside",
            SensorErrors {
                line_jump_rate_per_s: 120.0 / 3600.0,
                line_jump_m: 0.6,
                ..camera
            },
        ),
        (
            "a false yaw rate",
            SensorErrors {
                yaw_rate_gain: 1.3,
                yaw_rate_noise_rad_per_s: 0.01,
                ..camera
            },
        ),
        (
            "a biased yaw rate",
            SensorErrors {
                yaw_rate_bias_rad_per_s: 0.03,
                ..camera
            },
        ),
    ];
    let mut refused = Vec::new();
    for params in [ACTIVITY] {
        for (what, errors) in cases {
            for kmh in [40.0, 60.0, 100.0] {
                let scenario = scenario(params, kmh, errors, 5);
                let mut simulation = Simulation::with(&scenario, OverBus::new(scenario.setup()));
                let mut step = 0_u32;
                while let Some(outcome) = simulation.step(&Action::default()) {
                    if outcome.status.unwrap().faults.contains(Fault::Monitor) {
                        refused.push(format!("law {}, {what}, {kmh} km/h, at {step} ms", params.law));
                        break;
                    }
                    step += 1;
                }
            }
        }
    }
    assert!(refused.is_empty(), "{refused:#?}");
}
