//! The ECU's side: which of the frames that come may reach the controller.
//!
//! A frame whose proof follows it waits here, until the proof comes, for 5 ms at most; it counts as heard when it came. One frame of each
//! message waits: a later one takes its place. What is refused is counted by message and reason and told on the bus, and the
//! controller hears nothing of it.
//!
//! [`Verifier::receive`] works out no MAC: what has come with its proof waits for [`Verifier::verified`], which is called behind the step, so
//! that no flood of false proofs costs the step a MAC. Five frames are verified from one step to the next, a MAC each for the
//! epoch in use and the one that is offered. More never come: a frame of eight bytes takes a bus of 500 kbit/s 222 us. So a true frame waits
//! a millisecond at most, whatever else is on the bus.
//!
//! Epochs are not used up by whoever has frames refused. A sender whose frames pass has not lost count, and is not told to ask; one that
//! was kept from the bus on purpose is given 16 epochs at once, then one in 10 s. So the 4,096 of a start last for eleven hours, and a
//! true sender that asks is answered within 10 s in the worst case.

use haptic_core::bus::Frame;
use haptic_core::quantity::{Instant, Micros};
use heapless::Deque;

use crate::fresh::{Algorithm, Chosen, Proof};
use crate::messages::{
    COUNT, OFFER_ID, PROVEN, Place, ProofReceiver, Refusal, Refused, STATUS_ID, State, Status,
    frame_of_offer, proof_of_bytes,
};
use crate::{Keys, mac_of};

/// For so long a frame waits for its proof.
const PATIENCE: Micros = Micros::from_ms(5);
/// Frames that are verified from one step to the next.
const PER_STEP: u8 = 5;
/// Frames that wait for it: those of a step that is late, beside.
const WAITING: usize = 8;
/// Steps between two statuses, and between two offers, which come in a step without another line of the ECU's.
const STEPS_PER_STATUS: u32 = 100;
const STATUS_AT: u32 = 60;
const STEPS_PER_OFFER: u32 = 50;
const OFFER_AT: u32 = 35;
/// Steps without a frame that passed, after which what is refused may be the true sender's: two periods.
const LOST_AFTER: u32 = 20;
/// Epochs of a message that may be used at once, and steps until it is one more.
const AT_ONCE: u8 = 16;
const STEPS_PER_EPOCH: u32 = 10_000;
const EPOCH_AT: u32 = 5;
const REASONS: usize = Refusal::ALL.len();
const COUNTS: usize = COUNT.saturating_mul(REASONS);
/// Starts that have epochs of their own.
pub const STARTS: u32 = 1 << 20;

/// What the ECU knows when it starts.
#[derive(Clone, Copy)]
pub enum Credentials {
    /// No keys, in an image for the bench.
    Bench,
    /// No keys.
    None,
    /// Keys, and the number of this start, which no start had before; None where it could not be stored.
    Keys(Keys, Option<u32>),
}

/// A frame on its way to the controller, and when it came.
pub type Passed = (Frame, Instant);

/// Lets through what is proven.
pub struct Verifier {
    state: State,
    /// None where nothing can be verified.
    macs: Option<[Chosen; 2]>,
    ways: [Way; COUNT],
    refused: [[u16; REASONS]; COUNT],
    waiting: Deque<Waiting, WAITING>,
    /// Frames that may still be verified before the next step.
    left: u8,
    /// The count and the offer whose turn is next.
    next_count: usize,
    next_offer: usize,
}

/// A frame of a message of the list with its proof, and when it came.
struct Waiting {
    place: usize,
    passed: Passed,
    proof: Proof,
}

/// What is kept of one message.
struct Way {
    receiver: ProofReceiver,
    held: Option<Passed>,
    question: Option<u32>,
    /// Something was refused since the last status.
    is_refused: bool,
    /// Steps since a frame passed.
    quiet: u32,
    /// Epochs that may be used now.
    at_once: u8,
}

