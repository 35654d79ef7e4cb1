//! The controller: decoded inputs in, one torque command out. What it reads, decides and remembers stands here, and
//! the order of a step in `step`: inputs, modes, torque, limit and feedback.
//!
//! Not here: bytes and their checks, the monitor, the motor ([`crate::ecu`]).

pub mod config;
pub(crate) mod injection;
pub mod params;
mod step;

use crate::controller::config::Config;
use crate::controller::injection::{Injection, NoInjection};
use crate::law::activity::Activity;
use crate::law::probe::ProbeState;
use crate::law::{LaneSample, LawState};
use crate::quantity::{Instant, Micros, Radians, Ratio, Speed, Torque, TurningRate};
use crate::safety::coast::Coast;
use crate::safety::envelope::{EnvelopeState, LimitReason};
use crate::safety::faults::{Fault, FaultSet};
use crate::safety::hands::HandsState;
use crate::safety::modes::Mode;
use crate::safety::past::Past;
use crate::safety::plausibility::PlausibilityState;
use crate::safety::ramp::{History, Ramp};
use crate::safety::redundant::{Redundant, Words, are_whole, words};
use step::{Step, without};

/// Inputs must be valid for this long in Standby before a request can engage.
pub const READY: Micros = Micros::from_ms(500);
/// One input: the latest value that passed the bus's checks, and since when.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Input<T> {
    /// No usable value: never heard, stale, or refused for longer than the time-out.
    Lost,
    /// A value that is not older than the time-out.
    Held(T),
    /// A value that came since the last step.
    New(T),
}

impl<T: Copy> Input<T> {
    /// The value, new or held.
    #[must_use]
    pub const fn value(&self) -> Option<T> {
        match self {
            Self::Lost => None,
            Self::Held(value) | Self::New(value) => Some(*value),
        }
    }
}

words! {
    /// Driver torque and wheel angle.
    #[derive(Default)]
    pub struct Column {
        /// T_d on the wheel.
        pub driver_torque: Torque,
        /// phi.
        pub wheel_angle: Radians,
    }
}

words! {
    /// How the vehicle moves, as its own sensors have it.
    #[derive(Default)]
    pub struct Motion {
        /// Two sources of its speed.
        pub speeds: [Speed; 2],
        /// The measured yaw rate; counts only where there is one.
        pub yaw_rate: TurningRate,
        /// 1 where there is a measured yaw rate.
        pub has_yaw_rate: u32,
    }
}

impl Motion {
    /// Speeds, and the yaw rate if it is measured.
    #[must_use]
    pub fn new(speeds: [Speed; 2], yaw_rate: Option<TurningRate>) -> Self {
        Self {
            speeds,
            yaw_rate: yaw_rate.unwrap_or(TurningRate::ZERO),
            has_yaw_rate: u32::from(yaw_rate.is_some()),
        }
    }

    /// The yaw rate, if it is measured.
    #[must_use]
    pub fn yaw_rate(&self) -> Option<TurningRate> {
        (self.has_yaw_rate != 0).then_some(self.yaw_rate)
    }
}

/// What the host requests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Request {
    /// Guidance is wanted. A rising edge engages, a low level ends.
    pub engage: bool,
    /// Share of the law's torque to apply, 0 to 1; saturates there.
    pub authority: Ratio,
    /// The probe is wanted on top of it.
    pub probe: bool,
}

/// What the controller reads every millisecond.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Inputs {
    /// Lane errors.
    pub lane: Input<LaneSample>,
    /// The column's sensors.
    pub column: Input<Column>,
    /// Two sources of the vehicle's speed, and its yaw rate.
    pub motion: Input<Motion>,
    /// What the host requests.
    pub request: Input<Request>,
    /// Faults found outside: on the bus, by the monitor, at the output.
    pub faults: FaultSet,
}

impl Inputs {
    /// Nothing heard. No constant, which a step would copy whole.
    #[inline(always)]
    pub(crate) fn lost() -> Self {
        Self {
            lane: Input::Lost,
            column: Input::Lost,
            motion: Input::Lost,
            request: Input::Lost,
            faults: FaultSet::NONE,
        }
    }
}

/// What the controller decides every millisecond.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Command {
    /// T_h, the guidance torque to apply.
    pub torque: Torque,
    /// The part of it that is the probe, while there is one.
    pub probe: Option<Torque>,
    /// Which limit held it back.
    pub limit: LimitReason,
    /// The mode it belongs to.
    pub mode: Mode,
    /// What is wrong.
    pub faults: FaultSet,
    /// The driver has to take over.
    pub warning: bool,
}

words! {
    /// Everything that a flipped bit must not change unseen. What a step may leave as it is are parts of their own.
    pub(crate) struct Memory {
        hot: Hot,
        /// When each input was last new: how far back its loss reaches. Guidance ends before the clock wraps.
        heard: Heard,
        law: LawState,
        plausibility: PlausibilityState,
        /// The share of the law's torque that acts at the speed in use; 0 before there is one.
        share: Ratio,
        coast: Coast,
        ramp: Ramp,
    }
}

