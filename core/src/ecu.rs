//! The ECU: frames in, frames out. Holds one controller, the receivers of its inputs with their ages, the
//! monitor, and the counters of its own frames. Firmware and simulator carry bytes to it and from it,
//! nothing more.
//!
//! Above 500 lines because what goes in and out of a millisecond, and who counts it, is checked against itself
//! here: receivers, ages, monitor and frames of one state. Fault injection is in a file of its own.

#[cfg(feature = "fault-injection")]
pub mod injection;

use heapless::Vec;

use crate::actuator::Actuator;
use crate::advice::Advice;
use crate::bus::e2e::ReceiverState;
use crate::bus::messages::{
    Column as ColumnMessage, Demand, FaultRecord, Guidance, LanePreview, Message, ResetCause, TIMEOUT,
    Vehicle, Warning,
};
use crate::bus::{Frame, Reject};
use crate::controller::{Column, Command, Controller, ControllerState, Input, Inputs, Request};
use crate::envelope::LimitReason;
use crate::faults::{Fault, FaultSet, History};
use crate::law::LaneSample;
use crate::modes::Mode;
use crate::monitor::{Evidence, Monitor, MonitorState};
use crate::params::{Config, Setup};
use crate::plausibility::{lane_step_is_possible, speed_step_is_possible};
use crate::quantity::{Gain, Instant, Metres, Micros, Radians, Speed, Torque};
use crate::reliance::Sample;
use crate::vital::{Guarded, Vital, vital};

/// How the ECU came up: what the firmware knows before the first step.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Boot {
    /// Why it started.
    pub reset: ResetCause,
    /// Resets within the last 10 s, this one included, power-up not.
    pub recent_resets: u8,
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

/// The latest value of one input, with what judges the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
struct Slot<T> {
    e2e: ReceiverState,
    /// 1 while there is a value.
    has: u32,
    /// 1 until a step has seen it.
    fresh: u32,
    /// When it was true.
    at: Instant,
    value: T,
}

impl<T: Vital> Vital for Slot<T> {
    fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
        Self {
            e2e: self.e2e.map_words(change),
            has: change(self.has),
            fresh: change(self.fresh),
            at: self.at.map_words(change),
            value: self.value.map_words(change),
        }
    }

    fn is_inverse_of(&self, other: &Self) -> bool {
        self.e2e.is_inverse_of(&other.e2e)
            & self.has.is_inverse_of(&other.has)
            & self.fresh.is_inverse_of(&other.fresh)
            & self.at.is_inverse_of(&other.at)
            & self.value.is_inverse_of(&other.value)
    }
}

impl<T: Copy> Slot<T> {
    /// Nothing heard; `value` only fills the place.
    const fn new(e2e: ReceiverState, value: T, now: Instant) -> Self {
        Self {
            e2e,
            has: 0,
            fresh: 0,
            at: now,
            value,
        }
    }

    fn put(&mut self, value: T, at: Instant) {
        (self.has, self.fresh, self.value, self.at) = (1, 1, value, at);
    }

    fn last(&self) -> Option<T> {
        (self.has != 0).then_some(self.value)
    }

    /// What a step sees. A stale value is dropped, so that no instant outlives a wrap of the clock, and its
    /// sender has to be trusted anew.
    fn take(&mut self, now: Instant) -> Input<T> {
        if self.has != 0 && now.since(self.at) > TIMEOUT {
            self.has = 0;
            self.e2e = ReceiverState::NEW;
        }
        let fresh = core::mem::replace(&mut self.fresh, 0) != 0;
        match (self.has != 0, fresh) {
            (false, _) => Input::Lost,
            (true, false) => Input::Held(self.value),
            (true, true) => Input::New(self.value),
        }
    }
}

vital! {
    /// What the ECU must not lose to a flipped bit.
    struct Vitals {
        lane: Slot<LaneSample>,
        column: Slot<Column>,
        speeds: Slot<[Speed; 2]>,
        request: Slot<Request>,
        /// 1 when the sender of the last lane preview did not vouch for it.
        lane_invalid: u32,
        /// The torque applied since the last step.
        applied: Torque,
        /// [`Fault`] bits found outside the controller.
        faults: u32,
        last_step: Instant,
        /// Steps, which give the counters of the frames and their turns.
        steps: u32,
        monitor: MonitorState,
    }
}