impl Verifier {
    /// A verifier at its start.
    #[must_use]
    pub fn new(credentials: Credentials) -> Self {
        let (state, keys) = match credentials {
            Credentials::Bench => (State::Bench, None),
            Credentials::None => (State::NoKeys, None),
            Credentials::Keys(keys, start) => {
                let state = match keys.algorithm {
                    Algorithm::SipHash => State::SipHash,
                    Algorithm::AesCmac => State::AesCmac,
                };
                match start.filter(|start| *start < STARTS) {
                    Some(start) => (state, Some((keys, start))),
                    None => (State::NoStart, None),
                }
            }
        };
        let start = keys.map_or(0, |(_, start)| start);
        Self {
            state,
            macs: keys.map(|(keys, _)| keys.macs()),
            ways: PROVEN.map(|proven| Way {
                receiver: ProofReceiver::new(proven.info.id, start),
                held: None,
                question: None,
                is_refused: false,
                quiet: LOST_AFTER,
                at_once: AT_ONCE,
            }),
            refused: [[0; REASONS]; COUNT],
            waiting: Deque::new(),
            left: PER_STEP,
            next_count: 0,
            next_offer: 0,
        }
    }

    /// How it authenticates.
    #[must_use]
    pub const fn state(&self) -> State {
        self.state
    }

    /// All that was refused, saturating.
    #[must_use]
    pub fn total(&self) -> u32 {
        let counts = self.refused.iter().flatten();
        counts.fold(0, |sum, count| sum.saturating_add(u32::from(*count)))
    }

    /// Takes a frame from the bus; it, and when it came, if it needs no proof.
    pub fn receive(&mut self, frame: &Frame, now: Instant) -> Option<Passed> {
        let id = frame.id();
        if id == OFFER_ID || id == STATUS_ID {
            // Of no message of the list: counted as the first one's.
            self.refuse(0, Refusal::Foreign);
            return None;
        }
        let passed = Some((*frame, now));
        for (place, proven) in PROVEN.iter().enumerate() {
            if proven.info.id == id {
                return match (self.state, proven.place) {
                    (State::Bench, _) => passed,
                    // A set may be given to an ECU before its keys are.
                    (State::NoKeys, Place::Behind(_)) => passed,
                    (State::NoKeys | State::NoStart, _) => {
                        self.refuse(place, Refusal::NoKeys);
                        None
                    }
                    (_, Place::Behind(_)) => {
                        self.hold(place, frame, now);
                        None
                    }
                    (_, Place::Within) => {
                        let bytes = frame.payload::<8>().and_then(|data| data.last_chunk());
                        self.wait(place, (*frame, now), bytes);
                        None
                    }
                };
            }
            // Without keys a proof says nothing, and nobody has to ask.
            if proven.place == Place::Behind(id) {
                self.macs.as_ref()?;
                self.release(place, frame, now);
                return None;
            }
            if proven.question == id {
                self.macs.as_ref()?;
                self.ask(place, frame);
                return None;
            }
        }
        passed
    }

    /// The next frame that is proven, and when it came; None when nothing waits, or enough was verified for one step.
    pub fn verified(&mut self) -> Option<Passed> {
        while let Some(left) = self.left.checked_sub(1) {
            let next = self.waiting.pop_front()?;
            self.left = left;
            if self.accepts(&next) {
                return Some(next.passed);
            }
            self.refuse(next.place, Refusal::Proof);
        }
        None
    }

    /// What is to be said behind the step of that number; as many frames may be verified again.
    pub fn step(&mut self, steps: u32) -> Option<Frame> {
        self.left = PER_STEP;
        for way in &mut self.ways {
            way.quiet = way.quiet.saturating_add(1);
            if steps % STEPS_PER_EPOCH == EPOCH_AT {
                way.at_once = way.at_once.saturating_add(1).min(AT_ONCE);
            }
        }
        if steps % STEPS_PER_STATUS == STATUS_AT {
            let [counter, ..] = (steps / STEPS_PER_STATUS).to_le_bytes();
            return Some(self.status().encode(counter));
        }
        if steps % STEPS_PER_OFFER == OFFER_AT {
            return self.offer();
        }
        None
    }

    fn refuse(&mut self, place: usize, reason: Refusal) {
        let index = Refusal::ALL.iter().position(|other| *other == reason);
        let counts = self.refused.get_mut(place);
        if let Some(count) = counts
            .zip(index)
            .and_then(|(counts, index)| counts.get_mut(index))
        {
            *count = count.saturating_add(1);
        }
        if let Some(way) = self.ways.get_mut(place) {
            way.is_refused = true;
        }
    }

