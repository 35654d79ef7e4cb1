//! The controller's step: decoded inputs in, one torque command out. The one place that sees the mode
//! machine, the plausibility checks, the law, the envelope and the ramps together.
//!
//! Above 500 lines because the order of the step is its meaning: inputs, modes, torque, limit and feedback share
//! one state that no other file may touch, and are read in one go. A block that can stand alone has its own file.

use crate::config::Config;
use crate::envelope::{EnvelopeState, LimitReason, Situation};
use crate::faults::{Fault, FaultSet};
use crate::injection::{Injection, NoInjection};
use crate::law::{LaneSample, LawState};
use crate::modes::{Event, Events, Mode};
use crate::plausibility::{PlausibilityState, speeds_agree};
use crate::probe::ProbeState;
use crate::quantity::{Instant, Micros, Radians, Ratio, Speed, Torque, TorqueRate, product};
use crate::ramp::{HANDOVER, HISTORY, History, Ramp, smaller_of_same_sign};
use crate::redundant::{Redundant, words};

/// Inputs must be valid for this long in Standby before a request can engage.
pub const READY: Micros = Micros::from_ms(500);
/// A planned fade.
const FADE_RATE: TorqueRate = TorqueRate::from_nm_per_s(4.0);
/// A step that comes later than this after the last one missed its deadline.
const LATE: Micros = Micros::from_us(2_500);
/// A step that comes this late is a fault by itself: the world has moved on by half a camera period.
const LOST_TIME: Micros = Micros::from_ms(10);
/// So many late steps in a row are tolerated.
const LATE_STEPS: u32 = 1;
/// A step that comes sooner than this was not asked for.
const EARLY: Micros = Micros::from_us(500);
/// So many early steps in a row are tolerated: they earn no rate limit, but a runaway timer is a fault.
const EARLY_STEPS: u32 = 3;

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
    /// The same of another value.
    pub(crate) fn map<U>(self, change: impl FnOnce(T) -> U) -> Input<U> {
        match self {
            Self::Lost => Input::Lost,
            Self::Held(value) => Input::Held(change(value)),
            Self::New(value) => Input::New(change(value)),
        }
    }

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
    /// Two sources of the vehicle's speed.
    pub speeds: Input<[Speed; 2]>,
    /// What the host requests.
    pub request: Input<Request>,
    /// Faults found outside: on the bus, by the monitor, at the output.
    pub faults: FaultSet,
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
    /// Everything that a flipped bit must not change unseen.
    pub(crate) struct Memory {
        /// A [`Mode`] code.
        mode: u32,
        /// 1 while the last request was high.
        requested: u32,
        /// How long the inputs have been valid in Standby.
        ready: Micros,
        /// Time since each input was last new: how far back its loss reaches.
        age: Ages,
        /// [`Fault`] bits of inputs that were implausible when last new.
        implausible: u32,
        last_step: Instant,
        /// Late and early steps in a row.
        late: u32,
        early: u32,
        /// Class C faults stay until the next power-up.
        latched: u32,
        law: LawState,
        envelope: EnvelopeState,
        plausibility: PlausibilityState,
        ramp: Ramp,
        probe: ProbeState,
        /// The part of the torque applied that is the probe.
        probe_applied: Torque,
    }
}

words! {
    struct Ages {
        lane: Micros,
        column: Micros,
        speeds: Micros,
        request: Micros,
    }
}

impl Memory {
    const fn new(mode: Mode, now: Instant) -> Self {
        const NONE: Micros = Micros::from_us(0);
        Self {
            mode: mode as u32,
            // A request that is high from the start is no rising edge.
            requested: 1,
            ready: NONE,
            age: Ages {
                lane: NONE,
                column: NONE,
                speeds: NONE,
                request: NONE,
            },
            implausible: 0,
            last_step: now,
            late: 0,
            early: 0,
            latched: 0,
            law: LawState::NEW,
            envelope: EnvelopeState::new(now),
            plausibility: PlausibilityState::NEW,
            ramp: Ramp::NONE,
            probe: ProbeState::SILENT,
            probe_applied: Torque::ZERO,
        }
    }

