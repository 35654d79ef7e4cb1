//! The workbench behind the command line: what needs both the simulator and a target.

pub mod processor;
