//! The ECU's receivers: for each input the latest accepted value, and what the next one is checked against.
//!
//! Each receiver is kept twice by itself, so that a frame costs the comparison of one. Not here: what the values lead to
//! ([`crate::controller`]).

use super::counting::{Counting, Periods};
use crate::bus::e2e::ReceiverState;
use crate::bus::messages::{Column, LanePreview, Message, Request, Sender, TIMEOUT, Vehicle, sender_of};
use crate::bus::{Frame, Reject};
use crate::controller::inputs::{ColumnState, Input, Inputs, Motion};
use crate::lane::LaneSample;
use crate::quantity::{Instant, Metres, Micros, Radians, Ratio, Speed, Torque, per_second};
use crate::safety::actuator::Actuator;
use crate::safety::faults::Fault;
use crate::safety::monitor::Frames;
use crate::safety::plausibility::{
    BRAKES, SPEEDS_PATIENCE, lane_step_is_possible, speed_step_is_possible, speeds_agree,
};
use crate::safety::redundant::{Redundant, Words, apart};

/// The column's frames come at this rate.
const COLUMN_PERIOD_US: u32 = 2000;
/// A span longer than half a wrap of the clock is negative: the other instant is the later one.
const HALF_WRAP: Micros = Micros::from_us(u32::MAX / 2);
/// A vehicle slower than this stands.
const STANDSTILL: Speed = Speed::from_m_per_s(0.25);
/// How many Vehicle messages in a row must be accepted before the vehicle counts as standing.
const UNDISTURBED: u32 = 100;

/// The latest value of one input, with what the next is checked against. The four bytes share a word, as every step compares
/// all words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub(super) struct Slot<T> {
    /// A [`ReceiverState`]'s.
    e2e: [u8; 2],
    /// [`LOST`], [`HELD`] or [`NEW`], as an [`Input`].
    state: u8,
    /// Why the last frame was not used: [`INVALID`] or [`STEP`]; 0 if it was, or for another reason. Of speeds, how many
    /// messages in a row had one that stepped.
    doubt: u8,
    counting: Counting,
    /// When the value arrived.
    at: Instant,
    /// The sender's period, at least [`LEAST_PERIOD`].
    period: Micros,
    value: T,
}

/// The senders of each input: up to 200 frames a second, a column wired to the board 1000; down to a camera of 15 Hz, a column
/// and a vehicle's bus as they are in cars. Three periods without a message are a loss, and 30 ms at least.
const LANE: Periods = Periods {
    fastest: Micros::from_ms(4),
    slowest: Micros::from_us(66_667),
};
const COLUMN: Periods = Periods {
    fastest: Micros::from_us(800),
    slowest: Micros::from_ms(20),
};
const HOST: Periods = Periods {
    fastest: Micros::from_ms(4),
    slowest: Micros::from_ms(25),
};
/// A sender's period is forgotten within 2^6 of its messages: half a second of a camera of 120 Hz.
const PERIOD_SHIFT: u32 = 6;
/// A sender whose messages come closer is waited for as long as one of this: [`TIMEOUT`].
const LEAST_PERIOD: Micros = Micros::from_us(TIMEOUT.us() / 3);
/// A lane sample older than this on arrival is refused.
const OLDEST_SAMPLE: Micros = Micros::from_ms(150);

/// The sender marked it as not valid.
const INVALID: u8 = 1;
/// It was too far from the last accepted one.
const STEP: u8 = 2;

/// For how many steps OwnIdentifier lasts after a frame under an identifier of this ECU: a second.
const FOREIGN_STEPS: u32 = 1000;

/// No value, or too old.
const LOST: u8 = 0;
/// A value that a step has seen.
const HELD: u8 = 1;
/// A value that no step has seen.
const NEW: u8 = 2;

impl<T> Slot<T> {
    /// What is small, as a word.
    fn head(&self) -> u32 {
        let [last, clean] = self.e2e;
        u32::from_ne_bytes([last, clean, self.state, self.doubt])
    }
}

