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
mod parts;
mod results;
#[cfg(test)]
mod tests;
mod tune;

use std::path::Path;

use haptic_sim::drivers::{AnyDriver, DRIVERS, HABITS};
use haptic_sim::input::InputError;
use haptic_sim::kind::{Kind, Make, Parameter};
use haptic_sim::laws::{LAWS, Law};
use haptic_sim::scenario::{Scenario, ScenarioError};
use haptic_sim::seeds::named;
use rayon::prelude::*;
use serde::Deserialize;

use crate::files::Source;

pub use drive::{Driven, METRICS, Metric};
pub(crate) use drive::{failures, measured};
pub(crate) use file::drives;
pub(crate) use parts::{parts, unknown};
pub use results::{Cell, CompareResults, DriveRow, LawResult, Mean, Ratio};

/// The laws, drivers and habits that a file may name.
pub struct Kinds {
    /// Laws, and what may be put around one.
    pub laws: Vec<Kind<dyn Law>>,
    /// Drivers, and habits.
    pub drivers: Vec<Kind<dyn AnyDriver>>,
}

impl Default for Kinds {
    fn default() -> Self {
        Self {
            laws: LAWS.into(),
            drivers: DRIVERS.into_iter().chain(HABITS).collect(),
        }
    }
}

/// A law or driver of a file.
pub struct Chosen<'k, P: ?Sized + 'static> {
    /// Its name in the file.
    pub name: String,
    /// What it is.
    pub kind: &'k Kind<P>,
    /// The values of its parameters; `None` is the default, which tuning may leave.
    pub values: Vec<Option<f64>>,
    /// What is around it, the innermost first, with the values of their parameters.
    pub around: Vec<(&'k Kind<P>, Vec<f64>)>,
}

impl<'k, P: ?Sized> Chosen<'k, P> {
    /// The values of its parameters, untuned.
    pub fn untuned(&self) -> Vec<f64> {
        let pairs = self.values.iter().zip(self.kind.parameters);
        pairs.map(|(value, p)| value.unwrap_or(p.default)).collect()
    }

    /// Its kind in what is around it.
    fn kinds(&self) -> String {
        let around = self.around.iter().map(|(outer, _)| outer.name);
        around.fold(self.kind.name.to_owned(), |inner, outer| {
            format!("{outer}({inner})")
        })
    }

    /// The same, with other values of some parameters of what is around it.
    pub(crate) fn with_habit(&self, kind: &str, changed: &[(&str, f64)]) -> Self {
        let value = |p: &Parameter, value: &f64| {
            let found = changed.iter().find(|(name, _)| *name == p.name);
            found.map_or(*value, |(_, value)| *value)
        };
        let outer = |(outer, values): &(&'k Kind<P>, Vec<f64>)| {
            let values = outer.parameters.iter().zip(values);
            let all = values.map(|(p, old)| if outer.name == kind { value(p, old) } else { *old });
            (*outer, all.collect())
        };
        Self {
            name: self.name.clone(),
            kind: self.kind,
            values: self.values.clone(),
            around: self.around.iter().map(outer).collect(),
        }
    }

    /// As it is made untuned; refused in words that name it as the file does.
    pub(crate) fn check(
        &self,
        what: &str,
        source: &Source,
        scenario: &Scenario,
    ) -> Result<Box<P>, InputError> {
        let made = self.make(scenario, &self.untuned());
        made.map_err(|e| source.bad(format!("{what} {}: {e}", self.name)))
    }