    /// Keeps a frame until its proof comes.
    fn hold(&mut self, place: usize, frame: &Frame, now: Instant) {
        let before = self
            .ways
            .get_mut(place)
            .and_then(|way| way.held.replace((*frame, now)));
        if before.is_some() {
            self.refuse(place, Refusal::Unproven);
        }
    }

    /// Takes the proof of a frame that is held.
    fn release(&mut self, place: usize, proof: &Frame, now: Instant) {
        let held = self.ways.get_mut(place).and_then(|way| way.held.take());
        match held.filter(|(_, at)| now.since(*at) <= PATIENCE) {
            Some(held) => self.wait(place, held, proof.payload::<4>()),
            None => self.refuse(place, Refusal::NoFrame),
        }
    }

    /// Keeps a frame with its proof until it is verified.
    fn wait(&mut self, place: usize, passed: Passed, proof: Option<&[u8; 4]>) {
        let is_whole = PROVEN
            .get(place)
            .is_some_and(|proven| proven.text(&passed.0).is_some());
        let Some(proof) = proof.filter(|_| is_whole) else {
            self.refuse(place, Refusal::Length);
            return;
        };
        let proof = proof_of_bytes(*proof);
        let next = Waiting { place, passed, proof };
        if self.waiting.push_back(next).is_err() {
            self.refuse(place, Refusal::TooMany);
        }
    }

    fn accepts(&mut self, Waiting { place, passed, proof }: &Waiting) -> bool {
        let (Some(macs), Some(proven), Some(way)) =
            (&self.macs, PROVEN.get(*place), self.ways.get_mut(*place))
        else {
            return false;
        };
        let mac = mac_of(macs, proven.info.sender);
        let (text, left) = (proven.text(&passed.0), way.receiver.left());
        let is_true = text.is_some_and(|text| way.receiver.accept(mac, text, proof));
        if is_true {
            way.quiet = 0;
        }
        if way.receiver.left() < left {
            way.at_once = way.at_once.saturating_sub(1);
        }
        is_true
    }

    /// Keeps a question until its offer is due; a later one takes its place, as its sender awaits no other answer.
    fn ask(&mut self, place: usize, frame: &Frame) {
        let Some(number) = frame.payload::<4>() else {
            self.refuse(place, Refusal::Length);
            return;
        };
        if let Some(way) = self.ways.get_mut(place) {
            way.question = Some(u32::from_le_bytes(*number));
        }
    }

    /// The next answer, the messages in turn.
    fn offer(&mut self) -> Option<Frame> {
        let macs = self.macs.as_ref()?;
        for _ in 0..COUNT {
            let place = self.next_offer % COUNT;
            self.next_offer = place.wrapping_add(1);
            let (proven, way) = PROVEN.get(place).zip(self.ways.get_mut(place))?;
            let mac = mac_of(macs, proven.info.sender);
            if way.at_once > 0
                && let Some(question) = way.question.take()
                && let Some(offer) = way.receiver.offer(mac, question)
            {
                return Some(frame_of_offer(place, &offer));
            }
        }
        None
    }

    fn status(&mut self) -> Status {
        let has_keys = self.macs.is_some();
        let waits = |way: &mut Way| {
            let was_refused = core::mem::take(&mut way.is_refused);
            let is_lost = was_refused && way.quiet >= LOST_AFTER;
            has_keys && (is_lost || way.receiver.is_unsynchronised())
        };
        Status {
            state: self.state,
            waiting: self.ways.each_mut().map(waits),
            refused: self.line(),
        }
    }

    /// The next count, in turn, that is not zero.
    fn line(&mut self) -> Option<Refused> {
        for _ in 0..COUNTS {
            let place = self.next_count % COUNTS;
            self.next_count = place.wrapping_add(1);
            let reason = place % REASONS;
            let count = *self.refused.get(place / REASONS)?.get(reason)?;
            if count > 0 {
                return Some(Refused {
                    id: PROVEN.get(place / REASONS)?.info.id,
                    reason: *Refusal::ALL.get(reason)?,
                    count,
                });
            }
        }
        None
    }
}
