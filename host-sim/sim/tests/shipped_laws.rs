//! Driver activity, which ships on the ECU beside the paper's law in fixed point, against the same law in f64; and that nothing honest
//! makes the monitor refuse it.

use haptic_core::bus::Frame;
use haptic_core::controller::params::{DRIVER_ACTIVITY, Params};
use haptic_core::safety::faults::Fault;
use haptic_sim::guidance::{Actuation, Guidance, Observation, OverBus, OwnLaw, Status};
use haptic_sim::laws::{Gains, Law, LawView};
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

/// The law in f64 at the instants of the ECU's, which looks at each column frame, one in 2 ms, in the step after it.
#[derive(Clone)]
struct Sampled {
    paper: Gains,
    least: f64,
    rate: Rate,
    looked_s: f64,
    /// The view of the last frame and what (9) asked for then, until they are looked at.
    pending: Option<(LawView, f64)>,
    agreement: f64,
    size: f64,
    share: f64,
}

impl Sampled {
    const fn new(least: f64) -> Self {
        Self {
            paper: Gains::PAPER,
            least,
            rate: Rate {
                last: (0.0, 0.0),
                rate: 0.0,
            },
            looked_s: 0.0,
            pending: None,
            agreement: 0.0,
            size: 0.0,
            share: 1.0,
        }
    }

    fn look(&mut self, view: &LawView, asked_nm: f64) {
        let at_s = f64::from(view.step) * 1e-3;
        let passed_s = at_s - self.looked_s;
        self.looked_s = at_s;
        self.rate.take(view.wheel_angle_rad, at_s);
        let product = view.driver_torque_nm * asked_nm * self.rate.rate.powi(2);
        self.size += passed_s * (product.abs() - self.size);
        let agreement = self.agreement + passed_s / 0.5 * (product - self.agreement);
        self.agreement = agreement.clamp(-self.size, self.size);
        let against = (-self.agreement / (self.size + 0.5_f64.powi(20))).max(0.0);
        self.share = 1.0 - (1.0 - self.least) * against;
    }
}

impl Law for Sampled {
    fn ask(&mut self, view: &LawView) -> f64 {
        let asked_nm = self.paper.ask(view);
        if view.step.is_multiple_of(2) {
            self.pending = Some((*view, asked_nm));
        } else if let Some((view, asked_nm)) = self.pending.take() {
            self.look(&view, asked_nm);
        }
        self.share * asked_nm
    }
}

/// The ECU drives; the law in f64, behind an ECU of its own, is given the same sensors beside it. In two drives a last digit would in time
/// round one reading of the wheel angle, 0.1 deg, to the other side, and the drives would differ by what follows from that.
#[derive(Clone)]
struct Beside {
    ecu: OverBus,
    in_f64: OwnLaw<Sampled>,
    /// The largest difference of torque, N.m, and when.
    most: (f64, f64),
    /// The most that (9) asks for, N.m.
    paper_nm: f64,
    least_share: f64,
}

impl Guidance for Beside {
    fn looks_at_road(&self, step: u32) -> bool {
        self.ecu.looks_at_road(step)
    }

    fn step(&mut self, observation: &Observation) -> Actuation {
        let actuation = self.ecu.step(observation);
        let apart_nm = (self.in_f64.step(observation).torque_nm - actuation.torque_nm).abs();
        if apart_nm > self.most.0 {
            self.most = (apart_nm, f64::from(observation.step) * 1e-3);
        }
        let share = self.in_f64.law().share;
        self.paper_nm = self.paper_nm.max((self.in_f64.demanded_nm() / share).abs());
        self.least_share = self.least_share.min(share);
        actuation
    }

    fn status(&self) -> Option<Status> {
        self.ecu.status()
    }

    fn frames_in(&self) -> &[Frame] {
        self.ecu.frames_in()
    }

    fn frames_out(&self) -> &[Frame] {
        self.ecu.frames_out()
    }
}

/// What the torques of the two may differ by: the error of (9) in fixed point, that of the share times what (9) asks for
/// (both as documented, `core/tests` asserts them), and an LSB of the bus, as each is rounded to one.
const OF_PAPER_NM: f64 = 0.2e-3;
const OF_SHARE: f64 = 1e-3;
const ROUNDED_NM: f64 = 1.0 / 4096.0;

/// The whole course with both.
fn beside(kmh: f64, law: Sampled) -> Beside {
    let shipping = scenario(ACTIVITY, kmh, SensorErrors::default(), 3);
    let paper = scenario(Params::PAPER, kmh, SensorErrors::default(), 3);
    let beside = Beside {
        ecu: OverBus::new(shipping.setup()),
        in_f64: OwnLaw::new(&paper, law),
        most: (0.0, 0.0),
        paper_nm: 0.0,
        least_share: 1.0,
    };
    let mut simulation = Simulation::with(&shipping, beside);
    while simulation.step(&Action::default()).is_some() {}
    simulation.guidance().clone()
}

#[test]
fn driver_activity_on_the_ecu_is_that_in_f64() {
    for kmh in [60.0, 90.0] {
        let beside = beside(kmh, Sampled::new(ACTIVITY.activity_lambda_min));
        let (apart_nm, at_s) = beside.most;
        let allowed_nm = OF_PAPER_NM + OF_SHARE * beside.paper_nm + ROUNDED_NM;
        println!(
            "{kmh} km/h: {:.2} of {:.2} mN.m at {at_s} s",
            apart_nm * 1e3,
            allowed_nm * 1e3
        );
        assert!(apart_nm < allowed_nm, "{kmh} km/h: {apart_nm} N.m at {at_s} s");
        assert!(beside.least_share < 0.35, "{kmh} km/h: {}", beside.least_share);
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
    for params in [Params::PAPER, ACTIVITY] {
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