    pub(crate) fn make(&self, scenario: &Scenario, values: &[f64]) -> Result<Box<P>, ScenarioError> {
        let mut made = match self.kind.make {
            Make::Part(make) => make(scenario, values)?,
            Make::Given(make) => make(scenario, values)?,
            // The file was checked: what goes around another one is in `around`.
            Make::Around(_) => unreachable!("{} is made around another one", self.kind.name),
        };
        for (kind, values) in &self.around {
            if let Make::Around(make) = kind.make {
                made = make(scenario, values, made);
            }
        }
        Ok(made)
    }
}

/// The drives of a law with a driver: each road at each speed with each seed.
#[derive(Debug, Clone)]
pub struct Drives {
    /// A scenario for each road and speed, with what to call them.
    pub places: Vec<(String, f64, Scenario)>,
    /// Drives at each place.
    pub seeds: u32,
}

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

/// What fails in the judged drives.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Faults {
    /// Instants of a sudden loss of the torque, evenly over the drive.
    pub sudden_loss: u32,
    /// Instants from which on no lane comes.
    pub silent_lane: u32,
    /// How long a failed drive goes on, s.
    pub lasts_s: f64,
}

impl Default for Faults {
    fn default() -> Self {
        Self {
            sudden_loss: 0,
            silent_lane: 0,
            lasts_s: 15.0,
        }
    }
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

    /// Drives in all, tuning included and failures left out.
    pub fn drives(&self) -> u64 {
        let judged = self.jobs(&self.judged, |_| 1).len();
        let tuning = self.tuning.as_ref();
        let tuned = tuning.map_or(0, |tuning| {
            self.jobs(&tuning.drives, |law| tune::sets(self, law).len()).len()
        });
        (judged + tuned) as u64
    }

    /// Tunes, drives and sums up, on all cores; `progress` is called after each drive.
    ///
    /// # Errors
    /// As [`haptic_sim::scenario::ScenarioBuilder::build`] for a driver's parameters.
    pub fn run(&self, progress: impl Fn() + Sync) -> Result<CompareResults, ScenarioError> {
        let tuned = tune::tune(self, &progress)?;
        let jobs = self.jobs(&self.judged, |_| 1);
        // A driver's own set has the driver's number.
        let sets: Vec<Vec<Vec<f64>>> = tuned.iter().map(|law| law.values.clone()).collect();
        let jobs: Vec<Job> = jobs
            .into_iter()
            .map(|job| Job {
                set: job.driver,
                ..job
            })
            .collect();
        let driven = self.drive(&jobs, &sets, &self.judged, "judged", self.faults, &progress)?;
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

    /// Drives with sets of parameters for each law; in the order of the jobs, whatever the threads.
    fn drive(
        &self,
        jobs: &[Job],
        sets: &[Vec<Vec<f64>>],
        drives: &Drives,
        stream: &str,
        faults: Faults,
        progress: &(impl Fn() + Sync),
    ) -> Result<Vec<Driven>, ScenarioError> {
        let drive = |job: &Job| {
            let (road, speed_kmh, scenario) = &drives.places[job.place];
            let seed = seed_of(self.seed, stream, road, *speed_kmh, job.seed);
            let scenario = scenario.to_builder().seed(seed).build()?;
            let law = self.laws[job.law].make(&scenario, &sets[job.law][job.set])?;
            let driver = &self.drivers[job.driver];
            let driver = driver.make(&scenario, &driver.untuned())?;
            let driven = drive::drive(&scenario, law, driver, faults);
            progress();
            Ok(driven)
        };
        jobs.par_iter().map(drive).collect()
    }
}

/// The seed of a drive: drives of another stream share none.
pub(crate) fn seed_of(root: u64, stream: &str, road: &str, speed_kmh: f64, number: u32) -> u64 {
    // 53 bits, which every reader of a number takes whole.
    named(named(root, stream), &format!("{road} {speed_kmh} {number}")) >> 11
}

/// Does some work on so many threads; none: one a core.
///
/// # Errors
/// The system has no more threads.
pub fn on_threads<T: Send>(
    threads: Option<u32>,
    work: impl FnOnce() -> T + Send,
) -> Result<T, rayon::ThreadPoolBuildError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0) as usize);
    Ok(pool.build()?.install(work))
}