impl Vitals {
    /// Nothing heard; `e2e` says whether the senders are trusted already.
    fn new(e2e: ReceiverState, faults: FaultSet, now: Instant) -> Self {
        let lane = LaneSample {
            e_y: Metres::ZERO,
            e_theta: Radians::ZERO,
            at: now,
        };
        let column = Column {
            driver_torque: Torque::ZERO,
            wheel_angle: Radians::ZERO,
        };
        Self {
            lane: Slot::new(e2e, lane, now),
            column: Slot::new(e2e, column, now),
            speeds: Slot::new(e2e, [Speed::ZERO; 2], now),
            request: Slot::new(
                e2e,
                Request {
                    engage: 0,
                    authority: Gain::ZERO,
                    probe: 0,
                },
                now,
            ),
            lane_invalid: 0,
            applied: Torque::ZERO,
            faults: u32::from(faults.bits()),
            last_step: now,
            steps: 0,
            monitor: MonitorState::NEW,
        }
    }
}

/// What arrived beside the vital values.
#[derive(Debug, Clone, Default)]
struct Arrived {
    actuator: Actuator,
    /// Bytes of frames accepted since the last step, for the monitor's own decoding.
    lane: Option<[u8; 8]>,
    column: Option<[u8; 8]>,
    demand: Option<[u8; 8]>,
}

impl Arrived {
    fn take_in(&mut self, v: &mut Vitals, frame: &Frame, now: Instant) -> Result<(), Reject> {
        match frame.id() {
            LanePreview::ID => {
                let lane = LanePreview::decode(&mut v.lane.e2e, frame)?;
                v.lane_invalid = u32::from(!lane.valid);
                if !lane.valid {
                    return Ok(());
                }
                let at = now.before(lane.age);
                let sample = LaneSample {
                    e_y: lane.e_y,
                    e_theta: lane.e_theta,
                    at,
                };
                if let Some(last) = v.lane.last() {
                    // A span of almost a whole wrap of the clock is a step back in time: what differences
                    // samples would take it for a gap and start anew.
                    if at.since(last.at) > HALF_WRAP {
                        return Err(Reject::Older);
                    }
                    if !lane_step_is_possible(&last, &sample) {
                        return Err(Reject::Step);
                    }
                }
                v.lane.put(sample, at);
                self.lane = frame.full_data();
            }
            ColumnMessage::ID => {
                let c = ColumnMessage::decode(&mut v.column.e2e, frame)?;
                v.column.put(
                    Column {
                        driver_torque: c.driver_torque,
                        wheel_angle: c.wheel_angle,
                    },
                    now,
                );
                self.actuator.deliver(c.motor_torque);
                self.column = frame.full_data();
            }
            Vehicle::ID => {
                let speeds = Vehicle::decode(&mut v.speeds.e2e, frame)?.speeds;
                let follows = |last: [Speed; 2]| {
                    last.iter()
                        .zip(&speeds)
                        .all(|(last, new)| speed_step_is_possible(*last, *new))
                };
                if v.speeds.last().is_some_and(|last| !follows(last)) {
                    return Err(Reject::Step);
                }
                v.speeds.put(speeds, now);
            }
            Demand::ID => {
                let demand = Demand::decode(&mut v.request.e2e, frame)?;
                self.demand = frame.full_data();
                v.request.put(
                    Request {
                        engage: u32::from(demand.engage),
                        authority: demand.authority,
                        probe: u32::from(demand.probe),
                    },
                    now,
                );
            }
            _ => {}
        }
        Ok(())
    }

    /// The step has seen the frames.
    fn forget(&mut self) {
        (self.lane, self.column, self.demand) = (None, None, None);
    }
}

