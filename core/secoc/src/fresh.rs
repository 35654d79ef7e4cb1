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

use aes::cipher::{BlockEncrypt, KeyInit};
use aes::{Aes128, Block};
use heapless::Vec;
use siphasher::sip::SipHasher24;

/// A key of either MAC.
pub type Key = [u8; 16];

/// Epochs of one start; each is used up by a sender's good frame alone.
pub const EPOCHS: u32 = 1 << 12;
/// Bytes of a block of AES.
const BLOCK: usize = 16;
/// Bytes in front of a payload.
const HEAD: usize = 11;

/// What is authenticated: purpose, identifier, epoch and count, then the payload.
#[derive(Debug, Clone, Copy)]
pub struct Text<'a> {
    /// In front of the payload.
    pub head: [u8; HEAD],
    /// The payload.
    pub payload: &'a [u8],
}

/// A MAC, of which the first 32 bits are used.
pub trait Mac {
    /// The first 32 bits.
    fn tag(&self, text: &Text<'_>) -> u32;

    /// Which of the texts, which are equally long, has a tag that is wanted.
    fn find(&self, texts: &[Text<'_>], is_wanted: impl Fn(u32) -> bool) -> Option<usize> {
        texts.iter().position(|text| is_wanted(self.tag(text)))
    }
}

/// AES-CMAC (RFC 4493), its round keys and both subkeys worked out once. Two texts take as long as one, because the cipher works on two
/// blocks at a time; the crate `cmac` takes one text at a time, and a third block for the subkeys of each.
#[derive(Clone)]
pub struct Cmac {
    cipher: Aes128,
    /// For a last block that is whole, and for one that is filled up.
    subkeys: [u128; 2],
}

impl Cmac {
    /// The MAC under a key.
    #[must_use]
    pub fn new(key: &Key) -> Self {
        let cipher = Aes128::new(key.into());
        let mut block = Block::default();
        cipher.encrypt_block(&mut block);
        let doubled = |number: u128| (number << 1) ^ (number >> 127).wrapping_mul(0x87);
        let whole = doubled(u128::from_be_bytes(block.into()));
        Self {
            cipher,
            subkeys: [whole, doubled(whole)],
        }
    }

    /// The tags of texts that are as long as the first.
    fn tags<const N: usize>(&self, texts: [&Text<'_>; N]) -> [u32; N] {
        let length = texts
            .first()
            .map_or(HEAD, |text| text.payload.len().saturating_add(HEAD));
        let mut texts = texts.map(|text| text.head.iter().chain(text.payload));
        let mut blocks = [Block::default(); N];
        let [whole, filled] = self.subkeys;
        for from in (0..length).step_by(BLOCK) {
            let here = length.saturating_sub(from);
            let subkey = match here {
                0..BLOCK => filled,
                BLOCK => whole,
                _ => 0,
            };
            for (block, text) in blocks.iter_mut().zip(&mut texts) {
                let mut bytes = [0; BLOCK];
                bytes.iter_mut().zip(text).for_each(|(to, from)| *to = *from);
                if let Some(end) = bytes.get_mut(here) {
                    *end = 0x80;
                }
                let number = u128::from_be_bytes((*block).into()) ^ u128::from_be_bytes(bytes) ^ subkey;
                *block = number.to_be_bytes().into();
            }
            self.cipher.encrypt_blocks(&mut blocks);
        }
        blocks.map(|block| {
            let [a, b, c, d, ..] = <[u8; BLOCK]>::from(block);
            u32::from_be_bytes([a, b, c, d])
        })
    }
}

impl Mac for Cmac {
    fn tag(&self, text: &Text<'_>) -> u32 {
        let [tag] = self.tags([text]);
        tag
    }

    fn find(&self, texts: &[Text<'_>], is_wanted: impl Fn(u32) -> bool) -> Option<usize> {
        match texts {
            [first, second] => self.tags([first, second]).into_iter().position(is_wanted),
            _ => texts.iter().position(|text| is_wanted(self.tag(text))),
        }
    }
}

/// SipHash-2-4, a fraction of the work.
#[derive(Debug, Clone)]
pub struct SipHash(pub Key);

impl Mac for SipHash {
    fn tag(&self, text: &Text<'_>) -> u32 {
        let mut hasher = SipHasher24::new_with_key(&self.0);
        hasher.write(&text.head);
        hasher.write(text.payload);
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
    fn tag(&self, text: &Text<'_>) -> u32 {
        match self {
            Self::SipHash(mac) => mac.tag(text),
            Self::AesCmac(mac) => mac.tag(text),
        }
    }

    fn find(&self, texts: &[Text<'_>], is_wanted: impl Fn(u32) -> bool) -> Option<usize> {
        match self {
            Self::SipHash(mac) => mac.find(texts, is_wanted),
            Self::AesCmac(mac) => mac.find(texts, is_wanted),
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

/// A text of a purpose.
#[expect(clippy::as_conversions, reason = "the code of a variant")]
const fn text(purpose: Purpose, id: u16, epoch: u32, number: u32, payload: &[u8]) -> Text<'_> {
    let ([a, b], [c, d, e, f], [g, h, i, j]) = (id.to_be_bytes(), epoch.to_be_bytes(), number.to_be_bytes());
    Text {
        head: [purpose as u8, a, b, c, d, e, f, g, h, i, j],
        payload,
    }
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
        let text = text(Purpose::Offer, self.id, offer.epoch, question, &[]);
        let is_true = cut(self.mac.tag(&text), TAG) == offer.tag;
        if is_true && self.epoch != Some(offer.epoch) {
            (self.epoch, self.count) = (Some(offer.epoch), 0);
        }
        if is_true {
            self.question = None;
        }
    }

    /// The proof of the next frame; None without an epoch, or at its end.
    pub fn prove(&mut self, payload: &[u8]) -> Option<Proof> {
        let count = self.count.checked_add(1)?;
        let text = text(Purpose::Frame, self.id, self.epoch?, count, payload);
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

    /// Epochs that are left, the offered one included.
    #[must_use]
    pub const fn left(&self) -> u32 {
        self.left
    }

    /// Answers a sender's question; None when the start's epochs are used up.
    #[must_use]
    pub fn offer(&self, mac: &impl Mac, question: u32) -> Option<Offer> {
        let text = text(Purpose::Offer, self.id, self.offered, question, &[]);
        (self.left > 0).then(|| Offer {
            epoch: self.offered,
            tag: cut(mac.tag(&text), TAG),
        })
    }

    /// Whether a frame is the sender's, and fresh: newer than every one before. At most 2^`BITS` - 2 frames may be lost between two;
    /// a sender that is refused after more of them asks anew.
    pub fn accept(&mut self, mac: &impl Mac, payload: &[u8], proof: &Proof) -> bool {
        let offered = (self.left > 0).then_some((self.offered, 0));
        let (mut nexts, mut texts) = (Vec::<_, 2>::new(), Vec::<_, 2>::new());
        for (epoch, last) in self.used.into_iter().chain(offered) {
            if let Some((count, text)) = self.next(epoch, last, payload, proof) {
                // A place for each epoch.
                let _ = (nexts.push((epoch, count)), texts.push(text));
            }
        }
        let found = mac.find(&texts, |tag| cut(tag, TAG) == proof.tag);
        let Some((epoch, count)) = found.and_then(|place| nexts.get(place).copied()) else {
            return false;
        };
        if self.used.is_none_or(|(used, _)| used != epoch) {
            (self.offered, self.left) = (self.offered.wrapping_add(1), self.left.saturating_sub(1));
        }
        self.used = Some((epoch, count));
        true
    }

    /// The count that a frame of an epoch has behind the last one, and what its MAC is over.
    fn next<'a>(&self, epoch: u32, last: u32, payload: &'a [u8], proof: &Proof) -> Option<(u32, Text<'a>)> {
        let ahead = low(u32::from(proof.count).wrapping_sub(last), BITS);
        // The last one again, or so many were lost that it cannot be told.
        let count = last.checked_add(u32::from(ahead)).filter(|_| ahead > 0)?;
        let is_whole = low(count, BITS) == proof.count;
        is_whole.then(|| (count, text(Purpose::Frame, self.id, epoch, count, payload)))
    }
}
