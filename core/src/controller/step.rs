//! One step of the controller: the one place that sees the mode machine, the plausibility checks, the law, the
//! envelope and the ramps together. The order of its stations is its meaning, so they are read in one go.

use super::{ChangedParts, Command, Memory, PendingChecks, READY};
use crate::controller::config::Config;
use crate::controller::injection::Injection;
use crate::controller::inputs::{Input, Inputs, Request};
use crate::law::fdca::Car;
use crate::law::probe::ProbeState;
use crate::law::{EgoMotion, LaneSample, LawState};
use crate::quantity::{
    Instant, Metres, Micros, Radians, Ratio, Torque, TorqueRate, TurningRate, per_second, product, share_of,
};
use crate::safety::coast::{Coast, EXTRAPOLATION_PERIOD, PictureVerdict};
use crate::safety::envelope::{EnvelopeState, LimitReason, Situation};
use crate::safety::faults::{Fault, FaultSet};
use crate::safety::hands::{END, WARN};
use crate::safety::modes::{Event, Events, Mode};
use crate::safety::motion_history::MotionHistory;
use crate::safety::plausibility::{LaneMotion, lane_step_is_possible};
use crate::safety::ramp::{Ramp, TorqueHistory, handover_length, pace, smaller_of_same_sign};

/// A planned fade.
const FADE_RATE: TorqueRate = TorqueRate::from_nm_per_s(4.0);
/// A step that comes later than this after the last one missed its deadline.
const LATE: Micros = Micros::from_us(2_500);
/// A step that comes this late is a fault by itself: the world has moved on by half a camera period.
const LOST_TIME: Micros = Micros::from_ms(10);
/// So many late steps in a row are tolerated.
const LATE_STEPS: u8 = 1;
/// A step that comes sooner than this was not asked for.
const EARLY: Micros = Micros::from_us(500);
/// So many early steps in a row are tolerated: they earn no rate limit, but a runaway timer is a fault.
const EARLY_STEPS: u8 = 3;

/// A lane sample that is no older than this when it comes needs no other making up for than its rates.
const PROMPT: Micros = Micros::from_ms(10);

/// Spans beyond half a wrap of the clock are negative.
const HALF_WRAP: Micros = Micros::from_us(u32::MAX / 2);
/// What does not end guidance while the lane goes on.
const BRIDGED: FaultSet = FaultSet::NONE
    .with(Fault::LaneTimeout)
    .with(Fault::LaneInvalid)
    .with(Fault::LaneStep);

/// One step, with what it must not change.
pub(super) struct Step<'a, I> {
    pub(super) config: &'a Config,
    pub(super) now: Instant,
    pub(super) applied: Torque,
    pub(super) inputs: &'a Inputs,
    /// The lane that the law is shown: the input's, or in its place the one seen last as it went on.
    pub(super) lane: Input<LaneSample>,
    pub(super) elapsed: Micros,
    /// The share of the law's torque that driver activity leaves.
    pub(super) activity: Ratio,
    pub(super) injection: &'a I,
}

