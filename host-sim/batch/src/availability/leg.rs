//! One leg: five minutes, one car, one road.

use haptic_core::bus::e2e::ReceiverState;
use haptic_core::bus::messages::{Guidance as GuidanceMessage, Message};
use haptic_core::faults::{Fault, FaultSet};
use haptic_core::modes::Mode;
use haptic_sim::guidance::{NoGuidance, OverBus};
use haptic_sim::models::driver::{ArmGains, DriverParameters};
use haptic_sim::scenario::Speed;
use haptic_sim::seeds::Stream;
use haptic_sim::simulation::Ending;
use haptic_sim::{Action, Outcome, Scenario, Simulation};
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};
use serde::{Deserialize, Serialize};

use super::roads::falling_and_rising;
use super::{CARS, LEG_S, Road, WorldKind};

/// The driver asks for guidance again so long after it has left, ms.
const AGAIN_MS: u32 = 5000;
/// A request that was not granted is taken back for 100 ms in every second.
const ASKS_EVERY_MS: u32 = 1000;
const LOW_MS: u32 = 100;
/// Corner of the driver's remnant, Hz: lane keeping wanders slowly.
const REMNANT_CORNER_HZ: f64 = 0.1;

/// Which leg.
#[derive(Debug, Clone, Copy)]
pub struct LegNumber {
    /// The world.
    pub world: &'static WorldKind,
    /// The road.
    pub road: &'static Road,
    /// Counted from zero; legs of one number share course, driver, car and noise.
    pub number: u32,
}

/// What a leg showed, as a line of a file holds it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Leg {
    /// Name of the world.
    pub world: String,
    /// Name of the road.
    pub road: String,
    /// Which leg.
    pub number: u32,
    /// Which car.
    pub car: u64,
    /// How fast at the start, km/h; nowhere faster.
    pub speed_kmh: f64,
    /// How long, s.
    pub driven_s: f64,
    /// How long with guidance, s.
    pub active_s: f64,
    /// Standard deviation of the lateral position, m.
    pub sdlp_m: f64,
    /// Largest lateral error, m.
    pub largest_error_m: f64,
    /// How it ended.
    pub ended: Ended,
    /// What took guidance away.
    pub declarations: Vec<Declaration>,
    /// The same drive without guidance.
    pub by_hand: ByHand,
}

/// A drive by hand: the same driver, car, road, wind and noise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ByHand {
    /// How it ended.
    pub ended: Ended,
    /// Largest lateral error, m.
    pub largest_error_m: f64,
}

/// How a leg ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Ended {
    /// At its end.
    Whole,
    /// With a fault that only a new power-up ends.
    Latched,
    /// Off the road.
    Diverged,
}

/// Guidance left although nothing was wrong.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Declaration {
    /// When, s after the start of the leg.
    pub time_s: f64,
    /// The faults that the ECU named, joined by a plus.
    pub faults: String,
    /// Lateral acceleration of the road there, m/s2, left positive.
    pub lateral_m_per_s2: f64,
}

impl Leg {
    /// Whether this driver leaves the road with this car by hand too: then the drive says nothing of guidance.
    pub fn is_lost_by_hand(&self) -> bool {
        self.by_hand.ended == Ended::Diverged
    }

    /// Whether the ECU left, or the vehicle left the road, with guidance or by hand.
    pub(super) fn shows_something(&self) -> bool {
        !self.declarations.is_empty() || self.ended != Ended::Whole || self.is_lost_by_hand()
    }

    /// Whether it is the leg of that number.
    pub fn is(&self, number: &LegNumber) -> bool {
        self.number == number.number && self.world == number.world.name && self.road == number.road.name
    }
}

