//! The law that ships on the ECU beside the paper's, in fixed point, against that of `haptic_sim::laws` in f64; and that nothing
//! honest makes the monitor refuse it.

use haptic_core::controller::params::{DRIVER_ACTIVITY, FDCA, Params};
use haptic_core::safety::faults::Fault;
use haptic_sim::guidance::{OverBus, OwnLaw};
use haptic_sim::kind::Make;
use haptic_sim::laws::{Gains, LAWS, Law, LawView};
use haptic_sim::models::disturbances::SensorErrors;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::models::sensors::camera_looks;
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

const BY_FDCA: Params = Params {
    law: FDCA,
    ..Params::PAPER
};

/// As the comparison tunes it.
const TUNED_FDCA: Params = Params {
    fdca_lohs: 0.4,
    ..BY_FDCA
};

/// The filtered rate of the wheel in f64.
#[derive(Clone)]
struct Rate {
    last: (f64, f64),
    rate: f64,
}

impl Rate {
    fn take(&mut self, value: f64, at_s: f64) {
        let tau_s = 1.0 / (std::f64::consts::TAU * Params::PAPER.rate_corner_hz);
        let between_s = at_s - self.last.1;
        self.rate = (tau_s * self.rate + value - self.last.0) / (tau_s + between_s);
        self.last = (value, at_s);
    }
}

/// The law in f64 at the instants of the ECU's. The column sends every 2 ms, the vehicle every 10 ms. The law looks at the last column
/// frame in the step after a lane sample, or one later where a vehicle frame comes in that step and the last look is more than 12 ms
/// old; its rate is that of the wheel between looks. The share acts from the next vehicle frame on.
#[derive(Clone)]
struct Sampled {
    paper: Gains,
    least: f64,
    /// The last column frame: driver torque, wheel angle, and when it came.
    column: [f64; 2],
    column_step: u32,
    looked: u32,
    /// A lane sample waits for its check.
    is_due: bool,
    rate: Rate,
    sums: [f64; 2],
    share: f64,
}

impl Sampled {
    fn look(&mut self, guidance_torque_nm: f64) {
        let [driver_torque_nm, wheel_angle_rad] = self.column;
        let at_s = f64::from(self.column_step) * 1e-3;
        let weight = f64::from(self.column_step - self.looked) * 1e-3 / 0.5;
        self.rate.take(wheel_angle_rad, at_s);
        let product = driver_torque_nm * guidance_torque_nm * self.rate.rate.powi(2);
        self.sums[0] += weight * (product - self.sums[0]);
        self.sums[1] += weight * (product.abs() - self.sums[1]);
        self.looked = self.column_step;
    }
}

impl Law for Sampled {
    fn ask(&mut self, view: &LawView) -> f64 {
        let has_motion = view.step.is_multiple_of(10);
        if has_motion && self.sums[1] > 0.0 {
            let against = (-self.sums[0] / self.sums[1]).max(0.0);
            self.share = 1.0 - (1.0 - self.least) * against;
        }
        if view.step.is_multiple_of(2) {
            self.column = [view.driver_torque_nm, view.wheel_angle_rad];
            self.column_step = view.step;
        }
        if self.is_due {
            self.is_due = has_motion && self.column_step - self.looked > 12;
            if !has_motion {
                self.look(view.guidance_torque_nm);
            }
        }
        self.is_due |= camera_looks(view.step);
        self.share * self.paper.ask(view)
    }
}

/// The same drive twice: the ECU with its own law, and the same ECU with the law in f64 in its place. The largest differences of torque
/// and lateral error.
fn apart(params: Params, kmh: f64) -> [f64; 2] {
    let shipping = scenario(params, kmh, SensorErrors::default(), 3);
    let paper = scenario(Params::PAPER, kmh, SensorErrors::default(), 3);
    let law = Sampled {
        paper: Gains::PAPER,
        least: params.activity_lambda_min,
        column: [0.0; 2],
        column_step: 0,
        looked: 0,
        is_due: false,
        rate: Rate {
            last: (0.0, 0.0),
            rate: 0.0,
        },
        sums: [0.0; 2],
        share: 1.0,
    };
    let own = Simulation::with(&paper, OwnLaw::new(&paper, law)).run();
    let ecu = Simulation::with(&shipping, OverBus::new(shipping.setup())).run();
    assert_eq!(own.trace.samples.len(), ecu.trace.samples.len());
    let pairs = || own.trace.samples.iter().zip(&ecu.trace.samples);
    let most = |of: fn(&haptic_log::trace::Sample) -> f64| {
        pairs().map(|(a, b)| (of(a) - of(b)).abs()).fold(0.0, f64::max)
    };
    [most(|s| s.guidance_torque_nm), most(|s| s.lateral_error_m)]
}

#[test]
fn the_law_on_the_ecu_is_that_in_f64() {
    for kmh in [60.0, 90.0] {
        let [torque, error] = apart(ACTIVITY, kmh);
        println!("{kmh} km/h: {:.1} mN.m, {:.2} mm", torque * 1e3, error * 1e3);
        assert!(torque < 0.03 && error < 3e-3, "{kmh}: {torque} {error}");
    }
}

#[test]
fn fdca_on_the_ecu_is_that_in_f64() {
    for kmh in [60.0, 90.0] {
        let shipping = scenario(BY_FDCA, kmh, SensorErrors::default(), 3);
        let paper = scenario(Params::PAPER, kmh, SensorErrors::default(), 3);
        let kind = LAWS.iter().find(|kind| kind.name == "fdca").unwrap();
        let values: Vec<f64> = kind
            .parameters
            .iter()
            .map(|parameter| parameter.default)
            .collect();
        let Make::Part(make) = kind.make else {
            panic!("FDCA is a part")
        };
        let own = Simulation::with(&paper, OwnLaw::new(&paper, make(&paper, &values).unwrap())).run();
        let ecu = Simulation::with(&shipping, OverBus::new(shipping.setup())).run();
        let pairs = || own.trace.samples.iter().zip(&ecu.trace.samples);
        let most = |of: fn(&haptic_log::trace::Sample) -> f64| {
            pairs().map(|(a, b)| (of(a) - of(b)).abs()).fold(0.0, f64::max)
        };
        let [torque, error] = [most(|s| s.guidance_torque_nm), most(|s| s.lateral_error_m)];
        println!(
            "FDCA, {kmh} km/h: {:.1} mN.m, {:.2} mm",
            torque * 1e3,
            error * 1e3
        );
        assert!(torque < 0.1 && error < 3e-3, "{kmh}: {torque} {error}");
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
    for params in [ACTIVITY, BY_FDCA, TUNED_FDCA] {
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
