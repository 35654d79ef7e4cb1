//! Every law against every driver: roads, speeds, seeds and failures, from one file.
//!
//! Each law is tuned first until its objective stops moving ([`Tuning`]), and judged on drives with other seeds. A unit ([`Unit`]) draws
//! the same road, remnant, wind and sensor noise for every law, so that laws are compared pair by pair. Each judged drive is the trunk of its
//! failures: at every instant a copy of the loop goes on without the torque, or without the lane. What each law trades for what is its
//! *front*: of the sets that tuning tried, those that no other beats in peak, effort and conflict, driven again where laws are judged.
//!
//! - [`Compare::load`]: the file, checked; [`Kinds`]: the laws and drivers that it may name, with those of one's own.
//! - [`Compare::run`]: tuned, driven, summed up ([`CompareResults`]).
//!
//! Not here: the laws and drivers (`haptic_sim::laws`, `haptic_sim::drivers`).

mod days;
mod drive;
mod file;
mod front;
mod results;
#[cfg(test)]
mod tests;
mod tune;

use std::ops::Range;
use std::path::Path;

use haptic_sim::drivers::AnyDriver;
use haptic_sim::input::InputError;
use haptic_sim::laws::Law;

use crate::engine::{StudyError, Watch, each};
use crate::files::Source;
use crate::places::{Drives, seed_of};
use crate::statistics::Confidence;

pub use crate::engine::{Faults, on_threads};
pub use crate::metrics::{METRICS, Metric};
pub use crate::parts::{Chosen, Kinds};
pub use crate::places::Unit;
pub use crate::statistics::Mean;
pub use days::Adapted;
pub use drive::Driven;
pub use front::FrontPoint;
pub use results::{Cell, CompareResults, DriveRow, LawResult, Ratio};
pub use tune::TunedBy;

/// How laws are tuned.
#[derive(Debug, Clone)]
pub struct Tuning {
    /// Most sets of parameters that are tried for a law, the untuned one included.
    pub budget: u32,
    /// A law's tuning ends when two rounds of sets together cannot have lowered its objective by more than this share: the upper end of the
    /// interval.
    pub settles: f64,
    /// Most sets of a law's front.
    pub front: u32,
    /// What each is tried on, with every driver.
    pub drives: Drives,
    /// Weights of the metrics in the objective, in the order of [`METRICS`].
    pub weights: Vec<f64>,
}

/// A comparison, checked.
pub struct Compare<'k> {
    /// Its name.
    pub name: String,
    /// Root of all seeds.
    pub seed: u64,
    /// The laws; the first is what the others are held against.
    pub laws: Vec<Chosen<'k, dyn Law>>,
    /// The drivers.
    pub drivers: Vec<Chosen<'k, dyn AnyDriver>>,
    /// What is judged: the places of each world, one behind the other.
    pub judged: Drives,
    /// Names of the worlds; one without a name if the file has none.
    pub worlds: Vec<String>,
    /// How many days drivers who adapt have driven in each world before they are judged.
    pub days: Vec<u32>,
    /// Drivers without guidance, if they are published, and where.
    pub by_hand: Vec<Option<(Chosen<'k, dyn AnyDriver>, &'static str)>>,
    /// Whether the drivers are a sample of those that are meant: then means over drivers have intervals over drivers.
    pub drivers_are_a_sample: bool,
    /// Which laws are tuned for each driver by itself: what who knows the driver could choose.
    pub oracles: Vec<bool>,
    /// How laws are tuned first, if they are.
    pub tuning: Option<Tuning>,
    /// What fails.
    pub faults: Faults,
    /// How often intervals hold what they are of.
    pub level: Confidence,
}

/// Values of a law's parameters, and who drives with them.
#[derive(Debug, Clone, PartialEq)]
struct Set {
    law: usize,
    values: Vec<f64>,
    drivers: Range<usize>,
}

