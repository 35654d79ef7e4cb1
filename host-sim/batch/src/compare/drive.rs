//! One drive with its failures, and what is measured of it.

use haptic_sim::drivers::AnyDriver;
use haptic_sim::laws::Law;
use haptic_sim::scenario::Scenario;

use crate::Away;
use crate::engine::{After, Faults, drive_forked, failures, trunk};
use crate::metrics::{METRICS, measured};

/// What came of a drive and its failures.
#[derive(Debug, Clone, PartialEq)]
pub struct Driven {
    /// In the order of [`METRICS`].
    pub values: [Option<f64>; METRICS.len()],
    /// Whether it left the road.
    pub off_road: bool,
    /// Whether the ECU ended guidance by its own decision.
    pub left_by_itself: bool,
    /// Failed drives that left the road.
    pub failed_off_road: u32,
}

impl Driven {
    /// Drives to the end of the course, and so long from each failure.
    pub(super) fn new(
        scenario: &Scenario,
        law: Box<dyn Law>,
        driver: Box<dyn AnyDriver>,
        faults: Faults,
    ) -> Self {
        let trunk = trunk(scenario, law, driver);
        let (run, failed) = drive_forked(trunk, &failures(scenario, faults), faults.lasts_s, After::new);
        Self {
            values: measured(scenario, &run.trace, run.diverged(), &failed),
            off_road: run.diverged(),
            left_by_itself: Away::new(scenario, &run.trace).is_by_itself(),
            failed_off_road: failed.iter().filter(|after| after.is_off_road()).count() as u32,
        }
    }
}
