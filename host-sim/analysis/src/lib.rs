//! What a recorded drive tells.

pub mod identify;
pub mod metrics;