/// What sets are driven for.
#[derive(Clone, Copy)]
enum Stage<'a> {
    /// On the training drives, whose drivers have not adapted yet, without failures.
    Tuning(&'a Drives),
    /// On the judged drives, by drivers who stand where their days left them.
    Judged(&'a [Option<Adapted>], Faults),
}

/// Each set with each of its drivers.
fn pairs(sets: &[Set]) -> impl Iterator<Item = (&Set, usize)> {
    sets.iter()
        .flat_map(|set| set.drivers.clone().map(move |driver| (set, driver)))
}

impl<'k> Compare<'k> {
    /// Reads a file and checks it. Courses are found beside it.
    ///
    /// # Errors
    /// The file, the field, its value and its range.
    pub fn load(path: &Path, kinds: &'k Kinds) -> Result<Self, InputError> {
        let (source, text) = Source::open(path)?;
        file::from_text(&source, &text, kinds)
    }

    /// Tunes, drives and sums up, on all cores.
    ///
    /// # Errors
    /// As [`haptic_sim::scenario::ScenarioBuilder::build`] for a driver's parameters.
    pub fn run(&self, watch: &Watch<'_>) -> Result<CompareResults, StudyError> {
        let tuned = tune::tune(self, watch)?;
        let drivers = self.drivers.len();
        let set = |law: usize, driver: usize| Set {
            law,
            values: tuned[law].values[driver].clone(),
            drivers: driver..driver + 1,
        };
        let sets = (0..self.laws.len()).flat_map(|law| (0..drivers).map(move |driver| (law, driver)));
        let sets: Vec<Set> = sets.map(|(law, driver)| set(law, driver)).collect();
        let adapted = self.behind_days(&sets, watch)?;
        let driven = self.drive(&sets, Stage::Judged(&adapted, self.faults), watch)?;
        let front = front::fronts(self, &tuned, &driven, watch)?;
        Ok(results::sum_up(self, tuned, &driven, front, adapted))
    }

    /// How many units are judged.
    fn units(&self) -> usize {
        self.judged.units(self.worlds.len())
    }

    /// Whether a law is no guidance.
    fn is_none(&self, law: usize) -> bool {
        self.laws[law].kinds() == "none"
    }

    /// Drives each set with its drivers, at each place, with each seed.
    fn drive(&self, sets: &[Set], stage: Stage<'_>, watch: &Watch<'_>) -> Result<Vec<Driven>, StudyError> {
        let (drives, stream, faults) = match stage {
            Stage::Tuning(drives) => (drives, "tuning", Faults::default()),
            Stage::Judged(_, faults) => (&self.judged, "judged", faults),
        };
        let in_world = drives.places.len() / self.worlds.len().min(drives.places.len());
        let mut jobs = Vec::new();
        for (pair, (set, driver)) in pairs(sets).enumerate() {
            for (number, place) in drives.places.iter().enumerate() {
                let adapted = match stage {
                    Stage::Tuning(_) => None,
                    Stage::Judged(adapted, _) => {
                        adapted[pair * self.worlds.len() + number / in_world].as_ref()
                    }
                };
                jobs.extend((0..drives.seeds).map(|seed| (set, driver, place, adapted, seed)));
            }
        }
        each(
            &jobs,
            watch,
            |&(set, driver, (road, speed_kmh, scenario), adapted, seed)| {
                let seed = seed_of(self.seed, stream, road, *speed_kmh, seed);
                let scenario = scenario.to_builder().seed(seed).build()?;
                let law = self.laws[set.law].make(&scenario, &set.values)?;
                let by_hand = self.by_hand[driver].as_ref().filter(|_| self.is_none(set.law));
                let chosen = by_hand.map_or(&self.drivers[driver], |(by_hand, _)| by_hand);
                let driver = match adapted {
                    Some(adapted) => chosen.with_share(&scenario, adapted.share)?,
                    None => chosen.untuned_part(&scenario)?,
                };
                Ok(Driven::new(&scenario, law, driver, faults))
            },
        )
    }
}

/// The mean of each unit over its drives, of which the units are innermost, where they have values.
fn by_unit(units: usize, values: impl Iterator<Item = Option<f64>>) -> Vec<f64> {
    let mut sums = vec![(0.0, 0_u32); units];
    for (number, value) in values.enumerate() {
        if let Some(value) = value {
            let (sum, count) = &mut sums[number % units];
            *sum += value;
            *count += 1;
        }
    }
    let sums = sums.into_iter().filter(|(_, count)| *count > 0);
    sums.map(|(sum, count)| sum / f64::from(count)).collect()
}

/// A mean over units whose interval is none where nothing scattered: then nothing was drawn by chance.
fn mean_of(values: &[f64], level: Confidence) -> Option<Mean> {
    let mean = Mean::new(values, level)?;
    let interval = mean.interval.filter(|[low, high]| low < high);
    Some(Mean { interval, ..mean })
}
