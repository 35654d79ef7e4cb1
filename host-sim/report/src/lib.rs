//! Results as tables, figures and documents for people.
//!
//! - [`document`]: a report in HTML, with its tables and figures; series as CSV; files that appear together or not at all.
//! - [`plot`]: a figure as SVG, with the feature `png` as PNG too.
//! - [`studies`]: what each study of `haptic-batch` leaves behind.
//!
//! ```
//! use haptic_report::document::{FileSet, Owner};
//!
//! let directory = std::env::temp_dir().join(format!("haptic-report-{}", std::process::id()));
//! // Files of one study belong together, so they are moved into place when the last is written.
//! let files = FileSet::begin(&directory, Owner { command: "example", keeps: &[], force: false })?;
//! std::fs::write(files.staging().join("results.json"), "{}").unwrap();
//! assert!(!directory.join("results.json").exists());
//! files.finish()?;
//! assert!(directory.join("results.json").exists());
//! # std::fs::remove_dir_all(directory).unwrap();
//! # Ok::<(), haptic_report::document::WriteError>(())
//! ```
//!
//! Nothing is computed here. Not here: what a number means, and where the terminal's tables are printed.

pub mod document;
pub mod plot;
pub mod studies;
