//! The controller: decoded inputs in, one torque command out. This file declares its command and its memory; [`inputs`] what it
//! reads; `step` computes one step in order: inputs, mode, torque, limits.
//!
//! Not here: bytes and their checks, the monitor, the motor ([`crate::ecu`]).

pub mod config;
pub(crate) mod injection;
pub mod inputs;
pub mod params;
mod step;

use crate::controller::config::Config;
use crate::controller::injection::{Injection, NoInjection};
use crate::controller::inputs::Inputs;
use crate::law::LawState;
use crate::law::activity::Activity;
use crate::law::probe::ProbeState;
use crate::quantity::{Instant, Micros, Radians, Ratio, Torque, TurningRate};
use crate::safety::coast::Coast;
use crate::safety::envelope::{EnvelopeState, LimitReason};
use crate::safety::faults::{Fault, FaultSet};
use crate::safety::frozen_torque::FrozenTorqueState;
use crate::safety::hands::HandsState;
use crate::safety::modes::Mode;
use crate::safety::motion_history::MotionHistory;
use crate::safety::plausibility::PlausibilityState;
use crate::safety::ramp::{Ramp, TorqueHistory};
use crate::safety::redundant::{Redundant, Words, are_intact, words};
use step::{Step, subtract_probe};

/// Inputs must be valid for this long in Standby before a request can engage.
pub const READY: Micros = Micros::from_ms(500);

/// What the controller decides every millisecond.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Command {
    /// T_h, the guidance torque to apply.
    pub torque: Torque,
    /// The part of it that is the probe, while there is one.
    pub probe: Option<Torque>,
    /// The limit that acted on it.
    pub limit: LimitReason,
    /// The mode it belongs to.
    pub mode: Mode,
    /// The faults present.
    pub faults: FaultSet,
    /// The driver has to take over.
    pub warning: bool,
}

words! {
    /// State that is kept twice, so that a flipped bit is found. Each part is copied only in steps that change it.
    pub(crate) struct Memory {
        fast: FastState,
        /// When each input was last new. Guidance ends long before these instants are a wrap of the clock old.
        input_times: InputTimes,
        law: LawState,
        plausibility: PlausibilityState,
        /// Gain of the law at the speed in use, 0 to 1; 0 before the first speed.
        share: Ratio,
        coast: Coast,
        ramp: Ramp,
    }
}

words! {
    /// The part that most steps change.
    struct FastState {
        packed: PackedState,
        last_step: Instant,
        /// How long the inputs have been valid in Standby.
        ready: Micros,
        /// [`Fault`] bits that last beyond a step: of inputs that were implausible when last new, and of class C until power-off.
        kept: u32,
        /// The rate of turn at the instant of the last lane sample, and the angle turned since; zero for a fresh sample.
        rate_then: TurningRate,
        turned: Radians,
        /// The probe's part of the torque applied.
        probe_applied: Torque,
        probe: ProbeState,
        hands: HandsState,
        envelope: EnvelopeState,
    }
}

/// The parts beside `FastState` that a step changed, one bit each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct ChangedParts(u32);

impl ChangedParts {
    const NOTHING: Self = Self(0);
    const INPUT_TIMES: Self = Self(1);
    const LAW: Self = Self(2);
    const MOTION: Self = Self(4);
    const LANE: Self = Self(8);
    const COLUMN: Self = Self(16);
    const RAMP: Self = Self(32);
    const COAST: Self = Self(64);

    const fn add(&mut self, part: Self) {
        self.0 |= part.0;
    }

    const fn has(self, part: Self) -> bool {
        self.0 & part.0 != 0
    }
}

/// Inputs whose newest sample is still to be checked. Not kept twice: a flipped bit skips one check, whose time the next one
/// covers, or repeats one on the same sample, over no time.
/// Beside them what the column's check alone knows of the driver torque, and driver activity, which is bounded where it is read.
#[derive(Debug, Clone, Copy)]
struct PendingChecks {
    lane: bool,
    column: bool,
    frozen_torque: FrozenTorqueState,
    activity: Activity,
}

impl PendingChecks {
    fn new() -> Self {
        Self {
            lane: false,
            column: false,
            frozen_torque: FrozenTorqueState::default(),
            activity: Activity::NEW,
        }
    }
}

/// Four bytes that share a word, as memory is compared word by word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C, align(4))]
struct PackedState {
    /// A [`Mode`] code.
    mode: u8,
    /// 1 while the last request was high.
    requested: u8,
    /// Late and early steps in a row.
    late: u8,
    early: u8,
}

impl PackedState {
    const fn word(self) -> u32 {
        u32::from_ne_bytes([self.mode, self.requested, self.late, self.early])
    }
}

impl Words for PackedState {
    fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
        let [mode, requested, late, early] = change(self.word()).to_ne_bytes();
        Self {
            mode,
            requested,
            late,
            early,
        }
    }

    fn agreement(&self, other: &Self) -> u32 {
        self.word().agreement(&other.word())
    }
}

words! {
    struct InputTimes {
        lane: Instant,
        column: Instant,
        motion: Instant,
        request: Instant,
    }
}

impl Memory {
    #[expect(clippy::as_conversions, reason = "a code is its discriminant")]
    const fn new(mode: Mode, now: Instant) -> Self {
        Self {
            fast: FastState {
                packed: PackedState {
                    mode: mode as u8,
                    // A request that is high from the start is no rising edge.
                    requested: 1,
                    late: 0,
                    early: 0,
                },
                last_step: now,
                ready: Micros::from_us(0),
                kept: 0,
                rate_then: TurningRate::ZERO,
                turned: Radians::ZERO,
                probe_applied: Torque::ZERO,
                probe: ProbeState::SILENT,
                hands: HandsState::NEW,
                envelope: EnvelopeState::new(now),
            },
            input_times: InputTimes {
                lane: now,
                column: now,
                motion: now,
                request: now,
            },
            law: LawState::NEW,
            plausibility: PlausibilityState::NEW,
            share: Ratio::ZERO,
            coast: Coast::NEW,
            ramp: Ramp::NONE,
        }
    }

