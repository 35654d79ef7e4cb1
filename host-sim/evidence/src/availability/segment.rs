//! One segment: five minutes, one car, one road.

use haptic_core::safety::modes::Mode;
use haptic_sim::Scenario;
use haptic_sim::population::LaneKeeper;
use haptic_sim::scenario::{GuidanceParameters, Speed};
use haptic_sim::seeds::Stream;
use haptic_sim::simulation::{Ending, Run};
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};
use serde::{Deserialize, Serialize};

use super::drive::{by_hand, manual, with_ecu};
use super::roads::falling_and_rising;
use super::{CARS, Road, WorldKind};
use crate::declared::{Declaration, Reported};
use haptic_batch::StudyError;

/// Which segment.
#[derive(Debug, Clone, Copy)]
pub struct SegmentNumber {
    /// The world.
    pub world: &'static WorldKind,
    /// The road.
    pub road: &'static Road,
    /// Counted from zero; segments of one number share course, driver, car and noise.
    pub number: u32,
}

/// What a segment showed, as a line of a file holds it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveSegment {
    /// Name of the world.
    pub world: String,
    /// Name of the road.
    pub road: String,
    /// Which segment.
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
    /// The drive of the same car by hand, without guidance.
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

/// How a segment ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Ended {
    /// At its end.
    Whole,
    /// A fault that only a new power-up ends.
    Latched,
    /// Off the road.
    Diverged,
}

impl DriveSegment {
    /// Whether this driver leaves the road with this car by hand too: then the drive says nothing of guidance.
    pub fn is_lost_by_hand(&self) -> bool {
        self.by_hand.ended == Ended::Diverged
    }

    /// Whether the ECU left, or the vehicle left the road, with guidance or by hand.
    pub(super) fn shows_something(&self) -> bool {
        !self.declarations.is_empty() || self.ended != Ended::Whole || self.is_lost_by_hand()
    }

    /// Whether it is the segment of that number.
    pub fn is(&self, number: &SegmentNumber) -> bool {
        self.number == number.number && self.world == number.world.name && self.road == number.road.name
    }
}

impl SegmentNumber {
    /// The scenario of this segment.
    ///
    /// # Errors
    /// As [`haptic_sim::scenario::ScenarioBuilder::build`]; no built-in world meets one.
    pub fn scenario(&self, root: u64) -> Result<Scenario, StudyError> {
        let Self { world, road, number } = self;
        let named = road.name.bytes().fold(0_u64, |hash, byte| {
            hash.wrapping_mul(31).wrapping_add(byte.into())
        });
        let seed = Stream::Population
            .seed(root)
            // The number has the lower 32 bits, so that roads share no seed.
            .wrapping_add(named << 32)
            .wrapping_add((*number).into());
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        // A new draw goes behind all of these: each moves those that follow it, and so every published figure.
        let speed_kmh: f64 = rng.random_range(road.speed_kmh[0]..road.speed_kmh[1]);
        let driver = LaneKeeper::draw(&mut rng, road.remnant_sd_nm);
        // Noise of its own; 53 bits, so that any reader of JSON keeps it.
        let noise = rng.random::<u64>() >> 11;
        let lateral = world.lateral_m_per_s2().unwrap_or(road.lateral_m_per_s2);
        let course = road.course(speed_kmh / 3.6, lateral, world.surface(), &mut rng);
        // The same cars on every road and in every world.
        let car = (root << 16).wrapping_add((number % CARS).into());
        let speed = if world.changes_speed() {
            falling_and_rising(speed_kmh, &mut rng)
        } else {
            Speed::constant_kmh(speed_kmh)
        };
        let scenario = Scenario::builder().course(course).speed(speed);
        let scenario = world.on_its_column(scenario, GuidanceParameters::default());
        let scenario = driver
            .drives(scenario, speed_kmh / 3.6)
            .world(world.parameters())
            .tolerances(world.tolerances(car))
            .sensor_errors(world.sensor_errors())
            .seed(noise)
            .build()?;
        Ok(scenario)
    }

    /// Drives it alone, with the shipping ECU.
    ///
    /// # Errors
    /// As [`SegmentNumber::scenario`].
    pub fn drive(&self, root: u64) -> Result<DriveSegment, StudyError> {
        let scenario = self.scenario(root)?;
        let (run, reported) = with_ecu(&scenario, self.world.happens());
        let by_hand = ByHand::new(&by_hand(&manual(&scenario)?));
        Ok(self.segment(&scenario, &run, reported, by_hand))
    }

    /// What two drives showed.
    pub(super) fn segment(
        &self,
        scenario: &Scenario,
        run: &Run,
        reported: Reported,
        by_hand: ByHand,
    ) -> DriveSegment {
        let errors_m = || run.trace.samples.iter().map(|sample| sample.lateral_error_m);
        let samples = (run.trace.samples.len() as f64).max(1.0);
        let sum = |of: fn(f64) -> f64| errors_m().map(of).fold(0.0, |sum, x| sum + x);
        let mean_m = sum(|error_m| error_m) / samples;
        DriveSegment {
            world: self.world.name.into(),
            road: self.road.name.into(),
            number: self.number,
            car: scenario.tolerances().car.unwrap_or_default(),
            speed_kmh: scenario.speed_kmh(),
            driven_s: f64::from(run.steps) * 1e-3,
            active_s: f64::from(reported.active) * 1e-3,
            sdlp_m: (sum(|error_m| error_m * error_m) / samples - mean_m * mean_m)
                .max(0.0)
                .sqrt(),
            largest_error_m: largest_error_m(run),
            ended: match run.ending {
                _ if reported.mode == Mode::Fault => Ended::Latched,
                Ending::Diverged { .. } => Ended::Diverged,
                Ending::CourseEnd => Ended::Whole,
            },
            declarations: reported.declarations,
            by_hand,
        }
    }
}

impl ByHand {
    pub(super) fn new(run: &Run) -> Self {
        Self {
            ended: match run.ending {
                Ending::Diverged { .. } => Ended::Diverged,
                Ending::CourseEnd => Ended::Whole,
            },
            largest_error_m: largest_error_m(run),
        }
    }
}

/// Largest distance from the centreline, m.
fn largest_error_m(run: &Run) -> f64 {
    let samples = run.trace.samples.iter();
    samples
        .map(|sample| sample.lateral_error_m.abs())
        .fold(0.0, f64::max)
}
