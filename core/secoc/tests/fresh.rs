use std::collections::HashSet;

use haptic_secoc::fresh::{Cmac, Mac, Offer, Proof, Receiver, Sender, SipHash, Text};
use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};

use crate::KEY;

const ID: u16 = 0x130;

/// RFC 4493: the first four bytes of its examples 2 to 4. SipHash-2-4: the first word of the reference's vector for its key, of a
/// message of 15 bytes (Aumasson and Bernstein, appendix A).
#[test]
fn both_macs_are_those_of_their_papers() {
    static MESSAGE: [u8; 64] = [
        0x6B, 0xC1, 0xBE, 0xE2, 0x2E, 0x40, 0x9F, 0x96, 0xE9, 0x3D, 0x7E, 0x11, 0x73, 0x93, 0x17, 0x2A, 0xAE,
        0x2D, 0x8A, 0x57, 0x1E, 0x03, 0xAC, 0x9C, 0x9E, 0xB7, 0x6F, 0xAC, 0x45, 0xAF, 0x8E, 0x51, 0x30, 0xC8,
        0x1C, 0x46, 0xA3, 0x5C, 0xE4, 0x11, 0xE5, 0xFB, 0xC1, 0x19, 0x1A, 0x0A, 0x52, 0xEF, 0xF6, 0x9F, 0x24,
        0x45, 0xDF, 0x4F, 0x9B, 0x17, 0xAD, 0x2B, 0x41, 0x7B, 0xE6, 0x6C, 0x37, 0x10,
    ];
    let cmac = Cmac::new(&KEY);
    let text = |message: &'static [u8]| Text {
        head: *message.first_chunk().unwrap(),
        payload: &message[11..],
    };
    for (length, tag) in [(16, 0x070A_16B4), (40, 0xDFA6_6747), (64, 0x51F0_BEBF)] {
        let text = text(&MESSAGE[..length]);
        assert_eq!(cmac.tag(&text), tag, "{length} bytes");
        // Two at a time, on either place.
        let mut other = text;
        other.head[0] ^= 1;
        assert_eq!(cmac.find(&[other, text], |found| found == tag), Some(1));
        assert_eq!(cmac.find(&[text, other], |found| found == tag), Some(0));
    }
    static COUNTING: [u8; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];
    // 0xa129ca6149be45e5, little-endian.
    assert_eq!(SipHash(COUNTING).tag(&text(&COUNTING[..15])), 0xE545_BE49);
}

/// Two ends, and what an eavesdropper has.
struct Bus<M, const TAG: u32> {
    mac: M,
    sender: Sender<M, 8, TAG>,
    receiver: Receiver<8, TAG>,
    starts: u32,
    random: SmallRng,
    /// Payloads count up, so that each was sent once.
    sent: u64,
    taken: HashSet<u64>,
    /// Frames that were taken twice, or that nobody sent.
    false_ones: u64,
    frames: Vec<(u64, Proof)>,
    questions: Vec<u32>,
    offers: Vec<Offer>,
}

impl<M: Mac + Clone, const TAG: u32> Bus<M, TAG> {
    fn new(mac: M, seed: u64) -> Self {
        Self {
            sender: Sender::new(mac.clone(), ID),
            receiver: Receiver::new(ID, 1),
            starts: 1,
            mac,
            random: SmallRng::seed_from_u64(seed),
            sent: 0,
            taken: HashSet::new(),
            false_ones: 0,
            frames: Vec::new(),
            questions: Vec::new(),
            offers: Vec::new(),
        }
    }

    /// A frame comes: whether it is taken.
    fn come(&mut self, payload: u64, proof: &Proof) -> bool {
        let is_taken = self.receiver.accept(&self.mac, &payload.to_le_bytes(), proof);
        if is_taken {
            let is_true = payload <= self.sent && self.taken.insert(payload);
            self.false_ones += u64::from(!is_true);
        }
        is_taken
    }

    fn send(&mut self) -> Option<(u64, Proof)> {
        self.sent += 1;
        let proof = self.sender.prove(&self.sent.to_le_bytes())?;
        self.frames.push((self.sent, proof));
        Some((self.sent, proof))
    }

    fn synchronise(&mut self) {
        let question = self.sender.ask(self.random.random());
        self.questions.push(question);
        let offer = self.receiver.offer(&self.mac, question).unwrap();
        self.offers.push(offer);
        self.sender.take(&offer);
    }

    /// Whoever listened says old things, and some of his own.
    fn attack(&mut self) {
        for _ in 0..2 {
            if !self.frames.is_empty() {
                // Of late, or of long ago.
                let back = if self.random.random_bool(0.5) {
                    600
                } else {
                    usize::MAX
                };
                let from = self.frames.len().saturating_sub(back);
                let (payload, proof) = self.frames[self.random.random_range(from..self.frames.len())];
                self.come(payload, &proof);
                // A proof of another payload's.
                self.come(payload + 1_000_000_000, &proof);
            }
        }
        if let Some(question) = self
            .questions
            .get(self.random.random_range(0..=self.questions.len()))
        {
            // What he hears then is kept for later.
            self.offers.extend(self.receiver.offer(&self.mac, *question));
        }
        if let Some(offer) = self.offers.get(self.random.random_range(0..=self.offers.len())) {
            self.sender.take(&offer.clone());
        }
        let forged = Offer {
            epoch: self.random.random_range(4096..20_000),
            tag: self.random.random(),
        };
        self.sender.take(&forged);
    }
}

