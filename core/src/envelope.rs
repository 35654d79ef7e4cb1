//! The torque envelope: the last word on every command. It knows nothing of the guidance law.
//!
//! Every clamp returns its reason, and the reason that won is in the output.

use crate::quantity::Torque;

/// Which limit held the torque back.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum LimitReason {
    /// No limit acted.
    #[default]
    None = 0,
    /// The absolute limit L.
    Absolute = 1,
    /// No lane preview that may be trusted: the torque is zero.
    NoLaneInput = 2,
}

/// Limits of the torque; immutable once validated by [`crate::params`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Envelope {
    pub(crate) absolute: Torque,
}

impl Envelope {
    /// The nearest torque within the envelope, and which limit held it back.
    #[must_use]
    pub fn limit(&self, wanted: Torque) -> (Torque, LimitReason) {
        // +-L: the driver must be able to override the guidance by hand (paper, section 3.2).
        let limited = wanted.clamp(self.absolute.opposite(), self.absolute);
        (
            limited,
            if limited == wanted {
                LimitReason::None
            } else {
                LimitReason::Absolute
            },
        )
    }
}

impl LimitReason {
    /// The reason of a code on the bus.
    #[must_use]
    pub const fn from_code(code: i64) -> Option<Self> {
        match code {
            0 => Some(Self::None),
            1 => Some(Self::Absolute),
            2 => Some(Self::NoLaneInput),
            _ => None,
        }
    }
}