impl<I: Injection> Step<'_, I> {
    pub(super) fn run(
        &mut self,
        v: &mut Memory,
        changed: &mut ChangedParts,
        torque_history: &mut TorqueHistory,
        motion_history: &mut MotionHistory,
        pending: &mut PendingChecks,
    ) -> Command {
        let before = Mode::from_code(v.fast.packed.mode.into()).unwrap_or(Mode::Fault);
        let [mut bridged, mut reported] = [FaultSet::NONE; 2];
        if before == Mode::Active && !(v.coast.is_idle() && self.inputs.lane.value().is_some()) {
            changed.add(ChangedParts::COAST);
            [bridged, reported] = self.coast(v, changed, motion_history);
        }
        let fast_enough = self.is_fast_enough();
        let lost = self.update_inputs(v, changed, fast_enough, motion_history, pending);
        let (late, early) = self.keep_time(v);
        let mut faults = lost.union(v.faults()).union(self.inputs.faults).union(reported);
        faults.insert_if(late > LATE_STEPS || early > EARLY_STEPS, Fault::Deadline);
        v.fast.kept |= faults.common(FaultSet::CRITICAL).bits();

        if before == Mode::Active {
            v.fast.hands.add_guided_time(
                subtract_probe(self.applied, Some(v.fast.probe_applied)),
                self.elapsed,
            );
        }
        faults.insert_if(
            matches!(before, Mode::Active | Mode::Fade) && v.fast.hands.time_hands_off() >= WARN,
            Fault::HandsOff,
        );
        let mode = self.next_mode(v, before, faults.difference(bridged), fast_enough);
        if mode != before {
            changed.add(ChangedParts::LAW);
            changed.add(ChangedParts::COAST);
            changed.add(ChangedParts::RAMP);
            self.enter(v, mode, faults, torque_history);
        }
        let (torque, probe, limit) = self.torque(v, changed, mode, faults);
        v.fast.probe_applied = probe.unwrap_or(Torque::ZERO);
        // While it lets go of its line, whoever relies on guidance has to know.
        let warning = (mode == Mode::Active && faults.contains(Fault::LaneStep))
            || matches!(mode, Mode::Handover | Mode::Fault | Mode::Locked)
            || faults.contains(Fault::HandsOff);
        Command {
            torque,
            probe,
            limit,
            mode,
            faults,
            warning,
        }
    }

    /// The lane where its picture did not come, or did not agree. Returns the faults that do not end guidance because of it,
    /// and what there is to say of the pictures.
    #[cold]
    #[inline(never)]
    fn coast(
        &mut self,
        v: &mut Memory,
        changed: &mut ChangedParts,
        motion_history: &mut MotionHistory,
    ) -> [FaultSet; 2] {
        let Some(last) = v.law.last() else {
            return [FaultSet::NONE; 2];
        };
        let extrapolated_lane = |v: &Memory, motion_history: &MotionHistory, at| {
            let checks = &self.config.plausibility;
            checks.extrapolated_lane(&v.plausibility, motion_history, self.now, &last, at)
        };
        let is_older = |sample: LaneSample| sample.at.since(last.at) > HALF_WRAP;
        let demanded = self.law(v, last);
        match self.inputs.lane {
            Input::Lost => v.coast.picture_missing(demanded),
            Input::New(sample) if !is_older(sample) => {
                let agrees = lane_step_is_possible(&extrapolated_lane(v, motion_history, sample.at), &sample);
                // FDCA stands on its rates, so they must not stand still while trust comes back.
                let goes_by_pictures = self.config.fdca.get().is_some() && v.coast.sees();
                match v.coast.picture_arrived(&sample, agrees, demanded) {
                    PictureVerdict::SameLine if goes_by_pictures => {}
                    PictureVerdict::SameLine => v.law.relocate(sample),
                    PictureVerdict::NewLine => {
                        v.law = LawState::NEW;
                        v.plausibility.forget_lane();
                        motion_history.forget_line();
                    }
                    PictureVerdict::OtherLine => {}
                }
                changed.add(ChangedParts::LAW);
                changed.add(ChangedParts::LANE);
            }
            _ => {}
        }
        v.coast.advance(self.elapsed);
        let mut reported = FaultSet::NONE;
        reported.insert_if(v.coast.sees_other_line(), Fault::LaneStep);
        if !v.coast.is_extrapolating() {
            return [FaultSet::NONE, reported];
        }
        let passed = self.now.since(v.input_times.lane);
        // A camera may be later than before, or jitter: where the lane went on to waits for a picture to compare.
        let waits = self.inputs.lane.value().is_some_and(is_older);
        // It is of no use yet.
        reported.insert_if(waits && !v.coast.sees_other_line(), Fault::LaneTimeout);
        self.lane = if passed < EXTRAPOLATION_PERIOD || waits {
            Input::Held(last)
        } else {
            // As old as the pictures were.
            Input::New(extrapolated_lane(v, motion_history, last.at.after(passed)))
        };
        [BRIDGED, reported]
    }

    /// Takes the inputs: what is new goes through the plausibility checks. Returns what is lost.
    fn update_inputs(
        &self,
        v: &mut Memory,
        changed: &mut ChangedParts,
        fast_enough: Option<bool>,
        motion_history: &mut MotionHistory,
        pending: &mut PendingChecks,
    ) -> FaultSet {
        let Inputs {
            column,
            motion,
            request,
            ..
        } = self.inputs;
        let checks = &self.config.plausibility;
        let mut kept = v.faults();

        if let Input::New(motion) = motion {
            let passed = self.now.since(v.input_times.motion);
            v.input_times.motion = self.now;
            changed.add(ChangedParts::INPUT_TIMES);
            changed.add(ChangedParts::MOTION);
            let (agree, plausible) = v.plausibility.speeds_agree(motion.speeds, passed);
            kept.set(!plausible, Fault::SpeedImplausible);
            let speed = if agree {
                motion.speeds[0]
            } else {
                v.plausibility.speed()
            };
            let measured = motion.yaw_rate();
            let yaw_rate = measured.and_then(|rate| v.plausibility.accepted_yaw_rate(rate, passed));
            let is_distrusted = measured.is_some() && v.plausibility.motion.yaw.is_distrusted();
            kept.set(is_distrusted, Fault::YawRate);
            checks.motion(&mut v.plausibility, speed, yaw_rate);
            v.share = self.config.schedule.share(v.plausibility.speed());
            motion_history.record_turning_rate(self.now, v.plausibility.turning());
        }
        if fast_enough != Some(true) {
            changed.add(ChangedParts::LANE);
            changed.add(ChangedParts::COLUMN);
            // Neither model holds at a walking pace, let alone at an unknown one.
            v.plausibility.forget_lane();
            v.plausibility.forget_column();
        }
        match column {
            Input::New(c) => {
                v.input_times.column = self.now;
                changed.add(ChangedParts::INPUT_TIMES);
                changed.add(ChangedParts::COLUMN);
                v.fast.hands.update(c.driver_torque);
                v.plausibility.set_wheel_angle(c.wheel_angle);
            }
            Input::Held(_) => {}
            Input::Lost => {
                changed.add(ChangedParts::COLUMN);
                v.plausibility.forget_column();
                kept.set(false, Fault::ColumnImplausible);
            }
        }
        match self.lane {
            Input::New(_) => {
                v.input_times.lane = self.now;
                changed.add(ChangedParts::INPUT_TIMES);
            }
            Input::Held(_) => {}
            Input::Lost => {
                changed.add(ChangedParts::LANE);
                v.plausibility.forget_lane();
                motion_history.forget_line();
                kept.set(false, Fault::LaneImplausible);
            }
        }
        self.check(v, changed, motion_history, pending, &mut kept);
        self.compensate_age(v, motion_history);
        if let Input::New(_) = request {
            v.input_times.request = self.now;
            changed.add(ChangedParts::INPUT_TIMES);
        }

        v.fast.kept = kept.bits();
        self.lost_inputs()
    }

    /// The checks whose time has come.
    #[inline(always)]
    fn check(
        &self,
        v: &mut Memory,
        changed: &mut ChangedParts,
        motion_history: &mut MotionHistory,
        pending: &mut PendingChecks,
        kept: &mut FaultSet,
    ) {
        let checks = &self.config.plausibility;
        if let Some(c) = to_check(&self.inputs.column, &mut pending.column) {
            changed.add(ChangedParts::COLUMN);
            let plausible = checks.column(
                &mut v.plausibility,
                self.now,
                c.driver_torque,
                c.wheel_angle,
                self.applied,
            );
            kept.set(!plausible, Fault::ColumnImplausible);
        }
        if let Some(sample) = to_check(&self.lane, &mut pending.lane) {
            changed.add(ChangedParts::LANE);
            if v.coast.is_extrapolating() {
                // No picture, so nothing to compare.
                v.plausibility
                    .accept_extrapolation(motion_history, self.now, sample);
            } else {
                let moved = checks.lane(&mut v.plausibility, motion_history, self.now, sample);
                kept.set(moved == LaneMotion::Inconsistent, Fault::LaneImplausible);
                if moved == LaneMotion::ContradictsYawRate {
                    changed.add(ChangedParts::MOTION);
                    v.plausibility.distrust_yaw_rate();
                    kept.insert(Fault::YawRate);
                }
            }
        }
    }

    /// The inputs that are lost.
    #[inline(always)]
    fn lost_inputs(&self) -> FaultSet {
        let Inputs {
            lane,
            column,
            motion,
            request,
            ..
        } = self.inputs;
        let mut lost = FaultSet::NONE;
        // A frame that arrives and is refused is no time-out: the fault that says so came with the inputs.
        let refused = |fault| self.inputs.faults.contains(fault);
        lost.insert_if(
            lane.value().is_none() && !refused(Fault::LaneStep),
            Fault::LaneTimeout,
        );
        lost.insert_if(column.value().is_none(), Fault::ColumnTimeout);
        lost.insert_if(
            motion.value().is_none() && !refused(Fault::SpeedStep),
            Fault::SpeedTimeout,
        );
        lost.insert_if(request.value().is_none(), Fault::RequestTimeout);
        lost
    }

    /// What the vehicle turned since the lane sample in use, if that was old when it came.
    fn compensate_age(&self, v: &mut Memory, motion_history: &MotionHistory) {
        let Some(sample) = self.lane.value() else {
            return;
        };
        let age = self.now.since(sample.at);
        if age.us().saturating_sub(self.now.since(v.input_times.lane).us()) <= PROMPT.us() {
            (v.fast.turned, v.fast.rate_then) = (Radians::ZERO, TurningRate::ZERO);
        } else if let Input::New(_) = self.lane {
            (v.fast.turned, v.fast.rate_then) = motion_history.turned(self.now, sample.at);
        } else {
            let turned = per_second(v.plausibility.turning().bits(), self.elapsed);
            v.fast.turned = Radians::from_bits(v.fast.turned.bits().saturating_add(turned));
        }
    }

    /// How its motion since then differs from going on as it did, if that was so.
    #[inline(always)]
    fn ego_motion(&self, v: &Memory, sample: LaneSample) -> Option<EgoMotion> {
        let age = self.now.since(sample.at);
        if age.us().saturating_sub(self.now.since(v.input_times.lane).us()) <= PROMPT.us() {
            return None;
        }
        let went_on = per_second(v.fast.rate_then.bits(), age);
        let turned = i64::from(v.fast.turned.bits()).saturating_sub(i64::from(went_on));
        let faster =
            i64::from(v.plausibility.turning().bits()).saturating_sub(i64::from(v.fast.rate_then.bits()));
        let speed = v.plausibility.speed();
        let near = product(self.config.plausibility.near_time.bits(), speed.bits());
        Some(EgoMotion::new(
            Radians::from_wide(turned),
            TurningRate::from_wide(faster),
            speed,
            Metres::from_wide(near),
        ))
    }

    /// What the law demands by the sample taken last.
    #[inline(always)]
    fn law(&self, v: &Memory, sample: LaneSample) -> Torque {
        let (law, ego) = (&self.config.law, self.ego_motion(v, sample));
        match self.config.fdca.get() {
            None => law.demanded(&v.law, self.now, ego.as_ref()),
            Some(fdca) => {
                let car = Car {
                    speed: v.plausibility.speed(),
                    turning_gain: v.plausibility.turning_gain(),
                    turning: v.plausibility.turning(),
                    wheel: v.plausibility.wheel(),
                };
                fdca.demanded(law, &v.law, self.now, ego.as_ref(), &car)
            }
        }
    }

    /// Whether both speeds reach the slowest that is guided, if they are known.
    fn is_fast_enough(&self) -> Option<bool> {
        let least = self.config.least_speed;
        self.inputs
            .motion
            .value()
            .map(|motion| motion.speeds.iter().all(|speed| *speed >= least))
    }

    /// Counts steps that came late or early, in a row. A very late one counts for all it missed.
    fn keep_time(&self, v: &mut Memory) -> (u8, u8) {
        v.fast.packed.late = match self.elapsed {
            e if e > LOST_TIME => LATE_STEPS.saturating_add(1),
            e if e > LATE => v.fast.packed.late.saturating_add(1),
            _ => 0,
        };
        v.fast.packed.early = if self.elapsed < EARLY {
            v.fast.packed.early.saturating_add(1)
        } else {
            0
        };
        (v.fast.packed.late, v.fast.packed.early)
    }

    /// The most urgent event that changes the mode decides.
    fn next_mode(&self, v: &mut Memory, mode: Mode, faults: FaultSet, fast_enough: Option<bool>) -> Mode {
        let inputs_ok = !faults.intersects(FaultSet::INPUT);
        let request = self.inputs.request.value().map(|r| r.engage);
        let rising = request == Some(true) && v.fast.packed.requested == 0;
        if let Some(high) = request {
            v.fast.packed.requested = u8::from(high);
        }
        v.fast.ready = if mode == Mode::Standby && inputs_ok && fast_enough == Some(true) {
            Micros::from_us(v.fast.ready.us().saturating_add(self.elapsed.us())).min(READY)
        } else {
            Micros::from_us(0)
        };
        let mut raised = Events::only(Event::BootPassed);
        raised.insert_if(rising && v.fast.ready >= READY, Event::Engage);
        // Late steps carry the ramp further than the reduction limit lets the torque follow.
        raised.insert_if(v.ramp.is_done() && self.applied == Torque::ZERO, Event::Faded);
        let no_hand = v.fast.hands.time_hands_off() >= END;
        let is_over = request == Some(false) || fast_enough == Some(false) || no_hand;
        raised.insert_if(is_over, Event::Disengage);
        raised.insert_if(!inputs_ok, Event::InputLost);
        raised.insert_if(faults.intersects(FaultSet::LOCKING), Event::BootRejected);
        raised.insert_if(faults.intersects(FaultSet::CRITICAL), Event::Critical);
        mode.after_all(raised)
    }

    #[expect(clippy::as_conversions, reason = "a code is its discriminant")]
    fn enter(&self, v: &mut Memory, mode: Mode, faults: FaultSet, torque_history: &TorqueHistory) {
        v.fast.packed.mode = mode as u8;
        let trust = v.coast.trust;
        v.coast = Coast::NEW;
        v.fast.probe = ProbeState::SILENT;
        match mode {
            // Both may be from before the last wrap of the clock.
            Mode::Active => {
                (v.law, v.fast.envelope) = (LawState::NEW, EnvelopeState::new(self.now));
                v.fast.hands.reset();
            }
            Mode::Fade => v.ramp = Ramp::at_rate(self.applied, FADE_RATE),
            Mode::Handover => {
                let suspect = self.suspect_since(v, faults);
                // Half a wave of the probe must not stand in the wheel for two seconds, and what the other half
                // took away does not come back.
                let applied = smaller_of_same_sign(
                    self.applied,
                    subtract_probe(self.applied, Some(v.fast.probe_applied)),
                );
                let start = torque_history.handover_start(self.now, suspect, applied);
                v.ramp = Ramp::over(start, handover_length(trust));
            }
            _ => {}
        }
    }

    /// How long ago the earliest sample came that must not be trusted.
    fn suspect_since(&self, v: &Memory, faults: FaultSet) -> Micros {
        let lost_for = |fault, last_new| {
            if faults.contains(fault) {
                self.now.since(last_new)
            } else {
                Micros::from_us(0)
            }
        };
        faults
            .unseen()
            .max(lost_for(Fault::LaneTimeout, v.input_times.lane))
            .max(lost_for(Fault::LaneInvalid, v.input_times.lane))
            .max(lost_for(Fault::LaneStep, v.input_times.lane))
            .max(lost_for(Fault::SpeedStep, v.input_times.motion))
            .max(lost_for(Fault::ColumnTimeout, v.input_times.column))
            .max(lost_for(Fault::SpeedTimeout, v.input_times.motion))
            .max(lost_for(Fault::RequestTimeout, v.input_times.request))
    }

    /// The torque, the part of it that is the probe, and what limited it.
    fn torque(
        &self,
        v: &mut Memory,
        changed: &mut ChangedParts,
        mode: Mode,
        faults: FaultSet,
    ) -> (Torque, Option<Torque>, LimitReason) {
        let demanded = if matches!(mode, Mode::Active | Mode::Handover) {
            self.guidance(v, changed)
        } else {
            Torque::ZERO
        };
        let (wanted, probe) = match mode {
            Mode::Active => {
                let probe = self.probe(v);
                (add_probe(demanded, probe), probe)
            }
            // A driver who pushed the torque below its ramp does not get it back.
            Mode::Fade | Mode::Handover => {
                let is_plausible = !faults.contains(Fault::ColumnImplausible);
                let pace = if mode == Mode::Handover {
                    let driver = self.inputs.column.value().map(|c| c.driver_torque);
                    pace(self.applied, driver, is_plausible)
                } else {
                    1
                };
                let passed = Micros::from_us(self.elapsed.us().saturating_mul(pace));
                changed.add(ChangedParts::RAMP);
                let ending = smaller_of_same_sign(v.ramp.step(passed), self.applied);
                // While the lane still comes, no more than the law asks for: the curve may end before the ramp does.
                if mode == Mode::Handover && self.lane.value().is_some() {
                    (smaller_of_same_sign(ending, demanded), None)
                } else {
                    (ending, None)
                }
            }
            // At once: what is behind these modes must not move the wheel for another tick.
            Mode::Boot | Mode::Standby | Mode::Fault | Mode::Locked => {
                return (Torque::ZERO, None, LimitReason::Mode);
            }
        };
        // Without a column there is no override to judge; without a column there is also no Active.
        let driver = self
            .inputs
            .column
            .value()
            .map_or(Torque::ZERO, |c| c.driver_torque);
        let situation = Situation {
            applied: self.applied,
            elapsed: self.elapsed,
            driver,
        };
        let distrusted;
        let envelope = if mode == Mode::Handover && faults.contains(Fault::LaneImplausible) {
            distrusted = self.config.envelope.distrusted();
            &distrusted
        } else {
            &self.config.envelope
        };
        let (torque, limit) = envelope.step(&mut v.fast.envelope, self.now, wanted, &situation);
        match limit {
            LimitReason::None if mode != Mode::Active => (torque, probe, LimitReason::Mode),
            LimitReason::None => (torque, probe, limit),
            // Where a limit acts, no more may count as guidance than was applied.
            _ => (torque, probe.map(|probe| common_part(probe, torque)), limit),
        }
    }

    /// The probe's torque, while it is wanted or on its way out.
    fn probe(&self, v: &mut Memory) -> Option<Torque> {
        // Without trust left there is no guidance to ride on.
        let wanted = self.inputs.request.value().is_some_and(|r| r.probe) && v.coast.is_idle();
        self.config.probe.step(&mut v.fast.probe, self.elapsed, wanted)
    }

    /// The law's torque, scaled by the authority: of the last request, or all of it where none is heard any more. Zero without
    /// a lane.
    fn guidance(&self, v: &mut Memory, changed: &mut ChangedParts) -> Torque {
        let demanded = self.lane.value().map_or(Torque::ZERO, |sample| {
            if !v.law.is_latest(&sample) {
                changed.add(ChangedParts::LAW);
                self.config.law.update(&mut v.law, sample);
            }
            self.law(v, sample)
        });
        let mut demanded = v.coast.limited(demanded);
        if self.activity < Ratio::ONE {
            demanded = Torque::from_bits(share_of(self.activity.bits(), demanded.bits()));
        }
        let demanded = self.injection.law(demanded);
        // A share: more than all or less than nothing is a host's mistake.
        let share = |request: Request| request.authority.max(Ratio::ZERO).min(Ratio::ONE);
        let authority = self.inputs.request.value().map_or(Ratio::ONE, share);
        // Neither is more than one.
        let share = share_of(authority.bits(), v.share.bits());
        let share = share_of(share, v.coast.trust.bits());
        Torque::from_bits(share_of(share, demanded.bits()))
    }
}

