//! The laws that ship on the ECU beside the paper's, in fixed point, against those of `haptic_sim::laws` in f64; and that nothing
//! honest makes the monitor refuse it.

use haptic_core::bus::Frame;
use haptic_core::controller::params::{DRIVER_ACTIVITY, FDCA, Params};
use haptic_core::safety::faults::Fault;
use haptic_sim::guidance::{Actuation, Guidance, Observation, OverBus, OwnLaw, Status};
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
    const fn new(least: f64) -> Self {
        Self {
            paper: Gains::PAPER,
            least,
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
        }
    }

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

/// A law in f64 at the instants of the ECU's.
trait AtInstants: Law {
    /// What it leaves of (9).
    fn share(&self) -> f64 {
        1.0
    }
}

impl AtInstants for Sampled {
    fn share(&self) -> f64 {
        self.share
    }
}

/// FDCA of `haptic_sim::laws` with speed and yaw rate of the last vehicle frame, which comes every 10 ms.
#[derive(Clone)]
struct Held {
    fdca: Box<dyn Law>,
    speed_m_per_s: f64,
    yaw_rate_rad_per_s: f64,
}

impl Law for Held {
    fn ask(&mut self, view: &LawView) -> f64 {
        if view.step.is_multiple_of(10) {
            (self.speed_m_per_s, self.yaw_rate_rad_per_s) = (view.speed_m_per_s, view.yaw_rate_rad_per_s);
        }
        self.fdca.ask(&LawView {
            speed_m_per_s: self.speed_m_per_s,
            yaw_rate_rad_per_s: self.yaw_rate_rad_per_s,
            ..*view
        })
    }
}

impl AtInstants for Held {}

/// The ECU drives; the law in f64, behind an ECU of its own, is given the same sensors beside it. In two drives a last digit would in time
/// round one reading of the wheel angle, 0.1 deg, to the other side, and the drives would differ by what follows from that.
#[derive(Clone)]
struct Beside<L> {
    ecu: OverBus,
    in_f64: OwnLaw<L>,
    /// The largest difference of torque, N.m, and when.
    most: (f64, f64),
    /// The most that (9) asks for, N.m.
    paper_nm: f64,
    least_share: f64,
}

impl<L: AtInstants + Clone> Guidance for Beside<L> {
    fn looks_at_road(&self, step: u32) -> bool {
        self.ecu.looks_at_road(step)
    }

    fn step(&mut self, observation: &Observation) -> Actuation {
        let actuation = self.ecu.step(observation);
        let apart_nm = (self.in_f64.step(observation).torque_nm - actuation.torque_nm).abs();
        if apart_nm > self.most.0 {
            self.most = (apart_nm, f64::from(observation.step) * 1e-3);
        }
        let share = self.in_f64.law().share();
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
fn beside<L: AtInstants + Clone>(params: Params, kmh: f64, law: L) -> Beside<L> {
    let shipping = scenario(params, kmh, SensorErrors::default(), 3);
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
fn the_law_on_the_ecu_is_that_in_f64() {
    for kmh in [60.0, 90.0] {
        let beside = beside(ACTIVITY, kmh, Sampled::new(ACTIVITY.activity_lambda_min));
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

/// What FDCA on the ECU may differ by: its error in fixed point, as documented, an LSB of the bus for the torque, and what the bus rounds,
/// which the law in f64 does not see. Half an LSB of a yaw error makes at most two of them, of opposite signs, over tau and the least time
/// between two samples, in its rate; each change by half an LSB of speed moves the torque by its share, and once more by g.
fn allowed_for_fdca_nm(kmh: f64, torque_nm: f64) -> f64 {
    let car = &BY_FDCA.vehicle;
    let v = kmh / 3.6;
    let turns = v * car.curvature_gain_per_m / (1.0 + car.stability_factor_s2_per_m2 * v * v);
    let half = |bits: i32| 0.5_f64.powi(bits + 1);
    let tau_s = 1.0 / (std::f64::consts::TAU * BY_FDCA.rate_corner_hz);
    let rate = 2.0 * half(16) / (tau_s + 0.008) + half(12);
    let angle = BY_FDCA.fdca_k_y_rad_per_m * half(13) + BY_FDCA.fdca_k_psi * half(16);
    let rounded_nm = car.aligning_gain_nm_s2_per_m * v * (turns * angle + BY_FDCA.fdca_lohs * rate);
    1e-3 + ROUNDED_NM + rounded_nm + 2.0 * torque_nm * half(8) / v
}

#[test]
fn fdca_on_the_ecu_is_that_in_f64() {
    let kind = LAWS.iter().find(|kind| kind.name == "fdca").unwrap();
    let values: Vec<f64> = kind.parameters.iter().map(|p| p.default).collect();
    let Make::Part(make) = kind.make else {
        panic!("FDCA is a part")
    };
    for kmh in [60.0, 90.0] {
        let law = Held {
            fdca: make(&scenario(BY_FDCA, kmh, SensorErrors::default(), 3), &values).unwrap(),
            speed_m_per_s: 0.0,
            yaw_rate_rad_per_s: 0.0,
        };
        let beside = beside(BY_FDCA, kmh, law);
        let (apart_nm, at_s) = beside.most;
        let allowed_nm = allowed_for_fdca_nm(kmh, beside.paper_nm);
        println!(
            "FDCA, {kmh} km/h: {:.2} of {:.2} mN.m at {at_s} s, asks for {:.2} N.m",
            apart_nm * 1e3,
            allowed_nm * 1e3,
            beside.paper_nm
        );
        assert!(apart_nm < allowed_nm, "{kmh} km/h: {apart_nm} N.m at {at_s} s");
        assert!(beside.paper_nm > 0.5, "{kmh} km/h: {}", beside.paper_nm);
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
