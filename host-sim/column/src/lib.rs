//! Studies of the steering that cars have: a wheel on a torsion bar, with power assist (`haptic_sim::models::torsion_bar`).
//!
//! [`linear`] has its resonances, its transfer functions and the margins of its loops, [`study`] what integrators and buyers of
//! sensors ask of it.

pub mod linear;
pub mod study;
