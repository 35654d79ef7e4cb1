//! A second implementation of the ECU, in f64 and with a clock that does not wrap, from docs/explanation/behaviour.md, plausibility.md
//! and docs/reference/bus.md. Each step of the ECU is compared with it, over random drives with 21 kinds of faults on the bus
//! (`drive`).
//!
//! Where a value lies closer to a bound than both implementations round, either decision is right: a *tie*, which ends the drive.
//!
//! Not here: the monitor, which refuses nothing in these drives, memory faults, and the estimator.
//!
//! Above 500 lines because a step's order and the state that it moves stand together; what can stand alone (checks,
//! receivers, motor) has files of its own.

mod checks;
mod coast;
mod drive;
mod frames;
mod motor;
mod receivers;
mod torque;

use checks::{Checks, MotionHistory, Moved, Still};
use coast::{Coast, Sight};
use haptic_core::bus::{Frame, Reject};
use haptic_core::controller::inputs::Input;
use haptic_core::controller::params::Params;
use haptic_core::safety::actuator::Motor;
use haptic_core::safety::envelope::LimitReason;
use haptic_core::safety::faults::{Class, Fault, FaultSet};
use haptic_core::safety::modes::Mode;
use receivers::{Lane, Receivers, Seen};
use std::cell::Cell;

thread_local! { static CLOSEST: Cell<f64> = const { Cell::new(f64::INFINITY) }; }

/// `value > bound`; how close it was is remembered.
fn exceeds(value: f64, bound: f64) -> bool {
    is_close((value - bound) / bound.abs().clamp(0.01, 1.0));
    value > bound
}

fn is_close(apart: f64) {
    if apart != 0.0 {
        CLOSEST.set(CLOSEST.get().min(apart.abs()));
    }
}

const LSB: f64 = 1.0 / 16_777_216.0;

/// To the core's resolution.
fn near(value: f64) -> f64 {
    (value / LSB).round() * LSB
}

/// A value rounded down to the core's resolution.
fn down(value: f64) -> f64 {
    (value / LSB).floor() * LSB
}

/// What of a rate comes in a time, at most half a second: in the core's resolution and with its 2^32/10^6, so that what is summed for
/// minutes stays the same.
fn per_second(rate: f64, us: i64) -> f64 {
    let share = 4295 * i128::from(us.clamp(0, 499_996));
    let counts = (rate / LSB).round() as i128;
    ((counts * share + (1 << 31)) >> 32) as f64 * LSB
}

fn leak(sum: f64, change: f64, us: i64) -> f64 {
    sum - per_second(sum, us) + change
}

/// The nearer to zero of two torques to the same side.
fn smaller(a: f64, b: f64) -> f64 {
    if (a > 0.0) != (b > 0.0) {
        0.0
    } else if a.abs() < b.abs() {
        a
    } else {
        b
    }
}

/// What parameters decide.
#[derive(Debug, Clone)]
pub(crate) struct Constants {
    params: Params,
    curvature_gain: f64,
    stability_factor: f64,
    aligning_gain: f64,
    column_damping: f64,
    far_time: f64,
    near_time: f64,
    between: i64,
    phase_per_us: u32,
}

#[derive(Debug, Clone, Copy, Default)]
struct Law {
    last: Option<Lane>,
    rates: [f64; 2],
}

/// What driver activity has felt since guidance began.
#[derive(Debug, Clone, Copy, Default)]
struct Activity {
    /// The wheel's angle when it came last, and when that was.
    last: Option<(f64, i64)>,
    rate: f64,
    agreement: f64,
    size: f64,
    /// What came in the step before: its instant, and what (9) asked for then.
    pending: Option<(i64, receivers::Column, f64)>,
}

#[derive(Debug, Clone, Copy)]
struct Ramp {
    from: f64,
    length: i64,
    done: i64,
}

/// Outputs so far apart, newest first.
#[derive(Debug, Clone)]
struct Outputs {
    apart: i64,
    kept: std::collections::VecDeque<(i64, f64)>,
}

impl Outputs {
    fn new(apart: i64) -> Self {
        Self {
            apart,
            kept: Default::default(),
        }
    }

    fn push(&mut self, now: i64, torque: f64) -> bool {
        let is_due = self.kept.front().is_none_or(|(at, _)| now - at >= self.apart);
        if is_due {
            self.kept.push_front((now, torque));
            self.kept.truncate(64);
        }
        is_due
    }

    fn before(&self, now: i64, suspect: i64) -> f64 {
        let before = self.kept.iter().find(|(at, _)| now - at > suspect);
        before.map_or(0.0, |(_, torque)| *torque)
    }
}

