//! The world around the steering controller, and the closed loop with it.
//!
//! A driver and a guidance turn one steering wheel; column and vehicle answer; the road ahead is what both look at.
//! The driver is the model of Wang, Zheng, Nacpil and Nakano 2022: eyes with a delay, and an arm that weighs vision
//! (K_d) against the guidance torque (K_hg: 0 relies on it, 1 resists it). The guidance is the shipping controller of
//! `haptic-core`, behind its bus frames or past them. Driver, vehicle and guidance are [`parts`]: each may be one of your own.
//!
//! A [`Scenario`] is everything that decides a run; its builder refuses what cannot be. A [`Simulation`] is the run
//! as a value: `Clone + Send`, moved by [`Simulation::step`], one millisecond a call. What comes from outside in a step
//! is an [`Action`], what came of it an [`Outcome`]. A clone and its original give the same bits for the same actions,
//! and [`seeds`] names the stream of each source of noise.
//!
//! ```
//! use haptic_sim::parts::DriverVehicle;
//! use haptic_sim::scenario::Condition;
//! use haptic_sim::{Action, Scenario, Simulation};
//!
//! let scenario = Scenario::builder().condition(Condition::High).speed_kmh(70.0).build()?;
//! let mut simulation = Simulation::new(&scenario);
//! for _ in 0..1000 {
//!     simulation.step(&Action::default());
//! }
//! // From here on a hand pulls in one copy of the world, and in the other it does not.
//! let mut pulled = simulation.clone();
//! let hand = Action {
//!     hand_torque_nm: 1.0,
//!     ..Action::default()
//! };
//! for _ in 0..200 {
//!     simulation.step(&Action::default());
//!     pulled.step(&hand);
//! }
//! assert!(pulled.driver_vehicle().motion() != simulation.driver_vehicle().motion());
//! # Ok::<(), haptic_sim::scenario::ScenarioError>(())
//! ```
//!
//! No file, no thread, no clock: what a person wrote is text, and time is the number of a step. So it builds for
//! `wasm32-unknown-unknown`. Not here: what a run means (`haptic-analysis`), sets of runs (`haptic-batch`), faults inside
//! the controller (`haptic-campaign`).

pub mod action;
pub mod drivers;
pub mod ecu_events;
pub mod fork;
pub mod guidance;
pub mod kind;
pub mod laws;
pub mod models;
pub mod participants;
pub mod parts;
pub mod population;
mod preview;
pub mod scenario;
pub mod seeds;
pub mod share;
pub mod simulation;
pub mod stability;
pub mod unguided;
pub mod worlds;

pub use action::Action;
pub use haptic_input as input;
pub use haptic_input::fields;
pub use scenario::Scenario;
pub use simulation::{Outcome, Run, Simulation, simulate};
