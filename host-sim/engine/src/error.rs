//! Why a study has no result.

use std::path::{Path, PathBuf};

use haptic_analysis::identify::{FixError, LogError};
use haptic_sim::input::{InputError, RangeError};
use haptic_sim::models::road::CourseError;
use haptic_sim::scenario::ScenarioError;
use haptic_vehicle::{ColumnsError, VehicleError};

/// Why a study has no result. The text names the field with its value and its range, or the file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StudyError {
    /// A scenario that cannot be.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A road that cannot be.
    #[error(transparent)]
    Course(#[from] CourseError),
    /// A value outside its range.
    #[error(transparent)]
    Range(#[from] RangeError),
    /// A file that cannot be read or written, or what it says.
    #[error(transparent)]
    Input(#[from] InputError),
    /// A recording that cannot be used.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A parameter that is taken as known, and cannot be.
    #[error(transparent)]
    Fix(#[from] FixError),
    /// A recording that has not what tells a vehicle.
    #[error(transparent)]
    Columns(#[from] ColumnsError),
    /// A drive that cannot tell its vehicle.
    #[error(transparent)]
    Vehicle(#[from] VehicleError),
    /// A sweep's directory that cannot be used.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Whoever watched it ended it.
    #[error("ended on request")]
    Interrupted,
    /// Things that were asked for and do not go together.
    #[error("{0}")]
    Asked(String),
}

impl From<String> for StudyError {
    fn from(sentence: String) -> Self {
        Self::Asked(sentence)
    }
}

impl From<&str> for StudyError {
    fn from(sentence: &str) -> Self {
        Self::Asked(sentence.into())
    }
}

/// Refuses what was asked for, in a sentence.
///
/// # Errors
/// Always: [`StudyError::Asked`].
pub fn refuse<T>(sentence: impl Into<String>) -> Result<T, StudyError> {
    Err(StudyError::Asked(sentence.into()))
}

/// Why a directory cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// A file cannot be read or written.
    #[error(transparent)]
    File(InputError),
    /// The directory holds another sweep, or one of another program.
    #[error(
        "{} holds another sweep, or one that another version of the program began; give another --out, or remove it",
        .0.display()
    )]
    Another(PathBuf),
    /// Chunks are missing: how many, and of how many.
    #[error("{0} of {1} chunks are missing: other shards have not driven them yet")]
    Missing(u64, u64),
    /// Bytes that are no chunk of this sweep.
    #[error("chunk {0}: these bytes are no chunk of this sweep")]
    Corrupted(u64),
}

impl StoreError {
    /// What is wrong with a file of the directory.
    pub fn file(path: &Path, error: impl std::fmt::Display) -> Self {
        Self::File(InputError::new(path.display(), error))
    }
}
