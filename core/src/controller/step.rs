//! One step of the controller: the one place that sees the mode machine, the plausibility checks, the law, the
//! envelope and the ramps together. The order of its stations is its meaning, so they are read in one go.

use super::{ChangedParts, Command, Memory, PendingChecks, READY};
use crate::controller::config::Config;
use crate::controller::injection::Injection;
use crate::controller::inputs::{Input, Inputs, Motion, Request};
use crate::law::activity::Activity;
use crate::law::fdca::{Car, Choices};
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

/// Driver activity looks again where it has not for so long, and for so long in any step.
const LONG_WAIT: Micros = Micros::from_ms(12);
const LONGEST_WAIT: Micros = Micros::from_ms(50);

/// A lane sample no older than this when it arrives is continued at its own rates; an older one is also corrected by how the
/// vehicle has turned since.
const PROMPT: Micros = Micros::from_ms(10);

#[expect(clippy::as_conversions, reason = "a code is its discriminant")]
const STANDBY: u8 = Mode::Standby as u8;

/// A span longer than half a wrap of the clock is negative: the other instant is the later one.
const HALF_WRAP: Micros = Micros::from_us(u32::MAX / 2);
/// Faults that do not end guidance while the lane is extrapolated.
const BRIDGED: FaultSet = FaultSet::NONE
    .with(Fault::LaneTimeout)
    .with(Fault::LaneInvalid)
    .with(Fault::LaneStep);