impl<T: Words> Words for Slot<T> {
    fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
        let [last, clean, state, doubt] = change(self.head()).to_ne_bytes();
        Self {
            e2e: [last, clean],
            state,
            doubt,
            counting: self.counting.map_words(change),
            at: self.at.map_words(change),
            period: self.period.map_words(change),
            value: self.value.map_words(change),
        }
    }

    #[inline(always)]
    fn agreement(&self, other: &Self) -> u32 {
        self.head().agreement(&other.head())
            & self.counting.agreement(&other.counting)
            & self.at.agreement(&other.at)
            & self.period.agreement(&other.period)
            & self.value.agreement(&other.value)
    }
}

impl<T: Words> Slot<T> {
    /// Nothing heard; `value` only fills the place.
    fn redundant(e2e: ReceiverState, value: T, now: Instant) -> Redundant<Self> {
        Redundant::new(Self::new(e2e, value, now))
    }

    fn new(e2e: ReceiverState, value: T, now: Instant) -> Self {
        Self {
            e2e: e2e.bytes(),
            state: LOST,
            doubt: 0,
            counting: Counting::NEW,
            at: now,
            period: Micros::from_us(0),
            value,
        }
    }

    /// Checks a frame and decodes it: [`Message::decode_within`], with the time that counting takes.
    fn decode<M: Message>(
        &mut self,
        frame: &Frame,
        max_delta: u8,
        now: Instant,
        periods: &Periods,
    ) -> Result<M, Reject> {
        let before = ReceiverState::of_bytes(self.e2e);
        let mut after = before;
        let decoded = M::decode_within(&mut after, frame, max_delta);
        self.e2e = after.bytes();
        let is_counted = match decoded {
            Err(Reject::Length | Reject::Crc) => false,
            // The counter of a sender that is not trusted is not looked at then.
            Err(Reject::Range) => after != before,
            _ => true,
        };
        if !is_counted {
            return decoded;
        }
        let [_, head, ..] = *frame.bytes();
        match before.delta(head & 0x0F) {
            None => self.counting.begin(frame, now, periods),
            Some(ahead) if (1..=max_delta).contains(&ahead) => {
                if !self.counting.go_on(ahead, frame, now, periods) {
                    self.e2e = before.bytes();
                    return Err(Reject::TooFast);
                }
            }
            Some(ahead) => {
                if self.counting.is_contradicted(ahead, frame, now, periods) {
                    (self.state, self.doubt, self.e2e) = (LOST, 0, ReceiverState::NEW.bytes());
                }
            }
        }
        if self.counting.is_distrusted() {
            return decoded.and(Err(Reject::TwoSenders));
        }
        decoded
    }

    /// Takes a value heard now. The sender's period is the longest time between two of its messages lately: it grows at
    /// once and falls by a sixty-fourth of the way, so that a sender whose messages jitter is waited for as long as its gaps
    /// are. Unknown, it is the `slowest`, and then the first time between two messages, but no less than a quarter of that.
    fn put(&mut self, value: T, now: Instant, Periods { slowest, .. }: &Periods) {
        let (period, apart) = (self.period.us(), now.since(self.at).us().min(slowest.us()));
        let period = if self.state == LOST {
            slowest.us()
        } else if period >= slowest.us() {
            apart.max(slowest.us() / 4)
        } else if apart > period {
            apart
        } else {
            // No less than `apart`.
            period.wrapping_sub(period.wrapping_sub(apart) >> PERIOD_SHIFT)
        };
        self.period = Micros::from_us(period).max(LEAST_PERIOD);
        (self.state, self.value, self.at) = (NEW, value, now);
    }

    /// For how long the value may be used.
    fn timeout(&self) -> Micros {
        // No period is longer than the slowest sender's.
        Micros::from_us(self.period.us().wrapping_mul(3))
    }

    fn last(&self) -> Option<T> {
        (self.state != LOST).then_some(self.value)
    }
}

/// A slot as a step's input. A value past its time-out is dropped, before its instant could outlive a wrap of the clock, and its
/// sender must show clean frames again. Writes only what changes: in most steps nothing.
#[inline(always)]
fn take<T: Words, U: From<T>>(guarded: &mut Redundant<Slot<T>>, now: Instant, seen: &mut Input<U>) {
    let slot = guarded.value();
    let (state, value) = (slot.state, slot.value);
    if state == LOST {
        return;
    }
    if now.since(slot.at) > slot.timeout() {
        guarded.amend(|slot| (slot.state, slot.e2e) = (LOST, ReceiverState::NEW.bytes()));
    } else if state == HELD {
        *seen = Input::Held(value.into());
    } else {
        guarded.put(|slot| &mut slot.state, HELD);
        *seen = Input::New(value.into());
    }
}

