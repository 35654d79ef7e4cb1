//! Hands, told from the motor: after how long a wheel that nobody holds is known, at one false warning in 100 h beside each kind of hand.
//!
//! A second in which the estimate of the hands' torque swings by more than a threshold, or is in the mean above [`HELD_NM`], is one in
//! which a hand is *felt*. A warning comes after so many seconds without; threshold and seconds are chosen on one half of the drives,
//! and what they do is told of the other.
//!
//! One false warning in 100 h is not counted but extrapolated: seconds without a felt hand follow each other as those of the longest
//! fifth of the stretches do. The false warnings that were counted stand beside it. Hands are models of our own choice: a spring and a
//! damper on a wheel, a weight, tremor and a slow wish to steer.

use std::f64::consts::{PI, TAU};

use haptic_core::controller::config::Config;
use haptic_core::observer::State;
use haptic_core::quantity::{Radians, Torque};
use haptic_engine::statistics::Confidence;
use haptic_engine::{Part, Plan, StudyError};
use haptic_sim::Scenario;
use haptic_sim::models::STEP_S;
use haptic_sim::models::nonlinear::WorldParameters;
use haptic_sim::models::torsion_bar::{BarPlant, ColumnParameters};
use haptic_sim::parts::{Acting, Vehicle};
use haptic_sim::seeds;
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;

use super::{ColumnFile, Rate, believed, hands_torque, no_observer};

/// A larger mean torque is that of a hand: it is above the offset of a sensor.
pub const HELD_NM: f64 = 0.35;
/// How often a warning may be false, hours.
pub const FALSE_IN_H: f64 = 100.0;
/// Longest time to a warning that counts as told, s.
pub const LONGEST_S: f64 = 600.0;
/// Root of the drives' random numbers.
const SEED: u64 = 45_004;
const SPEED_M_PER_S: f64 = 60.0 / 3.6;
/// Thresholds of the swing of a second, N.m: from below a sensor's noise to a hand that steers.
const THRESHOLDS: usize = 28;

fn threshold_nm(k: usize) -> f64 {
    0.01 * 10_f64.powf(k as f64 / 14.0)
}

/// What is at the wheel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Hand {
    /// Nothing.
    None,
    /// Two fingers.
    Touch,
    /// An arm that lies on it and does nothing.
    Resting,
    /// A hand that steers.
    Steering,
}

impl Hand {
    /// All; the first is none.
    pub const ALL: [Self; 4] = [Self::None, Self::Touch, Self::Resting, Self::Steering];

    /// Stiffness (N.m/rad), damping (N.m.s/rad), weight, standard deviations of tremor and of what it wants (N.m).
    const fn model(self) -> [f64; 5] {
        match self {
            Self::None => [0.0; 5],
            Self::Touch => [0.2, 0.05, 0.0, 0.015, 0.0],
            Self::Resting => [1.0, 0.3, 0.2, 0.03, 0.0],
            Self::Steering => [3.0, 0.4, 0.0, 0.05, 0.5],
        }
    }
}

/// What the motor and the road do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Scene {
    /// Guidance of 0.15 N.m rms and the probe.
    Straight,
    /// Guidance and probe of a straight, and 1.5 N.m that come and go in 20 s.
    Bends,
    /// Bends on a rough road with a pothole in 5 s, which kick back through the aligning torque.
    Bumps,
}

impl Scene {
    /// All.
    pub const ALL: [Self; 3] = [Self::Straight, Self::Bends, Self::Bumps];
}

/// Who says what the hands' torque is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Eye {
    /// The bar's own reading, without an observer.
    Bar,
    /// The observer with an angle of the column in steps (degrees) at a rate, its bandwidth (rad/s), and the share of J_w that it
    /// believes in.
    Observer {
        /// Step of the angle.
        step_deg: f64,
        /// How often it comes.
        rate: Rate,
        /// Bandwidth.
        bandwidth: f64,
        /// Believed J_w over the true one.
        j_w_share: f64,
    },
}

const FINE: Eye = Eye::Observer {
    step_deg: 0.02,
    rate: Rate::EveryStep,
    bandwidth: 100.0,
    j_w_share: 1.0,
};
const COARSE: Eye = Eye::Observer {
    step_deg: 0.1,
    rate: Rate::Camera,
    bandwidth: 60.0,
    j_w_share: 1.0,
};
const LIGHT_WHEEL: Eye = Eye::Observer {
    step_deg: 0.02,
    rate: Rate::EveryStep,
    bandwidth: 100.0,
    j_w_share: 0.7,
};