/// One step: what it reads and does not change.
pub(super) struct Step<'a, I> {
    pub(super) config: &'a Config,
    pub(super) now: Instant,
    pub(super) applied: Torque,
    pub(super) inputs: &'a Inputs,
    /// The lane that the law uses: the input's, or the last one, extrapolated.
    pub(super) lane: Input<LaneSample>,
    /// It was old when it arrived.
    pub(super) is_late: bool,
    pub(super) elapsed: Micros,
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
        // In Active beside another line, or long without a picture, guidance lets go: the driver must know.
        let warning = (mode == Mode::Active && (faults.contains(Fault::LaneStep) || v.coast.is_long_blind()))
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

    /// Bridges a lane whose picture is missing or contradicts the last one: extrapolates it, and lets the trust in it fall. Returns
    /// the faults that do not end guidance meanwhile, and the faults to report about the pictures.
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
        let is_late = self.came_late(v, last);
        let demanded = if self.config.law.is_fdca() {
            self.demanded_by_fdca(v, last, is_late)
        } else {
            self.demanded_by_paper(v, last, is_late)
        };
        match self.inputs.lane {
            Input::Lost => v.coast.picture_missing(demanded),
            Input::New(sample) if !is_older(sample) => {
                let agrees = lane_step_is_possible(&extrapolated_lane(v, motion_history, sample.at), &sample);
                let checks = &self.config.plausibility;
                let follows = checks.other_line_follows(&v.plausibility, motion_history, self.now);
                match v.coast.picture_arrived(&sample, [agrees, follows], demanded) {
                    // From the extrapolated line to the picture is a jump, and no rate.
                    PictureVerdict::Returned => {
                        v.law.relocate(sample);
                        v.plausibility.forget_other_line();
                    }
                    PictureVerdict::Adopted => {
                        v.law = LawState::NEW;
                        v.plausibility.adopt_other_line(motion_history);
                    }
                    PictureVerdict::Expected | PictureVerdict::Elsewhere => {}
                }
                changed.add(ChangedParts::LAW);
                changed.add(ChangedParts::LANE);
            }
            _ => {}
        }
        let is_line_doubted = v.plausibility.is_line_doubted();
        v.coast.advance(self.elapsed, is_line_doubted);
        let mut reported = FaultSet::NONE;
        reported.insert_if(v.coast.sees_other_line(), Fault::LaneStep);
        if !v.coast.is_extrapolating() {
            return [FaultSet::NONE, reported];
        }
        let passed = self.now.since(v.input_times.lane);
        // A picture that is older than the extrapolation cannot be compared with it: no further extrapolation until it has caught up.
        let waits = self.inputs.lane.value().is_some_and(is_older);
        // Until then it counts as missing.
        reported.insert_if(waits && !v.coast.sees_other_line(), Fault::LaneTimeout);
        self.lane = if passed < EXTRAPOLATION_PERIOD || waits {
            Input::Held(last)
        } else {
            // Extrapolated to the age that pictures have when they arrive.
            Input::New(extrapolated_lane(v, motion_history, last.at.after(passed)))
        };
        [BRIDGED, reported]
    }

    /// Takes new inputs through the plausibility checks, and forgets what the checks know of lost ones. Returns the faults of
    /// lost inputs.
    fn update_inputs(
        &mut self,
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
        let mut kept = v.faults();

        if let Input::New(motion) = motion {
            self.update_motion(v, changed, motion, motion_history, &mut kept);
            if let Some(least) = self.config.plausibility.between.least_share() {
                let left = pending.activity.share(least);
                v.share = Ratio::from_fixed(share_of(left.fixed(), v.share.fixed()));
            }
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
                // The rim of a free wheel answers the probe too: driver torques are compared where it passes zero.
                if v.fast.probe.is_passing_zero() {
                    v.fast.hands.update(c.driver_torque);
                }
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

    /// Takes speeds and yaw rate that came since the last step: judges them, and what follows from the speed.
    #[inline(always)]
    fn update_motion(
        &self,
        v: &mut Memory,
        changed: &mut ChangedParts,
        motion: &Motion,
        motion_history: &mut MotionHistory,
        kept: &mut FaultSet,
    ) {
        let checks = &self.config.plausibility;
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

    /// Runs the plausibility checks that are pending.
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
            let is_tested = v.fast.packed.mode == STANDBY || v.fast.probe != ProbeState::SILENT;
            let passed = v.plausibility.since_column(self.now);
            let is_alive = pending.frozen_torque.is_alive(
                c.driver_torque,
                c.wheel_angle,
                v.plausibility.speed(),
                passed,
                is_tested,
            );
            let plausible = checks.column(
                &mut v.plausibility,
                self.now,
                c.driver_torque,
                c.wheel_angle,
                self.applied,
            );
            kept.set(!(is_alive && plausible), Fault::ColumnImplausible);
        }
        if let Some(sample) = to_check(&self.lane, &mut pending.lane) {
            changed.add(ChangedParts::LANE);
            let (state, now) = (&mut v.plausibility, self.now);
            let moved = if v.coast.is_extrapolating() {
                state.accept_extrapolation(motion_history, now, sample);
                // Pictures of another line are compared with themselves; where none comes, nothing is.
                let picture = self.inputs.lane.value().filter(|_| v.coast.sees_other_line());
                picture.map(|picture| checks.other_lane(state, motion_history, now, picture))
            } else {
                Some(checks.lane(state, motion_history, now, sample))
            };
            if let Some(moved) = moved {
                kept.set(moved == LaneMotion::Inconsistent, Fault::LaneImplausible);
            }
            if moved == Some(LaneMotion::ContradictsYawRate) {
                changed.add(ChangedParts::MOTION);
                v.plausibility.distrust_yaw_rate();
                kept.insert(Fault::YawRate);
            }
            if self.config.plausibility.between.least_share().is_some() {
                pending.lane |= self.look_at_activity(v, &mut pending.activity);
            }
        }
    }

    /// Driver activity looks at the column in the steps that check a lane sample, unless a vehicle frame came too: those have the
    /// most to do. Where a camera always keeps step with the vehicle frames, the next step repeats the check, and looks. Not inlined,
    /// so that it costs (9) nothing.
    #[cold]
    #[inline(never)]
    fn look_at_activity(&self, v: &Memory, activity: &mut Activity) -> bool {
        if let Some(column) = self.inputs.column.value()
            && let Some(least) = self.config.plausibility.between.least_share()
        {
            let waited = v.input_times.column.since(activity.looked_at());
            if matches!(self.inputs.motion, Input::New(_)) && waited < LONGEST_WAIT {
                return waited > LONG_WAIT;
            }
            activity.update(
                &self.config.law,
                least,
                v.input_times.column,
                column.wheel_angle,
                [column.driver_torque, self.applied],
            );
        }
        false
    }

    /// A time-out fault for each input without a usable value.
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
        // Where frames arrive and are refused, LaneStep or SpeedStep says so, and there is no time-out.
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

    /// How far the vehicle has turned since the lane sample in use, where that was old when it arrived.
    fn compensate_age(&mut self, v: &mut Memory, motion_history: &MotionHistory) {
        let Some(sample) = self.lane.value() else {
            return;
        };
        self.is_late = self.came_late(v, sample);
        if !self.is_late {
            (v.fast.turned, v.fast.rate_then) = (Radians::ZERO, TurningRate::ZERO);
        } else if let Input::New(_) = self.lane {
            (v.fast.turned, v.fast.rate_then) = motion_history.turned(self.now, sample.at);
        } else {
            let turned = per_second(v.plausibility.turning().fixed(), self.elapsed);
            v.fast.turned = v.fast.turned.plus(Radians::from_fixed(turned));
        }
    }

    /// Whether a sample was old when it arrived.
    #[inline(always)]
    fn came_late(&self, v: &Memory, sample: LaneSample) -> bool {
        let [age, held] = [sample.at, v.input_times.lane].map(|at| self.now.since(at).us());
        age.saturating_sub(held) > PROMPT.us()
    }

    /// How the vehicle's motion since an old sample differs from going on at the rate of turn that it had then.
    #[inline(always)]
    fn ego_motion(&self, v: &Memory, sample: LaneSample) -> EgoMotion {
        let age = self.now.since(sample.at);
        let went_on = per_second(v.fast.rate_then.fixed(), age);
        let speed = v.plausibility.speed();
        let near = product(self.config.plausibility.near_time.fixed(), speed.fixed());
        EgoMotion::new(
            v.fast.turned.minus(Radians::from_fixed(went_on)),
            v.plausibility.turning().minus(v.fast.rate_then),
            speed,
            Metres::from_wide(near),
        )
    }

    /// Whether both speeds reach the slowest that is guided, if they are known.
    fn is_fast_enough(&self) -> Option<bool> {
        let least = self.config.least_speed;
        self.inputs
            .motion
            .value()
            .map(|motion| motion.speeds.iter().all(|speed| *speed >= least))
    }

    /// Counts late and early steps in a row. One after more than [`LOST_TIME`] counts as too many at once.
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

    /// The next mode: of all events of this step the most urgent one that leads out of the present mode decides.
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
        // After a late step the ramp may be done before the torque, whose fall is limited, is zero.
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
            // Both hold instants, which may be older than a wrap of the clock.
            Mode::Active => {
                (v.law, v.fast.envelope) = (LawState::NEW, EnvelopeState::new(self.now));
                v.fast.hands.reset();
            }
            Mode::Fade => v.ramp = Ramp::at_rate(self.applied, FADE_RATE),
            Mode::Handover => {
                let suspect = self.suspect_since(v, faults);
                // The ramp starts from the torque without the probe, so that no half wave of it is held for two seconds; where the
                // probe had reduced the torque, from the reduced one.
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

    /// For how long the outputs may have been wrong: since the inputs of these faults were last good, or the time that a check
    /// needs to find a fault.
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
            // Where the envelope or the driver has brought the torque below its ramp, it does not rise again.
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
                // While the lane is known, no more than the law demands: a curve may end before the ramp does.
                if mode == Mode::Handover && self.lane.value().is_some() {
                    (smaller_of_same_sign(ending, demanded), None)
                } else {
                    (ending, None)
                }
            }
            // These modes have no torque, from their first step on.
            Mode::Boot | Mode::Standby | Mode::Fault | Mode::Locked => {
                return (Torque::ZERO, None, LimitReason::Mode);
            }
        };
        // Without a column the override limit cannot act; the mode is not Active then either.
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
            // Where a limit acts, the probe is at most as much of the torque as was left.
            _ => (torque, probe.map(|probe| common_part(probe, torque)), limit),
        }
    }

    /// The probe's torque, while it is wanted or on its way out.
    fn probe(&self, v: &mut Memory) -> Option<Torque> {
        // The probe needs a lane that is fully trusted.
        let wanted = self.inputs.request.value().is_some_and(|r| r.probe) && v.coast.is_idle();
        self.config.probe.step(&mut v.fast.probe, self.elapsed, wanted)
    }

    /// What (9) demands for the sample that it took last.
    #[inline(always)]
    fn demanded_by_paper(&self, v: &Memory, sample: LaneSample, is_late: bool) -> Torque {
        let ego = is_late.then(|| self.ego_motion(v, sample));
        self.config.law.demanded(&v.law, self.now, ego.as_ref())
    }

    /// What FDCA demands for that sample. Not inlined, so that it costs (9) nothing.
    #[cold]
    #[inline(never)]
    fn demanded_by_fdca(&self, v: &Memory, sample: LaneSample, is_late: bool) -> Torque {
        let ego = is_late.then(|| self.ego_motion(v, sample));
        let car = Car {
            speed: v.plausibility.speed(),
            turning_gain: v.plausibility.turning_gain(),
            turning: v.plausibility.turning(),
            aligning: self.config.plausibility.aligning_gain,
        };
        Choices::of(&self.config.law).demanded(&v.law, self.now, ego.as_ref(), &car)
    }

    #[cold]
    #[inline(never)]
    fn fdca(&self, v: &Memory) -> Torque {
        self.lane.value().map_or(Torque::ZERO, |sample| {
            self.demanded_by_fdca(v, sample, self.is_late)
        })
    }

    /// The law's torque times authority, gain at this speed and trust in the lane. Without a request the authority is 1: the mode
    /// ends guidance then. Without a lane the torque is zero.
    fn guidance(&self, v: &mut Memory, changed: &mut ChangedParts) -> Torque {
        let demanded = self.lane.value().map_or(Torque::ZERO, |sample| {
            if !v.law.is_latest(&sample) {
                changed.add(ChangedParts::LAW);
                self.config.law.update(&mut v.law, sample);
            }
            self.demanded_by_paper(v, sample, self.is_late)
        });
        // In the place of (9), whose words make no sense then: asked before, it would cost (9) more.
        let demanded = if self.config.law.is_fdca() {
            self.fdca(v)
        } else {
            demanded
        };
        let demanded = self.injection.law(v.coast.limited(demanded));
        // Clamped to 0 to 1: beyond that the host is wrong.
        let share = |request: Request| request.authority.max(Ratio::ZERO).min(Ratio::ONE);
        let authority = self.inputs.request.value().map_or(Ratio::ONE, share);
        // Neither factor exceeds 1, so the product cannot overflow.
        let share = share_of(authority.fixed(), v.share.fixed());
        let share = share_of(share, v.coast.trust.fixed());
        Torque::from_fixed(share_of(share, demanded.fixed()))
    }
}

/// The value to check in this step: one that was new in the step before, so that a step with a new value, which costs most,
/// checks nothing. Where every step has a new value, every second one is checked, over the time of both.
fn to_check<T: Copy>(input: &Input<T>, is_pending: &mut bool) -> Option<T> {
    let was_pending = core::mem::replace(is_pending, matches!(input, Input::New(_)) && !*is_pending);
    if was_pending { input.value() } else { None }
}

fn add_probe(guidance: Torque, probe: Option<Torque>) -> Torque {
    guidance.plus(probe.unwrap_or(Torque::ZERO))
}

pub(super) fn subtract_probe(torque: Torque, probe: Option<Torque>) -> Torque {
    add_probe(torque, probe.map(Torque::opposite))
}

/// `part`, cut to what lies between zero and `whole`.
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
