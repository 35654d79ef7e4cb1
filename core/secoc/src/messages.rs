//! Which messages are proven, where a proof lies, and the messages that belong to it. `authentication.dbc` describes all of them
//! for other tools; `tests/dbc.rs` holds the two together.
//!
//! A proof has 32 bits: four of the count, then 28 of the MAC. Request has room for it. The others, which have 11 to 24 bits to
//! spare, are followed by a frame of their own with it.

use haptic_core::bus::Frame;
use haptic_core::bus::e2e::Protection;
use haptic_core::bus::messages::{
    Info, LanePreview, Message, ParameterUnlock, ParameterWrite, Request, Vehicle, field, put_field,
};

use crate::fresh::{Offer, Proof, Receiver, Sender};

/// Bits of the count that a proof carries: 14 frames may be lost between two.
pub const COUNT_BITS: u32 = 4;
/// Bits of the MAC.
pub const TAG_BITS: u32 = 28;
/// A sender of such proofs.
pub(crate) type ProofSender<M> = Sender<M, COUNT_BITS, TAG_BITS>;
/// A receiver of such proofs.
pub(crate) type ProofReceiver = Receiver<COUNT_BITS, TAG_BITS>;

/// Where a message's proof lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// In bytes 4 to 7 of its frame, which no signal uses. The MAC is over bytes 1 to 3; the frame's CRC, over everything.
    Within,
    /// In a frame of four bytes that follows under this identifier. The MAC is over bytes 1 to 7.
    Behind(u16),
}

/// A message that is proven.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Proven {
    /// What core's list says of it.
    pub info: Info,
    /// Where its proof lies.
    pub place: Place,
    /// Under which identifier its sender asks for an epoch: a number, in four bytes.
    pub question: u16,
}

impl Proven {
    const fn new(info: Info, place: Place) -> Self {
        // Below every message that is awaited.
        let question = info.id.saturating_add(0x400);
        Self {
            info,
            place,
            question,
        }
    }

    /// What the MAC is over.
    pub(crate) fn text<'a>(&self, frame: &'a Frame) -> Option<&'a [u8]> {
        let bytes = match self.place {
            Place::Within => 1..4,
            Place::Behind(_) => 1..8,
        };
        frame.payload::<8>()?.get(bytes)
    }
}

/// How many messages are proven.
pub const COUNT: usize = 5;
/// Every message that is proven, most urgent first.
pub const PROVEN: [Proven; COUNT] = [
    Proven::new(LanePreview::INFO, Place::Behind(0x101)),
    Proven::new(Vehicle::INFO, Place::Behind(0x121)),
    Proven::new(Request::INFO, Place::Within),
    Proven::new(ParameterWrite::INFO, Place::Behind(0x141)),
    Proven::new(ParameterUnlock::INFO, Place::Behind(0x149)),
];

/// The ECU's answer to a question.
pub const OFFER_ID: u16 = 0x358;
/// What the ECU says of the authentication itself, every 100 ms.
pub const STATUS_ID: u16 = 0x360;
/// CRC and counter of the status.
const STATUS_PROTECTION: Protection = Protection::new(0xEE);

/// A proof as four bytes.
pub(crate) fn bytes_of_proof(proof: &Proof) -> [u8; 4] {
    ((proof.tag << COUNT_BITS) | u32::from(proof.count)).to_le_bytes()
}

/// The proof of four bytes.
pub(crate) fn proof_of_bytes(bytes: [u8; 4]) -> Proof {
    let word = u32::from_le_bytes(bytes);
    let [low, ..] = bytes;
    Proof {
        count: low & 0x0F,
        tag: word >> COUNT_BITS,
    }
}

/// The frame of an offer for a message of [`PROVEN`].
pub(crate) fn frame_of_offer(place: usize, offer: &Offer) -> Frame {
    let mut data = [0; 8];
    put_field(&mut data, i64::try_from(place).unwrap_or(0), 0, 4);
    put_field(&mut data, i64::from(offer.tag), 4, 28);
    put_field(&mut data, i64::from(offer.epoch), 32, 32);
    Frame::full(OFFER_ID, data)
}