/// A wheel on a bar: what it has in the place of the file's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Wheel {
    /// J_w, kg.m2.
    pub j_w_kg_m2: f64,
    /// K_tb, N.m/rad.
    pub k_tb_nm_per_rad: f64,
}

/// A drive of some hours.
#[derive(Debug, Clone, Copy)]
pub struct Case {
    wheel: usize,
    scene: Scene,
    hand: Hand,
    /// Whether it is of the half that thresholds are chosen on.
    chooses: bool,
}

/// The seconds of a drive, by eye: swing and mean of what it says, N.m.
pub type Driven = Vec<Vec<[f64; 2]>>;

/// A wheel, a scene, an eye and a kind of hand.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The wheel.
    pub wheel: Wheel,
    /// The scene.
    pub scene: Scene,
    /// The eye.
    pub eye: Eye,
    /// The hand that no warning may come beside.
    pub hand: Hand,
    /// How soon a wheel without hands is warned of; none where the eye does not tell it from that hand.
    pub told: Option<Told>,
}

/// How a hand is told from none.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Told {
    /// Threshold, N.m.
    pub threshold_nm: f64,
    /// After so many seconds without a felt hand there is a warning: those for one false one in [`FALSE_IN_H`], and the ends of
    /// their interval, of the study's level.
    pub after_s: [f64; 3],
    /// Median time from letting go to the warning, s; none where most stretches end before.
    pub warned_s: Option<f64>,
    /// False warnings in the drives of the other half with that hand.
    pub counted: u32,
}

/// Seconds in which a hand is felt, as shares of all: without a hand, and with one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Roc {
    /// The scene.
    pub scene: Scene,
    /// The hand.
    pub hand: Hand,
    /// Both shares by threshold.
    pub points: Vec<[f64; 2]>,
}

/// What came of all.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Results {
    /// The assist.
    pub curve: &'static str,
    /// Hours of each drive; each kind of hand has two in each scene with each wheel.
    pub hours: f64,
    /// How soon.
    pub rows: Vec<Row>,
    /// The file's wheel by the finer observer.
    pub roc: Vec<Roc>,
    /// How often intervals hold.
    #[serde(skip_serializing_if = "Confidence::is_usual")]
    pub level: Confidence,
}

/// The study, of a column.
#[derive(Debug, Clone)]
pub struct Study {
    /// The column and its assist.
    pub file: ColumnFile,
    /// Hours of each drive.
    pub hours: f64,
    /// How often intervals hold.
    pub level: Confidence,
}

/// A white noise through a lag: its standard deviation and time constant.
struct Noise {
    value: f64,
    sd: f64,
    keeps: f64,
}

impl Noise {
    fn new(sd: f64, time_s: f64) -> Self {
        let keeps = (-STEP_S / time_s).exp();
        Self {
            value: 0.0,
            sd,
            keeps,
        }
    }

    fn next(&mut self, random: &mut Xoshiro256PlusPlus) -> f64 {
        let white: f64 = StandardNormal.sample(random);
        self.value = self.keeps * self.value + self.sd * (1.0 - self.keeps * self.keeps).sqrt() * white;
        self.value
    }
}

/// Sums of a second.
#[derive(Clone, Copy, Default)]
struct Second([f64; 2]);

impl Second {
    /// Swing (standard deviation) and mean.
    fn of(self) -> [f64; 2] {
        let [sum, squares] = self.0.map(|x| x / 1000.0);
        [(squares - sum * sum).max(0.0).sqrt(), sum]
    }
}

/// What drives a wheel without looking at a road.
struct Bench {
    plant: BarPlant,
    scene: Scene,
    hand: Hand,
    random: Xoshiro256PlusPlus,
    guidance: Noise,
    rough: Noise,
    tremor: Noise,
    wish: Noise,
    /// Where the hand's spring holds the wheel, rad.
    held_rad: f64,
    /// The pothole that is under the wheel: its torque (N.m), and steps until it is passed.
    hole: (f64, u32),
    step: u32,
}

/// Steps of a pothole.
const HOLE_STEPS: u32 = 30;

