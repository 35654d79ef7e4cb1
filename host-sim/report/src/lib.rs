//! Results as tables and figures.

pub mod document;
pub mod plot;
pub mod studies;
