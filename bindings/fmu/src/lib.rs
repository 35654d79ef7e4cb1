//! The binaries of the FMUs: three models, FMI 2.0 and 3.0 co-simulation. Which model it is the token says that the importing
//! tool gives.
//!
//! A model's variables are one list, from which both descriptions follow. `unsafe` is in [`mod@unit`], [`fmi2`] and [`fmi3`] alone:
//! pointers come from the importing tool, as the standards say.

pub mod controller;
mod declare;
pub mod driver;
pub mod error;
pub mod fmi2;
pub mod fmi3;
mod history;
mod instance;
pub mod unit;
pub mod variable;
pub mod vehicle;

use variable::About;

/// Every model of this binary.
pub static MODELS: [&About; 3] = [&controller::ABOUT, &driver::ABOUT, &vehicle::ABOUT];
