//! A shard's chunks on threads, with progress; and when enough is known.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Normal};

use super::groups::Moments;
use super::{Chunk, Store, Sweep};
use crate::compare::on_threads;
use crate::error::{StudyError, refuse};

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

/// How far a shard is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Drives that are done now.
    pub done: u64,
    /// Of these, drives that an earlier start did.
    pub before: u64,
    /// Drives of the shard.
    pub all: u64,
}

/// Drives what is missing of a shard on so many threads, none: one a core; `progress` is called behind each chunk.
///
/// # Errors
/// A drive that cannot be; what the disk says. Chunks that were finished stay.
pub fn run_all(
    store: &Store,
    sweep: &Sweep,
    shard: Shard,
    threads: Option<u32>,
    progress: impl Fn(Progress) + Sync,
) -> Result<(), StudyError> {
    let count = |chunk: u64| {
        let drives = sweep.drives_of(chunk);
        drives.end - drives.start
    };
    let all = (0..sweep.chunks())
        .filter(|chunk| shard.has(*chunk))
        .map(count)
        .sum();
    let missing = store.missing(shard);
    let before = all - missing.iter().copied().map(count).sum::<u64>();
    let begin = Progress {
        done: before,
        before,
        all,
    };
    progress(begin);
    let state = Mutex::new((
        begin,
        Prefix {
            watch: Watch::new(sweep),
            next: 0,
        },
    ));
    let is_enough = AtomicBool::new(false);
    let drive = |number: u64| -> Result<(), StudyError> {
        if is_enough.load(Ordering::Relaxed) {
            return Ok(());
        }
        let chunk = sweep.run_chunk(number)?;
        store.put(number, &chunk.to_bytes(store.fingerprint()))?;
        let mut state = state.lock().unwrap_or_else(PoisonError::into_inner);
        let (now, prefix) = &mut *state;
        now.done += chunk.rows.len() as u64;
        progress(*now);
        if sweep.stop.is_some() && prefix.advance(store) {
            is_enough.store(true, Ordering::Relaxed);
        }
        Ok(())
    };
    let chunks = missing.into_iter().par_bridge();
    on_threads(threads, || chunks.try_for_each(drive)).map_err(|e| e.to_string())?
}

/// The chunks from the first on without a gap, whoever drove them.
struct Prefix {
    watch: Watch,
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
pub(super) struct Watch {
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

impl Watch {
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
