//! What the ECU hears: for each input the latest value, with what judges the next.
//!
//! Every receiver is guarded apart, so that a frame costs the check of its own and not of all. Not here: what the
//! values lead to.

use crate::actuator::Actuator;
use crate::bus::e2e::ReceiverState;
use crate::bus::messages::{
    Column as ColumnMessage, Demand, FaultRecord, Guidance, Identity, LanePreview, Message, ParameterStatus,
    ParameterValue, Rejection, TIMEOUT, Telemetry, Vehicle, Warning,
};
use crate::bus::{Frame, Reject};
use crate::controller::{Column, Input, Inputs, Motion, Request};
use crate::faults::{Fault, FaultSet};
use crate::law::LaneSample;
use crate::plausibility::{is_another_line, lane_step_is_possible, speed_step_is_possible};
use crate::quantity::{Instant, Metres, Micros, Radians, Ratio, Speed, Torque};
use crate::redundant::{Redundant, Words, words};

/// The column's frames come at this rate.
const COLUMN_PERIOD_US: u32 = 2000;
/// Spans beyond half a wrap of the clock are negative.
const HALF_WRAP: Micros = Micros::from_us(u32::MAX / 2);
/// Slower is standing.
const STANDSTILL: Speed = Speed::from_m_per_s(0.25);

/// The latest value of one input, with what judges the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub(super) struct Slot<T> {
    e2e: ReceiverState,
    /// [`LOST`], [`HELD`] or [`NEW`], as an [`Input`].
    state: u32,
    /// Why the last frame was not used: [`INVALID`] or [`STEP`]; 0 if it was, or for another reason.
    doubt: u32,
    /// When it was heard.
    at: Instant,
    /// How far apart its sender's messages come.
    period: Micros,
    value: T,
}

/// The slowest sender of each input that is waited for: a camera of 15 Hz, a column and a vehicle's bus as they are in
/// cars. Three periods without a message are a loss, and 30 ms at least.
const LANE_PERIOD: Micros = Micros::from_us(66_667);
const COLUMN_PERIOD: Micros = Micros::from_ms(20);
const MOTION_PERIOD: Micros = Micros::from_ms(25);
const REQUEST_PERIOD: Micros = Micros::from_ms(25);
/// A sender's period is forgotten within 2^6 of its messages: half a second of a camera of 120 Hz.
const PERIOD_SHIFT: u32 = 6;
/// A lane sample that is older than this when it comes is none.
const OLDEST_SAMPLE: Micros = Micros::from_ms(150);

/// Its sender did not vouch for it.
const INVALID: u32 = 1;
/// It was too far from the last one used.
const STEP: u32 = 2;

/// So many steps after a frame under an identifier of this ECU, that is still a fault: a second.
const FOREIGN_STEPS: u32 = 1000;

/// Nothing heard, or not for too long.
const LOST: u32 = 0;
/// A value that a step has seen.
const HELD: u32 = 1;
/// A value that no step has seen.
const NEW: u32 = 2;

impl<T: Words> Words for Slot<T> {
    fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
        Self {
            e2e: self.e2e.map_words(change),
            state: change(self.state),
            doubt: change(self.doubt),
            at: self.at.map_words(change),
            period: self.period.map_words(change),
            value: self.value.map_words(change),
        }
    }

    fn is_inverse_of(&self, other: &Self) -> bool {
        self.e2e.is_inverse_of(&other.e2e)
            & self.state.is_inverse_of(&other.state)
            & self.doubt.is_inverse_of(&other.doubt)
            & self.at.is_inverse_of(&other.at)
            & self.period.is_inverse_of(&other.period)
            & self.value.is_inverse_of(&other.value)
    }
}

impl<T: Words> Slot<T> {
    /// Nothing heard; `value` only fills the place.
    fn redundant(e2e: ReceiverState, value: T, now: Instant) -> Redundant<Self> {
        Redundant::new(Self::new(e2e, value, now))
    }

