//! A proof and its freshness: a MAC over identifier, payload and a freshness value, cut to the bits that a frame has for it; of the
//! freshness value it carries the lowest bits. A tag of 24 bits lets one false frame of 16.7 million pass for each epoch that it is
//! tried with, which are two.
//!
//! The freshness value is an *epoch* and a count. The receiver gives out epochs, and none twice: a sender without one [`Sender::ask`]s with
//! a number of its own, and the receiver's [`Offer`] is a MAC over that number too, so that no old offer is taken. The receiver goes
//! over to an offered epoch with the first good frame of it, and offers the same one until then: whoever repeats old questions
//! changes nothing. Neither side has to remember anything across a reset but the receiver, which begins each start with an epoch
//! that it never had.
//!
//! Not here: bits of frames (`messages`), and where the receiver keeps the number of its starts.

use core::hash::Hasher;

use aes::Aes128;
use cmac::Mac as _;
use heapless::Vec;
use siphasher::sip::SipHasher24;

/// A key of either MAC.
pub type Key = [u8; 16];

/// The longest payload.
pub const LONGEST: usize = 64;
/// Epochs of one start; each is used up by a sender's good frame alone.
pub const EPOCHS: u32 = 1 << 12;
/// What is authenticated: the purpose, identifier, epoch, count, payload.
type Text = Vec<u8, { LONGEST + 11 }>;

/// A MAC, of which the first 32 bits are used.
pub trait Mac {
    /// The first 32 bits.
    fn tag(&self, text: &[u8]) -> u32;
}

/// AES-CMAC (RFC 4493), its round keys worked out once.
#[derive(Clone)]
pub struct Cmac(cmac::Cmac<Aes128>);

impl Cmac {
    /// The MAC under a key.
    #[must_use]
    pub fn new(key: &Key) -> Self {
        Self(cmac::Mac::new(key.into()))
    }
}

impl Mac for Cmac {
    fn tag(&self, text: &[u8]) -> u32 {
        let mut mac = self.0.clone();
        mac.update(text);
        let [a, b, c, d, ..] = <[u8; 16]>::from(mac.finalize().into_bytes());
        u32::from_be_bytes([a, b, c, d])
    }
}

/// SipHash-2-4, a thirtieth of the work.
#[derive(Debug, Clone)]
pub struct SipHash(pub Key);

impl Mac for SipHash {
    fn tag(&self, text: &[u8]) -> u32 {
        let mut hasher = SipHasher24::new_with_key(&self.0);
        hasher.write(text);
        let [a, b, c, d, ..] = hasher.finish().to_le_bytes();
        u32::from_be_bytes([a, b, c, d])
    }
}

/// Which MAC.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Algorithm {
    /// SipHash-2-4.
    SipHash,
    /// AES-CMAC.
    AesCmac,
}

/// A MAC that is chosen when the program starts.
#[derive(Clone)]
#[expect(
    clippy::large_enum_variant,
    reason = "no allocation; an ECU has one for each of its two senders"
)]
pub enum Chosen {
    /// SipHash-2-4.
    SipHash(SipHash),
    /// AES-CMAC.
    AesCmac(Cmac),
}

impl Chosen {
    /// The MAC under a key.
    #[must_use]
    pub fn new(algorithm: Algorithm, key: &Key) -> Self {
        match algorithm {
            Algorithm::SipHash => Self::SipHash(SipHash(*key)),
            Algorithm::AesCmac => Self::AesCmac(Cmac::new(key)),
        }
    }
}

impl Mac for Chosen {
    fn tag(&self, text: &[u8]) -> u32 {
        match self {
            Self::SipHash(mac) => mac.tag(text),
            Self::AesCmac(mac) => mac.tag(text),
        }
    }
}

/// What a frame carries beside its payload.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Proof {
    /// The lowest bits of the count.
    pub count: u8,
    /// The highest bits of the MAC.
    pub tag: u32,
}

/// The receiver's answer to a sender's question.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Offer {
    /// The epoch to count in.
    pub epoch: u32,
    /// The highest bits of its MAC, as many as a proof has.
    pub tag: u32,
}

/// What a MAC is for: those of one purpose are none of another.
#[derive(Debug, Clone, Copy)]
enum Purpose {
    Frame = 1,
    Offer = 2,
}

/// A text of a purpose; None where the payload is too long.
#[expect(clippy::as_conversions, reason = "the code of a variant")]
fn text(purpose: Purpose, id: u16, epoch: u32, number: u32, payload: &[u8]) -> Option<Text> {
    let mut text = Text::new();
    text.push(purpose as u8).ok()?;
    text.extend_from_slice(&id.to_be_bytes()).ok()?;
    text.extend_from_slice(&epoch.to_be_bytes()).ok()?;
    text.extend_from_slice(&number.to_be_bytes()).ok()?;
    text.extend_from_slice(payload).ok()?;
    Some(text)
}

fn cut(tag: u32, bits: u32) -> u32 {
    tag >> 32_u32.saturating_sub(bits)
}