/// What the reference says of a step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Said {
    pub(crate) torque: f64,
    pub(crate) probe: Option<f64>,
    pub(crate) limit: LimitReason,
    pub(crate) mode: Mode,
    pub(crate) faults: FaultSet,
    pub(crate) warning: bool,
    /// A sample of the column came since the last step.
    pub(crate) has_column: bool,
    /// How close the closest decision was, as a share of its bound.
    pub(crate) closest: f64,
}

#[derive(Debug, Clone)]
pub(crate) struct Reference {
    c: Constants,
    pub(crate) receivers: Receivers,
    mode: Mode,
    /// The torque applied since the last step, its probe, and when that was.
    applied: f64,
    probe_applied: f64,
    last_step: i64,
    was_requested: bool,
    in_a_row: [u32; 2],
    ready: i64,
    kept: FaultSet,
    /// When lane, column, motion and request were new.
    times: [i64; 4],
    law: Law,
    activity: Activity,
    turned: f64,
    rate_then: f64,
    probe: [u32; 2],
    hand: (f64, i64),
    anchor: (f64, i64),
    checks: Checks,
    history: MotionHistory,
    still: Still,
    pending: [bool; 2],
    share: f64,
    coast: Coast,
    ramp: Ramp,
    outputs: [Outputs; 2],
    /// Found by the ECU beside its controller.
    own: FaultSet,
}

impl Reference {
    pub(crate) fn new(params: &Params, now: i64) -> Self {
        let v = &params.vehicle;
        let c = Constants {
            params: *params,
            curvature_gain: near(v.curvature_gain_per_m),
            stability_factor: near(v.stability_factor_s2_per_m2),
            aligning_gain: near(v.aligning_gain_nm_s2_per_m),
            column_damping: near(v.column_damping_nm_s),
            far_time: v.far_time_s,
            near_time: v.near_time_s,
            between: ((v.far_time_s - v.near_time_s).max(0.0) * 1e6).round() as i64,
            phase_per_us: (params.probe_frequency_hz * 4_294.967_296).round() as u32,
        };
        Self {
            c,
            receivers: Receivers::new(now),
            mode: Mode::Boot,
            applied: 0.0,
            probe_applied: 0.0,
            last_step: now,
            was_requested: true,
            in_a_row: [0; 2],
            ready: 0,
            kept: FaultSet::NONE,
            times: [now; 4],
            law: Law::default(),
            activity: Activity::default(),
            turned: 0.0,
            rate_then: 0.0,
            probe: [0; 2],
            hand: (0.0, 0),
            anchor: (0.0, now),
            checks: Checks::default(),
            history: MotionHistory::default(),
            still: Still::default(),
            pending: [false; 2],
            share: 0.0,
            coast: Coast::NEW,
            ramp: Ramp {
                from: 0.0,
                length: 1,
                done: 1,
            },
            outputs: [Outputs::new(5_000), Outputs::new(40_000)],
            own: FaultSet::NONE,
        }
    }

    /// Guiding from the start, and every sender trusted.
    pub(crate) fn engage(&mut self) {
        self.mode = Mode::Active;
        self.receivers.trust_all();
    }

    pub(crate) fn receive(&mut self, frame: &Frame, now: i64) -> Result<(), Reject> {
        self.receivers.receive(frame, now)
    }