/// Two halves as a word.
fn word([low, high]: [u16; 2]) -> u32 {
    u32::from(low) | u32::from(high) << 16
}

#[expect(clippy::as_conversions, reason = "the halves of a word")]
fn halves(word: u32) -> [u16; 2] {
    [word as u16, (word >> 16) as u16]
}

/// Takes a decoded lane preview into its slot.
fn take_preview(slot: &mut Slot<LaneSample>, lane: &LanePreview, now: Instant) -> Result<(), Reject> {
    slot.doubt = u8::from(!lane.valid);
    if !lane.valid {
        return Ok(());
    }
    let sample = LaneSample {
        e_y: lane.e_y,
        e_theta: lane.e_theta,
        at: now.before(lane.age),
    };
    if let Some(last) = slot.last() {
        // A span of more than half a wrap is a step back in time; the law's filter would take it for a long gap.
        if sample.at.since(last.at) > HALF_WRAP {
            return Err(Reject::Older);
        }
        if !lane_step_is_possible(&last, &sample) {
            slot.doubt = STEP;
            return Err(Reject::Step);
        }
    }
    if lane.age > OLDEST_SAMPLE {
        return Err(Reject::Older);
    }
    slot.put(sample, now, &LANE);
    Ok(())
}

/// The speeds to use of a message. One that steps, of a wheel that locks, slips or spins, follows the other one, unless the two
/// new ones agree: then it came back. Where both step, they are held. `None` if that lasts for longer than [`SPEEDS_PATIENCE`].
fn follow(slot: &mut Slot<Motion>, speeds: [Speed; 2]) -> Option<[Speed; 2]> {
    let Some(last) = slot.last() else {
        slot.doubt = 0;
        return Some(speeds);
    };
    let ([a, b], [a_before, b_before]) = (speeds, last.speeds);
    let moved = |from: Speed, other: Speed, other_before: Speed| from.plus(other.minus(other_before));
    // A message comes every 10 to 25 ms: no product of a count and a period wraps.
    let lasts = |doubt: u8| Micros::from_us(u32::from(doubt).wrapping_mul(slot.period.us()));
    let follow_within = |held: Micros| {
        let follows = |last: Speed, new: Speed| speed_step_is_possible(last, new, held);
        [follows(a_before, a), follows(b_before, b)]
    };
    let agree = speeds_agree(a, b);
    // Two that are held may be left behind by the vehicle; one goes with the other.
    let follows = match follow_within(Micros::from_us(0)) {
        [false, false] => follow_within(lasts(slot.doubt)),
        follows => follows,
    };
    let is_taken = match follows {
        [true, true] => true,
        [false, false] => false,
        _ => agree,
    };
    if is_taken {
        slot.doubt = 0;
        return Some(speeds);
    }
    let followed = match follows {
        [true, _] => [a, moved(b_before, a, a_before)],
        [_, true] => [moved(a_before, b, b_before), b],
        _ => last.speeds,
    };
    let doubt = slot.doubt.saturating_add(1);
    let is_short = lasts(doubt) <= SPEEDS_PATIENCE;
    slot.doubt = doubt;
    is_short.then_some(followed)
}

/// A [`Request`], its flags in a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub(super) struct RequestWords {
    engage: u16,
    probe: u16,
    authority: Ratio,
}

impl Words for RequestWords {
    fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
        let [engage, probe] = halves(change(word([self.engage, self.probe])));
        Self {
            engage,
            probe,
            authority: self.authority.map_words(change),
        }
    }

    #[inline(always)]
    fn agreement(&self, other: &Self) -> u32 {
        let [mine, others] = [self, other].map(|request| word([request.engage, request.probe]));
        mine.agreement(&others) & self.authority.agreement(&other.authority)
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
    pub(super) lane: Redundant<Slot<LaneSample>>,
    pub(super) column: Redundant<Slot<ColumnState>>,
    pub(super) motion: Redundant<Slot<Motion>>,
    pub(super) request: Redundant<Slot<RequestWords>>,
    pub(super) actuator: Actuator,
    /// What the monitor decodes by itself.
    pub(super) frames: Frames,
    /// Steps for which a frame under an identifier of this ECU is still a fault. Not kept twice: a flip raises the fault
    /// for a while, or ends it early.
    foreign: u32,
    standing: Standing,
}

