//! The ECU: frames in, frames out. Holds one controller, the receivers of its inputs, the monitor, and the
//! counters of its own frames. Firmware and simulator carry bytes to it and from it, nothing more.

#[cfg(feature = "another-law")]
mod another_law;
mod counting;
#[cfg(feature = "fault-injection")]
pub mod injection;
mod receivers;

use core::hint::black_box;

use heapless::Vec;

use crate::bus::e2e::ReceiverState;
use crate::bus::messages::{FaultRecord, Guidance, Message, ResetCause, Warning};
use crate::bus::{Frame, Reject};
use crate::controller::config::{Config, Setup};
use crate::controller::injection::{Injection, NoInjection};
use crate::controller::inputs::{ColumnState, Input, Inputs};
use crate::controller::{Command, Controller, ControllerState};
use crate::estimator::Sample;
use crate::estimator::background::Background;
use crate::quantity::{Instant, Torque};
use crate::safety::actuator::Motor;
use crate::safety::envelope::LimitReason;
use crate::safety::faults::{Fault, FaultHistory, FaultSet};
use crate::safety::modes::Mode;
use crate::safety::monitor::{Evidence, Frames, Monitor, MonitorState, New};
use crate::safety::redundant::{Redundant, words};
use receivers::Receivers;

/// How the ECU came up: what the firmware knows before the first step.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Boot {
    /// Why it started.
    pub reset: ResetCause,
    /// Resets within the last 10 s, this one included, power-up not.
    pub recent_resets: u8,
    /// Class C faults since power-up: a reset does not end them. Others are ignored.
    pub latched: FaultSet,
}

/// So many resets within 10 s lock the ECU.
pub const RESETS_TO_LOCK: u8 = 3;

/// What one step puts on the bus.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Step {
    /// The command behind the frames. Its torque is rounded to the bus's LSB: the one to apply.
    pub command: Command,
    /// The guidance frame.
    pub guidance: Frame,
    /// A warning and a line of the fault history, when it is their turn.
    pub others: Vec<Frame, 2>,
    /// Whether the monitor renewed its permission. Without it the firmware must not feed the watchdog.
    pub permitted: bool,
}

words! {
    /// State that is kept twice, beside that of the receivers.
    struct Memory {
        step: LastStep,
        monitor: MonitorState,
    }
}

words! {
    /// What every step changes.
    struct LastStep {
        /// The torque applied since.
        applied: Torque,
        /// [`Fault`] bits found outside the controller.
        faults: u32,
        at: Instant,
        /// Steps, which give the counters of the frames and their turns.
        count: u32,
    }
}

impl Memory {
    fn new(faults: FaultSet, now: Instant) -> Self {
        Self {
            step: LastStep {
                applied: Torque::ZERO,
                faults: faults.bits(),
                at: now,
                count: 0,
            },
            monitor: MonitorState::NEW,
        }
    }
}

/// A controller with its bus and its monitor.
// What each step and each frame reads comes first: a load of a Cortex-M4 reaches 4 KiB from where the ECU begins, and one of a
// float, of which the background is made, 1 KiB.
#[derive(Debug, Clone)]
#[repr(C)]
pub struct Ecu {
    background: Background,
    receivers: Receivers,
    memory: Redundant<Memory>,
    monitor: Redundant<Monitor>,
    controller: Controller,
    state: ControllerState,
    history: FaultHistory,
    reset: ResetCause,
    /// The step and the mode in which the present warning began.
    warned_at: Option<(u32, Mode)>,
    /// A line of the fault history is due, and a self-test of the monitor. Not kept twice: a flipped bit skips one or adds one.
    is_line_due: bool,
    is_test_due: bool,
}

/// Warnings and lines of the fault history come every so many steps.
const TURN: u32 = 100;
/// The monitor is tested every so many steps: twice a second.
const SELF_TEST: u32 = 512;
/// A line of the fault history that is due waits for a step without a new sample of the column, and a test for one without a
/// line too; neither waits for more steps than these.
const PATIENCE: u32 = 3;

impl Ecu {
    /// An ECU at power-up or after a reset. Without a good set of parameters it locks.
    #[must_use]
    pub fn new(setup: Option<&Setup>, boot: Boot, now: Instant) -> Self {
        let mut faults = boot.latched.common(FaultSet::CRITICAL);
        faults.insert_if(setup.is_none(), Fault::Parameters);
        faults.insert_if(boot.recent_resets >= RESETS_TO_LOCK, Fault::ResetLoop);
        Self::with(
            setup.unwrap_or(&Setup::PAPER),
            Mode::Boot,
            ReceiverState::NEW,
            boot,
            faults,
            now,
        )
    }

    /// Guidance active from the start and every sender trusted, as the paper's studies of driver models have
    /// it. Not for a vehicle.
    #[must_use]
    pub fn engaged(setup: &Setup, now: Instant) -> Self {
        Self::with(
            setup,
            Mode::Active,
            ReceiverState::TRUSTED,
            Boot::default(),
            FaultSet::NONE,
            now,
        )
    }

