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
use crate::kind::Parameter;
use crate::laws::weight;
use crate::models::road::Centreline;
use crate::models::{STEP_S, step_of};
use crate::parts::{Driver, DriverView};
use crate::seeds::{Stream, named};
use std::sync::Arc;

/// Torques of at most this size have no sign, N.m: as in the metric of conflict.
const DEAD_BAND_NM: f64 = 0.005;
/// Over which the shares of conflict and help are taken, s.
const MEMORY_S: f64 = 5.0;

/// A habit around a driver: what it makes of a view, and of the torque.
#[derive(Clone)]
struct Around<H> {
    driver: Box<dyn AnyDriver>,
    habit: H,
}

trait Habit: Clone + Send + Sync + 'static {
    /// What the driver perceives.
    fn perceives(&mut self, view: &DriverView) -> DriverView {
        *view
    }

    /// What becomes of the driver's torque, N.m.
    fn acts(&mut self, _view: &DriverView, torque_nm: f64) -> f64 {
        torque_nm
    }
}

impl<H: Habit> Driver for Around<H> {
    fn look_ahead_s(&self) -> [f64; 2] {
        self.driver.look_ahead_s()
    }

    fn step(&mut self, view: &DriverView) -> f64 {
        let perceived = self.habit.perceives(view);
        let torque_nm = self.driver.step(&perceived);
        self.habit.acts(view, torque_nm)
    }
}

fn around(driver: Box<dyn AnyDriver>, habit: impl Habit) -> Box<dyn AnyDriver> {
    Box::new(Around { driver, habit })
}

#[derive(Clone)]
struct OwnLine {
    road: Arc<Centreline>,
    offset_m: f64,
    cut_m2: f64,
}

impl Habit for OwnLine {
    fn perceives(&mut self, view: &DriverView) -> DriverView {
        let (_, curvature, _) = self.road.at(view.points_m[0]);
        let line_m = self.offset_m + self.cut_m2 * curvature;
        let lane = LaneErrors {
            e_y_m: view.lane.e_y_m + line_m,
            ..view.lane
        };
        DriverView { lane, ..*view }
    }
}

/// The shares of time in which driver and guidance turn against each other, and together.
#[derive(Debug, Clone, Default)]
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

#[derive(Clone)]
struct Trust {
    k_hg: f64,
    gains: [f64; 2],
    weight: f64,
    shock: f64,
    muscle: f64,
    shares: Shares,
    felt_nm: f64,
    was_lost: bool,
}

impl Habit for Trust {
    fn perceives(&mut self, view: &DriverView) -> DriverView {
        DriverView {
            guidance_torque_nm: 0.0,
            ..*view
        }
    }

    fn acts(&mut self, view: &DriverView, torque_nm: f64) -> f64 {
        let answer_nm = torque_nm - self.felt_nm;
        let [conflict, help] = self.shares.step(answer_nm, view.guidance_torque_nm);
        let wanted = (0.5 + self.gains[0] * conflict - self.gains[1] * help).clamp(0.0, 1.0);
        self.k_hg += self.weight * (wanted - self.k_hg);
        if view.is_lost && !self.was_lost {
            self.k_hg = (self.k_hg + self.shock).min(1.0);
        }
        self.was_lost = view.is_lost;
        self.felt_nm += self.muscle * (self.k_hg * view.guidance_torque_nm - self.felt_nm);
        answer_nm
    }
}

#[derive(Clone)]
struct Tiring {
    delay_s: f64,
    loss: f64,
    duration_s: f64,
    /// What was seen, the newest last.
    seen: VecDeque<LaneErrors>,
}

impl Habit for Tiring {
    fn perceives(&mut self, view: &DriverView) -> DriverView {
        let tired = (view.time_s() / self.duration_s).min(1.0);
        self.seen.push_back(view.lane);
        if self.seen.len() > step_of(self.delay_s) as usize + 1 {
            self.seen.pop_front();
        }
        let back = (step_of(self.delay_s * tired) as usize).min(self.seen.len() - 1);
        let seen = self.seen[self.seen.len() - 1 - back];
        let counts = 1.0 - self.loss * tired;
        let lane = LaneErrors {
            e_y_m: counts * seen.e_y_m,
            e_theta_rad: counts * seen.e_theta_rad,
        };
        DriverView { lane, ..*view }
    }
}

#[derive(Clone)]
struct Lapses {
    per_step: f64,
    lasts_steps: u32,
    random: Xoshiro256PlusPlus,
    /// What is seen, and until which step.
    lapse: Option<(LaneErrors, u32)>,
}

