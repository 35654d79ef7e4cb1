//! Which scenarios the lanes can drive.

use std::fmt;

use super::counts::{ONE, speed_heard};
use crate::models::disturbances::SensorErrors;
use crate::scenario::{Condition, FailureKind, Scenario, Sensors};

/// What keeps a run out of the lanes: the shipping ECU drives it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Reason {
    /// A camera whose pictures come late, that is blind at times, or that jumps to another line.
    Camera,
    /// Exact sensors, past the bus.
    ExactSensors,
    /// Slower than the controller guides.
    TooSlow,
    /// The lane preview fails within the first two seconds, while the ECU does not know its sender's period yet.
    EarlyFailure,
    /// A failure that ends: the ECU comes back.
    FailureEnds,
    /// Longer than the lanes' clock counts.
    TooLong,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Camera => "a camera that is late, blind at times, or on another line",
            Self::ExactSensors => "exact sensors, past the bus",
            Self::TooSlow => "slower than is guided",
            Self::EarlyFailure => "a lane preview that fails within the first 2 s",
            Self::FailureEnds => "a failure that ends",
            Self::TooLong => "longer than 2000 s",
        })
    }
}

/// From here on the ECU waits the same time for every sender of a lane preview.
const SETTLED_S: f64 = 2.0;
/// A count of speed on the bus, m/s.
const SPEED_LSB_M_PER_S: f64 = 1.0 / 256.0;
/// The lanes count microseconds in 31 bits.
const LONGEST_S: f64 = 2000.0;

/// Why the lanes cannot drive a scenario; `None` if they can.
#[must_use]
pub fn why_not(scenario: &Scenario) -> Option<Reason> {
    let SensorErrors {
        camera_latency,
        camera_jitter,
        dropouts,
        line_jumps,
        ..
    } = scenario.car().sensor_errors;
    let camera = [camera_latency, camera_jitter, dropouts, line_jumps];
    let guided = scenario.condition() != Condition::Manual;
    let params = scenario.controller_params();
    let failure = scenario.failure();
    let heard_m_per_s = f64::from(speed_heard(scenario)) * (1.0 / ONE);
    let reasons = [
        (guided && camera.iter().any(|error| *error != 0.0), Reason::Camera),
        (
            guided && scenario.sensors() == Sensors::Exact,
            Reason::ExactSensors,
        ),
        (
            guided && heard_m_per_s < params.least_speed_m_per_s + SPEED_LSB_M_PER_S,
            Reason::TooSlow,
        ),
        (
            failure.kind == FailureKind::Input && failure.time_s < SETTLED_S,
            Reason::EarlyFailure,
        ),
        (
            failure.kind != FailureKind::None && failure.duration_s.is_some(),
            Reason::FailureEnds,
        ),
        (scenario.duration_s() > LONGEST_S, Reason::TooLong),
    ];
    reasons
        .into_iter()
        .find_map(|(holds, reason)| holds.then_some(reason))
}