/// How fast the vehicle is at most. Not kept twice: it moves nothing.
#[derive(Debug, Clone, Copy)]
struct Standing {
    /// The larger speed, which falls no faster than a vehicle brakes.
    at_most: Speed,
    /// Messages in a row that were used.
    in_a_row: u32,
}

impl Standing {
    fn hear(&mut self, [a, b]: [Speed; 2], passed: Micros) {
        let braked = Speed::from_fixed(per_second(BRAKES.fixed(), passed));
        let still = self.at_most.minus(braked);
        (self.at_most, self.in_a_row) = (still.max(a).max(b), self.in_a_row.saturating_add(1));
    }
}

impl Receivers {
    /// Nothing heard; `e2e` says whether the senders are trusted already.
    pub(super) fn new(e2e: ReceiverState, now: Instant) -> Self {
        let lane = LaneSample {
            e_y: Metres::ZERO,
            e_theta: Radians::ZERO,
            at: now,
        };
        let column = ColumnState {
            driver_torque: Torque::ZERO,
            wheel_angle: Radians::ZERO,
        };
        let request = RequestWords {
            engage: 0,
            authority: Ratio::ZERO,
            probe: 0,
        };
        Self {
            lane: Slot::redundant(e2e, lane, now),
            column: Slot::redundant(e2e, column, now),
            motion: Slot::redundant(e2e, Motion::default(), now),
            request: Slot::redundant(e2e, request, now),
            actuator: Actuator::default(),
            frames: Frames::NONE,
            foreign: 0,
            standing: Standing {
                at_most: Speed::ZERO,
                in_a_row: 0,
            },
        }
    }

    /// Takes a frame. `None` if the receiver that it is for is damaged.
    pub(super) fn receive(&mut self, frame: &Frame, now: Instant) -> Option<Result<(), Reject>> {
        let Self {
            actuator,
            frames,
            standing,
            ..
        } = self;
        match frame.id() {
            LanePreview::ID => self.lane.change(|slot| {
                let preview = slot.decode::<LanePreview>(frame, LanePreview::MAX_DELTA, now, &LANE)?;
                take_preview(slot, &preview, now)?;
                if preview.valid {
                    (frames.new.lane, frames.lane) = (true, *frame.bytes());
                }
                Ok(())
            }),
            Column::ID => self.column.change(|slot| {
                let c = slot.decode::<Column>(frame, column_window(slot, now), now, &COLUMN)?;
                let column = ColumnState {
                    driver_torque: c.driver_torque,
                    wheel_angle: c.wheel_angle,
                };
                slot.put(column, now, &COLUMN);
                actuator.deliver(c.motor_torque);
                (frames.new.column, frames.column) = (true, *frame.bytes());
                Ok(())
            }),
            Vehicle::ID => {
                let heard = self.motion.change(|slot| {
                    let Vehicle { speeds, yaw_rate } = slot.decode(frame, Vehicle::MAX_DELTA, now, &HOST)?;
                    let speeds = follow(slot, speeds).ok_or(Reject::Step)?;
                    standing.hear(speeds, now.since(slot.at));
                    slot.put(Motion::new(speeds, yaw_rate), now, &HOST);
                    Ok(())
                });
                if heard != Some(Ok(())) {
                    standing.in_a_row = 0;
                }
                heard
            }
            Request::ID => self.request.change(|slot| {
                let request: Request = slot.decode(frame, Request::MAX_DELTA, now, &HOST)?;
                let request = RequestWords {
                    engage: u16::from(request.engage),
                    probe: u16::from(request.probe),
                    authority: request.authority,
                };
                slot.put(request, now, &HOST);
                (frames.new.request, frames.request) = (true, *frame.bytes());
                Ok(())
            }),
            // A node does not receive its own frames: another one sends in this ECU's name.
            id if sender_of(id) == Some(Sender::Ecu) => {
                self.foreign = FOREIGN_STEPS;
                Some(Err(Reject::OwnIdentifier))
            }
            _ => Some(Ok(())),
        }
    }

