//! The observer of the hands' torque: its limits, and beside f64 and a simulated wheel.

mod limits;
mod oracle;