    fn faults(&self) -> FaultSet {
        FaultSet::from_bits(self.implausible | self.latched)
    }
}

/// What the controller remembers from step to step.
#[derive(Debug, Clone)]
pub struct ControllerState {
    pub(crate) memory: Redundant<Memory>,
    history: History,
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

    fn with(mode: Mode, now: Instant) -> Self {
        Self {
            memory: Redundant::new(Memory::new(mode, now)),
            history: History::new(),
        }
    }

    /// The copies of a redundant state differ: nothing of it can be used, and it stays so.
    fn lose_memory(&mut self, now: Instant) -> Command {
        let mut faults = FaultSet::NONE;
        faults.insert(Fault::Memory);
        let memory = Memory {
            latched: faults.bits(),
            ..Memory::new(Mode::Fault, now)
        };
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
        self.step_with(state, now, applied, inputs, &NoInjection)
    }

    #[inline]
    pub(crate) fn step_with<I: Injection>(
        &self,
        state: &mut ControllerState,
        now: Instant,
        applied: Torque,
        inputs: &Inputs,
        injection: &I,
    ) -> Command {
        let Some(config) = self.config.get() else {
            return state.lose_memory(now);
        };
        let history = &mut state.history;
        let command = state.memory.change(|memory| {
            let step = Step {
                config,
                now,
                applied,
                inputs,
                elapsed: now.since(memory.last_step),
                injection,
            };
            memory.last_step = now;
            step.run(memory, history)
        });
        let Some(command) = command else {
            return state.lose_memory(now);
        };
        state.history.push(now, without(command.torque, command.probe));
        command
    }
}

/// One step, with what it must not change.
struct Step<'a, I> {
    config: &'a Config,
    now: Instant,
    applied: Torque,
    inputs: &'a Inputs,
    elapsed: Micros,
    injection: &'a I,
}

