//! What the controller reads: the latest usable value of each input.
//!
//! Not here: how a value comes from the bytes of a frame ([`crate::bus`]), and for how long it may be used ([`crate::ecu`]).

use crate::lane::LaneSample;
use crate::quantity::{Radians, Ratio, Speed, Torque, TurningRate};
use crate::safety::faults::FaultSet;
use crate::safety::redundant::words;

/// One input: the latest value that passed the bus's checks, and since when.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Input<T> {
    /// No usable value: never heard, stale, or refused for longer than the time-out.
    Lost,
    /// A value that is not older than the time-out.
    Held(T),
    /// A value that came since the last step.
    New(T),
}

impl<T: Copy> Input<T> {
    /// The value, new or held.
    #[must_use]
    pub const fn value(&self) -> Option<T> {
        match self {
            Self::Lost => None,
            Self::Held(value) | Self::New(value) => Some(*value),
        }
    }
}

words! {
    /// Driver torque and wheel angle. Where the sensor is a torsion bar the torque is the bar's, and the angle that of the end that the
    /// parameters say.
    #[derive(Default)]
    pub struct ColumnState {
        /// T_d on the wheel.
        pub driver_torque: Torque,
        /// phi.
        pub wheel_angle: Radians,
    }
}

words! {
    /// How the vehicle moves, as its own sensors have it.
    #[derive(Default)]
    pub struct Motion {
        /// Two sources of its speed.
        pub speeds: [Speed; 2],
        /// The measured yaw rate; counts only where there is one.
        pub yaw_rate: TurningRate,
        /// 1 where there is a measured yaw rate.
        pub has_yaw_rate: u32,
    }
}

impl Motion {
    /// Speeds, and the yaw rate if it is measured.
    #[must_use]
    pub fn new(speeds: [Speed; 2], yaw_rate: Option<TurningRate>) -> Self {
        Self {
            speeds,
            yaw_rate: yaw_rate.unwrap_or(TurningRate::ZERO),
            has_yaw_rate: u32::from(yaw_rate.is_some()),
        }
    }

    /// The yaw rate, if it is measured.
    #[must_use]
    pub fn yaw_rate(&self) -> Option<TurningRate> {
        (self.has_yaw_rate != 0).then_some(self.yaw_rate)
    }
}

/// What the host requests; on the bus every 10 ms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Request {
    /// Guidance is wanted. A rising edge engages, a low level ends.
    pub engage: bool,
    /// Share of the law's torque to apply, 0 to 1; saturates there.
    pub authority: Ratio,
    /// The probe is wanted on top of it.
    pub probe: bool,
}

/// What the controller reads every millisecond.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Inputs {
    /// Lane errors.
    pub lane: Input<LaneSample>,
    /// The column's sensors.
    pub column: Input<ColumnState>,
    /// Two sources of the vehicle's speed, and its yaw rate.
    pub motion: Input<Motion>,
    /// What the host requests.
    pub request: Input<Request>,
    /// Faults found outside: on the bus, by the monitor, at the output.
    pub faults: FaultSet,
}

impl Inputs {
    /// Nothing heard. No constant, which a step would copy whole.
    #[inline(always)]
    pub(crate) fn lost() -> Self {
        Self {
            lane: Input::Lost,
            column: Input::Lost,
            motion: Input::Lost,
            request: Input::Lost,
            faults: FaultSet::NONE,
        }
    }
}