    /// One step; `applied` is what the ECU applied since the last.
    pub(crate) fn step(&mut self, now: i64, applied: f64) -> Said {
        CLOSEST.set(f64::INFINITY);
        self.applied = applied;
        let mut seen = self.receivers.take(now);
        let judged = self.receivers.motor.judge(applied);
        self.own.insert_if(judged == Motor::Astray, Fault::Actuator);
        self.own.set(judged == Motor::Weak, Fault::MotorWeak);
        seen.faults = seen.faults.union(self.own);
        let elapsed = now - self.last_step;
        self.last_step = now;
        let before = self.mode;
        let mut lane = seen.lane;
        let (mut bridges, mut reported) = (false, FaultSet::NONE);
        if before == Mode::Active && !(self.coast.is_idle() && seen.lane.value().is_some()) {
            (bridges, reported) = self.go_on(now, elapsed, &seen, &mut lane);
        }
        let least = near(self.c.params.least_speed_m_per_s);
        let fast = seen.motion.value().map(|m| m.speeds.iter().all(|v| *v >= least));
        self.update(now, elapsed, &seen, &lane, fast);

        let mut faults = self.kept.union(seen.faults).union(reported);
        for (is_lost, fault, refused) in [
            (seen.lane.value().is_none(), Fault::LaneTimeout, Fault::LaneStep),
            (
                seen.column.value().is_none(),
                Fault::ColumnTimeout,
                Fault::ColumnTimeout,
            ),
            (
                seen.motion.value().is_none(),
                Fault::SpeedTimeout,
                Fault::SpeedStep,
            ),
            (
                seen.request.value().is_none(),
                Fault::RequestTimeout,
                Fault::RequestTimeout,
            ),
        ] {
            faults.insert_if(is_lost && !seen.faults.contains(refused), fault);
        }
        self.keep_time(elapsed);
        faults.insert_if(self.in_a_row[0] > 1 || self.in_a_row[1] > 3, Fault::Deadline);
        let critical = faults.common(FaultSet::of_class(Class::C));
        self.kept = self.kept.union(critical);

        if before == Mode::Active && !exceeds(0.05, (self.applied - self.probe_applied).abs()) {
            self.hand.1 += elapsed;
        }
        let is_guided = matches!(before, Mode::Active | Mode::Fade);
        faults.insert_if(is_guided && self.hand.1 >= 15_000_000, Fault::HandsOff);
        let mut ending = faults;
        if bridges {
            for fault in [Fault::LaneTimeout, Fault::LaneInvalid, Fault::LaneStep] {
                ending.set(false, fault);
            }
        }
        self.mode = self.next_mode(&seen, ending, fast, elapsed);
        if self.mode != before {
            self.enter(now, faults);
        }
        let (torque, probe, limit) = self.torque(now, elapsed, &seen, &lane, faults);
        self.probe_applied = probe.unwrap_or(0.0);
        let kept = torque - self.probe_applied;
        if self.outputs[0].push(now, kept) {
            self.outputs[1].push(now, kept);
        }
        let warning = matches!(self.mode, Mode::Handover | Mode::Fault | Mode::Locked)
            || (self.mode == Mode::Active
                && (faults.contains(Fault::LaneStep) || self.coast.is_long_blind()))
            || faults.contains(Fault::HandsOff);
        Said {
            torque,
            probe,
            limit,
            mode: self.mode,
            faults,
            warning,
            has_column: matches!(seen.column, Input::New(_)),
            closest: CLOSEST.get(),
        }
    }

    /// New inputs through the checks, and lost ones forgotten.
    fn update(&mut self, now: i64, elapsed: i64, seen: &Seen, lane: &Input<Lane>, fast: Option<bool>) {
        if let Input::New(motion) = seen.motion {
            let passed = now - self.times[2];
            self.times[2] = now;
            let (agree, are_plausible) = self.checks.speeds(motion.speeds, passed);
            self.kept.set(!are_plausible, Fault::SpeedImplausible);
            let v = if agree { motion.speeds[0] } else { self.checks.v };
            self.checks.motion(&self.c, v, motion.yaw_rate, passed);
            let is_denied = motion.yaw_rate.is_some() && self.checks.yaw.is_distrusted();
            self.kept.set(is_denied, Fault::YawRate);
            let (low, high) = (self.c.params.low_speed_share, self.c.params.high_speed_share);
            let kmh = v * 3.6;
            self.share = if kmh < 60.0 {
                low + (1.0 - low) * (kmh.max(20.0) - 20.0) / 40.0
            } else {
                1.0 + (high - 1.0) * (kmh.min(130.0) - 60.0) / 70.0
            };
            self.history.record_rate(now, self.checks.turning(&self.c));
        }
        if fast != Some(true) {
            self.checks.forget_lane();
            self.checks.forget_column();
        }
        match seen.column {
            Input::New(column) => {
                self.times[1] = now;
                if self.probe_passes_zero() {
                    let is_felt = column.driver.abs() > 0.35 || (column.driver - self.hand.0).abs() > 0.08;
                    if is_felt {
                        self.hand = (column.driver, 0);
                    }
                }
                self.checks.wheel = column.wheel;
            }
            Input::Held(_) => {}
            Input::Lost => {
                self.checks.forget_column();
                self.kept.set(false, Fault::ColumnImplausible);
            }
        }
        match lane {
            Input::New(_) => self.times[0] = now,
            Input::Held(_) => {}
            Input::Lost => {
                self.checks.forget_lane();
                self.history.forget_line();
                self.kept.set(false, Fault::LaneImplausible);
            }
        }
        self.check(now, seen, lane);
        if let Some(sample) = lane.value() {
            let was_prompt = (now - sample.at) - (now - self.times[0]) <= 10_000;
            if was_prompt {
                (self.turned, self.rate_then) = (0.0, 0.0);
            } else if let Input::New(_) = lane {
                (self.turned, self.rate_then) = self.history.turned(now, sample.at);
            } else {
                self.turned += per_second(self.checks.turning(&self.c), elapsed);
            }
        }
        if let Input::New(_) = seen.request {
            self.times[3] = now;
        }
    }