    fn faults(&self) -> FaultSet {
        FaultSet::from_bits(self.fast.kept)
    }
}

/// What the controller remembers from step to step.
#[derive(Debug, Clone)]
pub struct ControllerState {
    pub(crate) memory: Redundant<Memory>,
    torque_history: TorqueHistory,
    motion_history: MotionHistory,
    pending: PendingChecks,
}

impl ControllerState {
    /// The state at power-up: mode Boot.
    #[must_use]
    pub fn new(now: Instant) -> Self {
        Self::with(Mode::Boot, now)
    }

    /// Guidance active from the start, as the paper's studies of driver models have it. Not for a vehicle.
    #[must_use]
    pub fn engaged(now: Instant) -> Self {
        Self::with(Mode::Active, now)
    }

    pub(crate) fn with(mode: Mode, now: Instant) -> Self {
        Self {
            memory: Redundant::new(Memory::new(mode, now)),
            torque_history: TorqueHistory::new(),
            motion_history: MotionHistory::new(),
            pending: PendingChecks::new(),
        }
    }

    /// The copies of the state differ, so none can be used: starts anew in Fault, with the memory fault latched.
    fn lose_memory(&mut self, now: Instant) -> Command {
        let mut faults = FaultSet::NONE;
        faults.insert(Fault::Memory);
        let mut memory = Memory::new(Mode::Fault, now);
        memory.fast.kept = faults.bits();
        self.memory.set(memory);
        Command {
            torque: Torque::ZERO,
            probe: None,
            limit: LimitReason::Mode,
            mode: Mode::Fault,
            faults,
            warning: true,
        }
    }
}

/// The controller's configuration: law, limits and checks; immutable.
#[derive(Debug, Clone, Copy)]
pub struct Controller {
    pub(crate) config: Redundant<Config>,
}

impl Controller {
    /// A controller with checked parameters.
    #[must_use]
    pub fn new(config: Config) -> Self {
        Self {
            config: Redundant::new(config),
        }
    }

    /// The configuration, if its copies agree.
    #[must_use]
    pub fn config(&self) -> Option<Config> {
        self.config.get().copied()
    }

    /// One step of the 1 kHz loop. `applied` is the torque that was really applied since the last one.
    #[must_use]
    pub fn step(
        &self,
        state: &mut ControllerState,
        now: Instant,
        applied: Torque,
        inputs: &Inputs,
    ) -> Command {
        self.step_with(state, false, now, applied, inputs, &NoInjection)
    }

    /// Whether both copies of configuration and of state agree.
    #[inline(always)]
    pub(crate) fn is_intact(&self, state: &ControllerState) -> bool {
        self.config.agrees_apart() && state.memory.agrees_apart()
    }

    /// `is_known_intact`: [`Self::is_intact`] was true in this step already.
    #[inline]
    pub(crate) fn step_with<I: Injection>(
        &self,
        state: &mut ControllerState,
        is_known_intact: bool,
        now: Instant,
        applied: Torque,
        inputs: &Inputs,
        injection: &I,
    ) -> Command {
        if !is_known_intact && !are_intact(&self.config, &state.memory) {
            return state.lose_memory(now);
        }
        let config = self.config.value();
        // Both copies agree on a law that there is not: a memory fault as any other.
        let Some(law) = config.law() else {
            return state.lose_memory(now);
        };
        let memory = state.memory.value_mut();
        let mut step = Step {
            config,
            law,
            now,
            applied,
            inputs,
            lane: inputs.lane,
            is_late: false,
            elapsed: now.since(memory.fast.last_step),
            injection,
        };
        memory.fast.last_step = now;
        let mut changed = ChangedParts::NOTHING;
        let (torque_history, motion_history) = (&mut state.torque_history, &mut state.motion_history);
        let command = step.run(
            memory,
            &mut changed,
            torque_history,
            motion_history,
            &mut state.pending,
        );
        seal(&mut state.memory, changed);
        state
            .torque_history
            .push(now, subtract_probe(command.torque, command.probe));
        command
    }
}

/// Brings the second copy of each changed part up to date. Not inlined, which costs fewer instructions.
#[inline(never)]
fn seal(memory: &mut Redundant<Memory>, changed: ChangedParts) {
    memory.seal_part(|v| &mut v.fast);
    if changed.has(ChangedParts::INPUT_TIMES) {
        memory.seal_part(|v| &mut v.input_times);
    }
    if changed.has(ChangedParts::LAW) {
        memory.seal_part(|v| &mut v.law);
    }
    if changed.has(ChangedParts::MOTION) {
        memory.seal_part(|v| &mut v.plausibility.motion);
        memory.seal_part(|v| &mut v.share);
    }
    if changed.has(ChangedParts::LANE) {
        memory.seal_part(|v| &mut v.plausibility.lane);
    }
    if changed.has(ChangedParts::COLUMN) {
        memory.seal_part(|v| &mut v.plausibility.column);
    }
    if changed.has(ChangedParts::COAST) {
        memory.seal_part(|v| &mut v.coast);
    }
    if changed.has(ChangedParts::RAMP) {
        memory.seal_part(|v| &mut v.ramp);
    }
}