impl LegNumber {
    /// The scenario of this leg.
    ///
    /// # Errors
    /// As [`haptic_sim::scenario::ScenarioBuilder::build`]; no built-in world meets one.
    pub fn scenario(&self, root: u64) -> Result<Scenario, String> {
        let Self { world, road, number } = self;
        let named = road.name.bytes().fold(0_u64, |hash, byte| {
            hash.wrapping_mul(31).wrapping_add(byte.into())
        });
        let seed = Stream::Population
            .seed(root)
            .wrapping_add(named << 32)
            .wrapping_add((*number).into());
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let speed_kmh: f64 = rng.random_range(road.speed_kmh[0]..road.speed_kmh[1]);
        let t_p = rng.random_range(0.1..0.3);
        let reliance: f64 = rng.random();
        // Noise of its own; 53 bits, so that any reader of JSON keeps it.
        let noise = rng.random::<u64>() >> 11;
        let lateral = world.lateral_m_per_s2().unwrap_or(road.lateral_m_per_s2);
        let course = road.course(speed_kmh / 3.6, lateral, world.surface(), &mut rng);
        let car = (root << 16).wrapping_add((number % CARS).into());
        let speed = if world.changes_speed() {
            falling_and_rising(speed_kmh, &mut rng)
        } else {
            Speed::Constant(speed_kmh)
        };
        let scenario = Scenario::builder()
            .course(course)
            .speed(speed)
            .driver(DriverParameters {
                t_p,
                remnant_sd_nm: road.remnant_sd_nm,
                remnant_corner_hz: REMNANT_CORNER_HZ,
                ..COMPETENT()
            })
            .gains(arm(speed_kmh / 3.6, reliance))
            .world(world.parameters())
            .tolerances(world.tolerances(car))
            .sensor_errors(world.sensor_errors())
            .seed(noise)
            .build()?;
        Ok(scenario)
    }

    /// Drives it.
    ///
    /// # Errors
    /// As [`LegNumber::scenario`].
    pub fn drive(&self, root: u64) -> Result<Leg, String> {
        let scenario = self.scenario(root)?;
        let mut simulation = Simulation::with(&scenario, OverBus::new(scenario.setup()));
        let mut watch = Watch::new();
        while watch.steps < (LEG_S * 1e3) as u32 && watch.mode != Mode::Fault {
            let action = watch.action();
            let Some(outcome) = simulation.step(&action) else {
                break;
            };
            watch.observe(&outcome);
        }
        let ended = match simulation.ending() {
            _ if watch.mode == Mode::Fault => Ended::Latched,
            Some(Ending::Diverged { .. }) => Ended::Diverged,
            _ => Ended::Whole,
        };
        let samples = watch.samples.max(1.0);
        let mean_m = watch.sum_m / samples;
        Ok(Leg {
            world: self.world.name.into(),
            road: self.road.name.into(),
            number: self.number,
            car: scenario.tolerances().car.unwrap_or_default(),
            speed_kmh: scenario.speed_kmh(),
            driven_s: f64::from(watch.steps) * 1e-3,
            active_s: f64::from(watch.active) * 1e-3,
            sdlp_m: (watch.squares_m2 / samples - mean_m * mean_m).max(0.0).sqrt(),
            largest_error_m: watch.largest_m,
            ended,
            declarations: watch.declarations,
            by_hand: by_hand(&scenario),
        })
    }
}

fn by_hand(scenario: &Scenario) -> ByHand {
    let mut simulation = Simulation::with(scenario, NoGuidance);
    let mut largest_error_m = 0.0_f64;
    while simulation.steps() < (LEG_S * 1e3) as u32 {
        let Some(outcome) = simulation.step(&Action::default()) else {
            break;
        };
        if let Some(sample) = outcome.sample {
            largest_error_m = largest_error_m.max(sample.lateral_error_m.abs());
        }
    }
    let ended = match simulation.ending() {
        Some(Ending::Diverged { .. }) => Ended::Diverged,
        _ => Ended::Whole,
    };
    ByHand {
        ended,
        largest_error_m,
    }
}

