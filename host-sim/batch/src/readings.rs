//! What the ECU said of the driver's reliance during a run, from its telemetry on the bus.

use haptic_core::bus::messages::{Message, Telemetry};
use serde::Serialize;

use haptic_sim::Outcome;
use haptic_sim::models::STEP_S;

/// One report of the ECU.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Reading {
    /// When it was sent, s.
    pub time_s: f64,
    /// Whether there was a probe.
    pub probing: bool,
    /// K_hg and its standard deviation, once identified.
    pub estimate: Option<[f64; 2]>,
}

/// Collects the ECU's reports while a run goes on.
#[derive(Debug, Clone, Default)]
pub struct Readings {
    /// In the order of sending, 20 ms apart.
    pub readings: Vec<Reading>,
    /// Steps in which a limit held the torque back while there was a probe.
    pub limited_steps: u32,
}

impl Readings {
    /// Takes what came of a step.
    pub fn observe(&mut self, outcome: &Outcome) {
        let frame = outcome
            .frames_out
            .iter()
            .find(|frame| frame.id() == Telemetry::ID);
        let data = frame.and_then(|frame| frame.data().try_into().ok());
        // The simulated bus damages nothing, so that the signals may be read without a receiver.
        if let Some(telemetry) = data.and_then(|data| Telemetry::unpack(&data)) {
            self.readings.push(Reading {
                time_s: f64::from(outcome.observation.step) * STEP_S,
                probing: telemetry.probe.is_some(),
                estimate: telemetry.k_hg.map(|r| [r.k_hg.si(), r.deviation.si()]),
            });
        }
        let probing = self.readings.last().is_some_and(|last| last.probing);
        self.limited_steps += u32::from(probing && outcome.decided.limited);
    }

    /// The last report at or before a time.
    pub fn at(&self, time_s: f64) -> Option<&Reading> {
        let next = self.readings.partition_point(|r| r.time_s <= time_s);
        self.readings.get(next.checked_sub(1)?)
    }
}
