//! The commands, a file each.

pub(crate) mod availability;
pub(crate) mod eps;
pub(crate) mod faults;
pub(crate) mod handover;
pub(crate) mod real_drives;
pub(crate) mod reliance;
pub(crate) mod validate;
