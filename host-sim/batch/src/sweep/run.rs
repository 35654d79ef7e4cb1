//! A shard's chunks as a study of the engine; and when enough is known.

use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

use statrs::distribution::{ContinuousCDF, Normal};

use super::groups::Moments;
use super::{Chunk, Store, Sweep};
use crate::engine::{self, Part, Plan, Study, StudyError, Watch, refuse};

/// A part of a sweep: every n-th chunk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    number: u64,
    of: u64,
}

impl Shard {
    /// All of it.
    pub const WHOLE: Self = Self { number: 1, of: 1 };

    /// Shard `number` of `of`, from 1.
    ///
    /// # Errors
    /// A number outside 1 to `of`.
    pub fn new(number: u64, of: u64) -> Result<Self, StudyError> {
        if (1..=of).contains(&number) {
            return Ok(Self { number, of });
        }
        refuse(format!(
            "shard {number} of {of}: the first number is 1 to the second"
        ))
    }

    pub(super) fn has(self, chunk: u64) -> bool {
        chunk % self.of == self.number - 1
    }
}

impl std::str::FromStr for Shard {
    type Err = StudyError;

    fn from_str(text: &str) -> Result<Self, StudyError> {
        let parts = text
            .split_once('/')
            .and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        let (number, of) = parts.ok_or_else(|| format!("{text:?}: a shard is I/N, such as 1/3"))?;
        Self::new(number, of)
    }
}

/// The chunks of a shard.
struct Chunks<'a> {
    store: &'a Store<'a>,
    sweep: &'a Sweep,
    shard: Shard,
}

/// Drives what is missing of a shard on every core.
///
/// # Errors
/// A drive that cannot be; what the disk says. Chunks that were finished stay.
pub fn run_all(store: &Store<'_>, sweep: &Sweep, shard: Shard, watch: &Watch<'_>) -> Result<(), StudyError> {
    let prefix = Prefix {
        watch: Enough::new(sweep),
        next: 0,
    };
    let kept = Kept {
        store,
        prefix: sweep.stop.is_some().then(|| Mutex::new(prefix)),
    };
    let chunks = Chunks { store, sweep, shard };
    engine::run(&chunks, &kept, watch)
}

/// A row would be a chunk, which is on the disk by then: all of them may be more than memory holds.
impl Study for Chunks<'_> {
    type Case = u64;
    type Row = ();
    type Results = ();

    fn plan(&self) -> Result<Plan<u64>, StudyError> {
        let mine = (0..self.sweep.chunks()).filter(|chunk| self.shard.has(*chunk));
        Ok(Plan::one_by_one(mine.collect()))
    }

    fn drive(&self, part: &Part<'_, u64, ()>) -> Result<Vec<()>, StudyError> {
        part.one_by_one(|number| {
            let chunk = self.sweep.run_chunk(*number)?;
            Ok(self
                .store
                .put(*number, &chunk.to_bytes(self.store.fingerprint()))?)
        })
    }

    fn summarise(&self, _: Vec<u64>, _: Vec<()>) -> Result<(), StudyError> {
        Ok(())
    }

    fn drives(&self, number: &u64) -> u64 {
        let drives = self.sweep.drives_of(*number);
        drives.end - drives.start
    }
}

/// Chunks on the disk, and whether enough is known by them.
struct Kept<'a> {
    store: &'a Store<'a>,
    /// None of a sweep that goes to its end.
    prefix: Option<Mutex<Prefix>>,
}

impl engine::Store<u64, ()> for Kept<'_> {
    fn kept(&self, number: &u64) -> Result<Option<()>, StudyError> {
        Ok(self.store.get(*number).map(|_| ()))
    }

    fn keep(&self, _: &u64, (): &()) -> Result<ControlFlow<()>, StudyError> {
        let Some(prefix) = &self.prefix else {
            return Ok(ControlFlow::Continue(()));
        };
        let mut prefix = prefix.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(if prefix.advance(self.store) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        })
    }
}

/// The chunks from the first on without a gap, whoever drove them.
struct Prefix {
    watch: Enough,
    next: u64,
}

impl Prefix {
    fn advance(&mut self, store: &Store) -> bool {
        while let Some(chunk) = store.get(self.next) {
            self.next += 1;
            if self.watch.add(&chunk) {
                return true;
            }
        }
        false
    }
}

/// The mean of a metric over samples, chunk by chunk in order: whether it is known well enough. A sample's drives
/// (grid and repeats) count as one observation, their mean: they are not independent of each other.
#[derive(Debug, Clone)]
pub(super) struct Enough {
    metric: Option<usize>,
    half_width: f64,
    quantile: f64,
    least: u64,
    block: u64,
    next_drive: u64,
    sum: f64,
    with_value: u64,
    observed: Moments,
}

impl Enough {
    pub(super) fn new(sweep: &Sweep) -> Self {
        let stop = sweep.stop.as_ref();
        let standard = Normal::standard();
        Self {
            metric: stop.and_then(|stop| sweep.metrics().iter().position(|d| d.name == stop.metric)),
            half_width: stop.map_or(0.0, |stop| stop.half_width),
            quantile: stop.map_or(0.0, |stop| standard.inverse_cdf(0.5 + stop.confidence / 2.0)),
            least: stop.map_or(0, |stop| stop.least.max(2)),
            // With nothing sampled the repeats are the observations.
            block: if sweep.sampled.is_empty() {
                1
            } else {
                sweep.drives_of_a_sample()
            },
            next_drive: 0,
            sum: 0.0,
            with_value: 0,
            observed: Moments::default(),
        }
    }

    /// Takes the next chunk; whether it is the last that is needed.
    pub(super) fn add(&mut self, chunk: &Chunk) -> bool {
        let Some(metric) = self.metric else { return false };
        for row in &chunk.rows {
            if let Some(value) = row.metrics[metric] {
                self.sum += value;
                self.with_value += 1;
            }
            self.next_drive += 1;
            if self.next_drive.is_multiple_of(self.block) {
                self.observe();
            }
        }
        let is_known = |(variance, _): (f64, f64)| self.quantile * variance.sqrt() <= self.half_width;
        self.observed.count >= self.least && self.observed.of_mean().is_some_and(is_known)
    }

    fn observe(&mut self) {
        if self.with_value > 0 {
            self.observed.add(self.sum / self.with_value as f64);
        }
        (self.sum, self.with_value) = (0.0, 0);
    }
}
