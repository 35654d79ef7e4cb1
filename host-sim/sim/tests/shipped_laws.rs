//! The laws that ship on the ECU beside the paper's, in fixed point, against those of `haptic_sim::laws` in f64; and that nothing
//! honest makes the monitor refuse them.

use haptic_core::controller::params::{DRIVER_ACTIVITY, FDCA, Params};
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

fn fdca() -> [Params; 2] {
    let defaults = Params {
        law: FDCA,
        ..Params::PAPER
    };
    let chosen = Params {
        fdca_k_y_rad_per_m: 0.3,
        fdca_lohs: 0.4,
        fdca_loha_nm_per_rad: 1.0,
        ..defaults
    };
    [defaults, chosen]
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
    let (name, values) = if params.law == FDCA {
        let p = params;
        let choices = [
            p.fdca_k_y_rad_per_m,
            p.fdca_k_psi,
            p.fdca_lohs,
            p.fdca_sohf,
            p.fdca_loha_nm_per_rad,
        ];
        ("fdca", choices.to_vec())
    } else {
        (
            "driver_activity",
            vec![params.k_1, params.activity_lambda_min, 0.5],
        )
    };
    let kind = LAWS.iter().find(|kind| kind.name == name).unwrap();
    let Make::Part(make) = kind.make else { panic!() };
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

/// FDCA stands on the rate of the yaw error, of which an LSB of the bus, 15 urad, is 10 mN.m at 60 km/h until the filter has forgotten it.
#[test]
fn laws_on_the_ecu_are_those_in_f64() {
    for (params, kmh, torque_nm, error_m) in [
        (fdca()[0], 60.0, 0.03, 3e-3),
        (fdca()[1], 60.0, 0.03, 3e-3),
        (fdca()[0], 90.0, 0.04, 3e-3),
        (ACTIVITY, 60.0, 0.03, 3e-3),
        (ACTIVITY, 90.0, 0.03, 3e-3),
    ] {
        let [torque, error] = apart(params, kmh);
        println!(
            "law {} at {kmh} km/h: {:.1} mN.m, {:.2} mm",
            params.law,
            torque * 1e3,
            error * 1e3
        );
        assert!(
            torque < torque_nm && error < error_m,
            "{} {kmh}: {torque} {error}",
            params.law
        );
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
    let [defaults, chosen] = fdca();
    let mut refused = Vec::new();
    for params in [defaults, chosen, ACTIVITY] {
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