/// A driver who keeps the lane in a real car. The paper's hold the wheel so loosely (1 N.m/rad) that the friction of a
/// column alone carries them metres aside at 120 km/h; hands that steer hold it several times stiffer and answer sooner.
const COMPETENT: fn() -> DriverParameters = || DriverParameters {
    a_1: 0.2,
    k_nms: 5.0,
    t_nms: 0.05,
    ..DriverParameters::default()
};

/// The arm of a driver who has learnt what the wheel asks for at an angle: it grows with v^2/(1 + K*v^2), K the stability
/// factor of table 9, and so does the driver's stiffness, which the paper gives for 60 km/h.
fn arm(v_m_per_s: f64, reliance: f64) -> ArmGains {
    const STABILITY_S2_PER_M2: f64 = 0.00175;
    let heaviness = |v: f64| v * v / (1.0 + STABILITY_S2_PER_M2 * v * v);
    let heavier = (heaviness(v_m_per_s) / heaviness(60.0 / 3.6) - 1.0).max(0.0);
    ArmGains {
        k_d: (5.0 - reliance) * (1.0 + 1.5 * heavier) - 1.0,
        k_hg: 1.0 - reliance,
    }
}

/// Driver, host and listener of a leg.
struct Watch {
    receiver: ReceiverState,
    mode: Mode,
    faults: FaultSet,
    /// Steps since guidance left; none while it is there.
    away: Option<u32>,
    steps: u32,
    active: u32,
    /// Lateral acceleration of the road, left positive.
    lateral_m_per_s2: f64,
    samples: f64,
    sum_m: f64,
    squares_m2: f64,
    largest_m: f64,
    declarations: Vec<Declaration>,
}

impl Watch {
    fn new() -> Self {
        Self {
            receiver: ReceiverState::TRUSTED,
            mode: Mode::Active,
            faults: FaultSet::NONE,
            away: None,
            steps: 0,
            active: 0,
            lateral_m_per_s2: 0.0,
            samples: 0.0,
            sum_m: 0.0,
            squares_m2: 0.0,
            largest_m: 0.0,
            declarations: Vec::new(),
        }
    }

    /// What driver and host do next.
    fn action(&self) -> Action {
        let engage = match self.away {
            None => true,
            // A handover goes on while the request stays.
            Some(_) if self.mode != Mode::Standby => true,
            Some(away) => away >= AGAIN_MS && away % ASKS_EVERY_MS >= LOW_MS,
        };
        Action {
            engage: Some(engage),
            ..Action::default()
        }
    }

    fn observe(&mut self, outcome: &Outcome) {
        self.steps += 1;
        if let Some(sample) = outcome.sample {
            let v = sample.speed_m_per_s;
            self.lateral_m_per_s2 = sample.curvature_1pm * v * v;
            let error_m = sample.lateral_error_m;
            self.samples += 1.0;
            self.sum_m += error_m;
            self.squares_m2 += error_m * error_m;
            self.largest_m = self.largest_m.max(error_m.abs());
        }
        let frame = outcome.frames_out.first();
        let guidance = frame.and_then(|frame| GuidanceMessage::decode(&mut self.receiver, frame).ok());
        if let Some(guidance) = guidance {
            if self.mode == Mode::Active && guidance.mode != Mode::Active {
                let named = guidance.faults.without(self.faults);
                self.declarations.push(Declaration {
                    time_s: outcome.time_s(),
                    faults: names(if named == FaultSet::NONE {
                        guidance.faults
                    } else {
                        named
                    }),
                    lateral_m_per_s2: self.lateral_m_per_s2,
                });
            }
            (self.mode, self.faults) = (guidance.mode, guidance.faults);
        }
        if self.mode == Mode::Active {
            (self.active, self.away) = (self.active + 1, None);
        } else {
            self.away = Some(self.away.map_or(0, |away| away + 1));
        }
    }
}

fn names(faults: FaultSet) -> String {
    let named: Vec<String> = Fault::ALL
        .into_iter()
        .filter(|fault| faults.contains(*fault))
        .map(|fault| format!("{fault:?}"))
        .collect();
    if named.is_empty() {
        return "none named".into();
    }
    named.join("+")
}