/// The value whose check has come: that of the step before. A step that takes a new value has work enough; where there is
/// one in every step, every other one is checked, for as much time as both.
fn to_check<T: Copy>(input: &Input<T>, is_pending: &mut bool) -> Option<T> {
    let was_pending = core::mem::replace(is_pending, matches!(input, Input::New(_)) && !*is_pending);
    input.value().filter(|_| was_pending)
}

fn add_probe(guidance: Torque, probe: Option<Torque>) -> Torque {
    guidance.plus(probe.unwrap_or(Torque::ZERO))
}

pub(super) fn subtract_probe(torque: Torque, probe: Option<Torque>) -> Torque {
    add_probe(torque, probe.map(Torque::opposite))
}

/// As much of `part` as `whole` can hold.
fn common_part(part: Torque, whole: Torque) -> Torque {
    part.max(whole.min(Torque::ZERO)).min(whole.max(Torque::ZERO))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each new value is checked once, in the step after it; where there is one in every step, in every other step.
    #[test]
    fn a_value_is_checked_in_the_step_after_it() {
        let mut pending = false;
        let inputs = [
            (Input::Lost, None),
            (Input::Held(1), None),
            (Input::New(2), None),
            (Input::Held(2), Some(2)),
            (Input::Held(2), None),
            (Input::New(3), None),
            (Input::New(4), Some(4)),
            (Input::New(5), None),
            (Input::New(6), Some(6)),
            (Input::New(7), None),
            (Input::Lost, None),
            (Input::Held(8), None),
        ];
        for (step, (input, checked)) in inputs.into_iter().enumerate() {
            assert_eq!(to_check(&input, &mut pending), checked, "{step}");
        }
    }
}
