//! What happened when.

/// Something that happened in a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// When, s since the start of the run.
    pub time_s: f64,
    /// What.
    pub what: String,
}
