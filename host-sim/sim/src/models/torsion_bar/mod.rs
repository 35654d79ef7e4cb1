//! The steering that cars have: wheel, torsion bar, column with rack and motor, power assist.
//!
//! ```text
//! J_w phi_w'' + B_w phi_w' + friction_w = T_hand - T_tb          wheel, held by the hands
//! J_c phi_c'' + B_c phi_c' + friction_c = T_tb + T_motor + T_a   column, rack and motor, seen at the wheel; delta = K_t phi_c
//! T_tb = K_tb (phi_w - phi_c) + B_tb (phi_w' - phi_c')           the bar, whose sensor reads its twist
//! ```
//!
//! `J_w + J_c = J_s` and `B_w + B_c = B_s`: with a stiff bar and no assist this is the paper's column (5). [`BarPlant`] moves it,
//! as a vehicle whose driver's torque is that of the hands; a scenario asks for it with `column.kind = "torsion-bar"`.
//!
//! Not here: its linear form's margins and the studies of it (`haptic-column`).

mod assist;
mod exact;
mod parameters;
mod plant;

pub use assist::{Assist, Curve, CurveChoice, Usual};
pub use exact::matrices;
pub use parameters::{AngleSensor, AssistParameters, ColumnFault, ColumnKind, ColumnParameters, Inject};
pub use plant::*;
