//! The ECU's side: which of the frames that come may reach the controller.
//!
//! A frame whose proof follows it waits here, until the proof comes, for 5 ms at most; it counts as heard when it came. One frame of each
//! message waits: a later one takes its place. What is refused is counted by message and reason and told on the bus, and the
//! controller hears nothing of it.
//!
//! A step verifies eight frames at most, twice what true senders send in a millisecond, so that a flood of false proofs takes no more than
//! sixteen MACs of a step's time.

use haptic_core::bus::Frame;
use haptic_core::quantity::{Instant, Micros};

use crate::fresh::{Algorithm, Chosen, Proof};
use crate::messages::{
    COUNT, OFFER_ID, PROVEN, Place, ProofReceiver, Refusal, Refused, STATUS_ID, State, Status,
    frame_of_offer, proof_of_bytes,
};
use crate::{Keys, mac_of};

/// For so long a frame waits for its proof.
const PATIENCE: Micros = Micros::from_ms(5);
/// Frames that a step verifies.
const PER_STEP: u8 = 8;
/// Steps between two statuses, and between two offers, which come in a step without another line of the ECU's.
const STEPS_PER_STATUS: u32 = 100;
const STATUS_AT: u32 = 60;
const STEPS_PER_OFFER: u32 = 50;
const OFFER_AT: u32 = 35;
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
    /// Frames that this step may still verify.
    left: u8,
    /// The count and the offer whose turn is next.
    next_count: usize,
    next_offer: usize,
}

/// What is kept of one message.
struct Way {
    receiver: ProofReceiver,
    held: Option<Passed>,
    question: Option<u32>,
    /// Something was refused since the last status: its sender may have lost count.
    is_refused: bool,
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
            }),
            refused: [[0; REASONS]; COUNT],
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

    /// Takes a frame from the bus; what may go on, and when that came.
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
                        self.verify(place, frame, bytes).then_some((*frame, now))
                    }
                };
            }
            // Without keys a proof says nothing, and nobody has to ask.
            if proven.place == Place::Behind(id) {
                self.macs.as_ref()?;
                return self.release(place, frame, now);
            }
            if proven.question == id {
                self.macs.as_ref()?;
                self.ask(place, frame);
                return None;
            }
        }
        passed
    }

    /// What is to be said behind the step of that number; the next step verifies anew.
    pub fn step(&mut self, steps: u32) -> Option<Frame> {
        self.left = PER_STEP;
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

    /// Takes the proof of a frame that waits; the frame, if it is proven.
    fn release(&mut self, place: usize, proof: &Frame, now: Instant) -> Option<Passed> {
        let held = self.ways.get_mut(place)?.held.take();
        let Some((frame, at)) = held.filter(|(_, at)| now.since(*at) <= PATIENCE) else {
            self.refuse(place, Refusal::NoFrame);
            return None;
        };
        self.verify(place, &frame, proof.payload::<4>())
            .then_some((frame, at))
    }

    /// Whether a frame is proven.
    fn verify(&mut self, place: usize, frame: &Frame, proof: Option<&[u8; 4]>) -> bool {
        let text = PROVEN.get(place).and_then(|proven| proven.text(frame));
        let refusal = match (text, proof) {
            (Some(text), Some(proof)) => {
                let Some(left) = self.left.checked_sub(1) else {
                    self.refuse(place, Refusal::TooMany);
                    return false;
                };
                self.left = left;
                let proof = proof_of_bytes(*proof);
                if self.accepts(place, text, &proof) {
                    return true;
                }
                Refusal::Proof
            }
            _ => Refusal::Length,
        };
        self.refuse(place, refusal);
        false
    }

    fn accepts(&mut self, place: usize, text: &[u8], proof: &Proof) -> bool {
        let (Some(macs), Some(proven), Some(way)) = (&self.macs, PROVEN.get(place), self.ways.get_mut(place))
        else {
            return false;
        };
        way.receiver.accept(mac_of(macs, proven.info.sender), text, proof)
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
            if let Some(question) = way.question.take()
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
            has_keys && (was_refused || way.receiver.is_unsynchronised())
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