    /// Whether the vehicle stands: both speeds are known and next to nothing, it can have come to that, and for a hundred
    /// messages none was refused, as those of a second sender are.
    pub(super) fn stands(&self) -> bool {
        let is_known = self.motion.get().and_then(Slot::last).is_some();
        let Standing { at_most, in_a_row } = self.standing;
        is_known && at_most <= STANDSTILL && in_a_row >= UNDISTURBED
    }

    /// Makes the last lane preview count as one that arrived now, for an injected fault.
    pub(super) fn renew_lane(&mut self, now: Instant) {
        let _ = self.lane.change(|slot| (slot.at, slot.value.at) = (now, now));
    }

    /// Whether no receiver is damaged.
    #[inline(always)]
    pub(super) fn are_intact(&self) -> bool {
        let receivers = apart(self);
        receivers.lane.agrees()
            && receivers.column.agrees()
            && receivers.motion.agrees()
            && receivers.request.agrees()
    }

    /// Fills in the inputs of a step, from receivers that are intact into [`Inputs::lost`].
    #[inline(always)]
    pub(super) fn take(&mut self, now: Instant, inputs: &mut Inputs) {
        take(&mut self.lane, now, &mut inputs.lane);
        take(&mut self.column, now, &mut inputs.column);
        take(&mut self.motion, now, &mut inputs.motion);
        take(&mut self.request, now, &mut inputs.request);
        let faults = &mut inputs.faults;
        // A bad last frame explains a loss, and is no fault by itself: a single one happens.
        if inputs.lane == Input::Lost {
            let doubt = self.lane.value().doubt;
            faults.insert_if(doubt == INVALID, Fault::LaneInvalid);
            faults.insert_if(doubt == STEP, Fault::LaneStep);
        }
        if inputs.motion == Input::Lost {
            faults.insert_if(self.motion.value().doubt != 0, Fault::SpeedStep);
        }
        if self.foreign > 0 {
            self.foreign = self.foreign.saturating_sub(1);
            faults.insert(Fault::OwnIdentifier);
        }
    }
}

/// The largest step of the column's counter to accept after a silence: three at first, more the longer it lasts. A narrow window
/// lets few of the sixteen counters of a replayed frame pass. After a loss nothing is in use that a step could lead on from.
#[expect(clippy::as_conversions, reason = "at most 14")]
fn column_window(slot: &Slot<ColumnState>, now: Instant) -> u8 {
    if slot.state == LOST {
        return Column::MAX_DELTA;
    }
    let periods = now.since(slot.at).us() / COLUMN_PERIOD_US;
    periods.saturating_add(u32::from(Column::MAX_DELTA)).min(14) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is said of a preview of this age that comes `apart` after one that was not late.
    fn taken(apart: Micros, age: Micros) -> Result<(), Reject> {
        let start = Instant::from_us(1_000_000);
        let sample = LaneSample {
            at: start,
            ..LaneSample::default()
        };
        let mut slot = Slot::new(ReceiverState::NEW, sample, start);
        slot.put(sample, start, &LANE);
        let lane = LanePreview {
            valid: true,
            age,
            ..LanePreview::default()
        };
        take_preview(&mut slot, &lane, start.after(apart))
    }

    #[test]
    fn a_sample_is_too_old_beyond_150_ms() {
        let apart = Micros::from_ms(500);
        assert_eq!(taken(apart, Micros::from_us(150_000)), Ok(()));
        assert_eq!(taken(apart, Micros::from_us(150_001)), Err(Reject::Older));
    }

    /// The clock has 2^32 microseconds: up to 2^31 - 1 on is later, everything else before.
    #[test]
    fn a_sample_before_the_last_one_is_older() {
        let age = Micros::from_us(0);
        for later in [0, 1, 8_333, (1 << 31) - 1] {
            assert_eq!(taken(Micros::from_us(later), age), Ok(()), "{later}");
        }
        for before in [1 << 31, u32::MAX - 8_333, u32::MAX] {
            assert_eq!(
                taken(Micros::from_us(before), age),
                Err(Reject::Older),
                "{before}"
            );
        }
    }
}
