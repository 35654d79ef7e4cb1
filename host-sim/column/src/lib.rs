//! The steering that cars have: wheel, torsion bar, column with rack and motor, power assist.
//!
//! ```text
//! J_w phi_w'' + B_w phi_w' + friction_w = T_hand - T_tb          wheel, held by the hands
//! J_c phi_c'' + B_c phi_c' + friction_c = T_tb + T_motor + T_a   column, rack and motor, seen at the wheel; delta = K_t phi_c
//! T_tb = K_tb (phi_w - phi_c) + B_tb (phi_w' - phi_c')           the bar, whose sensor reads its twist
//! ```
//!
//! `J_w + J_c = J_s` and `B_w + B_c = B_s`: with a stiff bar and no assist this is the paper's column (5). [`Plant`] moves it,
//! [`ThroughBar`] puts a driver of `haptic_sim::parts` at its wheel, whose guidance reads the bar in the place of the hands, and
//! [`linear`] has its resonances, its transfer functions and the margins of its loops.
//!
//! The simulator's own column is the rigid one: no scenario file has a bar yet, and the ECU takes T_d for the hands' torque.

mod assist;
pub mod linear;
mod parameters;
mod plant;
pub mod study;
mod through_bar;

pub use assist::{Assist, Curve};
pub use parameters::{BarParameters, ColumnError, Inject};
pub use plant::{Plant, STATES};
pub use through_bar::ThroughBar;
