//! What an evaluation hands on.

use serde::Serialize;

use crate::RunRecord;
use haptic_sim::scenario::{Condition, FailureKind, Sensors};

/// Something that the evaluation must show, and whether it did.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Claim {
    /// The claim.
    pub claim: String,
    /// Whether it holds.
    pub holds: bool,
    /// The numbers behind it.
    pub evidence: String,
}

/// The results of an evaluation, as JSON holds them.
#[derive(Debug, Clone, Serialize)]
pub struct EvaluationResults {
    /// Name of the course.
    pub course: String,
    /// Its length, m.
    pub course_length_m: f64,
    /// Speed at the start, km/h; the records have the mean, the least and the largest.
    pub speed_kmh: f64,
    /// When the guidance fails in the runs with failure, s.
    pub failure_time_s: f64,
    /// What the controller saw.
    pub sensors: Sensors,
    /// Stretch that was measured, m.
    pub window_m: [f64; 2],
    /// One record for each run: the 21 of section 5 (no failure, or a sudden loss of the torque), then the 9 in
    /// which the guidance's input fails and the ECU hands over.
    pub runs: Vec<RunRecord>,
    /// What the evaluation must show, where it was run as the paper ran it; and wherever it was run, which runs were not
    /// guided throughout, if there are such.
    pub claims: Vec<Claim>,
    /// What a reader has to know of these results.
    pub notes: Vec<String>,
}

impl EvaluationResults {
    /// The record of a run, if there is one.
    pub fn record(&self, t_p: f64, condition: Condition, failure: FailureKind) -> Option<&RunRecord> {
        self.runs
            .iter()
            .find(|r| r.t_p == t_p && r.condition == condition && r.failure == failure)
    }

    /// Whether no claim is broken.
    pub fn all_claims_hold(&self) -> bool {
        self.claims.iter().all(|claim| claim.holds)
    }
}
