//! What the ECU said of itself, and when: modes and faults by name, from its guidance frames.

use haptic_core::bus::Frame;
use haptic_core::bus::e2e::ReceiverState;
use haptic_core::bus::messages::{Guidance, Message};
use haptic_core::faults::{Fault, FaultSet};
use haptic_core::modes::Mode;

use crate::models::STEP_S;
use crate::simulation::Outcome;
use haptic_log::Event;

/// Listens to an ECU.
#[derive(Debug, Clone)]
pub struct EcuEvents {
    receiver: ReceiverState,
    mode: Option<Mode>,
    faults: FaultSet,
    events: Vec<Event>,
}

impl EcuEvents {
    /// Nothing heard yet.
    pub fn new() -> Self {
        Self {
            receiver: ReceiverState::TRUSTED,
            mode: None,
            faults: FaultSet::NONE,
            events: Vec::new(),
        }
    }

    /// Takes what came of a step.
    pub fn observe(&mut self, outcome: &Outcome) {
        if let Some(frame) = outcome.frames_out.first() {
            self.take_frame(outcome.observation.step, frame);
        }
    }

    /// Takes the frame of a step.
    pub fn take_frame(&mut self, step: u32, frame: &Frame) {
        let Ok(guidance) = Guidance::decode(&mut self.receiver, frame) else {
            return;
        };
        let time_s = f64::from(step) * STEP_S;
        let appeared = guidance.faults.without(self.faults);
        let names = Fault::ALL.into_iter().filter(|fault| appeared.contains(*fault));
        self.events.extend(names.map(|fault| Event {
            time_s,
            what: format!("The ECU reports {fault:?}"),
        }));
        if self.mode.is_some_and(|mode| mode != guidance.mode) {
            self.events.push(Event {
                time_s,
                what: format!("The ECU goes to {:?}", guidance.mode),
            });
        }
        (self.mode, self.faults) = (Some(guidance.mode), guidance.faults);
    }

    /// Everything heard, in order of time.
    pub fn into_events(self) -> Vec<Event> {
        self.events
    }
}

impl Default for EcuEvents {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptic_core::bus::messages::ResetCause;
    use haptic_core::envelope::LimitReason;
    use haptic_core::quantity::Torque;

    #[test]
    fn a_fault_is_told_by_name_once_and_a_mode_when_it_changes() {
        let frame = |step: u32, mode, bits| {
            let guidance = Guidance {
                torque: Torque::ZERO,
                limit: LimitReason::None,
                mode,
                warning: false,
                faults: FaultSet::from_bits(bits),
                reset: ResetCause::PowerOn,
            };
            guidance.encode(step as u8)
        };
        let mut ecu = EcuEvents::new();
        // Bit 0 and bit 3 of the status frame are LaneTimeout and ColumnTimeout in core/haptic.dbc.
        for (step, mode, bits) in [
            (0, Mode::Active, 0),
            (1, Mode::Handover, 1),
            (2, Mode::Handover, 9),
            (3, Mode::Standby, 9),
        ] {
            ecu.take_frame(step, &frame(step, mode, bits));
        }
        let told: Vec<_> = ecu
            .into_events()
            .into_iter()
            .map(|event| (event.time_s, event.what))
            .collect();
        let expected = [
            (0.001, "The ECU reports LaneTimeout"),
            (0.001, "The ECU goes to Handover"),
            (0.002, "The ECU reports ColumnTimeout"),
            (0.003, "The ECU goes to Standby"),
        ];
        assert_eq!(told, expected.map(|(time_s, what)| (time_s, what.to_string())));
    }
}