/// Frames of which a tenth is lost, some come late, old ones are repeated, and both sides reset now and then; communication is back
/// with the first frame behind an offer. How many were taken twice, or were nobody's.
fn drive<M: Mac + Clone, const TAG: u32>(mac: M, frames: u64) -> u64 {
    let mut bus = Bus::<M, TAG>::new(mac, 47);
    bus.synchronise();
    let (mut late, mut lost, mut resets, mut refused) = (None, 0_u64, 0_u64, 0);
    while bus.sent < frames {
        match bus.random.random_range(0..2000) {
            0 => {
                // What it counted is gone, and nothing is on its way to it.
                bus.sender = Sender::new(bus.mac.clone(), ID);
                bus.synchronise();
                resets += 1;
                let (payload, proof) = bus.send().unwrap();
                assert!(bus.come(payload, &proof), "back with the first frame");
            }
            1 => {
                bus.starts += 1;
                bus.receiver = Receiver::new(ID, bus.starts);
                assert!(bus.receiver.is_unsynchronised());
                let (payload, proof) = bus.send().unwrap();
                assert!(!bus.come(payload, &proof), "of an old epoch");
                bus.synchronise();
                resets += 1;
                let (payload, proof) = bus.send().unwrap();
                assert!(bus.come(payload, &proof), "back with the next frame");
            }
            _ => {}
        }
        let (payload, proof) = bus.send().unwrap();
        match bus.random.random_range(0..100) {
            0..10 => lost += 1,
            10..15 => late = Some((payload, proof)),
            _ => {
                if !bus.come(payload, &proof) {
                    refused += 1;
                    bus.synchronise();
                }
            }
        }
        if let Some((payload, proof)) = late.take_if(|(late, _)| *late != payload) {
            // It is behind one that was taken, or it is not.
            bus.come(payload, &proof);
        }
        bus.attack();
    }
    let taken = bus.taken.len() as u64;
    assert!(taken > frames * 8 / 10, "{taken} of {frames}");
    assert!(
        resets > frames / 2000 && lost > frames / 20,
        "{resets} resets, {lost} lost"
    );
    // Lost and late frames are no reason; a false one is, which carries the count or the epoch on.
    assert!(refused <= bus.false_ones, "{refused} refused");
    bus.false_ones
}

#[test]
fn of_a_million_frames_none_is_taken_twice() {
    assert_eq!(drive::<_, 32>(SipHash(KEY), 1_000_000), 0);
}

/// A tag of 24 bits lets one false frame of 16.7 million pass in each of two epochs. Of four million 0.5 are expected, and more than
/// four with a probability of 0.0002.
#[test]
fn a_short_tag_lets_as_many_pass_as_chance_does() {
    assert!(drive::<_, 24>(SipHash(KEY), 1_000_000) <= 4);
}

#[test]
fn aes_does_it_too() {
    assert_eq!(drive::<_, 32>(Cmac::new(&KEY), 20_000), 0);
}

#[test]
fn a_proof_is_of_its_identifier_payload_count_and_key() {
    let mac = Cmac::new(&KEY);
    let pair = || {
        let mut sender = Sender::<_, 4, 24>::new(Cmac::new(&KEY), ID);
        let receiver = Receiver::<4, 24>::new(ID, 7);
        let question = sender.ask(3);
        sender.take(&receiver.offer(&mac, question).unwrap());
        (sender, receiver)
    };
    let (mut sender, mut receiver) = pair();
    let proof = sender.prove(b"payload").unwrap();
    let mut other = Receiver::<4, 24>::new(ID + 1, 7);
    assert!(!other.accept(&mac, b"payload", &proof), "another identifier");
    let mut other = Receiver::<4, 24>::new(ID, 7);
    assert!(
        !other.accept(&Cmac::new(&[0; 16]), b"payload", &proof),
        "another key"
    );
    assert!(!receiver.accept(&mac, b"Payload", &proof) && !receiver.accept(&mac, b"payloa", &proof));
    for bit in 0..24 {
        let tag = proof.tag ^ 1 << bit;
        assert!(
            !receiver.accept(&mac, b"payload", &Proof { tag, ..proof }),
            "bit {bit}"
        );
    }
    for count in (0..=255).filter(|count| *count != proof.count) {
        assert!(
            !receiver.accept(&mac, b"payload", &Proof { count, ..proof }),
            "count {count}"
        );
    }
    assert!(receiver.accept(&mac, b"payload", &proof) && !receiver.accept(&mac, b"payload", &proof));
    // Fourteen may be lost of four bits; fifteen are one too many.
    for (lost, is_taken) in [(14, true), (15, false)] {
        let (mut sender, mut receiver) = pair();
        assert!(receiver.accept(&mac, b"", &sender.prove(b"").unwrap()));
        for _ in 0..lost {
            assert!(sender.prove(b"").is_some());
        }
        assert_eq!(
            receiver.accept(&mac, b"", &sender.prove(b"").unwrap()),
            is_taken,
            "{lost} lost"
        );
    }
    assert_eq!(
        Sender::<_, 4, 24>::new(Cmac::new(&KEY), ID).prove(b""),
        None,
        "no epoch"
    );
}

/// An offer answers the last question of its sender, once.
#[test]
fn an_old_offer_is_none() {
    let mac = Cmac::new(&KEY);
    let (mut sender, receiver) = (
        Sender::<_, 8, 24>::new(Cmac::new(&KEY), ID),
        Receiver::<8, 24>::new(ID, 1),
    );
    let question = sender.ask(1);
    let old = receiver.offer(&mac, question).unwrap();
    sender.ask(2);
    sender.take(&old);
    assert_eq!(sender.prove(b""), None);
    sender.take(&receiver.offer(&mac, 2).unwrap());
    let first = sender.prove(b"").unwrap();
    // Taken again it would count from the beginning.
    sender.take(&receiver.offer(&mac, 2).unwrap());
    assert_ne!(sender.prove(b"").unwrap(), first);
}
