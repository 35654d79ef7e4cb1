//! The engine of all studies: what is driven, what is kept of each drive, and what is made of all, as one value; and what else all
//! studies share: [`StudyError`], the [`Recorder`] of the host computer's log, [`statistics`], and what of the [`paper`] they drive.
//!
//! A [`Study`] plans its *cases*, each of which is a drive or a few that belong together, and says how a *part* of the plan is driven
//! ([`Part`]) and what it makes of the *rows*, one for each case. [`run()`] does the rest, and nothing else in a study does:
//!
//! - threads, and which cases one of them drives at once ([`Driven`]);
//! - runs side by side in one thread, one in five hundred held against the shipping ECU ([`Part::side_by_side`]);
//! - progress, and an end on request ([`Watch`]);
//! - rows of an earlier run that are not driven again, new ones that are kept as soon as they are there, and an end as soon as enough
//!   is known ([`Store`]).
//!
//! A list of jobs that asks for no more than a row of each is such a study too ([`each`], [`runs`], [`logs`]).
//!
//! ```
//! use haptic_engine::{Part, Plan, Study, StudyError, Watch};
//! use haptic_sim::Scenario;
//! use haptic_sim::scenario::Condition;
//!
//! /// How far the paper's driver leaves the middle of the lane, by hand and with guidance.
//! struct Peaks;
//!
//! impl Study for Peaks {
//!     type Case = Condition;
//!     type Row = f64;
//!     type Results = Vec<(Condition, f64)>;
//!
//!     fn plan(&self) -> Result<Plan<Condition>, StudyError> {
//!         Ok(Plan::side_by_side(vec![Condition::Manual, Condition::High], 1))
//!     }
//!
//!     fn drive(&self, part: &Part<'_, Condition, f64>) -> Result<Vec<f64>, StudyError> {
//!         let scenario = |condition: &Condition| Ok(Scenario::builder().condition(*condition).build()?);
//!         part.side_by_side(scenario, |_, _, run| {
//!             let errors_m = run.trace.samples.iter().map(|sample| sample.lateral_error_m.abs());
//!             Ok(errors_m.fold(0.0, f64::max))
//!         })
//!     }
//!
//!     fn summarise(&self, cases: Vec<Condition>, rows: Vec<f64>) -> Result<Self::Results, StudyError> {
//!         Ok(cases.into_iter().zip(rows).collect())
//!     }
//! }
//!
//! let peaks_m = Peaks.run(&Watch::nobody()).unwrap();
//! assert!(peaks_m.iter().all(|(_, peak_m)| (0.1..0.5).contains(peak_m)));
//! ```
//!
//! Not here: what a metric is (`haptic-analysis`), what is driven (`haptic-sim`), how results look.

mod entries;
mod error;
pub mod paper;
#[cfg(feature = "parquet")]
mod parquet;
mod part;
mod presets;
mod recorder;
mod shares;
mod side_by_side;
pub mod statistics;
mod store;
mod table;
#[cfg(test)]
mod tests;
mod trunk;
mod watch;

use std::sync::atomic::{AtomicBool, Ordering};

use haptic_vectorised::BATCH;
use rayon::prelude::*;

pub use entries::{Entry, EntryKind, number, text};
pub use error::{StoreError, StudyError, refuse};
pub use part::Part;
pub use presets::{each, logs, runs};
pub use recorder::{Recorder, recorded};
pub use shares::shares;
pub use side_by_side::{Checked, Group};
pub use store::{Resumed, Store};
pub use table::Tables;
pub use trunk::{After, Faults, Trunk, drive_forked, failures, trunk};
pub use watch::{Progress, Watch, on_threads};

/// Most cases of a part: the more, the less often a batch waits for its last run, and the fewer threads share the work.
const MOST_OF_A_PART: usize = 4 * BATCH;

/// What is driven, what is kept of each drive, and what is made of all.
pub trait Study: Sync {
    /// What tells a drive from the others.
    type Case: Sync;
    /// What is kept of a drive.
    type Row: Send;
    /// What the study finds.
    type Results;

    /// Every case, in order.
    ///
    /// # Errors
    /// What cannot be driven.
    fn plan(&self) -> Result<Plan<Self::Case>, StudyError>;