    fn new(e2e: ReceiverState, value: T, now: Instant) -> Self {
        Self {
            e2e,
            state: LOST,
            doubt: 0,
            at: now,
            period: Micros::from_us(0),
            value,
        }
    }

    /// Takes a value heard now. The sender's period is the longest time between two of its messages lately: it grows at
    /// once and falls by a sixty-fourth of the way, so that a sender whose messages jitter is waited for as long as its gaps
    /// are. Unknown, it is the `slowest`, and then the first time between two messages, but no less than a quarter of that.
    fn put(&mut self, value: T, now: Instant, slowest: Micros) {
        let (period, apart) = (self.period.us(), now.since(self.at).us().min(slowest.us()));
        let period = if self.state == LOST {
            slowest.us()
        } else if period >= slowest.us() {
            apart.max(slowest.us() / 4)
        } else if apart > period {
            apart
        } else {
            period.saturating_sub(period.saturating_sub(apart) >> PERIOD_SHIFT)
        };
        self.period = Micros::from_us(period);
        (self.state, self.value, self.at) = (NEW, value, now);
    }

    /// For how long the value may be used.
    fn timeout(&self) -> Micros {
        Micros::from_us(self.period.us().saturating_mul(3)).max(TIMEOUT)
    }

    fn last(&self) -> Option<T> {
        (self.state != LOST).then_some(self.value)
    }

    /// What a step sees. A stale value is dropped, so that no instant outlives a wrap of the clock, and its
    /// sender has to be trusted anew.
    fn take(&mut self, now: Instant) -> Input<T> {
        if self.state != LOST && now.since(self.at) > self.timeout() {
            self.state = LOST;
            self.e2e = ReceiverState::NEW;
        }
        let seen = self.state;
        self.state = seen.min(HELD);
        match seen {
            LOST => Input::Lost,
            HELD => Input::Held(self.value),
            _ => Input::New(self.value),
        }
    }
}

words! {
    /// A lane sample that was too far from the last one used, and whether there is one.
    struct Refused {
        sample: LaneSample,
        is_there: u32,
        /// 1 when the sample in use is of another line than the one before.
        moved: u32,
    }
}

/// The lane's receiver: what it hears, and what it refused last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub(super) struct LaneSlot {
    slot: Slot<LaneSample>,
    refused: Refused,
}

impl Words for LaneSlot {
    fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
        Self {
            slot: self.slot.map_words(change),
            refused: self.refused.map_words(change),
        }
    }

    fn is_inverse_of(&self, other: &Self) -> bool {
        self.slot.is_inverse_of(&other.slot) & self.refused.is_inverse_of(&other.refused)
    }
}

impl LaneSlot {
    /// Takes a preview. Two in a row that agree with each other, and with a line chosen anew, begin that line.
    fn take(&mut self, lane: &LanePreview, now: Instant) -> Result<(), Reject> {
        let Self { slot, refused } = self;
        slot.doubt = u32::from(!lane.valid);
        if !lane.valid {
            return Ok(());
        }
        let sample = LaneSample {
            e_y: lane.e_y,
            e_theta: lane.e_theta,
            at: now.before(lane.age),
        };
        let Some(last) = slot.last() else {
            refused.is_there = 0;
            return Self::use_if_young(slot, sample, lane.age, now);
        };
        // A span of almost a whole wrap of the clock is a step back in time: what differences samples would take it
        // for a gap and start anew.
        if sample.at.since(last.at) > HALF_WRAP {
            return Err(Reject::Older);
        }
        if lane_step_is_possible(&last, &sample) {
            refused.is_there = 0;
            return Self::use_if_young(slot, sample, lane.age, now);
        }
        let agrees = refused.is_there != 0 && lane_step_is_possible(&refused.sample, &sample);
        if agrees && is_another_line(&last, &sample) {
            (refused.is_there, refused.moved) = (0, 1);
            return Self::use_if_young(slot, sample, lane.age, now);
        }
        (refused.sample, refused.is_there) = (sample, 1);
        slot.doubt = STEP;
        Err(Reject::Step)
    }