impl Habit for Lapses {
    fn perceives(&mut self, view: &DriverView) -> DriverView {
        let draw: f64 = self.random.random();
        if self
            .lapse
            .is_some_and(|(_, until)| view.warning || view.step >= until)
        {
            self.lapse = None;
        }
        if self.lapse.is_none() && !view.warning && draw < self.per_step {
            self.lapse = Some((view.lane, view.step + self.lasts_steps));
        }
        let lane = self.lapse.map_or(view.lane, |(lane, _)| lane);
        DriverView { lane, ..*view }
    }
}

#[derive(Clone)]
struct Warning {
    answers: bool,
}

impl Habit for Warning {
    fn perceives(&mut self, view: &DriverView) -> DriverView {
        let is_lost = self.answers && view.warning;
        DriverView { is_lost, ..*view }
    }
}

#[derive(Clone)]
struct Stiffening {
    stiffness: f64,
    damping: f64,
    shares: Shares,
    held_rad: f64,
}

impl Habit for Stiffening {
    fn acts(&mut self, view: &DriverView, torque_nm: f64) -> f64 {
        let [conflict, _] = self.shares.step(torque_nm, view.guidance_torque_nm);
        self.held_rad += weight(0.5) * (view.wheel_angle_rad - self.held_rad);
        let spring_nm = self.stiffness * (view.wheel_angle_rad - self.held_rad);
        torque_nm - conflict * (spring_nm + self.damping * view.wheel_rate_rad_per_s)
    }
}

pub(super) const KINDS: [Kind<dyn AnyDriver>; 6] = [
    Kind {
        name: "own_line",
        source: "ours",
        parameters: &[
            Parameter::ours("offset_m", 0.3, [-2.0, 2.0]),
            Parameter::ours("cut_m2", 0.0, [-500.0, 500.0]),
        ],
        make: Make::Around(|scenario, v, driver| {
            let road = scenario.course().centreline();
            around(
                driver,
                OwnLine {
                    road,
                    offset_m: v[0],
                    cut_m2: v[1],
                },
            )
        }),
    },
    Kind {
        name: "trust",
        source: "ours; Nikolaidis et al. 2017",
        parameters: &[
            Parameter::ours("k_hg", 0.5, [0.0, 1.0]),
            Parameter::ours("g_c", 0.5, [0.0, 5.0]),
            Parameter::ours("g_h", 0.5, [0.0, 5.0]),
            Parameter::ours("tau_s", 30.0, [0.1, 1000.0]),
            Parameter::ours("shock", 0.4, [0.0, 1.0]),
        ],
        make: Make::Around(|scenario, v, driver| {
            let habit = Trust {
                k_hg: v[0],
                gains: [v[1], v[2]],
                weight: weight(v[3]),
                shock: v[4],
                muscle: weight(scenario.driver().t_nms),
                shares: Shares::default(),
                felt_nm: 0.0,
                was_lost: false,
            };
            around(driver, habit)
        }),
    },
    Kind {
        name: "tiring",
        source: "ours",
        parameters: &[
            Parameter::ours("delay_s", 0.3, [0.0, 2.0]),
            Parameter::ours("loss", 0.3, [0.0, 1.0]),
            Parameter::ours("duration_s", 600.0, [1.0, 100_000.0]),
        ],
        make: Make::Around(|_, v, driver| {
            let habit = Tiring {
                delay_s: v[0],
                loss: v[1],
                duration_s: v[2],
                seen: VecDeque::new(),
            };
            around(driver, habit)
        }),
    },
    Kind {
        name: "lapses",
        source: "ours",
        parameters: &[
            Parameter::ours("every_s", 30.0, [0.1, 100_000.0]),
            Parameter::ours("lasts_s", 2.0, [0.0, 60.0]),
        ],
        make: Make::Around(|scenario, v, driver| {
            let habit = Lapses {
                per_step: STEP_S / v[0],
                lasts_steps: step_of(v[1]),
                random: Xoshiro256PlusPlus::seed_from_u64(named(
                    Stream::World.seed(scenario.seed()),
                    "lapses",
                )),
                lapse: None,
            };
            around(driver, habit)
        }),
    },
    Kind {
        name: "warning",
        source: "ours",
        parameters: &[Parameter::ours("answers", 1.0, [0.0, 1.0])],
        make: Make::Around(|_, v, driver| around(driver, Warning { answers: v[0] >= 0.5 })),
    },
    Kind {
        name: "stiffening",
        source: "ours",
        parameters: &[
            Parameter::ours("stiffness_nm_per_rad", 10.0, [0.0, 100.0]),
            Parameter::ours("damping_nm_s_per_rad", 0.5, [0.0, 10.0]),
        ],
        make: Make::Around(|_, v, driver| {
            let habit = Stiffening {
                stiffness: v[0],
                damping: v[1],
                shares: Shares::default(),
                held_rad: 0.0,
            };
            around(driver, habit)
        }),
    },
];