    /// Builds the state in place: a copy of it would take half of the stack.
    fn with(
        setup: &Setup,
        mode: Mode,
        e2e: ReceiverState,
        boot: Boot,
        faults: FaultSet,
        now: Instant,
    ) -> Self {
        Self {
            controller: Controller::new(setup.config),
            state: ControllerState::with(mode, now),
            monitor: Redundant::new(setup.monitor),
            memory: Redundant::new(Memory::new(faults, now)),
            receivers: Receivers::new(e2e, now),
            history: FaultHistory::new(now),
            reset: boot.reset,
            warned_at: None,
            is_line_due: false,
            is_test_due: false,
            background: Background::new(setup.estimator),
        }
    }

    /// Takes a frame that arrived at `now`. Frames of no interest are ignored.
    ///
    /// # Errors
    /// Why a frame with a known identifier is not used; the last good one stays in use until it is stale.
    // A function of its own in every image, from which the tools follow the torque path.
    #[inline(never)]
    pub fn receive(&mut self, frame: &Frame, now: Instant) -> Result<(), Reject> {
        // A damaged receiver takes no frame; the next step finds and reports it.
        self.receivers.receive(frame, now).unwrap_or(Ok(()))
    }

    /// One step of the 1 kHz loop.
    // As `receive`.
    #[inline(never)]
    pub fn step(&mut self, now: Instant) -> Step {
        self.step_with(now, &NoInjection)
    }

    #[inline(always)]
    fn step_with<I: Injection>(&mut self, now: Instant, injection: &I) -> Step {
        if injection.lane_never_ages() {
            self.receivers.renew_lane(now);
        }
        let intact = self.is_intact();
        let mut inputs = Inputs::lost();
        if intact || (self.memory.get().is_some() && self.receivers.are_intact()) {
            self.receivers.take(now, &mut inputs);
        } else {
            self.reset_state(now);
        }
        let last = &self.memory.value().step;
        let (applied, steps) = (last.applied, last.count);
        let elapsed_us = now.since(last.at).us();
        let mut faults = FaultSet::from_bits(last.faults);
        // A monitor whose copies differ permits nothing.
        let monitor = if intact {
            Some(self.monitor.value())
        } else {
            self.monitor.get()
        };
        let motor = self.receivers.actuator.judge(applied);
        faults.insert_if(motor == Motor::Astray, Fault::Actuator);
        faults.set(motor == Motor::Weak, Fault::MotorWeak);
        let is_busy = matches!(inputs.column, Input::New(_));
        let is_line_now = has_come(
            &mut self.is_line_due,
            steps.wrapping_sub(TURN / 2) % TURN,
            is_busy,
        );
        let since_test = steps.wrapping_sub(1) % SELF_TEST;
        if has_come(&mut self.is_test_due, since_test, is_busy || is_line_now) {
            let passes = passes_self_test(monitor, steps / SELF_TEST, injection);
            faults.insert_if(!passes, Fault::SelfTest);
        }
        faults.insert_if(monitor.is_none(), Fault::Memory);
        inputs.faults = inputs.faults.union(faults);
        let mut command =
            self.controller
                .step_with(&mut self.state, intact, now, applied, &inputs, injection);
        command.torque = Guidance::rounded(command.torque);
        let mut guidance = self.guidance(&command, steps);

        let evidence = Evidence {
            frames: &self.receivers.frames,
            guidance: guidance.bytes(),
            elapsed_us,
        };
        let memory = self.memory.value_mut();
        let permitted = permits(monitor, &mut memory.monitor, &evidence, injection);
        faults.insert_if(!permitted, Fault::Monitor);
        memory.step = LastStep {
            applied: if permitted { command.torque } else { Torque::ZERO },
            faults: faults.bits(),
            at: now,
            count: steps.wrapping_add(1),
        };
        seal(&mut self.memory, self.receivers.frames.new);
        // Each accepted frame is shown to the monitor once.
        self.receivers.frames.new = New::default();
        if !permitted {
            command = Command {
                torque: Torque::ZERO,
                probe: None,
                limit: LimitReason::Monitor,
                mode: Mode::Fault,
                faults: command.faults.union(faults),
                warning: true,
                hands: command.hands,
            };
            guidance = self.guidance(&command, steps);
        }
        let sample = sample(&inputs.column, command.hands, now, applied);
        self.background.take(sample, command.probe);
        self.history.step(now, command.faults);
        let others = self.others(&command, steps, is_line_now);
        Step {
            command,
            guidance,
            others,
            permitted,
        }
    }

    /// The background part of a step, to be called once after its frames have left: the telemetry frame, when it
    /// is its turn. In f32, and without effect on any torque.
    pub fn background_step(&mut self) -> Option<Frame> {
        self.background.step()
    }

