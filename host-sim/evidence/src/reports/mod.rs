//! What each command of this program shows: a report of its results, for a page and for a terminal.

pub(crate) mod availability;
mod changes;
pub(crate) mod faults;
pub(crate) mod handover;
mod random;
pub(crate) mod real_drives;
pub(crate) mod reliance;
pub(crate) mod validation;
mod vehicle;