const fn low(count: u32, bits: u32) -> u8 {
    let [byte, ..] = (count & 1_u32.wrapping_shl(bits).wrapping_sub(1)).to_le_bytes();
    byte
}

/// The sender of one identifier, whose frames carry the lowest `BITS` bits of the count, 2 to 8, and `TAG` bits of the MAC, 24 to 32.
#[derive(Clone)]
pub struct Sender<M, const BITS: u32, const TAG: u32> {
    mac: M,
    id: u16,
    epoch: Option<u32>,
    count: u32,
    question: Option<u32>,
}

impl<M: Mac, const BITS: u32, const TAG: u32> Sender<M, BITS, TAG> {
    /// A sender at its start, without an epoch.
    #[must_use]
    pub const fn new(mac: M, id: u16) -> Self {
        const {
            assert!(
                BITS >= 2 && BITS <= 8 && TAG >= 24 && TAG <= 32,
                "bits of a proof"
            )
        };
        Self {
            mac,
            id,
            epoch: None,
            count: 0,
            question: None,
        }
    }

    /// Asks for an epoch, with a number that was not asked with before; a random one.
    pub const fn ask(&mut self, number: u32) -> u32 {
        self.question = Some(number);
        number
    }

    /// Takes an offer, if it answers the last question.
    pub fn take(&mut self, offer: &Offer) {
        let Some(question) = self.question else {
            return;
        };
        let is_true = text(Purpose::Offer, self.id, offer.epoch, question, &[])
            .is_some_and(|text| cut(self.mac.tag(&text), TAG) == offer.tag);
        if is_true && self.epoch != Some(offer.epoch) {
            (self.epoch, self.count) = (Some(offer.epoch), 0);
        }
        if is_true {
            self.question = None;
        }
    }

    /// The proof of the next frame; None without an epoch, at its end, or with a payload that is too long.
    pub fn prove(&mut self, payload: &[u8]) -> Option<Proof> {
        let count = self.count.checked_add(1)?;
        let text = text(Purpose::Frame, self.id, self.epoch?, count, payload)?;
        self.count = count;
        Some(Proof {
            count: low(count, BITS),
            tag: cut(self.mac.tag(&text), TAG),
        })
    }
}

/// The receiver of one identifier.
/// It is lent its MAC, which several share.
#[derive(Debug, Clone)]
pub struct Receiver<const BITS: u32, const TAG: u32> {
    id: u16,
    /// The epoch in use and its last count.
    used: Option<(u32, u32)>,
    /// The one that is offered.
    offered: u32,
    /// Epochs that are left, the offered one included.
    left: u32,
}

impl<const BITS: u32, const TAG: u32> Receiver<BITS, TAG> {
    /// A receiver at the start of that number, which no start had before.
    #[must_use]
    pub const fn new(id: u16, start: u32) -> Self {
        Self {
            id,
            used: None,
            offered: start.wrapping_mul(EPOCHS),
            left: EPOCHS,
        }
    }

    /// Whether no frame can be taken before a sender has asked: it is the start.
    #[must_use]
    pub const fn is_unsynchronised(&self) -> bool {
        self.used.is_none()
    }

    /// Answers a sender's question; None when the start's epochs are used up.
    #[must_use]
    pub fn offer(&self, mac: &impl Mac, question: u32) -> Option<Offer> {
        let text = text(Purpose::Offer, self.id, self.offered, question, &[]).filter(|_| self.left > 0)?;
        Some(Offer {
            epoch: self.offered,
            tag: cut(mac.tag(&text), TAG),
        })
    }

    /// Whether a frame is the sender's, and fresh: newer than every one before. At most 2^`BITS` - 2 frames may be lost between two;
    /// a sender that is refused after more of them asks anew.
    pub fn accept(&mut self, mac: &impl Mac, payload: &[u8], proof: &Proof) -> bool {
        if let Some((epoch, last)) = self.used
            && let Some(count) = self.next(mac, epoch, last, payload, proof)
        {
            self.used = Some((epoch, count));
            return true;
        }
        if self.left == 0 {
            return false;
        }
        let Some(count) = self.next(mac, self.offered, 0, payload, proof) else {
            return false;
        };
        self.used = Some((self.offered, count));
        (self.offered, self.left) = (self.offered.wrapping_add(1), self.left.saturating_sub(1));
        true
    }

    /// The count of a frame of an epoch, behind the last one.
    fn next(&self, mac: &impl Mac, epoch: u32, last: u32, payload: &[u8], proof: &Proof) -> Option<u32> {
        let ahead = low(u32::from(proof.count).wrapping_sub(last), BITS);
        // The last one again, or so many were lost that it cannot be told.
        let count = last.checked_add(u32::from(ahead)).filter(|_| ahead > 0)?;
        let text = text(Purpose::Frame, self.id, epoch, count, payload)?;
        let is_whole = low(count, BITS) == proof.count;
        (is_whole && cut(mac.tag(&text), TAG) == proof.tag).then_some(count)
    }
}
