//! What the events of a step make of the mode, and what a mode begins with.

use super::Step;
use crate::controller::READY;
use crate::controller::injection::Injection;
use crate::controller::memory::ChangedParts;
use crate::law::LawState;
use crate::law::activity::Activity;
use crate::law::probe::ProbeState;
use crate::quantity::{Instant, Micros, Torque, TorqueRate};
use crate::safety::coast::Coast;
use crate::safety::envelope::EnvelopeState;
use crate::safety::faults::{Fault, FaultSet};
use crate::safety::hands::END;
use crate::safety::modes::{Event, Events, Mode};
use crate::safety::ramp::{Ramp, handover_length, smaller_of_same_sign};

/// A planned fade.
const FADE_RATE: TorqueRate = TorqueRate::from_nm_per_s(4.0);
/// A step that comes more than this after the last one is late.
const LATE: Micros = Micros::from_us(2_500);
/// One step that comes this late is a fault by itself: the vehicle has moved for more than a period of the camera.
const LOST_TIME: Micros = Micros::from_ms(10);
/// How many late steps in a row are tolerated.
const LATE_STEPS: u8 = 1;
/// A step that comes less than this after the last one is early.
const EARLY: Micros = Micros::from_us(500);
/// How many early steps in a row are tolerated. Each gains nothing, as every limit goes by the time passed; more mean a timer that
/// runs away, which is a fault.
const EARLY_STEPS: u8 = 3;

impl<I: Injection> Step<'_, I> {
    /// Counts late and early steps in a row, and says whether there were too many. One after more than [`LOST_TIME`] counts as too many
    /// at once.
    pub(super) fn is_out_of_time(&mut self) -> bool {
        let packed = &mut self.memory.fast.packed;
        packed.late = match self.elapsed {
            elapsed if elapsed > LOST_TIME => LATE_STEPS.saturating_add(1),
            elapsed if elapsed > LATE => packed.late.saturating_add(1),
            _ => 0,
        };
        packed.early = if self.elapsed < EARLY {
            packed.early.saturating_add(1)
        } else {
            0
        };
        packed.late > LATE_STEPS || packed.early > EARLY_STEPS
    }

    /// The next mode: of all events of this step the most urgent one that leads out of the present mode decides.
    pub(super) fn next_mode(&mut self, mode: Mode, faults: FaultSet, fast_enough: Option<bool>) -> Mode {
        let inputs_ok = !faults.intersects(FaultSet::INPUT);
        let request = self.inputs.request.value().map(|r| r.engage);
        let fast = &mut self.memory.fast;
        let rising = request == Some(true) && fast.packed.requested == 0;
        // A lost request keeps the last: one that comes back high is no rising edge.
        if let Some(high) = request {
            fast.packed.requested = u8::from(high);
        }
        fast.ready = if mode == Mode::Standby && inputs_ok && fast_enough == Some(true) {
            Micros::from_us(fast.ready.us().saturating_add(self.elapsed.us())).min(READY)
        } else {
            Micros::from_us(0)
        };
        let mut raised = Events::only(Event::BootPassed);
        raised.insert_if(rising && fast.ready >= READY, Event::Engage);
        // After a late step the ramp may be done before the torque, whose fall is limited, is zero.
        raised.insert_if(
            self.memory.ramp.is_done() && self.applied == Torque::ZERO,
            Event::Faded,
        );
        let no_hand = fast.hands.time_hands_off() >= END;
        let is_over = request == Some(false) || fast_enough == Some(false) || no_hand;
        raised.insert_if(is_over, Event::Disengage);
        raised.insert_if(!inputs_ok, Event::InputLost);
        raised.insert_if(faults.intersects(FaultSet::LOCKING), Event::BootRejected);
        raised.insert_if(faults.intersects(FaultSet::CRITICAL), Event::Critical);
        mode.after_all(raised)
    }

    /// Begins a mode.
    #[expect(clippy::as_conversions, reason = "a code is its discriminant")]
    pub(super) fn enter(&mut self, mode: Mode, faults: FaultSet) {
        self.changed.add(ChangedParts::LAW);
        self.changed.add(ChangedParts::COAST);
        self.changed.add(ChangedParts::RAMP);
        self.memory.fast.packed.mode = mode as u8;
        let trust = self.memory.coast.trust;
        self.memory.coast = Coast::NEW;
        self.memory.fast.probe = ProbeState::SILENT;
        match mode {
            Mode::Active => {
                // Both hold instants, which may be older than a wrap of the clock.
                (self.memory.law, self.memory.fast.envelope) = (LawState::NEW, EnvelopeState::new(self.now));
                self.memory.fast.hands.reset();
                // What was felt in another drive says nothing of this one.
                self.once.activity = Activity::NEW;
            }
            Mode::Fade => self.memory.ramp = Ramp::at_rate(self.applied, FADE_RATE),
            Mode::Handover => {
                let suspect = self.suspect_since(faults);
                // The ramp starts from the torque without the probe, so that no half wave of it is held for two seconds; where the
                // probe had reduced the torque, from the reduced one.
                let applied = smaller_of_same_sign(self.applied, self.applied_without_probe());
                let start = self
                    .once
                    .torque_history
                    .handover_start(self.now, suspect, applied);
                self.memory.ramp = Ramp::over(start, handover_length(trust));
            }
            // The others have no torque.
            Mode::Boot | Mode::Standby | Mode::Fault | Mode::Locked => {}
        }
    }

    /// For how long the outputs may have been wrong: since the inputs of these faults were last good, or the time that a check
    /// needs to find a fault.
    fn suspect_since(&self, faults: FaultSet) -> Micros {
        let lost_for = |fault, last_new: Instant| {
            if faults.contains(fault) {
                self.now.since(last_new)
            } else {
                Micros::from_us(0)
            }
        };
        let times = &self.memory.input_times;
        faults
            .unseen()
            .max(lost_for(Fault::LaneTimeout, times.lane))
            .max(lost_for(Fault::LaneStep, times.lane))
            .max(lost_for(Fault::SpeedStep, times.motion))
            .max(lost_for(Fault::ColumnTimeout, times.column))
            .max(lost_for(Fault::SpeedTimeout, times.motion))
            .max(lost_for(Fault::RequestTimeout, times.request))
    }
}
