//! A study with participants: conditions, who drives them, and in which order, from one file.
//!
//! A *session* is one participant under one condition. A participant is simulated (one of the paper's, or a driver of the file) or a
//! person, whose drive was recorded elsewhere and is imported. What a session recorded is kept in a directory of its own with version,
//! seed and scenario, and is never written again; a study that was interrupted goes on where it was.
//!
//! - [`Study::load`]: the file, checked; every session's scenario.
//! - [`Study::import`]: a person's recording.
//! - [`Study::run`]: the simulated sessions that are missing.
//! - [`Study::results`]: what is recorded, measured, and what is not there yet.

mod file;
mod guidance;
mod order;
mod paired;
mod repeated;
mod store;
#[cfg(test)]
mod tests;

use std::path::Path;

use haptic_sim::input::InputError;
use haptic_sim::scenario::{Condition, Scenario};
use haptic_sim::simulation::Run;
use serde::{Deserialize, Serialize};

pub use order::Order;
pub use paired::{Difference, of_participants};
pub use repeated::{Repeated, Test};

use crate::engine::{StudyError, Watch, each, refuse, runs};
use crate::record::RunRecord;
use crate::statistics::Confidence;
use crate::{files, left_by_themselves};

/// A study, checked.
#[derive(Debug, Clone)]
pub struct Study {
    /// Its name.
    pub name: String,
    /// Names of the conditions, as listed.
    pub conditions: Vec<String>,
    /// Every session: participants as listed, each in the order that the participant meets the conditions.
    pub sessions: Vec<Session>,
    /// What a reader has to know of the design.
    pub notes: Vec<String>,
}

/// Who drives a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Subject {
    /// A driver model.
    Simulated,
    /// Somebody, recorded elsewhere.
    Person,
}

/// Where a recording comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// This program.
    Simulated,
    /// A file that was brought in.
    Imported,
}

/// One participant under one condition.
#[derive(Debug, Clone)]
pub struct Session {
    /// Name of the participant.
    pub participant: String,
    /// Name of the condition.
    pub condition: String,
    /// Place in the participant's order, from 1.
    pub position: usize,
    /// Which time it is that the participant drives under the condition, from 1.
    pub repetition: usize,
    /// Who drives.
    pub who: Subject,
    /// Everything that decides it. Of a person it says road, speed and guidance, and the driver is not meant.
    pub scenario: Scenario,
}

/// A session in the results.
#[derive(Debug, Clone, Serialize)]
pub struct SessionResult {
    /// Name of the participant.
    pub participant: String,
    /// Place in the participant's order, from 1.
    pub position: usize,
    /// Name of the condition.
    pub condition: String,
    /// Which time it is that the participant drives under the condition, from 1.
    pub repetition: usize,
    /// Who drives.
    pub who: Subject,
    /// Seed of all random numbers.
    pub seed: u64,
    /// What was recorded; nothing if it is missing.
    pub recorded: Option<Recorded>,
}

/// A recording, measured.
#[derive(Debug, Clone, Serialize)]
pub struct Recorded {
    /// Where it comes from.
    pub source: Source,
    /// The program that kept it.
    pub version: String,
    /// Its record; the condition in it is the scenario's.
    pub record: RunRecord,
}

/// What a study found so far.
#[derive(Debug, Clone, Serialize)]
pub struct StudyResults {
    /// Its name.
    pub study: String,
    /// Names of the conditions, as listed.
    pub conditions: Vec<String>,
    /// Every session, in order.
    pub sessions: Vec<SessionResult>,
    /// How often intervals hold what they are of.
    #[serde(skip_serializing_if = "Confidence::is_usual")]
    pub level: Confidence,
    /// How much the conditions differ, participant by participant.
    pub differences: Vec<Difference>,
    /// Whether three or more conditions differ at all, metric by metric; empty of fewer.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub repeated: Vec<Repeated>,
    /// What a reader has to know.
    pub notes: Vec<String>,
}

impl Session {
    /// What the command line calls it.
    fn name(&self) -> String {
        name_of(&self.participant, &self.condition, self.repetition)
    }
}

fn name_of(participant: &str, condition: &str, repetition: usize) -> String {
    match repetition {
        1 => format!("{participant}/{condition}"),
        later => format!("{participant}/{condition}/{later}"),
    }
}

impl SessionResult {
    /// What the command line calls it.
    #[must_use]
    pub fn name(&self) -> String {
        name_of(&self.participant, &self.condition, self.repetition)
    }
}

impl Study {
    /// Reads a study file.
    ///
    /// # Errors
    /// The file, the participant and the condition, the field, its value and its range.
    pub fn load(path: &Path) -> Result<Self, InputError> {
        let (source, text) = files::Source::open(path)?;
        file::from_text(&source, &text)
    }

