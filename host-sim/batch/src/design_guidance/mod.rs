//! The paper's look-ahead gains designed for the drivers who are to drive with them.
//!
//! Some of the fourteen participants drive the middle of the lane, the others a line of their own beside it. CMA-ES searches scales of
//! a_1' to a_4' in vectorised runs, once for each *stretch*: how far beyond its bars a
//! set may go, in the cost of a loss and in what else the drivers pay. What no other set beats in lane
//! error, in the price for the drivers and in the cost of a sudden loss is the front. The best set of each stretch is judged on held-out
//! roads, speeds, seeds and drivers.
//!
//! - [`DesignGuidance::load`]: the file, checked.
//! - [`DesignGuidance::run`]: searched and judged; sets that an earlier run evaluated are not driven again.
//!
//! Not here: the optimiser (the crate `cmaes`), laws that the lanes do not know ([`crate::compare`]).

mod evaluate;
mod file;
mod search;
#[cfg(test)]
mod tests;

use haptic_core::controller::params::Params;
use std::path::Path;

use crate::engine::StudyError;
use crate::files::Source;
use crate::statistics::Confidence;
use haptic_sim::input::InputError;
use haptic_sim::scenario::Scenario;
use serde::Serialize;

pub use evaluate::{Evaluated, Figures};
pub use search::{BARS, Bar, Choice, DesignResults, SetRow};

/// The gains a_1' to a_4'.
pub type Gains = [f64; 4];

/// The gains of table 8.
fn published() -> Gains {
    let Params {
        a_1, a_2, a_3, a_4, ..
    } = Params::PAPER;
    [a_1, a_2, a_3, a_4]
}

/// A driver of the population.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Member {
    /// Number of the participant of the paper.
    pub participant: u32,
    /// The line of its own, m left of the middle; 0: none.
    pub line_m: f64,
}

/// What sets are driven on.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stage {
    /// Its drivers.
    pub drivers: Vec<Member>,
    /// Road and speed of each place.
    pub places: Vec<(String, f64)>,
    /// Drives of a driver at each place.
    pub seeds: u32,
    /// Sudden losses in each drive.
    pub losses: u32,
    /// Its seeds are drawn by this name.
    #[serde(skip)]
    stream: &'static str,
    /// By place.
    #[serde(skip)]
    scenarios: Vec<Scenario>,
}

/// A design, checked.
#[derive(Debug, Clone)]
pub struct DesignGuidance {
    name: String,
    seed: u64,
    /// The first for the search, the second for the judgement.
    stages: [Stage; 2],
    budget: u32,
    /// Stretches of the bars of the loss, and of what else a driver pays.
    stretches: Vec<[f64; 2]>,
    /// The least and the largest gains.
    range: [Gains; 2],
    bars: [f64; BARS.len()],
    identity: u64,
    /// How often intervals hold.
    pub level: Confidence,
}

impl DesignGuidance {
    /// Reads a file and checks it. Courses are found beside it. `own_line_share` takes the place of the file's in the search; the
    /// judgement has the file's.
    ///
    /// # Errors
    /// The file, the field, its value and its range.
    pub fn load(path: &Path, own_line_share: Option<f64>) -> Result<Self, InputError> {
        let (source, text) = Source::open(path)?;
        file::from_text(&source, &text, own_line_share)
    }

    /// Tells what it drives from what another design drives.
    pub fn identity(&self) -> u64 {
        self.identity
    }

    /// Sets that are evaluated at most.
    fn sets(&self) -> u64 {
        let stretches = self.stretches.len() as u64;
        2 + stretches * (u64::from(self.budget).next_multiple_of(8) + 1)
    }

    /// The row that is chosen, from 0.
    ///
    /// # Errors
    /// There is no such row.
    pub fn row(&self, number: u32) -> Result<usize, StudyError> {
        let last = self.stretches.len() as u32;
        haptic_sim::input::in_range("--choose", f64::from(number), 1.0..=f64::from(last), "")?;
        Ok(number as usize - 1)
    }
}
