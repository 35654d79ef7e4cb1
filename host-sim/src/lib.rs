//! The workbench behind the command line: what needs both the simulator and a target.
//!
//! Everything else is in the crates that it is made of: `haptic-sim` (the world and the loop), `haptic-log`,
//! `haptic-analysis`, `haptic-batch` (studies), `haptic-campaign` (faults), `haptic-pil` (QEMU, boards) and
//! `haptic-report`. `docs/design.md` draws them. The program is `src/main.rs`, a file for each of its commands below
//! `src/cli`.
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

pub mod processor;

/// The examples of the documents, as doctests.
#[cfg(doctest)]
#[doc = include_str!("../../docs/tutorials/inject-a-fault.md")]
#[doc = include_str!("../../docs/how-to/extend.md")]
#[doc = include_str!("../../docs/design.md")]
struct Documents;
