//! Studies that are a list of jobs and no more: whoever has the list gets a row for each.

use std::marker::PhantomData;

use haptic_analysis::identify::DriveLog;
use haptic_sim::scenario::Scenario;
use haptic_sim::simulation::Run;

use super::{Driven, Part, Plan, Study, Watch};
use crate::error::StudyError;

struct Jobs<'a, J, R, F> {
    jobs: &'a [J],
    driven: Driven,
    drive: F,
    row: PhantomData<fn() -> R>,
}

impl<'a, J, R, F> Study for Jobs<'a, J, R, F>
where
    J: Sync,
    R: Send,
    F: Fn(&Part<'_, &'a J, R>) -> Result<Vec<R>, StudyError> + Sync,
{
    type Case = &'a J;
    type Row = R;
    type Results = Vec<R>;

    fn plan(&self) -> Result<Plan<&'a J>, StudyError> {
        Ok(Plan {
            cases: self.jobs.iter().collect(),
            driven: self.driven,
        })
    }

    fn drive(&self, part: &Part<'_, &'a J, R>) -> Result<Vec<R>, StudyError> {
        (self.drive)(part)
    }

    fn summarise(&self, _: Vec<&'a J>, rows: Vec<R>) -> Result<Vec<R>, StudyError> {
        Ok(rows)
    }
}

fn rows<'a, J: Sync, R: Send>(
    jobs: &'a [J],
    driven: Driven,
    watch: &Watch<'_>,
    drive: impl Fn(&Part<'_, &'a J, R>) -> Result<Vec<R>, StudyError> + Sync,
) -> Result<Vec<R>, StudyError> {
    let row = PhantomData;
    let jobs = Jobs {
        jobs,
        driven,
        drive,
        row,
    };
    jobs.run(watch)
}

/// Makes a row of each job, on every core.
///
/// # Errors
/// What `drive` says; as [`run`](super::run()).
pub fn each<J: Sync, R: Send>(
    jobs: &[J],
    watch: &Watch<'_>,
    drive: impl Fn(&J) -> Result<R, StudyError> + Sync,
) -> Result<Vec<R>, StudyError> {
    rows(jobs, Driven::OneByOne, watch, |part| {
        part.one_by_one(|job| drive(job))
    })
}

/// Drives a scenario for each job side by side where that can be, and makes a row of its run.
///
/// # Errors
/// As [`Part::side_by_side`]; as [`run`](super::run()).
pub fn runs<J: Sync, R: Send>(
    jobs: &[J],
    seed: u64,
    watch: &Watch<'_>,
    scenario: impl Fn(&J) -> Result<Scenario, StudyError> + Sync,
    measure: impl Fn(&J, &Scenario, &Run) -> Result<R, StudyError> + Sync,
) -> Result<Vec<R>, StudyError> {
    rows(jobs, Driven::SideBySide { seed }, watch, |part| {
        part.side_by_side(
            |job| scenario(job),
            |job, scenario, run| measure(job, scenario, run),
        )
    })
}

/// Drives as [`runs`] does, with the log that the paper's apparatus would write.
///
/// # Errors
/// As [`runs`].
pub fn logs<J: Sync, R: Send>(
    jobs: &[J],
    seed: u64,
    watch: &Watch<'_>,
    scenario: impl Fn(&J) -> Result<Scenario, StudyError> + Sync,
    measure: impl Fn(&J, &Scenario, &Run, DriveLog) -> Result<R, StudyError> + Sync,
) -> Result<Vec<R>, StudyError> {
    rows(jobs, Driven::SideBySide { seed }, watch, |part| {
        part.logged(
            |job| scenario(job),
            |job, scenario, run, log| measure(job, scenario, run, log),
        )
    })
}
