//! A driver and an automation hold one steering wheel: this package drives them in closed loop, with the controller that
//! runs on the steering ECU. `cargo doc --open` begins here.
//!
//! | You want to | begin with |
//! |---|---|
//! | step a drive, with a driver, a vehicle or a guidance law of your own | [`haptic_sim::Simulation`], [`haptic_sim::parts`] |
//! | read or write a log | [`haptic_log::formats`] |
//! | find a driver's parameters in a log | [`haptic_analysis::identify`] |
//! | run many drives, or one of the studies | [`haptic_batch`] |
//! | inject faults and judge what follows | `haptic_campaign`, `haptic_evidence` |
//! | compare with QEMU or a board | [`haptic_pil`] |
//! | draw a result | [`haptic_report`] |
//! | read what decides the torque | [`haptic_core`] |
//!
//! `docs/design.md` draws how they depend on each other. The program is `src/main.rs`, with a file for each of its
//! commands below `src/cli`; beside them the library holds what needs both the simulator and a target:
//!
//! ```
//! use std::ops::ControlFlow;
//!
//! use haptic_sim::Scenario;
//! use haptic_sim::scenario::Condition;
//! use haptic_pil::Target;
//! use host_sim::processor::{self, ProcessorError};
//!
//! // A scenario that cannot be compared is refused before any target is opened.
//! let manual = Scenario::builder().condition(Condition::Manual).build()?;
//! let board = Target::Board("can0".into());
//! let refused = processor::run(&manual, &board, |_| ControlFlow::Continue(()));
//! assert!(matches!(refused, Err(ProcessorError::Scenario(_))));
//! # Ok::<(), haptic_sim::scenario::ScenarioError>(())
//! ```

pub mod cli;
pub mod processor;
pub mod tester;

/// The examples of the documents, as doctests.
#[cfg(doctest)]
#[doc = include_str!("../../docs/tutorials/inject-a-fault.md")]
#[doc = include_str!("../../docs/how-to/extend.md")]
#[doc = include_str!("../../docs/design.md")]
struct Documents;