    /// A value is checked in the step after it came; where one comes in every step, every second.
    fn check(&mut self, now: i64, seen: &Seen, lane: &Input<Lane>) {
        let is_due = |is_new: bool, pending: &mut bool| {
            let was = *pending;
            *pending = is_new && !was;
            was
        };
        let is_new = matches!(seen.column, Input::New(_));
        if let (true, Some(column)) = (is_due(is_new, &mut self.pending[1]), seen.column.value()) {
            let is_tested = self.mode == Mode::Standby || self.probe != [0; 2];
            let passed = self.checks.since_column(now);
            let is_alive = self
                .still
                .is_alive(column.driver, column.wheel, self.checks.v, passed, is_tested);
            let belongs = self
                .checks
                .column(&self.c, now, column.driver, column.wheel, self.applied);
            self.kept.set(!(is_alive && belongs), Fault::ColumnImplausible);
        }
        let is_new = matches!(lane, Input::New(_));
        if let (true, Some(lane)) = (is_due(is_new, &mut self.pending[0]), lane.value()) {
            let moved = if self.coast.goes_on() {
                self.checks.went_on(&mut self.history, lane);
                let picture = seen.lane.value();
                let Some(picture) = picture.filter(|_| self.coast.sight == Sight::Apart) else {
                    return;
                };
                self.checks.other_lane(&self.c, &mut self.history, picture)
            } else {
                self.checks.lane(&self.c, &mut self.history, lane)
            };
            self.kept
                .set(moved == Moved::Inconsistent, Fault::LaneImplausible);
            if moved == Moved::ContradictsYawRate {
                self.checks.distrust_yaw_rate();
                self.kept.insert(Fault::YawRate);
            }
        }
    }

    fn keep_time(&mut self, elapsed: i64) {
        let [late, early] = self.in_a_row;
        self.in_a_row = [
            match elapsed {
                10_001.. => 2,
                2_501.. => late + 1,
                _ => 0,
            },
            if elapsed < 500 { early + 1 } else { 0 },
        ];
    }

    /// The table of docs/explanation/behaviour.md, the most urgent first.
    fn next_mode(&mut self, seen: &Seen, faults: FaultSet, fast: Option<bool>, elapsed: i64) -> Mode {
        let is_lost = faults.intersects(FaultSet::of_class(Class::B));
        let request = seen.request.value().map(|request| request.engage);
        let rises = request == Some(true) && !self.was_requested;
        self.was_requested = request.unwrap_or(self.was_requested);
        self.ready = if self.mode == Mode::Standby && !is_lost && fast == Some(true) {
            self.ready + elapsed
        } else {
            0
        };
        let ends = request == Some(false) || fast == Some(false) || self.hand.1 >= 30_000_000;
        let is_done = self.ramp.done >= self.ramp.length && self.applied == 0.0;
        match self.mode {
            Mode::Fault | Mode::Locked => self.mode,
            _ if faults.intersects(FaultSet::of_class(Class::C)) => Mode::Fault,
            Mode::Boot => Mode::Standby,
            Mode::Standby if rises && self.ready >= 500_000 => Mode::Active,
            Mode::Active if is_lost => Mode::Handover,
            Mode::Active | Mode::Handover if ends => Mode::Fade,
            Mode::Fade | Mode::Handover if is_done => Mode::Standby,
            mode => mode,
        }
    }

    fn enter(&mut self, now: i64, faults: FaultSet) {
        let trust = self.coast.trust;
        (self.coast, self.probe) = (Coast::NEW, [0; 2]);
        match self.mode {
            Mode::Active => {
                (self.law, self.anchor) = (Law::default(), (0.0, now));
                self.activity = Activity::default();
                self.hand.1 = 0;
            }
            Mode::Fade => {
                let length = (self.applied.abs() * 1e6 / 4.0) as i64 + 1;
                self.ramp = Ramp {
                    from: self.applied,
                    length,
                    done: 0,
                };
            }
            Mode::Handover => {
                // How long the outputs may have been wrong.
                let unseen = [
                    (Fault::LaneImplausible, 10_000_000),
                    (Fault::ColumnImplausible, 1_500_000),
                    (Fault::SpeedImplausible, 800_000),
                    (Fault::LaneTimeout, now - self.times[0]),
                    (Fault::LaneInvalid, now - self.times[0]),
                    (Fault::LaneStep, now - self.times[0]),
                    (Fault::ColumnTimeout, now - self.times[1]),
                    (Fault::SpeedTimeout, now - self.times[2]),
                    (Fault::SpeedStep, now - self.times[2]),
                    (Fault::RequestTimeout, now - self.times[3]),
                ];
                let suspect = unseen.iter().filter(|(fault, _)| faults.contains(*fault));
                let suspect = suspect.map(|(_, us)| *us).max().unwrap_or(0);
                let [fine, coarse] = &self.outputs;
                let outputs = if suspect < 300_000 { fine } else { coarse };
                let applied = smaller(self.applied, self.applied - self.probe_applied);
                self.ramp = Ramp {
                    from: smaller(outputs.before(now, suspect), applied),
                    length: ((2e6 * trust).round() as i64).max(1_000_000),
                    done: 0,
                };
            }
            _ => {}
        }
    }
}