    fn use_if_young(
        slot: &mut Slot<LaneSample>,
        sample: LaneSample,
        age: Micros,
        now: Instant,
    ) -> Result<(), Reject> {
        if age > OLDEST_SAMPLE {
            return Err(Reject::Older);
        }
        slot.put(sample, now, LANE_PERIOD);
        Ok(())
    }
}

/// Bytes of frames accepted since the last step, for the monitor's own decoding.
#[derive(Debug, Clone, Default)]
pub(super) struct Accepted {
    pub(super) lane: Option<[u8; 8]>,
    pub(super) column: Option<[u8; 8]>,
    pub(super) demand: Option<[u8; 8]>,
}

words! {
    /// A [`Request`], its flags as words.
    pub(super) struct RequestWords {
        engage: u32,
        authority: Ratio,
        probe: u32,
    }
}

impl From<RequestWords> for Request {
    fn from(words: RequestWords) -> Self {
        Self {
            engage: words.engage != 0,
            authority: words.authority,
            probe: words.probe != 0,
        }
    }
}

/// The receivers of all inputs.
#[derive(Debug, Clone)]
pub(super) struct Receivers {
    pub(super) lane: Redundant<LaneSlot>,
    pub(super) column: Redundant<Slot<Column>>,
    pub(super) motion: Redundant<Slot<Motion>>,
    pub(super) request: Redundant<Slot<RequestWords>>,
    pub(super) actuator: Actuator,
    pub(super) accepted: Accepted,
    /// Steps for which a frame under an identifier of this ECU is still a fault. Not kept twice: a flip raises the fault
    /// for a while, or ends it early.
    foreign: u32,
}

impl Receivers {
    /// Nothing heard; `e2e` says whether the senders are trusted already.
    pub(super) fn new(e2e: ReceiverState, now: Instant) -> Self {
        let lane = LaneSample {
            e_y: Metres::ZERO,
            e_theta: Radians::ZERO,
            at: now,
        };
        let column = Column {
            driver_torque: Torque::ZERO,
            wheel_angle: Radians::ZERO,
        };
        let request = RequestWords {
            engage: 0,
            authority: Ratio::ZERO,
            probe: 0,
        };
        Self {
            lane: Redundant::new(LaneSlot {
                slot: Slot::new(e2e, lane, now),
                refused: Refused {
                    sample: lane,
                    is_there: 0,
                    moved: 0,
                },
            }),
            column: Slot::redundant(e2e, column, now),
            motion: Slot::redundant(e2e, Motion::default(), now),
            request: Slot::redundant(e2e, request, now),
            actuator: Actuator::default(),
            accepted: Accepted::default(),
            foreign: 0,
        }
    }