/// The offer of a frame, and the place of its message.
pub(crate) fn offer_of_frame(frame: &Frame) -> Option<(usize, Offer)> {
    let data = frame.payload::<8>()?;
    let number = |start, bits| field(data, start, bits);
    let offer = Offer {
        epoch: u32::try_from(number(32, 32)).ok()?,
        tag: u32::try_from(number(4, 28)).ok()?,
    };
    Some((usize::try_from(number(0, 4)).ok()?, offer))
}

/// How the ECU authenticates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum State {
    /// It has no keys and is for the bench: every frame passes.
    Bench,
    /// It has no keys: no Request passes, so that it never engages.
    NoKeys,
    /// It could not count its start, so that no epoch is new: nothing that is to be proven passes.
    NoStart,
    /// What is to be proven passes with a proof by SipHash-2-4.
    SipHash,
    /// What is to be proven passes with a proof by AES-CMAC.
    AesCmac,
}

/// Why something was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Refusal {
    /// Its proof is not its sender's, or is not fresh.
    Proof,
    /// The next frame came, and no proof before it.
    Unproven,
    /// A proof without a frame, or too late behind it.
    NoFrame,
    /// Not as long as it is.
    Length,
    /// More than can wait to be verified.
    TooMany,
    /// Under an identifier of this ECU.
    Foreign,
    /// It cannot be verified: there is no key, or no start that was counted.
    NoKeys,
}

impl Refusal {
    /// Every reason, in the order of its codes on the bus.
    pub const ALL: [Self; 7] = [
        Self::Proof,
        Self::Unproven,
        Self::NoFrame,
        Self::Length,
        Self::TooMany,
        Self::Foreign,
        Self::NoKeys,
    ];
}

/// How often a message was refused for a reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Refused {
    /// The message's identifier.
    pub id: u16,
    /// Why.
    pub reason: Refusal,
    /// How often since the start; it stays at its largest value.
    pub count: u16,
}

/// What the ECU says of the authentication: message `Authentication`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Status {
    /// How it authenticates.
    pub state: State,
    /// The messages of [`PROVEN`] whose sender has to ask for an epoch.
    pub waiting: [bool; COUNT],
    /// The next count that is not zero.
    pub refused: Option<Refused>,
}

impl Status {
    /// The frame under a counter, modulo 16.
    #[must_use]
    #[expect(clippy::as_conversions, reason = "codes of variants")]
    pub fn encode(&self, counter: u8) -> Frame {
        let mut data = [0; 8];
        put_field(&mut data, i64::from(self.state as u8), 12, 3);
        for (bit, waits) in (16..).zip(self.waiting) {
            put_field(&mut data, i64::from(waits), bit, 1);
        }
        if let Some(Refused { id, reason, count }) = self.refused {
            put_field(&mut data, i64::from(id), 24, 11);
            put_field(&mut data, i64::from(reason as u8), 36, 3);
            put_field(&mut data, i64::from(count), 40, 16);
        }
        STATUS_PROTECTION.protect(&mut data, counter);
        Frame::full(STATUS_ID, data)
    }

    /// The status of a frame; None where it is none, or its CRC does not fit.
    #[must_use]
    pub fn decode(frame: &Frame) -> Option<Self> {
        let data = frame.payload::<8>().filter(|_| frame.id() == STATUS_ID)?;
        if !STATUS_PROTECTION.is_intact(data) {
            return None;
        }
        let state = match field(data, 12, 3) {
            0 => State::Bench,
            1 => State::NoKeys,
            2 => State::NoStart,
            3 => State::SipHash,
            4 => State::AesCmac,
            _ => return None,
        };
        let mut waiting = [false; COUNT];
        for (bit, waits) in (16..).zip(&mut waiting) {
            *waits = field(data, bit, 1) != 0;
        }
        let count = u16::try_from(field(data, 40, 16)).ok()?;
        let reason = usize::try_from(field(data, 36, 3)).ok()?;
        let refused = Refused {
            id: u16::try_from(field(data, 24, 11)).ok()?,
            reason: *Refusal::ALL.get(reason)?,
            count,
        };
        Some(Self {
            state,
            waiting,
            refused: (count > 0).then_some(refused),
        })
    }
}