impl<I: Injection> Step<'_, I> {
    fn run(&self, v: &mut Memory, history: &mut History) -> Command {
        let lost = self.look(v);
        let (late, early) = self.keep_time(v);
        let mut faults = lost.union(v.faults()).union(self.inputs.faults);
        faults.insert_if(late > LATE_STEPS || early > EARLY_STEPS, Fault::Deadline);
        v.latched |= faults.common(FaultSet::CRITICAL).bits();

        let before = Mode::from_code(v.mode).unwrap_or(Mode::Fault);
        let mode = self.next_mode(v, before, faults);
        if mode != before {
            self.enter(v, mode, faults, history);
        }
        let (torque, probe, limit) = self.torque(v, mode);
        v.probe_applied = probe.unwrap_or(Torque::ZERO);
        let warning = matches!(mode, Mode::Handover | Mode::Fault | Mode::Locked);
        Command {
            torque,
            probe,
            limit,
            mode,
            faults,
            warning,
        }
    }

    /// Takes the inputs: what is new goes through the plausibility checks. Returns what is lost.
    fn look(&self, v: &mut Memory) -> FaultSet {
        let Inputs {
            lane,
            column,
            speeds,
            request,
            ..
        } = self.inputs;
        let checks = &self.config.plausibility;
        let mut lost = FaultSet::NONE;
        let mut implausible = FaultSet::from_bits(v.implausible);

        v.age.speeds = self.age(speeds, v.age.speeds);
        if let Input::New([a, b]) = speeds {
            let agree = speeds_agree(*a, *b);
            implausible.set(!agree, Fault::SpeedImplausible);
            if agree {
                checks.speed(&mut v.plausibility, *a);
            }
        }
        if !self.is_fast_enough().unwrap_or(false) {
            // Neither model holds at a walking pace, let alone at an unknown one.
            v.plausibility.forget_lane();
            v.plausibility.forget_column();
        }
        v.age.column = self.age(column, v.age.column);
        match column {
            Input::New(c) => {
                let plausible = checks.column(
                    &mut v.plausibility,
                    self.now,
                    c.driver_torque,
                    c.wheel_angle,
                    self.applied,
                );
                implausible.set(!plausible, Fault::ColumnImplausible);
            }
            Input::Held(_) => {}
            Input::Lost => {
                v.plausibility.forget_column();
                implausible.set(false, Fault::ColumnImplausible);
            }
        }
        v.age.lane = self.age(lane, v.age.lane);
        match lane {
            Input::New(sample) => {
                let plausible = checks.lane(&mut v.plausibility, *sample);
                implausible.set(!plausible, Fault::LaneImplausible);
            }
            Input::Held(_) => {}
            Input::Lost => {
                v.plausibility.forget_lane();
                implausible.set(false, Fault::LaneImplausible);
            }
        }
        v.age.request = self.age(request, v.age.request);

        // A frame that arrives and is refused is no time-out: the fault that says so came with the inputs.
        let refused = |fault| self.inputs.faults.contains(fault);
        lost.insert_if(
            lane.value().is_none() && !refused(Fault::LaneStep),
            Fault::LaneTimeout,
        );
        lost.insert_if(column.value().is_none(), Fault::ColumnTimeout);
        lost.insert_if(
            speeds.value().is_none() && !refused(Fault::SpeedStep),
            Fault::SpeedTimeout,
        );
        lost.insert_if(request.value().is_none(), Fault::CommandTimeout);
        v.implausible = implausible.bits();
        lost
    }

    fn age<T>(&self, input: &Input<T>, so_far: Micros) -> Micros {
        match input {
            Input::New(_) => Micros::from_us(0),
            _ => Micros::from_us(so_far.us().saturating_add(self.elapsed.us())),
        }
    }

    /// Whether both speeds reach the slowest that is guided, if they are known.
    fn is_fast_enough(&self) -> Option<bool> {
        let least = self.config.least_speed;
        self.inputs
            .speeds
            .value()
            .map(|speeds| speeds.iter().all(|speed| *speed >= least))
    }

    /// Counts steps that came late or early, in a row. A very late one counts for all it missed.
    fn keep_time(&self, v: &mut Memory) -> (u32, u32) {
        v.late = match self.elapsed {
            e if e > LOST_TIME => LATE_STEPS.saturating_add(1),
            e if e > LATE => v.late.saturating_add(1),
            _ => 0,
        };
        v.early = if self.elapsed < EARLY {
            v.early.saturating_add(1)
        } else {
            0
        };
        (v.late, v.early)
    }

    /// The most urgent event that changes the mode decides.
    fn next_mode(&self, v: &mut Memory, mode: Mode, faults: FaultSet) -> Mode {
        let inputs_ok = !faults.intersects(FaultSet::INPUT);
        let request = self.inputs.request.value().map(|r| r.engage);
        let fast_enough = self.is_fast_enough();
        let rising = request == Some(true) && v.requested == 0;
        if let Some(high) = request {
            v.requested = u32::from(high);
        }
        v.ready = if mode == Mode::Standby && inputs_ok && fast_enough == Some(true) {
            Micros::from_us(v.ready.us().saturating_add(self.elapsed.us())).min(READY)
        } else {
            Micros::from_us(0)
        };
        let mut raised = Events::of(Event::BootPassed);
        raised.insert_if(rising && v.ready >= READY, Event::Engage);
        // Late steps carry the ramp further than the reduction limit lets the torque follow.
        raised.insert_if(v.ramp.is_done() && self.applied == Torque::ZERO, Event::Faded);
        let is_over = request == Some(false) || fast_enough == Some(false);
        raised.insert_if(is_over, Event::Disengage);
        raised.insert_if(!inputs_ok, Event::InputLost);
        raised.insert_if(faults.intersects(FaultSet::LOCKING), Event::BootRejected);
        raised.insert_if(faults.intersects(FaultSet::CRITICAL), Event::Critical);
        mode.after_all(raised)
    }

    fn enter(&self, v: &mut Memory, mode: Mode, faults: FaultSet, history: &History) {
        v.mode = mode as u32;
        v.probe = ProbeState::SILENT;
        match mode {
            // Both may be from before the last wrap of the clock.
            Mode::Active => (v.law, v.envelope) = (LawState::NEW, EnvelopeState::new(self.now)),
            Mode::Fade => v.ramp = Ramp::at_rate(self.applied, FADE_RATE),
            Mode::Handover => {
                let suspect = self.suspect_since(v, faults);
                // Half a wave of the probe must not stand in the wheel for two seconds, and what the other half
                // took away does not come back.
                let applied =
                    smaller_of_same_sign(self.applied, without(self.applied, Some(v.probe_applied)));
                v.ramp = Ramp::over(history.handover_start(self.now, suspect, applied), HANDOVER);
            }
            _ => {}
        }
    }

    /// How long ago the earliest sample came that must not be trusted.
    fn suspect_since(&self, v: &Memory, faults: FaultSet) -> Micros {
        let lost_for = |fault, age| {
            if faults.contains(fault) {
                age
            } else {
                Micros::from_us(0)
            }
        };
        if faults.intersects(FaultSet::IMPLAUSIBLE) {
            return HISTORY;
        }
        lost_for(Fault::LaneTimeout, v.age.lane)
            .max(lost_for(Fault::LaneStep, v.age.lane))
            .max(lost_for(Fault::SpeedStep, v.age.speeds))
            .max(lost_for(Fault::ColumnTimeout, v.age.column))
            .max(lost_for(Fault::SpeedTimeout, v.age.speeds))
            .max(lost_for(Fault::CommandTimeout, v.age.request))
    }

    /// The torque, the part of it that is the probe, and what limited it.
    fn torque(&self, v: &mut Memory, mode: Mode) -> (Torque, Option<Torque>, LimitReason) {
        let (wanted, probe) = match mode {
            Mode::Active => {
                let guidance = self.guidance(v);
                let probe = self.probe(v);
                (with(guidance, probe), probe)
            }
            // A driver who pushed the torque below its ramp does not get it back.
            Mode::Fade | Mode::Handover => (
                smaller_of_same_sign(v.ramp.step(self.elapsed), self.applied),
                None,
            ),
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
        let (torque, limit) = self
            .config
            .envelope
            .step(&mut v.envelope, self.now, wanted, &situation);
        match limit {
            LimitReason::None if mode != Mode::Active => (torque, probe, LimitReason::Mode),
            LimitReason::None => (torque, probe, limit),
            // Where a limit acts, no more may count as guidance than was applied.
            _ => (torque, probe.map(|probe| common_part(probe, torque)), limit),
        }
    }

    /// The probe's torque, while it is wanted or on its way out.
    fn probe(&self, v: &mut Memory) -> Option<Torque> {
        let wanted = self.inputs.request.value().is_some_and(|r| r.probe);
        self.config.probe.step(&mut v.probe, self.elapsed, wanted)
    }

    /// The law's torque, scaled by the authority.
    fn guidance(&self, v: &mut Memory) -> Torque {
        let law = |sample| self.config.law.step(&mut v.law, self.now, sample);
        let asked = self.inputs.lane.value().map_or(Torque::ZERO, law);
        let asked = self.injection.law(asked);
        // A share: more than all or less than nothing is a host's mistake.
        let share = |request: Request| request.authority.max(Ratio::ZERO).min(Ratio::ONE);
        let authority = self.inputs.request.value().map_or(Ratio::ZERO, share);
        Torque::from_wide(product(authority.bits(), asked.bits()))
    }
}

fn with(guidance: Torque, probe: Option<Torque>) -> Torque {
    guidance.plus(probe.unwrap_or(Torque::ZERO))
}

fn without(torque: Torque, probe: Option<Torque>) -> Torque {
    with(torque, probe.map(Torque::opposite))
}

/// As much of `part` as `whole` can hold.
fn common_part(part: Torque, whole: Torque) -> Torque {
    part.max(whole.min(Torque::ZERO)).min(whole.max(Torque::ZERO))
}