    /// Drives a part of the plan; a row for each case, in order.
    ///
    /// # Errors
    /// A scenario that cannot be; a run that differs from the shipping ECU's; what the part's own ways to drive say.
    fn drive(&self, part: &Part<'_, Self::Case, Self::Row>) -> Result<Vec<Self::Row>, StudyError>;

    /// What the rows say. There are as many rows as cases, unless the store said that enough was known.
    ///
    /// # Errors
    /// What the study refuses to say.
    fn summarise(&self, cases: Vec<Self::Case>, rows: Vec<Self::Row>) -> Result<Self::Results, StudyError>;

    /// How many drives a case is, for the progress.
    fn drives(&self, _case: &Self::Case) -> u64 {
        1
    }

    /// Drives all and sums up, with nothing kept.
    ///
    /// # Errors
    /// As [`run()`].
    fn run(&self, watch: &Watch<'_>) -> Result<Self::Results, StudyError>
    where
        Self: Sized,
    {
        run(self, &(), watch)
    }
}

/// What a study drives.
#[derive(Debug, Clone)]
pub struct Plan<C> {
    /// In order.
    pub cases: Vec<C>,
    /// How they are shared among threads.
    pub driven: Driven,
}

/// Which cases a thread drives at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Driven {
    /// Several side by side; the seed draws those that the shipping ECU drives a second time.
    SideBySide {
        /// Root of the draw.
        seed: u64,
    },
    /// One after the other in the order of the plan, whichever thread is free.
    OneByOne,
}

impl<C> Plan<C> {
    /// Cases that are driven side by side.
    pub fn side_by_side(cases: Vec<C>, seed: u64) -> Self {
        let driven = Driven::SideBySide { seed };
        Self { cases, driven }
    }

    /// Cases that are driven one by one.
    pub fn one_by_one(cases: Vec<C>) -> Self {
        let driven = Driven::OneByOne;
        Self { cases, driven }
    }
}

/// Drives what the store does not have of a study, on every core, and sums up.
///
/// # Errors
/// What the study or the store says; [`StudyError::Interrupted`] if whoever watches ends it.
pub fn run<S: Study>(
    study: &S,
    store: &impl Store<S::Case, S::Row>,
    watch: &Watch<'_>,
) -> Result<S::Results, StudyError> {
    let Plan { cases, driven } = study.plan()?;
    let kept = cases.iter().map(|case| store.kept(case));
    let mut rows: Vec<Option<S::Row>> = kept.collect::<Result<_, _>>()?;
    let places: Vec<usize> = (0..cases.len()).filter(|place| rows[*place].is_none()).collect();
    let drives =
        |places: &mut dyn Iterator<Item = usize>| places.map(|place| study.drives(&cases[place])).sum();
    let all: u64 = drives(&mut (0..cases.len()));
    watch.begin(all, all - drives(&mut places.iter().copied()))?;
    let missing = places.len();
    let is_enough = AtomicBool::new(false);
    let drive = |(first, places): (usize, &[usize])| -> Result<Vec<(usize, S::Row)>, StudyError> {
        if is_enough.load(Ordering::Relaxed) {
            return Ok(Vec::new());
        }
        let of_part: Vec<&S::Case> = places.iter().map(|place| &cases[*place]).collect();
        let done = |place: usize, row: &S::Row| {
            if store.keep(of_part[place], row)?.is_break() {
                is_enough.store(true, Ordering::Relaxed);
            }
            watch.done(study.drives(of_part[place]))
        };
        let rows = study.drive(&Part::new(&of_part, driven, [first, missing], &done))?;
        // One less would give every later case another's row.
        if rows.len() != places.len() {
            return refuse(format!("{} of {} runs came back", rows.len(), places.len()));
        }
        Ok(places.iter().copied().zip(rows).collect())
    };
    let size = match driven {
        Driven::OneByOne => 1,
        Driven::SideBySide { .. } => size_of_a_part(places.len()),
    };
    // The bridge hands the parts out in their order.
    let parts = places.chunks(size).enumerate().par_bridge();
    let parts = parts.map(|(number, places)| drive((number * size, places)));
    for (place, row) in parts.collect::<Result<Vec<_>, _>>()?.into_iter().flatten() {
        rows[place] = Some(row);
    }
    study.summarise(cases, rows.into_iter().flatten().collect())
}

/// Several parts for each thread, so that none waits long for the last.
fn size_of_a_part(cases: usize) -> usize {
    let share = cases.div_ceil(rayon::current_num_threads()).max(1);
    if share < 2 * BATCH {
        return share;
    }
    (share / 2).next_multiple_of(BATCH).min(MOST_OF_A_PART)
}
