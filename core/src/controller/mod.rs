//! The controller: decoded inputs in, one torque command out. This file declares its command; [`inputs`] what it reads; `memory` what it
//! remembers; `step` computes one step in order: inputs, mode, torque, limits.
//!
//! Not here: bytes and their checks, the monitor, the motor ([`crate::ecu`]).

pub mod config;
pub(crate) mod injection;
pub mod inputs;
mod memory;
pub mod params;
mod step;

use crate::controller::config::Config;
use crate::controller::injection::{Injection, NoInjection};
use crate::controller::inputs::Inputs;
use crate::observer::{self, Sensor};
use crate::quantity::{Instant, Micros, Torque};
use crate::safety::envelope::LimitReason;
use crate::safety::faults::{Fault, FaultSet};
use crate::safety::modes::Mode;
use crate::safety::redundant::{Redundant, are_intact};
use memory::{ChangedParts, KeptOnce, Memory, seal};
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
    /// The hands' torque that it went by; `None` without a column.
    pub hands: Option<Torque>,
}

/// What the controller remembers from step to step.
#[derive(Debug, Clone)]
#[repr(C)]
pub struct ControllerState {
    pub(crate) memory: Redundant<Memory>,
    /// What the observer of the hands' torque remembers. Where the sensor is of the hands nothing reads it, and it is not compared.
    pub(crate) observer: Redundant<observer::State>,
    once: KeptOnce,
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
            observer: Redundant::new(observer::State::NEW),
            once: KeptOnce::new(),
        }
    }

    /// The copies of the state differ, so none can be used: starts anew in Fault, with the memory fault latched.
    fn lose_memory(&mut self, now: Instant) -> Command {
        let mut faults = FaultSet::NONE;
        faults.insert(Fault::Memory);
        let mut memory = Memory::new(Mode::Fault, now);
        memory.fast.kept = faults.bits();
        self.memory.set(memory);
        self.observer.set(observer::State::NEW);
        Command {
            torque: Torque::ZERO,
            probe: None,
            limit: LimitReason::Mode,
            mode: Mode::Fault,
            faults,
            warning: true,
            hands: None,
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
    pub(crate) fn is_intact(&self, state: &ControllerState) -> bool {
        self.config.agrees_apart() && state.memory.agrees_apart()
    }

    /// `is_known_intact`: [`Self::is_intact`] was true in this step already.
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
        // Both copies agree on a law or a sensor that there is not: a memory fault as any other.
        let (Some(law), Some(sensor)) = (config.law(), config.sensor()) else {
            return state.lose_memory(now);
        };
        if matches!(sensor, Sensor::Bar(_)) && !state.observer.agrees_apart() {
            return state.lose_memory(now);
        }
        let memory = state.memory.value_mut();
        let elapsed = now.since(memory.fast.last_step);
        memory.fast.last_step = now;
        let mut step = Step {
            config,
            law,
            sensor,
            now,
            elapsed,
            applied,
            inputs,
            injection,
            lane: inputs.lane,
            is_late: false,
            hands: None,
            memory,
            observer: &mut state.observer,
            changed: ChangedParts::NOTHING,
            once: &mut state.once,
        };
        let command = step.run();
        let changed = step.changed;
        seal(&mut state.memory, changed);
        let guidance = subtract_probe(command.torque, command.probe);
        state.once.torque_history.push(now, guidance);
        command
    }
}
