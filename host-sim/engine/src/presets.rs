//! Studies that are a list of jobs and no more: whoever has the list gets a row for each.

use haptic_analysis::identify::DriveLog;
use haptic_sim::scenario::Scenario;
use haptic_sim::simulation::Run;

use super::{Driven, Part, Plan, Study, Watch};
use crate::error::StudyError;

/// How the rows of a part are made.
type Drive<'a, J, R> = &'a (dyn Fn(&Part<'_, &'a J, R>) -> Result<Vec<R>, StudyError> + Sync);

struct Jobs<'a, J, R> {
    jobs: &'a [J],
    driven: Driven,
    drive: Drive<'a, J, R>,
}

impl<'a, J: Sync, R: Send> Study for Jobs<'a, J, R> {
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

/// Makes a row of each job, on every core.
///
/// # Errors
/// What `drive` says; as [`run`](super::run()).
pub fn each<J: Sync, R: Send>(
    jobs: &[J],
    watch: &Watch<'_>,
    drive: impl Fn(&J) -> Result<R, StudyError> + Sync,
) -> Result<Vec<R>, StudyError> {
    let drive: Drive<'_, J, R> = &|part| part.one_by_one(|job| drive(job));
    let driven = Driven::OneByOne;
    Jobs { jobs, driven, drive }.run(watch)
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
    let drive: Drive<'_, J, R> =
        &|part| part.side_by_side(|job| scenario(job), |job, own, run| measure(job, own, run));
    let driven = Driven::SideBySide { seed };
    Jobs { jobs, driven, drive }.run(watch)
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
    let drive: Drive<'_, J, R> = &|part| {
        part.logged(
            |job| scenario(job),
            |job, own, run, log| measure(job, own, run, log),
        )
    };
    let driven = Driven::SideBySide { seed };
    Jobs { jobs, driven, drive }.run(watch)
}
