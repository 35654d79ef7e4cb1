//! One step of the controller: the one place that sees mode machine, plausibility checks, law, envelope and ramps together.
//! [`Step::run`] has its stations in order, and the order is their meaning. Each station has a file:
//!
//! - `lane`: the lane that the law goes by, the picture's or the last one's, extrapolated.
//! - `inputs`: new inputs go through the checks, and what is known of lost ones is forgotten.
//! - `modes`: what the events of the step make of the mode, and what a mode begins with.
//! - `torque`: what the law asks for, what the probe adds, and what the limits leave of both.

mod inputs;
mod lane;
mod modes;
mod torque;

use super::Command;
use super::memory::{ChangedParts, KeptOnce, Memory};
use crate::controller::config::Config;
use crate::controller::injection::Injection;
use crate::controller::inputs::{Input, Inputs};
use crate::lane::LaneSample;
use crate::law::Law;
use crate::observer::{self, Sensor};
use crate::quantity::{Instant, Micros, Torque};
use crate::safety::faults::{Fault, FaultSet};
use crate::safety::hands::WARN;
use crate::safety::modes::Mode;
use crate::safety::redundant::Redundant;

/// One step: what it reads, and what it changes.
pub(super) struct Step<'a, I> {
    pub(super) config: &'a Config,
    pub(super) law: Law<'a>,
    pub(super) sensor: Sensor<'a>,
    pub(super) now: Instant,
    pub(super) elapsed: Micros,
    /// The torque that was really applied since the last step.
    pub(super) applied: Torque,
    pub(super) inputs: &'a Inputs,
    pub(super) injection: &'a I,
    /// The lane that the law uses: the input's, or the last one, extrapolated.
    pub(super) lane: Input<LaneSample>,
    /// It was old when it arrived.
    pub(super) is_late: bool,
    /// The hands' torque, as far as the sensor tells it.
    pub(super) hands: Option<Torque>,
    pub(super) memory: &'a mut Memory,
    pub(super) observer: &'a mut Redundant<observer::State>,
    pub(super) changed: ChangedParts,
    pub(super) once: &'a mut KeptOnce,
}

impl<I: Injection> Step<'_, I> {
    pub(super) fn run(&mut self) -> Command {
        // No code but that of a mode is ever stored; the copies have been compared.
        let before = Mode::from_code(self.memory.fast.packed.mode.into()).unwrap_or(Mode::Fault);
        let [mut bridged, mut reported] = [FaultSet::NONE; 2];
        if before == Mode::Active && !(self.memory.coast.is_idle() && self.inputs.lane.value().is_some()) {
            self.changed.add(ChangedParts::COAST);
            [bridged, reported] = self.coast();
        }
        let fast_enough = self.is_fast_enough();
        let lost = self.update_inputs(fast_enough);
        let mut faults = lost
            .union(self.memory.faults())
            .union(self.inputs.faults)
            .union(reported);
        faults.insert_if(self.is_out_of_time(), Fault::Deadline);
        self.memory.fast.kept |= faults.common(FaultSet::CRITICAL).bits();

        if before == Mode::Active {
            // The probe is no guidance: a hand that lets it pass has not refused anything.
            let guided = self.applied_without_probe();
            self.memory.fast.hands.add_guided_time(guided, self.elapsed);
        }
        faults.insert_if(
            matches!(before, Mode::Active | Mode::Fade) && self.memory.fast.hands.time_hands_off() >= WARN,
            Fault::HandsOff,
        );
        let mode = self.next_mode(before, faults.difference(bridged), fast_enough);
        if mode != before {
            self.enter(mode, faults);
        }
        let (torque, probe, limit) = self.torque(mode, faults);
        self.memory.fast.probe_applied = probe.unwrap_or(Torque::ZERO);
        // In Active beside another line, or long without a picture, guidance lets go: the driver must know.
        let lets_go = faults.contains(Fault::LaneStep) || self.memory.coast.is_long_blind();
        let warning = (mode == Mode::Active && lets_go)
            || matches!(mode, Mode::Handover | Mode::Fault | Mode::Locked)
            || faults.contains(Fault::HandsOff);
        Command {
            torque,
            probe,
            limit,
            mode,
            faults,
            warning,
            hands: self.hands,
        }
    }

    /// The torque applied since the last step, without the probe's part of it.
    fn applied_without_probe(&self) -> Torque {
        subtract_probe(self.applied, Some(self.memory.fast.probe_applied))
    }
}

fn add_probe(guidance: Torque, probe: Option<Torque>) -> Torque {
    guidance.plus(probe.unwrap_or(Torque::ZERO))
}

pub(super) fn subtract_probe(torque: Torque, probe: Option<Torque>) -> Torque {
    add_probe(torque, probe.map(Torque::opposite))
}