words! {
    /// What most steps change.
    struct Hot {
        small: Small,
        last_step: Instant,
        /// How long the inputs have been valid in Standby.
        ready: Micros,
        /// [`Fault`] bits that stay: of inputs that were implausible when last new, and of class C until the next power-up.
        kept: u32,
        /// The rate of turn when the last lane sample was true, and what the vehicle has turned since.
        rate_then: TurningRate,
        turned: Radians,
        /// The part of the torque applied that is the probe.
        probe_applied: Torque,
        probe: ProbeState,
        hands: HandsState,
        envelope: EnvelopeState,
    }
}

/// The parts beside [`Hot`] that a step changed, one bit each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Changed(u32);

impl Changed {
    const NOTHING: Self = Self(0);
    const HEARD: Self = Self(1);
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

/// The samples in use that have not gone through their checks. Not kept twice: a flip costs one check, whose sums the
/// next one makes up for, or brings one more of the same sample, which changes nothing but how long it counts.
#[derive(Debug, Clone, Copy, Default)]
struct Due {
    lane: bool,
    column: bool,
}

/// What is small shares a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C, align(4))]
struct Small {
    /// A [`Mode`] code.
    mode: u8,
    /// 1 while the last request was high.
    requested: u8,
    /// Late and early steps in a row.
    late: u8,
    early: u8,
}

impl Small {
    const fn word(self) -> u32 {
        u32::from_ne_bytes([self.mode, self.requested, self.late, self.early])
    }
}

impl Words for Small {
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
    struct Heard {
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
            hot: Hot {
                small: Small {
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
            heard: Heard {
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
        FaultSet::from_bits(self.hot.kept)
    }
}

/// What the controller remembers from step to step.
#[derive(Debug, Clone)]
pub struct ControllerState {
    pub(crate) memory: Redundant<Memory>,
    history: History,
    past: Past,
    due: Due,
    activity: Activity,
}

impl ControllerState {
    /// At power-up: Boot.
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
            history: History::new(),
            past: Past::new(),
            due: Due::default(),
            activity: Activity::NEW,
        }
    }

    /// The copies of a redundant state differ: nothing of it can be used, and it stays so.
    fn lose_memory(&mut self, now: Instant) -> Command {
        let mut faults = FaultSet::NONE;
        faults.insert(Fault::Memory);
        let mut memory = Memory::new(Mode::Fault, now);
        memory.hot.kept = faults.bits();
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

/// The whole control law with its limits; immutable.
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

    /// Whether configuration and state are whole.
    #[inline(always)]
    pub(crate) fn is_whole(&self, state: &ControllerState) -> bool {
        self.config.agrees_apart() && state.memory.agrees_apart()
    }

    /// `found_whole`: [`Self::is_whole`] was true in this step already.
    #[inline]
    pub(crate) fn step_with<I: Injection>(
        &self,
        state: &mut ControllerState,
        found_whole: bool,
        now: Instant,
        applied: Torque,
        inputs: &Inputs,
        injection: &I,
    ) -> Command {
        if !found_whole && !are_whole(&self.config, &state.memory) {
            return state.lose_memory(now);
        }
        let ControllerState {
            memory: kept,
            history,
            past,
            due,
            activity,
        } = state;
        let memory = kept.value_mut();
        let mut step = Step {
            config: self.config.value(),
            now,
            applied,
            inputs,
            lane: inputs.lane,
            elapsed: now.since(memory.hot.last_step),
            activity,
            injection,
        };
        memory.hot.last_step = now;
        let mut changed = Changed::NOTHING;
        let command = step.run(memory, &mut changed, history, past, due);
        seal(kept, changed);
        history.push(now, without(command.torque, command.probe));
        command
    }
}

/// Copies what a step changed. A function of its own, as the comparison is.
#[inline(never)]
fn seal(memory: &mut Redundant<Memory>, changed: Changed) {
    memory.seal_part(|v| &mut v.hot);
    if changed.has(Changed::HEARD) {
        memory.seal_part(|v| &mut v.heard);
    }
    if changed.has(Changed::LAW) {
        memory.seal_part(|v| &mut v.law);
    }
    if changed.has(Changed::MOTION) {
        memory.seal_part(|v| &mut v.plausibility.motion);
        memory.seal_part(|v| &mut v.share);
    }
    if changed.has(Changed::LANE) {
        memory.seal_part(|v| &mut v.plausibility.lane);
    }
    if changed.has(Changed::COLUMN) {
        memory.seal_part(|v| &mut v.plausibility.column);
    }
    if changed.has(Changed::COAST) {
        memory.seal_part(|v| &mut v.coast);
    }
    if changed.has(Changed::RAMP) {
        memory.seal_part(|v| &mut v.ramp);
    }
}