    /// Whether all copies agree. Not inlined, for the reasons of `redundant::are_intact`.
    #[inline(never)]
    fn is_intact(&self) -> bool {
        self.memory.agrees_apart()
            && self.monitor.agrees_apart()
            && self.receivers.are_intact()
            && self.controller.is_intact(&self.state)
    }

    /// Replaces a damaged state by a new one with the memory fault, which latches.
    #[cold]
    #[inline(never)]
    fn reset_state(&mut self, now: Instant) {
        let mut faults = FaultSet::NONE;
        faults.insert(Fault::Memory);
        self.state = ControllerState::new(now);
        self.receivers = Receivers::new(ReceiverState::NEW, now);
        self.memory.set(Memory::new(faults, now));
    }

    #[expect(clippy::as_conversions, reason = "a counter is cut to its four bits")]
    fn guidance(&self, command: &Command, steps: u32) -> Frame {
        Guidance {
            torque: command.torque,
            limit: command.limit,
            mode: command.mode,
            warning: command.warning,
            faults: command.faults,
            reset: self.reset,
        }
        .encode(steps as u8)
    }

    /// A warning in the step that needs it, in each mode, then one each turn; a line of the fault history each turn.
    #[expect(
        clippy::as_conversions,
        reason = "a counter is cut to its four bits; there are at most 32 lines"
    )]
    fn others(&mut self, command: &Command, steps: u32, is_line_now: bool) -> Vec<Frame, 2> {
        let mut frames = Vec::new();
        if command.warning {
            let before = self.warned_at.filter(|(_, mode)| *mode == command.mode);
            let (since, _) = *self.warned_at.insert(before.unwrap_or((steps, command.mode)));
            let passed = steps.wrapping_sub(since);
            if passed.is_multiple_of(TURN) {
                let counter = passed / TURN;
                let warning = Warning {
                    mode: command.mode,
                    faults: command.faults,
                };
                // Two frames have two places.
                let _ = frames.push(warning.encode(counter as u8));
            }
        } else {
            self.warned_at = None;
        }
        if is_line_now {
            let (turn, total) = (steps / TURN, self.history.kinds());
            let index = turn.checked_rem(total);
            let record = index.and_then(|index| self.history.record(index));
            if let Some((index, record)) = index.zip(record) {
                let line = FaultRecord {
                    index: index as u8,
                    total: total as u8,
                    record,
                };
                let _ = frames.push(line.encode(turn as u8));
            }
        }
        frames
    }

    /// Whether the vehicle stands, by both of its speeds; not when they are unknown.
    #[must_use]
    pub fn stands(&self) -> bool {
        self.receivers.stands()
    }

    /// The configuration in use, if its copies agree.
    #[must_use]
    pub fn config(&self) -> Option<Config> {
        self.controller.config()
    }
}

/// Brings the second copies of what a step changed up to date. Not inlined, as the controller's.
#[inline(never)]
fn seal(memory: &mut Redundant<Memory>, new: New) {
    let memory = black_box(memory);
    memory.seal_part(|memory| &mut memory.step);
    memory.seal_part(|memory| &mut memory.monitor.step);
    if new.lane {
        memory.seal_part(|memory| &mut memory.monitor.lane_state);
    }
    if new.column {
        memory.seal_part(|memory| &mut memory.monitor.wheel);
    }
}

/// Whether work has come whose turn began `since` steps ago.
#[inline(always)]
fn has_come(is_due: &mut bool, since: u32, is_busy: bool) -> bool {
    if since != 0 && !*is_due {
        return false;
    }
    *is_due = is_busy && since < PATIENCE;
    !*is_due
}

/// A new sample of the column for the estimator, if one came.
#[inline(always)]
fn sample(
    column: &Input<ColumnState>,
    hands: Option<Torque>,
    now: Instant,
    applied: Torque,
) -> Option<Sample> {
    match column {
        Input::New(column) => Some(Sample {
            at: now,
            applied,
            driver_torque: hands.unwrap_or(column.driver_torque),
            wheel_angle: column.wheel_angle,
        }),
        _ => None,
    }
}

/// The self-test: in each turn the monitor must refuse a frame that only one of its rules refuses. A monitor whose copies differ
/// refuses everything, and so passes.
#[inline(never)]
fn passes_self_test<I: Injection>(monitor: Option<&Monitor>, turn: u32, injection: &I) -> bool {
    monitor.is_none_or(|monitor| {
        let (mut state, guidance) = monitor.self_test_vector(turn);
        let evidence = Evidence {
            frames: &Frames::NONE,
            guidance: &guidance,
            elapsed_us: 1000,
        };
        !permits(Some(monitor), &mut state, &evidence, injection)
    })
}

/// Whether the monitor permits the guidance frame. A monitor whose copies differ permits nothing.
fn permits<I: Injection>(
    monitor: Option<&Monitor>,
    state: &mut MonitorState,
    evidence: &Evidence<'_>,
    injection: &I,
) -> bool {
    injection.monitor_passes(evidence.guidance)
        || monitor.is_some_and(|monitor| monitor.step(state, evidence))
}
