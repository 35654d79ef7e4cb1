//! What the claims about controller and identification rest on, as far as no other crate needs it. The program is `src/main.rs`.
//!
//! - [`availability`]: how often the ECU hands over on real roads although nothing is wrong, and an EPS with limits of its own faults.
//! - [`handover`]: what a failed input costs, by speed, delay and reliance.
//! - [`reliance`]: the ECU's live estimate of the driver's reliance, against the truth.
//! - [`estimates`]: the identification, on drivers whose truth is known; [`vehicle`]: that of a vehicle.
//! - [`real_drives`]: recordings of real people.

pub mod availability;
mod declared;
pub mod estimates;
pub mod handover;
pub mod real_drives;
pub mod reliance;
pub mod vehicle;
