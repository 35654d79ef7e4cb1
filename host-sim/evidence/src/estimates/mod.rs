//! How right the estimates of `identify` are: published drivers with a known truth, driven, recorded and identified many times.
//!
//! - [`repeat`]: whether intervals hold the truth as often as they say.
//! - [`corruptions`], [`recordings`]: logs as real recorders leave them.
//! - [`RandomPlan`]: drives that are composed by chance.
//! - [`changes`]: what changes in mid-drive.
//! - [`methods`]: ways to treat the camera's noise.
//!
//! Not here: the drives themselves (`haptic_batch::experiment`), the estimators (`haptic-analysis`).

mod changes;
mod changing;
mod corruption;
mod corruptions;
mod kinds;
mod methods;
mod random;
mod recordings;
mod repetitions;

pub use changes::{Changes, ChangesLine, changes};
pub use changing::{Changed, DriverChanges, driver_at};
pub use corruption::{Corruption, POPULATION};
pub use corruptions::{CorruptionLine, Corruptions, Held, SoughtWheel, corruptions};
pub use kinds::{KINDS, Kind};
pub use methods::{METHODS, MethodLine, Methods, methods};
pub use random::{ConditionLine, RandomDrive, RandomDrives, RandomPlan, Said, Share, Tally, resumed_random};
pub use recordings::{CHANNELS, Channel, recordings};
pub use repetitions::{Repeated, Repetitions, repeat};