    /// Keeps a person's recording. `what` is `PARTICIPANT/CONDITION`, with `/2` and so on from the second repetition on.
    ///
    /// # Errors
    /// A session that the study does not have, is simulated or is recorded already; a file that is no drive of it.
    pub fn import(&self, out: &Path, what: &str, file: &Path) -> Result<(), StudyError> {
        self.session_of_a_person(what)?;
        let csv = std::fs::read(file).map_err(|e| InputError::new(file.display(), e));
        self.import_table(out, what, (file, &csv?))
    }

    /// Keeps a person's recording that was read from another file, as CSV.
    ///
    /// # Errors
    /// As [`Study::import`].
    pub fn import_table(
        &self,
        out: &Path,
        what: &str,
        (file, csv): (&Path, &[u8]),
    ) -> Result<(), StudyError> {
        let session = self.session_of_a_person(what)?;
        let place = store::place(out, session);
        if place.exists() {
            return Err(store::already(&place));
        }
        store::import(self, session, out, (file, csv))
    }

    /// The session of this name, which a person drives.
    fn session_of_a_person(&self, what: &str) -> Result<&Session, StudyError> {
        let found = self.sessions.iter().find(|s| s.name() == what);
        let Some(session) = found else {
            let names: Vec<String> = self
                .sessions
                .iter()
                .filter(|s| s.who == Subject::Person)
                .map(Session::name)
                .collect();
            return refuse(format!(
                "{what}: no session of a person; there are: {}",
                names.join(", ")
            ));
        };
        if session.who != Subject::Person {
            return refuse(format!("{what}: this participant is simulated"));
        }
        Ok(session)
    }

    /// Drives the simulated sessions that are missing, on all cores. What is recorded in `out` is checked first: with another session in a place nothing is driven.
    ///
    /// # Errors
    /// A place with another session in it; what the disk says; a drive that differs from the shipping ECU's.
    pub fn run(&self, out: &Path, watch: &Watch<'_>) -> Result<(), StudyError> {
        let missing = self.missing(out)?;
        let seed = missing.first().map_or(0, |session| session.scenario.seed());
        let scenario = |session: &&Session| Ok(session.scenario.clone());
        let keep = |session: &&Session, _: &Scenario, run: &Run| store::keep_run(self, session, out, run);
        runs(&missing, seed, watch, scenario, keep).map(drop)
    }

    /// Simulated sessions that are not recorded yet.
    ///
    /// # Errors
    /// A place with another session in it.
    pub fn missing(&self, out: &Path) -> Result<Vec<&Session>, StudyError> {
        let mut missing = Vec::new();
        for session in &self.sessions {
            let there = store::read(self, session, out)?.is_some();
            if !there && session.who == Subject::Simulated {
                missing.push(session);
            }
        }
        Ok(missing)
    }

    /// What is recorded, measured from the recordings alone, with intervals of a level.
    ///
    /// # Errors
    /// A recording that cannot be read, or is another session's.
    pub fn results(&self, out: &Path, level: Confidence) -> Result<StudyResults, StudyError> {
        let result = |session: &Session| -> Result<SessionResult, StudyError> {
            let found = store::read(self, session, out)?;
            Ok(SessionResult {
                participant: session.participant.clone(),
                position: session.position,
                condition: session.condition.clone(),
                repetition: session.repetition,
                who: session.who,
                seed: session.scenario.seed(),
                recorded: found.map(|(stored, record)| Recorded {
                    source: stored.source,
                    version: stored.version,
                    record,
                }),
            })
        };
        let sessions = each(&self.sessions, &Watch::nobody(), result)?;
        let mut notes = self.notes.clone();
        let guided = sessions.iter().filter_map(|s| {
            let recorded = s.recorded.as_ref()?;
            (recorded.record.condition != Condition::Manual).then_some((&recorded.record.away, s.name()))
        });
        notes.extend(
            left_by_themselves(guided.clone()).map(|left| format!("{left}; the means hold them too")),
        );
        match guided.filter(|(away, _)| away.unguided_s.is_none()).count() {
            0 => {}
            count => notes.push(format!(
                "{count} recordings with guidance do not say when it was away"
            )),
        }
        let mut versions: Vec<&str> = sessions
            .iter()
            .filter_map(|s| s.recorded.as_ref().map(|r| r.version.as_str()))
            .collect();
        versions.sort_unstable();
        versions.dedup();
        if versions.len() > 1 {
            notes.push(format!(
                "sessions are of several versions: {}",
                versions.join(", ")
            ));
        }
        Ok(StudyResults {
            study: self.name.clone(),
            conditions: self.conditions.clone(),
            level,
            differences: paired::differences(&self.conditions, &sessions, level),
            repeated: repeated::repeated(&self.conditions, &sessions),
            sessions,
            notes,
        })
    }
}
