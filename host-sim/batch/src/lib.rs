//! Studies: what to simulate, and what to make of it.
//!
//! A study takes scenarios of `haptic-sim`, drives them on every core, measures them with `haptic-analysis`, and gives
//! one value that is a result: serialisable, without a file or a word for people.
//!
//! - [`engine`]: how a study is driven; each of the following is a value for it, or a small program over it.
//! - [`evaluate`]: section 5 of the paper, three drivers under four conditions, with and without failure.
//! - [`claims`]: what that evaluation must show.
//! - [`experiment`]: sections 3 and 4, the participants driven, identified and driven again.
//! - [`identify`]: one recorded drive.
//! - [`vehicle`]: the vehicle of a recorded drive.
//! - [`several`]: identified drivers beside each other.
//! - [`run`]: one scenario.
//! - [`study`]: participants and conditions in their order, recorded session by session.
//! - [`sweep`]: many drives with varied fields.
//! - [`compare`]: every law against every driver.
//! - [`design_guidance`]: the law's gains designed for a population of drivers.
//! - [`adaptation`]: a law that adapts to a driver who adapts to it.
//! - [`course`]: a road looked at.
//! - [`bus_load`]: how full the CAN bus is at worst.
//! - [`stability`]: who keeps the lane at which speed and with which delay.
//!
//! ```
//! use haptic_sim::Scenario;
//! use haptic_sim::scenario::Condition;
//!
//! let peak_m = |condition| {
//!     let scenario = Scenario::builder().condition(condition).build().unwrap();
//!     let single = haptic_batch::run::run(scenario, false).unwrap();
//!     single.results.record.metrics.peak_lateral_error_m.unwrap()
//! };
//! // Without guidance the paper's quickest driver is as good as with it (section 5.1).
//! assert!((peak_m(Condition::Manual) / peak_m(Condition::Mid) - 1.0).abs() < 0.1);
//! ```
//!
//! Not here: options and exit codes (the command line), how a metric is computed, which files are left and how they look.

pub mod adaptation;
mod away;
pub mod bus_load;
pub mod compare;
pub mod course;
pub mod design;
pub mod design_guidance;
mod drivers;
pub mod evaluate;
pub mod experiment;
pub mod files;
pub mod identify;
mod metrics;
mod parts;
mod path;
mod places;
pub mod readings;
mod record;
pub mod run;
pub mod several;
mod sobol;
pub mod study;
pub mod sweep;

pub mod stability;

pub mod vehicle;

pub use away::{Away, left_by_themselves};
pub use evaluate::claims;
pub use haptic_engine as engine;
pub use haptic_engine::statistics::{Confidence, Mean, Rate};
pub use haptic_engine::{StudyError, paper, refuse, shares, statistics};
pub use record::{RunRecord, check_window, peak_m};

/// Version and commit of this program, as results name it.
pub const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "+", env!("HAPTIC_COMMIT"));
