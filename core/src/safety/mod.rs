//! Bounds, checks and memory that keep a torque safe whatever the law asks for.
//!
//! - Inputs: can they be true together ([`plausibility`], [`yaw`], with the motion history in [`motion_history`]), is the driver
//!   torque alive ([`frozen_torque`]), and does the driver hold the wheel ([`hands`])?
//! - Reaction: the modes and what leads from one to another ([`modes`]), the faults with their classes ([`faults`]), the
//!   way to zero ([`ramp`]), guidance without a picture ([`coast`]).
//! - Output: the limits of the torque ([`envelope`]), a second computation that has to agree ([`monitor`]), a motor that
//!   has to deliver what it was told ([`actuator`]).
//! - Memory: state that is kept twice, against bit flips ([`redundant`]).
//!
//! These modules do not know the controller. It joins them to one step ([`crate::controller`]).

pub mod actuator;
pub mod coast;
pub mod envelope;
pub mod faults;
pub mod frozen_torque;
pub mod hands;
pub mod modes;
pub mod monitor;
pub mod motion_history;
pub mod plausibility;
pub mod ramp;
pub mod redundant;
pub mod yaw;
