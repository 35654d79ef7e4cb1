//! Why a study has no result.

use haptic_analysis::identify::{FixError, LogError};
use haptic_analysis::vehicle::{ColumnsError, VehicleError};
use haptic_sim::input::{InputError, RangeError};
use haptic_sim::models::road::CourseError;
use haptic_sim::scenario::ScenarioError;

use crate::sweep::StoreError;

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
pub(crate) fn refuse<T>(sentence: impl Into<String>) -> Result<T, StudyError> {
    Err(StudyError::Asked(sentence.into()))
}
