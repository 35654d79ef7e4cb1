//! Habits that any driver may have. All are ours, after what is said of drivers in the literature; none has been identified.
//!
//! - *Own line*: what is seen is to a line `offset + cut*kappa` left of the middle, kappa the curvature at the near point
//!   ("drivers always naturally cut curves", Wang et al. 2022, discussion).
//! - *Trust*: the arm's answer to the guidance is `-K_hg*L[T_h]` with L the muscle's lag, in the place of the driver's own;
//!   `tau*dK_hg/dt = clamp(0.5 + g_c*C - g_h*H, 0, 1) - K_hg`, C and H the shares of time with T_d*T_h < 0 and > 0, low-passed
//!   with 5 s; a loss of guidance adds 0.4 at once (bounded memory: Nikolaidis et al. 2017).
//! - *Tiring*: what is seen comes later by `delay*x` and counts `1 - loss*x`, x from 0 to 1 over the duration: t_p and K_d drift.
//! - *Lapses*: for a while the driver sees what was there when it began; lapses begin at random, and end early at a warning.
//! - *Warning*: whether the driver knows of a loss: 0 never, 1 by the warning lamp alone.
//! - *Stiffening*: `T = T_inner - g*(k*(phi - L[phi]) + b*dphi/dt)`, g the share of time in conflict as in trust, L a low-pass of
//!   0.5 s: co-contraction holds the wheel where it was.

use std::collections::VecDeque;

use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};

use super::{AnyDriver, Kind, Make};
use crate::guidance::LaneErrors;
use crate::kind::{Origin, Parameter};
use crate::laws::weight;
use crate::models::{STEP_S, step_of};
use crate::parts::{Driver, DriverView};
use crate::scenario::Scenario;
use crate::seeds::{Stream, named};

/// Torques of at most this size have no sign, N.m: as in the metric of conflict.
const DEAD_BAND_NM: f64 = 0.005;
/// Over which the shares of conflict and help are taken, s.
const MEMORY_S: f64 = 5.0;

/// A driver with a habit: a function that shows the driver a view of its own, and makes a torque of the answer.
#[derive(Clone)]
struct Around<H> {
    driver: Box<dyn AnyDriver>,
    habit: H,
}

impl<H: FnMut(&DriverView, &mut dyn AnyDriver) -> f64> Driver for Around<H> {
    fn look_ahead_s(&self) -> [f64; 2] {
        self.driver.look_ahead_s()
    }

    fn step(&mut self, view: &DriverView) -> f64 {
        (self.habit)(view, self.driver.as_mut())
    }

    fn k_hg(&self) -> Option<f64> {
        self.driver.k_hg()
    }
}

fn around<H>(driver: Box<dyn AnyDriver>, habit: H) -> Box<dyn AnyDriver>
where
    H: FnMut(&DriverView, &mut dyn AnyDriver) -> f64 + Clone + Send + Sync + 'static,
{
    Box::new(Around { driver, habit })
}

fn seeing(view: &DriverView, e_y_m: f64, e_theta_rad: f64) -> DriverView {
    let lane = LaneErrors { e_y_m, e_theta_rad };
    DriverView { lane, ..*view }
}

/// The shares of time in which driver and guidance turn against each other, and together.
#[derive(Clone, Default)]
struct Shares([f64; 2]);

impl Shares {
    fn step(&mut self, driver_nm: f64, guidance_nm: f64) -> [f64; 2] {
        let counts = driver_nm.abs().min(guidance_nm.abs()) > DEAD_BAND_NM;
        let product = driver_nm * guidance_nm;
        let now = [counts && product < 0.0, counts && product > 0.0];
        for (share, is) in self.0.iter_mut().zip(now) {
            *share += weight(MEMORY_S) * (f64::from(is) - *share);
        }
        self.0
    }
}

fn own_line(scenario: &Scenario, v: &[f64], driver: Box<dyn AnyDriver>) -> Box<dyn AnyDriver> {
    let (road, offset_m, cut_m2) = (scenario.course().centreline(), v[0], v[1]);
    around(driver, move |view, driver| {
        let (_, curvature, _) = road.at(view.points_m[0]);
        let line_m = offset_m + cut_m2 * curvature;
        driver.step(&seeing(view, view.lane.e_y_m + line_m, view.lane.e_theta_rad))
    })
}

#[derive(Clone)]
struct Trust {
    driver: Box<dyn AnyDriver>,
    k_hg: f64,
    g_c: f64,
    g_h: f64,
    shock: f64,
    /// Weights of what is new in K_hg and in the muscle.
    follows: f64,
    muscle: f64,
    shares: Shares,
    felt_nm: f64,
    was_lost: bool,
}

impl Driver for Trust {
    fn look_ahead_s(&self) -> [f64; 2] {
        self.driver.look_ahead_s()
    }

    fn step(&mut self, view: &DriverView) -> f64 {
        let deaf = DriverView {
            guidance_torque_nm: 0.0,
            ..*view
        };
        let answer_nm = self.driver.step(&deaf) - self.felt_nm;
        let [conflict, help] = self.shares.step(answer_nm, view.guidance_torque_nm);
        let wanted = (0.5 + self.g_c * conflict - self.g_h * help).clamp(0.0, 1.0);
        self.k_hg += self.follows * (wanted - self.k_hg);
        if view.is_lost && !self.was_lost {
            self.k_hg = (self.k_hg + self.shock).min(1.0);
        }
        self.was_lost = view.is_lost;
        self.felt_nm += self.muscle * (self.k_hg * view.guidance_torque_nm - self.felt_nm);
        answer_nm
    }

