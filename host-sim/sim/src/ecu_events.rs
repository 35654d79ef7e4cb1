//! What the ECU said of itself, and when: modes and faults by name.

use haptic_core::bus::Frame;
use haptic_core::bus::e2e::ReceiverState;
use haptic_core::bus::messages::{Guidance, Message};
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;

use crate::guidance::Status;
use crate::models::STEP_S;
use crate::simulation::Outcome;
use haptic_log::Event;

/// What an ECU says of itself from an instant on, until it says something else.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Said {
    /// When, s since the start of the run.
    pub time_s: f64,
    /// Its mode.
    pub mode: Mode,
    /// The faults that are there.
    pub faults: FaultSet,
}

/// Listens to an ECU.
#[derive(Debug, Clone)]
pub struct EcuEvents {
    receiver: ReceiverState,
    said: Vec<Said>,
}

impl EcuEvents {
    /// Nothing heard yet.
    pub fn new() -> Self {
        Self {
            receiver: ReceiverState::TRUSTED,
            said: Vec::new(),
        }
    }

    /// Takes what came of a step.
    pub fn observe(&mut self, outcome: &Outcome) {
        if let Some(status) = &outcome.status {
            self.take(outcome.observation.step, status.mode, status.faults);
        }
    }

    /// Takes the frame of a step.
    pub fn take_frame(&mut self, step: u32, frame: &Frame) {
        if let Ok(guidance) = Guidance::decode(&mut self.receiver, frame) {
            self.take(step, guidance.mode, guidance.faults);
        }
    }

    fn take(&mut self, step: u32, mode: Mode, faults: FaultSet) {
        let is_new = |last: &Said| (last.mode, last.faults) != (mode, faults);
        if self.said.last().is_none_or(is_new) {
            let time_s = f64::from(step) * STEP_S;
            self.said.push(Said { time_s, mode, faults });
        }
    }

    /// What it said last of mode and faults.
    pub fn status(&self) -> Option<Status> {
        self.said.last().map(|said| Status {
            mode: said.mode,
            faults: said.faults,
            ..Status::GUIDES
        })
    }

    /// Everything that happened, in order of time: faults that appeared, modes that changed.
    pub fn events(&self) -> impl Iterator<Item = Event> {
        let before = std::iter::once(None).chain(self.said.iter().map(Some));
        self.said.iter().zip(before).flat_map(|(said, before)| {
            let appeared = said
                .faults
                .difference(before.map_or(FaultSet::NONE, |before| before.faults));
            let names = Fault::ALL
                .into_iter()
                .filter(move |fault| appeared.contains(*fault));
            let reports = names.map(|fault| format!("The ECU reports {fault:?}"));
            let goes = before.filter(|before| before.mode != said.mode);
            let goes = goes.map(|_| format!("The ECU goes to {:?}", said.mode));
            let time_s = said.time_s;
            reports.chain(goes).map(move |what| Event { time_s, what })
        })
    }

    /// The first step from one on in which a fault appeared.
    pub fn first_fault_from(&self, step: u32) -> Option<u32> {
        let steps = self.said.windows(2).filter_map(|pair| {
            let appeared = pair[1].faults.difference(pair[0].faults);
            (appeared != FaultSet::NONE).then(|| (pair[1].time_s / STEP_S).round() as u32)
        });
        steps.into_iter().find(|at| *at >= step)
    }

    /// What it said from the start, and at each change.
    pub fn into_said(self) -> Vec<Said> {
        self.said
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
    use haptic_core::quantity::Torque;
    use haptic_core::safety::envelope::LimitReason;

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
        let told: Vec<_> = ecu.events().map(|event| (event.time_s, event.what)).collect();
        let expected = [
            (0.001, "The ECU reports LaneTimeout"),
            (0.001, "The ECU goes to Handover"),
            (0.002, "The ECU reports ColumnTimeout"),
            (0.003, "The ECU goes to Standby"),
        ];
        assert_eq!(told, expected.map(|(time_s, what)| (time_s, what.to_string())));
    }
}
