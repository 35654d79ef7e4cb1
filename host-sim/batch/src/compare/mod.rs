//! Every law against every driver: roads, speeds, seeds and failures, from one file.
//!
//! Each law is tuned first, with as many drives as every other ([`Tuning`]), and judged on drives with other seeds. A seed draws the same
//! remnant, wind and sensor noise for every law, so that laws are compared pair by pair. Each judged drive is the trunk of its
//! failures: at every instant a copy of the loop goes on without the torque, or without the lane.
//!
//! - [`Compare::load`]: the file, checked; [`Kinds`]: the laws and drivers that it may name, with those of one's own.
//! - [`Compare::run`]: tuned, driven, summed up ([`CompareResults`]).
//!
//! Not here: the laws and drivers (`haptic_sim::laws`, `haptic_sim::drivers`).

mod drive;
mod file;
mod results;
#[cfg(test)]
mod tests;
mod tune;

use std::path::Path;

use haptic_sim::drivers::AnyDriver;
use haptic_sim::input::InputError;
use haptic_sim::laws::Law;

use crate::engine::{Watch, each};
use crate::error::StudyError;
use crate::files::Source;
use crate::places::{Drives, seed_of};
use crate::statistics::Confidence;

pub use crate::engine::{Faults, on_threads};
pub use crate::metrics::{METRICS, Metric};
pub use crate::parts::{Chosen, Kinds};
pub use crate::statistics::Mean;
pub use drive::Driven;
pub use results::{Cell, CompareResults, DriveRow, LawResult, Ratio};

/// How laws are tuned.
#[derive(Debug, Clone)]
pub struct Tuning {
    /// Sets of parameters that are tried for each law, the untuned one included.
    pub budget: u32,
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
    /// Which laws are tuned for each driver by itself: what who knows the driver could choose.
    pub oracles: Vec<bool>,
    /// How laws are tuned first, if they are.
    pub tuning: Option<Tuning>,
    /// What fails.
    pub faults: Faults,
    /// How often intervals hold what they are of.
    pub level: Confidence,
}

/// A drive to be done.
#[derive(Debug, Clone, Copy)]
struct Job {
    law: usize,
    set: usize,
    driver: usize,
    place: usize,
    seed: u32,
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
        let sets: Vec<Vec<Vec<f64>>> = tuned.iter().map(|law| law.values.clone()).collect();
        let mut jobs = self.jobs(&self.judged, |_| 1);
        // A driver's own set has the driver's number.
        jobs.iter_mut().for_each(|job| job.set = job.driver);
        let driven = self.drive(&jobs, &sets, &self.judged, "judged", self.faults, watch)?;
        Ok(results::sum_up(self, tuned, &jobs, &driven))
    }

    fn jobs(&self, drives: &Drives, sets: impl Fn(usize) -> usize) -> Vec<Job> {
        let mut jobs = Vec::new();
        for law in 0..self.laws.len() {
            for set in 0..sets(law) {
                for driver in 0..self.drivers.len() {
                    for place in 0..drives.places.len() {
                        jobs.extend((0..drives.seeds).map(|seed| Job {
                            law,
                            set,
                            driver,
                            place,
                            seed,
                        }));
                    }
                }
            }
        }
        jobs
    }

    /// Drives with sets of parameters for each law, in the order of the jobs.
    fn drive(
        &self,
        jobs: &[Job],
        sets: &[Vec<Vec<f64>>],
        drives: &Drives,
        stream: &str,
        faults: Faults,
        watch: &Watch<'_>,
    ) -> Result<Vec<Driven>, StudyError> {
        each(jobs, watch, |job| {
            let (road, speed_kmh, scenario) = &drives.places[job.place];
            let seed = seed_of(self.seed, stream, road, *speed_kmh, job.seed);
            let scenario = scenario.to_builder().seed(seed).build()?;
            let law = self.laws[job.law].make(&scenario, &sets[job.law][job.set])?;
            let driver = self.drivers[job.driver].untuned_part(&scenario)?;
            Ok(Driven::new(&scenario, law, driver, faults))
        })
    }
}