impl Bench {
    fn new(plant: BarPlant, case: &Case, seed: u64) -> Self {
        let [_, _, _, tremor, wish] = case.hand.model();
        Self {
            plant,
            scene: case.scene,
            hand: case.hand,
            random: Xoshiro256PlusPlus::seed_from_u64(seed),
            guidance: Noise::new(0.15, 0.5),
            rough: Noise::new(0.3, 0.01),
            tremor: Noise::new(tremor, 0.02),
            wish: Noise::new(wish, 1.0),
            held_rad: 0.0,
            hole: (0.0, 0),
            step: 0,
        }
    }

    fn kick_nm(&mut self) -> f64 {
        if self.scene != Scene::Bumps {
            return 0.0;
        }
        let rough = self.rough.next(&mut self.random);
        if self.hole.1 == 0 {
            if self.random.random::<f64>() < STEP_S / 5.0 {
                let size = 2.0 + 6.0 * self.random.random::<f64>();
                let side = if self.random.random() { 1.0 } else { -1.0 };
                self.hole = (side * size, HOLE_STEPS);
            }
            return rough;
        }
        self.hole.1 -= 1;
        rough + self.hole.0 * (PI * f64::from(self.hole.1) / f64::from(HOLE_STEPS)).sin()
    }

    fn advance(&mut self) {
        let t = f64::from(self.step) * STEP_S;
        let bend = match self.scene {
            Scene::Straight => 0.0,
            Scene::Bends | Scene::Bumps => 1.5 * (TAU * 0.05 * t).sin(),
        };
        let guidance_nm = bend + self.guidance.next(&mut self.random) + 0.2 * (TAU * 2.5 * t).sin();
        let [stiffness, damping, weight, ..] = self.hand.model();
        let motion = self.plant.motion();
        // A grip follows the wheel in some seconds.
        self.held_rad += (motion.wheel_angle_rad - self.held_rad) * STEP_S / 2.0;
        let beside = self.tremor.next(&mut self.random) + self.wish.next(&mut self.random);
        let hands_nm = stiffness * (self.held_rad - motion.wheel_angle_rad)
            - damping * motion.wheel_rate_rad_per_s
            + weight
            + beside;
        self.plant.kick_nm = self.kick_nm();
        self.plant.step(&Acting {
            driver_torque_nm: hands_nm,
            guidance_torque_nm: guidance_nm,
            speed_m_per_s: [SPEED_M_PER_S; 2],
            bank_rad: 0.0,
        });
        self.step += 1;
    }
}

impl Study {
    /// The file's wheel, and others of usual practice.
    fn wheels(&self) -> [Wheel; 5] {
        let ColumnParameters {
            j_w_kg_m2,
            k_tb_nm_per_rad,
            ..
        } = self.file.column;
        let wheel = |j_w_kg_m2, k_tb_nm_per_rad| Wheel {
            j_w_kg_m2,
            k_tb_nm_per_rad,
        };
        [
            wheel(j_w_kg_m2, k_tb_nm_per_rad),
            wheel(j_w_kg_m2, 86.0),
            wheel(j_w_kg_m2, 172.0),
            wheel(0.03, k_tb_nm_per_rad),
            wheel(0.05, k_tb_nm_per_rad),
        ]
    }

