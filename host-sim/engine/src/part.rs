//! Cases that one thread drives, and the ways to drive them.

use haptic_analysis::identify::DriveLog;
use haptic_sim::scenario::Scenario;
use haptic_sim::simulation::{Run, simulate};
use haptic_vectorised::{Event, Options};
use rayon::prelude::*;

use super::Driven;
use super::side_by_side::{Checked, Group};
use crate::error::StudyError;
use crate::recorder::{Recorder, recorded};

/// Keeps the row of a case, whose place in the part it gets, and says so to whoever watches.
type Done<'a, R> = &'a (dyn Fn(usize, &R) -> Result<(), StudyError> + Sync);

/// Cases that one thread drives. Whatever drives them tells [`Part::done`] each row as soon as it is there; the ways below do.
pub struct Part<'a, C, R> {
    /// In the order of the plan.
    pub cases: &'a [&'a C],
    first: u64,
    checked: Checked,
    done: Done<'a, R>,
}

impl<'a, C, R> Part<'a, C, R> {
    /// The first of the cases has this place among so many.
    pub(super) fn new(
        cases: &'a [&'a C],
        driven: Driven,
        [first, of]: [usize; 2],
        done: Done<'a, R>,
    ) -> Self {
        let seed = match driven {
            Driven::SideBySide { seed } => seed,
            Driven::OneByOne => 0,
        };
        Self {
            cases,
            first: first as u64,
            checked: Checked::new(seed, of as u64),
            done,
        }
    }

    /// Keeps the row of a case by its place in the part.
    ///
    /// # Errors
    /// What the store says; that the study was ended.
    pub fn done(&self, place: usize, row: &R) -> Result<(), StudyError> {
        (self.done)(place, row)
    }

    /// Makes a row of each case, one after the other.
    ///
    /// # Errors
    /// What `drive` says; as [`Part::done`].
    pub fn one_by_one(
        &self,
        mut drive: impl FnMut(&C) -> Result<R, StudyError>,
    ) -> Result<Vec<R>, StudyError> {
        let rows = self.cases.iter().enumerate().map(|(place, case)| {
            let row = drive(case)?;
            self.done(place, &row)?;
            Ok(row)
        });
        rows.collect()
    }

    /// Scenarios of the cases, in their order.
    ///
    /// # Errors
    /// What `scenario` says.
    pub fn scenarios(
        &self,
        scenario: impl Fn(&C) -> Result<Scenario, StudyError>,
    ) -> Result<Vec<Scenario>, StudyError> {
        self.cases.iter().map(|case| scenario(case)).collect()
    }

    /// The scenarios as runs that go side by side.
    pub fn group<'s>(&self, scenarios: &'s [Scenario]) -> Group<'s> {
        Group {
            scenarios,
            first: self.first,
            checked: self.checked,
        }
    }
}

impl<C: Sync, R: Send> Part<'_, C, R> {
    /// Drives each case's scenario side by side where that can be, else with the shipping ECU, and makes a row of its run.
    ///
    /// # Errors
    /// What `scenario` and `measure` say; a run that differs from the shipping ECU's; as [`Part::done`].
    pub fn side_by_side(
        &self,
        scenario: impl Fn(&C) -> Result<Scenario, StudyError>,
        measure: impl Fn(&C, &Scenario, &Run) -> Result<R, StudyError> + Sync,
    ) -> Result<Vec<R>, StudyError> {
        let scenarios = self.scenarios(scenario)?;
        let row = |place: usize, run: &Run| -> Result<R, StudyError> {
            let row = measure(self.cases[place], &scenarios[place], run)?;
            self.done(place, &row)?;
            Ok(row)
        };
        let found = self
            .group(&scenarios)
            .measured(Options::default(), simulate, row)?;
        let found = found.into_par_iter().enumerate();
        found
            .map(|(place, found)| found.map_or_else(|| row(place, &simulate(&scenarios[place])), Ok))
            .collect()
    }

    /// Drives as [`Part::side_by_side`] does, with the log that the paper's apparatus would write.
    ///
    /// # Errors
    /// As [`Part::side_by_side`].
    pub fn logged(
        &self,
        scenario: impl Fn(&C) -> Result<Scenario, StudyError>,
        measure: impl Fn(&C, &Scenario, &Run, DriveLog) -> Result<R, StudyError>,
    ) -> Result<Vec<R>, StudyError> {
        let scenarios = self.scenarios(scenario)?;
        let row = |place: usize, run: &Run, log: DriveLog| -> Result<R, StudyError> {
            let row = measure(self.cases[place], &scenarios[place], run, log)?;
            self.done(place, &row)?;
            Ok(row)
        };
        let options = Options {
            every_step: true,
            ..Options::default()
        };
        let mut recorders = vec![Recorder::new(true); scenarios.len()];
        let mut rows: Vec<Option<R>> = scenarios.iter().map(|_| None).collect();
        let rejected = self
            .group(&scenarios)
            .run_batch(options, simulate, |place, event| {
                match event {
                    Event::Steps(steps) => steps.iter().for_each(|step| recorders[place].take(*step)),
                    Event::Ended(run) => {
                        let recorder = std::mem::replace(&mut recorders[place], Recorder::new(true));
                        rows[place] = Some(row(place, run, recorder.into_log())?);
                    }
                    Event::Rejected(_) => (),
                }
                Ok(())
            })?;
        for place in rejected {
            let (run, log) = recorded(&scenarios[place]);
            rows[place] = Some(row(place, &run, log)?);
        }
        Ok(rows.into_iter().flatten().collect())
    }
}