    /// Takes a frame. `None` if the receiver that it is for is damaged.
    pub(super) fn receive(&mut self, frame: &Frame, now: Instant) -> Option<Result<(), Reject>> {
        let Self {
            actuator, accepted, ..
        } = self;
        match frame.id() {
            LanePreview::ID => self.lane.change(|lane| {
                let preview = LanePreview::decode(&mut lane.slot.e2e, frame)?;
                lane.take(&preview, now)?;
                if preview.valid {
                    accepted.lane = frame.full_data();
                }
                Ok(())
            }),
            ColumnMessage::ID => self.column.change(|slot| {
                let c =
                    ColumnMessage::decode_within(&mut slot.e2e, frame, column_window(now.since(slot.at)))?;
                let column = Column {
                    driver_torque: c.driver_torque,
                    wheel_angle: c.wheel_angle,
                };
                slot.put(column, now, COLUMN_PERIOD);
                actuator.deliver(c.motor_torque);
                accepted.column = frame.full_data();
                Ok(())
            }),
            Vehicle::ID => self.motion.change(|slot| {
                let Vehicle { speeds, yaw_rate } = Vehicle::decode(&mut slot.e2e, frame)?;
                let follows = |last: Motion| {
                    last.speeds
                        .iter()
                        .zip(&speeds)
                        .all(|(last, new)| speed_step_is_possible(*last, *new))
                };
                if slot.last().is_some_and(|last| !follows(last)) {
                    slot.doubt = STEP;
                    return Err(Reject::Step);
                }
                slot.doubt = 0;
                slot.put(Motion::new(speeds, yaw_rate), now, MOTION_PERIOD);
                Ok(())
            }),
            Demand::ID => self.request.change(|slot| {
                let demand = Demand::decode(&mut slot.e2e, frame)?;
                let request = RequestWords {
                    engage: u32::from(demand.engage),
                    authority: demand.authority,
                    probe: u32::from(demand.probe),
                };
                slot.put(request, now, REQUEST_PERIOD);
                accepted.demand = frame.full_data();
                Ok(())
            }),
            // On a bus nobody hears itself.
            id if is_own(id) => {
                self.foreign = FOREIGN_STEPS;
                Some(Err(Reject::OwnIdentifier))
            }
            _ => Some(Ok(())),
        }
    }

    /// Whether the vehicle stands: both speeds are known and next to nothing.
    pub(super) fn stands(&self) -> bool {
        let motion = self.motion.get().and_then(Slot::last);
        motion.is_some_and(|motion| motion.speeds.iter().all(|speed| *speed <= STANDSTILL))
    }

    /// The last lane preview passes for one that came now.
    pub(super) fn renew_lane(&mut self, now: Instant) {
        let _ = self.lane.change(|lane| {
            lane.slot.at = now;
            lane.slot.value.at = now;
        });
    }

    /// What a step sees, or `None` if a receiver is damaged.
    pub(super) fn take(&mut self, now: Instant) -> Option<Inputs> {
        let (lane, lane_doubt, moved) = self.lane.change(|lane| {
            let moved = core::mem::replace(&mut lane.refused.moved, 0);
            (lane.slot.take(now), lane.slot.doubt, moved)
        })?;
        let (motion, speeds_doubt) = self.motion.change(|slot| (slot.take(now), slot.doubt))?;
        let mut faults = FaultSet::NONE;
        // What is wrong with the last frame is the reason of a loss, not a fault by itself: one may be a blink.
        if lane == Input::Lost {
            faults.insert_if(lane_doubt == INVALID, Fault::LaneInvalid);
            faults.insert_if(lane_doubt == STEP, Fault::LaneStep);
        }
        faults.insert_if(motion == Input::Lost && speeds_doubt == STEP, Fault::SpeedStep);
        if self.foreign > 0 {
            self.foreign = self.foreign.saturating_sub(1);
            faults.insert(Fault::OwnIdentifier);
        }
        Some(Inputs {
            lane,
            column: self.column.change(|slot| slot.take(now))?,
            motion,
            line_moved: moved != 0,
            request: self.request.change(|slot| slot.take(now).map(Request::from))?,
            faults,
        })
    }
}

/// The step of the column's counter that may have been lost in a silence. The longer it lasted, the more: at once no more
/// than three, so that few of the sixteen counters let an old frame pass.
#[expect(clippy::as_conversions, reason = "at most 14")]
fn column_window(silence: Micros) -> u8 {
    let periods = silence.us() / COLUMN_PERIOD_US;
    periods
        .saturating_add(u32::from(ColumnMessage::MAX_DELTA))
        .min(14) as u8
}

/// Whether an identifier is this ECU's (`core/tests/attacks.rs` holds it to the list of messages).
const fn is_own(id: u16) -> bool {
    matches!(
        id,
        Guidance::ID
            | Warning::ID
            | FaultRecord::ID
            | Telemetry::ID
            | ParameterStatus::ID
            | ParameterValue::ID
            | Rejection::ID
            | Identity::ID
    )
}
