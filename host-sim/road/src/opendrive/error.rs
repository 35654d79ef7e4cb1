//! Why a file has no lane to drive on.

/// Why a file has no lane to drive on: one sentence with the road, the place in it and the reason.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub(crate) struct RoadError(String);

impl From<String> for RoadError {
    fn from(sentence: String) -> Self {
        Self(sentence)
    }
}

impl From<&str> for RoadError {
    fn from(sentence: &str) -> Self {
        Self(sentence.into())
    }
}

pub(super) fn refuse<T>(sentence: impl Into<String>) -> Result<T, RoadError> {
    Err(RoadError(sentence.into()))
}