    fn k_hg(&self) -> Option<f64> {
        Some(self.k_hg)
    }
}

fn trust(scenario: &Scenario, v: &[f64], driver: Box<dyn AnyDriver>) -> Box<dyn AnyDriver> {
    Box::new(Trust {
        driver,
        k_hg: v[0],
        g_c: v[1],
        g_h: v[2],
        follows: weight(v[3]),
        shock: v[4],
        muscle: weight(scenario.driver().t_nms),
        shares: Shares::default(),
        felt_nm: 0.0,
        was_lost: false,
    })
}

fn tiring(_: &Scenario, v: &[f64], driver: Box<dyn AnyDriver>) -> Box<dyn AnyDriver> {
    let (delay_s, loss, duration_s) = (v[0], v[1], v[2]);
    // What was seen, the newest last.
    let mut all = VecDeque::new();
    around(driver, move |view, driver| {
        let tired = (view.time_s() / duration_s).min(1.0);
        all.push_back(view.lane);
        if all.len() > step_of(delay_s) as usize + 1 {
            all.pop_front();
        }
        let back = (step_of(delay_s * tired) as usize).min(all.len() - 1);
        let seen: LaneErrors = all[all.len() - 1 - back];
        let counts = 1.0 - loss * tired;
        driver.step(&seeing(view, counts * seen.e_y_m, counts * seen.e_theta_rad))
    })
}

fn lapses(scenario: &Scenario, v: &[f64], driver: Box<dyn AnyDriver>) -> Box<dyn AnyDriver> {
    let (per_step, lasts_steps) = (STEP_S / v[0], step_of(v[1]));
    let seed = named(Stream::World.seed(scenario.seed()), "lapses");
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    // What is seen, and until which step.
    let mut lapse: Option<(LaneErrors, u32)> = None;
    around(driver, move |view, driver| {
        let draw: f64 = random.random();
        if lapse.is_some_and(|(_, until)| view.warning || view.step >= until) {
            lapse = None;
        }
        if lapse.is_none() && !view.warning && draw < per_step {
            lapse = Some((view.lane, view.step + lasts_steps));
        }
        let lane = lapse.map_or(view.lane, |(lane, _)| lane);
        driver.step(&DriverView { lane, ..*view })
    })
}

fn warning(_: &Scenario, v: &[f64], driver: Box<dyn AnyDriver>) -> Box<dyn AnyDriver> {
    let answers = v[0] >= 0.5;
    around(driver, move |view, driver| {
        let is_lost = answers && view.warning;
        driver.step(&DriverView { is_lost, ..*view })
    })
}

fn stiffening(_: &Scenario, v: &[f64], driver: Box<dyn AnyDriver>) -> Box<dyn AnyDriver> {
    let (stiffness, damping, mut shares, mut held_rad) = (v[0], v[1], Shares::default(), 0.0);
    around(driver, move |view, driver| {
        let torque_nm = driver.step(view);
        let [conflict, _] = shares.step(torque_nm, view.guidance_torque_nm);
        held_rad += weight(0.5) * (view.wheel_angle_rad - held_rad);
        let spring_nm = stiffness * (view.wheel_angle_rad - held_rad);
        torque_nm - conflict * (spring_nm + damping * view.wheel_rate_rad_per_s)
    })
}

pub(super) const KINDS: [Kind<dyn AnyDriver>; 6] = [
    Kind {
        name: "own_line",
        source: "ours",
        origin: Origin::Ours,
        parameters: &[
            Parameter::ours("offset_m", 0.3, [-2.0, 2.0]),
            Parameter::ours("cut_m2", 0.0, [-500.0, 500.0]),
        ],
        make: Make::Around(own_line),
    },
    Kind {
        name: "trust",
        source: "Nikolaidis et al. 2017",
        origin: Origin::After,
        parameters: &[
            Parameter::ours("k_hg", 0.5, [0.0, 1.0]),
            Parameter::ours("g_c", 0.5, [0.0, 5.0]),
            Parameter::ours("g_h", 0.5, [0.0, 5.0]),
            Parameter::ours("tau_s", 30.0, [0.1, 1e6]),
            Parameter::ours("shock", 0.4, [0.0, 1.0]),
        ],
        make: Make::Around(trust),
    },
    Kind {
        name: "tiring",
        source: "ours",
        origin: Origin::Ours,
        parameters: &[
            Parameter::ours("delay_s", 0.3, [0.0, 2.0]),
            Parameter::ours("loss", 0.3, [0.0, 1.0]),
            Parameter::ours("duration_s", 600.0, [1.0, 100_000.0]),
        ],
        make: Make::Around(tiring),
    },
    Kind {
        name: "lapses",
        source: "ours",
        origin: Origin::Ours,
        parameters: &[
            Parameter::ours("every_s", 30.0, [0.1, 100_000.0]),
            Parameter::ours("lasts_s", 2.0, [0.0, 60.0]),
        ],
        make: Make::Around(lapses),
    },
    Kind {
        name: "warning",
        source: "ours",
        origin: Origin::Ours,
        parameters: &[Parameter::ours("answers", 1.0, [0.0, 1.0])],
        make: Make::Around(warning),
    },
    Kind {
        name: "stiffening",
        source: "ours",
        origin: Origin::Ours,
        parameters: &[
            Parameter::ours("stiffness_nm_per_rad", 10.0, [0.0, 100.0]),
            Parameter::ours("damping_nm_s_per_rad", 0.5, [0.0, 10.0]),
        ],
        make: Make::Around(stiffening),
    },
];
