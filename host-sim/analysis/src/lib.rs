//! What a recorded drive tells of who drove.
//!
//! [`identify`] leads from a record to the parameters of the driver, with their uncertainty. K_hg is how strongly the
//! driver resists the guidance, t_p the delay from seeing to acting, `gain_i` what the torque can tell of vision. An
//! estimate that the data do not carry is no number but a verdict: not identified.
//!
//! ```
//! use haptic_analysis::identify::{DriveLog, Options, identify_with_noise_model};
//! use std::path::Path;
//!
//! let drives = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/driver-logs");
//! let log = DriveLog::open(&drives.join("guided-passive.csv"), false)?;
//! let found = identify_with_noise_model(&log, &Options::default());
//! // The drive was recorded without a probe, so its torque does not tell K_hg.
//! assert!(!found.parameters.k_hg.identified);
//! // The torque tells (K_d + K_nms) * a_i, never K_d alone.
//! assert!(found.parameters.k_d.estimate.is_none());
//! # Ok::<(), haptic_analysis::identify::LogError>(())
//! ```
//!
//! It works on records alone. Not here: driving (`haptic-sim`), sets of drives (`haptic-batch`), how well a drive
//! went (`haptic-metrics`), its vehicle (`haptic-vehicle`).

pub mod identify;