    /// The file's wheel is looked at by all eyes, the others by one.
    fn eyes(wheel: usize) -> &'static [Eye] {
        const ALL: [Eye; 4] = [FINE, COARSE, LIGHT_WHEEL, Eye::Bar];
        if wheel == 0 { &ALL } else { &ALL[..1] }
    }

    /// Wheels and scenes: the file's in all, the others on bumps.
    fn places(&self) -> Vec<(usize, Scene)> {
        let own = Scene::ALL.map(|scene| (0, scene));
        let others = (1..self.wheels().len()).map(|wheel| (wheel, Scene::Bumps));
        own.into_iter().chain(others).collect()
    }

    /// Drives a case.
    ///
    /// # Errors
    /// A column that cannot be, or that the observer cannot be set up for.
    pub fn driven(&self, case: &Case) -> Result<Driven, StudyError> {
        let wheel = self.wheels()[case.wheel];
        let mut file = self.file.clone();
        (file.column.j_w_kg_m2, file.column.k_tb_nm_per_rad) = (wheel.j_w_kg_m2, wheel.k_tb_nm_per_rad);
        let world = WorldParameters {
            motor_ripple_nm: 0.05,
            ..WorldParameters::default()
        };
        let seed = seeds::named(SEED, &format!("{case:?}"));
        let scenario = file.with(Scenario::builder().world(world).seed(seed)).build()?;
        let plant = BarPlant::new(&scenario).with_assist(file.one_curve().1.assist());
        let mut bench = Bench::new(plant, case, seed);
        let eyes = Self::eyes(case.wheel);
        let mut observers = Vec::new();
        for eye in eyes {
            observers.push(match *eye {
                Eye::Bar => None,
                Eye::Observer {
                    step_deg,
                    rate,
                    bandwidth,
                    j_w_share,
                } => {
                    let mut of = believed(&file, 1.0 / rate.hz(), bandwidth);
                    of.wheel_inertia_kg_m2 *= j_w_share;
                    let config = Config::new(&of).map_err(no_observer)?;
                    Some((config, State::NEW, step_deg.to_radians(), rate))
                }
            });
        }
        let mut driven: Driven = vec![Vec::new(); eyes.len()];
        // The first second settles.
        for second in 0..=(3600.0 * self.hours) as u32 {
            let mut sums = vec![Second::default(); eyes.len()];
            for _ in 0..1000 {
                let (bar_nm, column_rad) = (bench.plant.sensor_torque_nm(), bench.plant.column_angle_rad());
                for (observer, Second(sums)) in observers.iter_mut().zip(&mut sums) {
                    let says_nm = match observer {
                        None => bar_nm,
                        Some((config, state, step_rad, rate)) => {
                            let sampled = rate.samples(bench.step);
                            let seen = (column_rad / *step_rad).round() * *step_rad;
                            let angle = sampled.then(|| Radians::from_rad(seen));
                            let bar_torque = Torque::from_nm(bar_nm);
                            hands_torque(config, state, bar_torque, angle).nm()
                        }
                    };
                    sums[0] += says_nm;
                    sums[1] += says_nm * says_nm;
                }
                bench.advance();
            }
            if second > 0 {
                for (seconds, sums) in driven.iter_mut().zip(sums) {
                    seconds.push(sums.of());
                }
            }
        }
        Ok(driven)
    }
}

impl haptic_engine::Study for Study {
    type Case = Case;
    type Row = Driven;
    type Results = Results;

    fn plan(&self) -> Result<Plan<Case>, StudyError> {
        let mut cases = Vec::new();
        for (wheel, scene) in self.places() {
            for hand in Hand::ALL {
                cases.extend([true, false].map(|chooses| Case {
                    wheel,
                    scene,
                    hand,
                    chooses,
                }));
            }
        }
        Ok(Plan::one_by_one(cases))
    }

    fn drive(&self, part: &Part<'_, Case, Driven>) -> Result<Vec<Driven>, StudyError> {
        part.one_by_one(|case| self.driven(case))
    }

    fn summarise(&self, cases: Vec<Case>, driven: Vec<Driven>) -> Result<Results, StudyError> {
        let (wheels, mut rows, mut roc) = (self.wheels(), Vec::new(), Vec::new());
        for (wheel, scene) in self.places() {
            for (k, eye) in Self::eyes(wheel).iter().enumerate() {
                let of = |hand, chooses| {
                    let is = |case: &Case| {
                        (case.wheel, case.scene, case.hand, case.chooses) == (wheel, scene, hand, chooses)
                    };
                    cases.iter().position(is).map_or(&[][..], |at| &driven[at][k][..])
                };
                for hand in Hand::ALL.into_iter().skip(1) {
                    let none = [true, false].map(|chooses| of(Hand::None, chooses));
                    let hands = [true, false].map(|chooses| of(hand, chooses));
                    rows.push(Row {
                        wheel: wheels[wheel],
                        scene,
                        eye: *eye,
                        hand,
                        told: told(none, hands, self.hours, self.level),
                    });
                    if (wheel, k) == (0, 0) {
                        let share = |seconds: &[[f64; 2]], threshold| {
                            let felt = seconds.iter().filter(|second| is_felt(second, threshold)).count();
                            felt as f64 / seconds.len().max(1) as f64
                        };
                        let points = (0..THRESHOLDS).map(threshold_nm);
                        let points = points.map(|nm| [none[1], hands[1]].map(|seconds| share(seconds, nm)));
                        roc.push(Roc {
                            scene,
                            hand,
                            points: points.collect(),
                        });
                    }
                }
            }
        }
        Ok(Results {
            curve: self.file.one_curve().0,
            hours: self.hours,
            rows,
            roc,
            level: self.level,
        })
    }
}