/// A controller with its bus and its monitor.
#[derive(Debug, Clone)]
pub struct Ecu {
    controller: Controller,
    state: ControllerState,
    monitor: Guarded<Monitor>,
    vitals: Guarded<Vitals>,
    arrived: Arrived,
    history: History,
    boot: Boot,
    warned_at: Option<u32>,
    advice: Advice,
    #[cfg(feature = "fault-injection")]
    injected: injection::Injected,
}

/// Spans beyond half a wrap of the clock are negative.
const HALF_WRAP: Micros = Micros::from_us(u32::MAX / 2);
/// Warnings and lines of the fault history come every so many steps.
const TURN: u32 = 100;
/// The monitor is tested every so many steps: twice a second.
const SELF_TEST: u32 = 512;

impl Ecu {
    /// An ECU at power-up or after a reset. Without a good set of parameters it locks.
    #[must_use]
    pub fn new(setup: Option<&Setup>, boot: Boot, now: Instant) -> Self {
        let mut faults = FaultSet::NONE;
        faults.insert_if(setup.is_none(), Fault::Parameters);
        faults.insert_if(boot.recent_resets >= RESETS_TO_LOCK, Fault::ResetLoop);
        let state = ControllerState::new(now);
        Self::with(
            setup.unwrap_or(&Setup::PAPER),
            state,
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
        let state = ControllerState::engaged(now);
        Self::with(
            setup,
            state,
            ReceiverState::TRUSTED,
            Boot::default(),
            FaultSet::NONE,
            now,
        )
    }

    fn with(
        setup: &Setup,
        state: ControllerState,
        e2e: ReceiverState,
        boot: Boot,
        faults: FaultSet,
        now: Instant,
    ) -> Self {
        Self {
            controller: Controller::new(setup.config),
            state,
            monitor: Guarded::new(setup.monitor),
            vitals: Guarded::new(Vitals::new(e2e, faults, now)),
            arrived: Arrived::default(),
            history: History::new(now),
            boot,
            warned_at: None,
            advice: Advice::new(setup.reliance),
            #[cfg(feature = "fault-injection")]
            injected: injection::Injected::default(),
        }
    }

    /// Takes a frame that arrived at `now`. Frames of no interest are ignored.
    ///
    /// # Errors
    /// Why a frame with a known identifier is not used; the last good one stays in use until it is stale.
    pub fn receive(&mut self, frame: &Frame, now: Instant) -> Result<(), Reject> {
        let arrived = &mut self.arrived;
        // Even a rejected frame may have moved a counter. Damaged vitals are found and reported by the next step.
        self.vitals
            .change(|vitals| arrived.take_in(vitals, frame, now))
            .unwrap_or(Ok(()))
    }

    /// One step of the 1 kHz loop.
    pub fn step(&mut self, now: Instant) -> Step {
        let mut v = match self.vitals.get() {
            Some(vitals) => *vitals,
            None => self.begin_anew(now),
        };
        let steps = v.steps;
        let mut faults = FaultSet::from_bits(v.faults as u16);
        faults.insert_if(!self.arrived.actuator.obeys(v.applied), Fault::Actuator);
        faults.insert_if(
            steps.is_multiple_of(SELF_TEST) && !self.monitor_refuses_nonsense(),
            Fault::SelfTest,
        );
        faults.insert_if(self.monitor.get().is_none(), Fault::Memory);
        let lane = v.lane.take(now);
        // An invalid preview is the reason of a time-out, not a fault by itself: one may be a blink.
        faults.set(lane == Input::Lost && v.lane_invalid != 0, Fault::LaneInvalid);
        let inputs = Inputs {
            lane,
            column: v.column.take(now),
            speeds: v.speeds.take(now),
            request: v.request.take(now),
            faults,
        };
        let applied = v.applied;
        let mut command = self.controller.step(&mut self.state, now, applied, &inputs);
        command.torque = Guidance::rounded(command.torque);
        let mut guidance = self.guidance(&command, steps);

        let evidence = Evidence {
            lane: self.arrived.lane.as_ref(),
            column: self.arrived.column.as_ref(),
            demand: self.arrived.demand.as_ref(),
            guidance: guidance.bytes(),
            elapsed_us: now.since(v.last_step).us(),
        };
        let permitted = self.permits(&mut v.monitor, &evidence);
        if !permitted {
            faults.insert(Fault::Monitor);
            command = Command {
                torque: Torque::ZERO,
                probe: None,
                limit: LimitReason::Monitor,
                mode: Mode::Fault,
                faults: command.faults.union(faults),
                warning: true,
            };
            guidance = self.guidance(&command, steps);
        }
        self.arrived.forget();
        v.faults = u32::from(faults.bits());
        v.applied = command.torque;
        v.last_step = now;
        v.steps = steps.wrapping_add(1);
        self.vitals.set(v);
        let sample = match inputs.column {
            Input::New(column) => Some(Sample {
                at: now,
                applied,
                driver_torque: column.driver_torque,
                wheel_angle: column.wheel_angle,
            }),
            _ => None,
        };
        self.advice.take(sample, command.probe);
        self.history.step(now, command.faults);
        let others = self.others(&command, steps);
        Step {
            command,
            guidance,
            others,
            permitted,
        }
    }

    /// The advisory part of a step, to be called once after its frames have left: the telemetry frame, when it
    /// is its turn. In f32, and without effect on any torque.
    pub fn advise(&mut self) -> Option<Frame> {
        self.advice.step()
    }

    /// The vital state is damaged: nothing of it can be used. What comes in its place knows nothing but the
    /// memory fault, which latches.
    fn begin_anew(&mut self, now: Instant) -> Vitals {
        let mut faults = FaultSet::NONE;
        faults.insert(Fault::Memory);
        self.state = ControllerState::new(now);
        let vitals = Vitals::new(ReceiverState::NEW, faults, now);
        self.vitals.set(vitals);
        vitals
    }

    fn guidance(&self, command: &Command, steps: u32) -> Frame {
        Guidance {
            torque: command.torque,
            limit: command.limit,
            mode: command.mode,
            warning: command.warning,
            faults: command.faults,
            reset: self.boot.reset,
        }
        .encode(steps as u8)
    }

    /// A warning in the step that needs it, then one each turn; a line of the fault history each turn.
    fn others(&mut self, command: &Command, steps: u32) -> Vec<Frame, 2> {
        let mut frames = Vec::new();
        let due = |since: u32| steps.wrapping_sub(since).is_multiple_of(TURN);
        if command.warning {
            let since = *self.warned_at.get_or_insert(steps);
            if due(since) {
                let counter = steps.wrapping_sub(since) / TURN;
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
        let total = self.history.records().count();
        let turn = steps / TURN;
        let index = (turn as usize).checked_rem(total).unwrap_or(0);
        if due(0)
            && let Some(record) = self.history.records().nth(index)
        {
            let line = FaultRecord {
                index: index as u8,
                total: total as u8,
                record,
            };
            let _ = frames.push(line.encode(turn as u8));
        }
        frames
    }

    /// The self-test: the monitor must refuse 8 N.m, which no profile allows.
    fn monitor_refuses_nonsense(&self) -> bool {
        let mut state = MonitorState::NEW;
        let nonsense = (0x7FFF_u64 << 12 | u64::from(Mode::Active as u8) << 32).to_le_bytes();
        let evidence = Evidence {
            lane: None,
            column: None,
            demand: None,
            guidance: &nonsense,
            elapsed_us: 1000,
        };
        !self.permits(&mut state, &evidence)
    }

    /// Asks the monitor. One whose limits are damaged permits nothing.
    fn permits(&self, state: &mut MonitorState, evidence: &Evidence<'_>) -> bool {
        #[cfg(feature = "fault-injection")]
        if self.injected.monitor_agrees {
            return true;
        }
        self.monitor
            .get()
            .is_some_and(|monitor| monitor.step(state, evidence))
    }

    /// The configuration in use, if its copies agree.
    #[must_use]
    pub fn config(&self) -> Option<Config> {
        self.controller.config()
    }
}
