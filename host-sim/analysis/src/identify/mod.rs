//! From a recorded drive to the driver's parameters, their uncertainty, and a verdict on whether the data can
//! carry them.
//!
//! Two estimators share one log, one muscle and one form of result: `noise_model` (the default) and
//! `paper` (the published way, kept as the baseline it is compared with); `tracking` follows a driver who
//! changes. A log is read and checked by `haptic-recording`. Terms: *a_1, a_2, a_3, t_p,
//! K_d, K_hg, K_nms, t_nms* are the paper's; *gain_i* = (K_d + K_nms)*a_i is what the torque alone can tell of K_d
//! and a_i; the *remnant* is the part of the driver's torque that no linear model of the inputs explains.
//!
//! What is not here: driving (the models do that), sets of drives (the studies), and the command line.

mod balance;
mod change;
mod diagnostics;
mod lane;
mod motion;
mod noise_model;
mod options;
mod paper;
mod pieces;
mod prepare;
mod result;
mod road;
mod search;
mod signals;
mod switches;
mod together;
mod tracking;
mod verdict;
mod wheel;
mod wide;

pub use balance::Balance;
pub use change::{BLIP_S, Change, Constancy, Power, Shape};
pub use diagnostics::{autocorrelation, fit_percent};
pub use haptic_recording::{
    COLUMNS, DriveLog, HAPTIC_DBC, Layout, LogError, Mapping, Recording, SPEED_COLUMN, Signals, SingleTrack,
    Table, of_bytes, of_table, open as open_mapped,
};
pub use lane::LaneNoise;
pub use noise_model::{
    INFORMED, Information, LONGEST_DELAY_S, Truth, identify as identify_with_noise_model, information,
};
pub use options::{FixError, Inertia, Options, WHEEL_INERTIA_KG_M2};
pub use paper::{TABLE_4, identify as identify_as_published};
pub use pieces::{Piece, Pieces, identify_in_pieces};
pub use prepare::{ColumnFaults, LeftOut, Preflight, Reason};
pub use result::{
    AtTNms, Combination, Correlation, Errors, Identification, InputCorrelation, OwnLine, Parameter,
    Parameters, Refutation, Remnant, Start, Torques, Traces, Whiteness,
};
pub use search::{Bounds, Optimum, Quadratic, Termination, minimise};
pub use signals::Muscle;
pub use together::{identify_together, identify_together_and_track};
pub use tracking::{History, Tracking, WANDERING_PER_ROOT_S, identify_and_track, track};