fn is_felt(second: &[f64; 2], threshold_nm: f64) -> bool {
    second[0] > threshold_nm || second[1].abs() > HELD_NM
}

/// Lengths of the stretches without a felt hand, s.
fn stretches(seconds: &[[f64; 2]], threshold_nm: f64) -> Vec<u32> {
    let mut found = vec![0];
    for second in seconds {
        match (is_felt(second, threshold_nm), found.last_mut()) {
            (false, Some(last)) => *last += 1,
            (true, Some(last)) if *last > 0 => found.push(0),
            _ => {}
        }
    }
    found.retain(|length| *length > 0);
    found
}

/// Seconds without a felt hand that come once in [`FALSE_IN_H`] beside a hand, with the ends of their interval. The longest fifth of the
/// stretches goes on from second to second with one probability; one more of each kind than was seen, as none is seen too easily.
pub fn timer_s(seconds: &[[f64; 2]], threshold_nm: f64, hours: f64, level: Confidence) -> [f64; 3] {
    let mut lengths = stretches(seconds, threshold_nm);
    lengths.sort_unstable();
    let from = lengths.get(lengths.len() * 4 / 5).map_or(1, |length| *length);
    let beyond: Vec<u32> = lengths
        .iter()
        .filter(|length| **length >= from)
        .map(|length| length - from)
        .collect();
    let (goes_on, ends) = (
        1.0 + f64::from(beyond.iter().sum::<u32>()),
        1.0 + beyond.len() as f64,
    );
    let share = goes_on / (goes_on + ends);
    let half = level.normal() * (share * (1.0 - share) / (goes_on + ends)).sqrt();
    let starts_in_100_h = FALSE_IN_H * ends / hours;
    [share, share - half, share + half].map(|share| {
        // A share of 1 never ends, one of 0 at once.
        let share = share.clamp(1e-6, 1.0 - 1e-6);
        f64::from(from) + (starts_in_100_h.ln() / -share.ln()).max(0.0).ceil()
    })
}

/// Median time to a warning without a hand, s, from any second on; none where more than half have none to the drive's end.
fn warned_s(seconds: &[[f64; 2]], threshold_nm: f64, after_s: f64) -> Option<f64> {
    let wait = |from: usize| {
        let mut still = 0.0;
        for (passed, second) in seconds[from..].iter().enumerate() {
            still = if is_felt(second, threshold_nm) {
                0.0
            } else {
                still + 1.0
            };
            if still >= after_s {
                return passed as f64 + 1.0;
            }
        }
        f64::INFINITY
    };
    // Letting go in the last sixth would be cut by the end.
    let mut waits: Vec<f64> = (0..seconds.len() * 5 / 6).step_by(7).map(wait).collect();
    waits.sort_by(f64::total_cmp);
    waits
        .get(waits.len() / 2)
        .copied()
        .filter(|wait| wait.is_finite())
}

/// The threshold with the soonest warning on the first of both halves, and what it does on the second.
fn told(none: [&[[f64; 2]]; 2], hands: [&[[f64; 2]]; 2], hours: f64, level: Confidence) -> Option<Told> {
    let on_first = |k: usize| {
        let after_s = timer_s(hands[0], threshold_nm(k), hours, level);
        let warned = warned_s(none[0], threshold_nm(k), after_s[0])?;
        (after_s[0] <= LONGEST_S).then_some((warned, threshold_nm(k), after_s))
    };
    let best = (0..THRESHOLDS)
        .filter_map(on_first)
        .min_by(|a, b| a.0.total_cmp(&b.0));
    best.map(|(_, threshold_nm, after_s)| Told {
        threshold_nm,
        after_s,
        warned_s: warned_s(none[1], threshold_nm, after_s[0]),
        counted: stretches(hands[1], threshold_nm)
            .into_iter()
            .filter(|length| f64::from(*length) >= after_s[0])
            .count() as u32,
    })
}
