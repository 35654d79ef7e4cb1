//! Both sides on a bus that loses, swaps and repeats frames, and resets of either.
//!
//! Above 500 lines because the tests share one bus with both sides on it: split, it would be there twice.

use std::collections::HashSet;

use haptic_core::bus::Frame;
use haptic_core::bus::e2e::ReceiverState;
use haptic_core::bus::messages::{Column, LanePreview, Message, ParameterUnlock, Request, Vehicle};
use haptic_core::quantity::{Instant, Micros, Ratio};
use haptic_secoc::Keys;
use haptic_secoc::fresh::Algorithm;
use haptic_secoc::messages::{PROVEN, Place, Refusal, STATUS_ID, State, Status};
use haptic_secoc::prover::Prover;
use haptic_secoc::verifier::{Credentials, Passed, Verifier};
use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};

const OFFER: u16 = 0x358;

fn keyed(algorithm: Algorithm, start: u32) -> Verifier {
    Verifier::new(Credentials::Keys(Keys::bench(algorithm), Some(start)))
}

/// What passes when a frame comes, worked out at once.
fn come(verifier: &mut Verifier, frame: &Frame, now: Instant) -> Option<Passed> {
    let passed = verifier.receive(frame, now);
    passed.or_else(|| verifier.verified())
}

/// A number as the payload that is authenticated of a message, so that each frame is sent once.
fn numbered(id: u16, number: u32) -> Frame {
    let mut data = [0; 8];
    data[1..4].copy_from_slice(&number.to_le_bytes()[..3]);
    Frame::full(id, data)
}

fn number(frame: &Frame) -> (u16, u32) {
    let [_, a, b, c, ..] = frame.full_data().unwrap();
    (frame.id(), u32::from_le_bytes([a, b, c, 0]))
}

/// The ECU, both senders in one, and all that was ever on the bus.
struct Bus {
    verifier: Verifier,
    prover: Prover,
    random: SmallRng,
    ms: u32,
    starts: u32,
    heard: Vec<Frame>,
    taken: HashSet<(u16, u32)>,
    sent: u32,
    false_ones: u32,
}

impl Bus {
    fn new(algorithm: Algorithm) -> Self {
        Self {
            verifier: keyed(algorithm, 1),
            prover: Prover::new(&Keys::bench(algorithm)),
            random: SmallRng::seed_from_u64(7),
            ms: 0,
            starts: 1,
            heard: Vec::new(),
            taken: HashSet::new(),
            sent: 0,
            false_ones: 0,
        }
    }

    fn come(&mut self, frame: &Frame) -> bool {
        let now = Instant::from_us(self.ms.wrapping_mul(1000));
        let mut has_passed = false;
        assert_eq!(self.verifier.receive(frame, now), None, "without a proof");
        while let Some((passed, _)) = self.verifier.verified() {
            let key = number(&passed);
            self.false_ones += u32::from(key.1 > self.sent || !self.taken.insert(key));
            has_passed = true;
        }
        has_passed
    }

    /// A step of the ECU, and what its senders make of what it says.
    fn step(&mut self) {
        self.ms += 1;
        if let Some(frame) = self.verifier.step(self.ms) {
            let random = &mut self.random;
            for question in self.prover.hear(&frame, || random.random()) {
                self.come(&question);
                self.heard.push(question);
            }
        }
    }

    fn send(&mut self, id: u16) -> Vec<Frame> {
        self.sent += 1;
        let frames = self.prover.prove(&numbered(id, self.sent)).to_vec();
        self.heard.extend(&frames);
        frames
    }

    /// Steps until a message passes; how many.
    fn resume(&mut self, id: u16) -> u32 {
        for steps in 1..1000 {
            self.step();
            let frames = self.send(id);
            if frames
                .iter()
                .fold(false, |passed, frame| passed | self.come(frame))
            {
                return steps;
            }
        }
        panic!("nothing passes");
    }
}

/// One of ten frames is lost, one of a hundred comes after the next, an eavesdropper repeats two old ones for each, in pairs or apart,
/// and every thousandth time one side starts anew. `frames` counts the true ones, proofs included.
fn drive(algorithm: Algorithm, frames: usize) {
    let mut bus = Bus::new(algorithm);
    let ids = [LanePreview::ID, Vehicle::ID, Request::ID];
    let (mut count, mut resets, mut longest, mut lost) = (0, 0, 0, 0);
    let mut late: Vec<Frame> = Vec::new();
    for id in ids {
        bus.resume(id);
    }
    while count < frames {
        let id = ids[bus.sent as usize % 3];
        match bus.random.random_range(0..2000) {
            0 => bus.prover = Prover::new(&Keys::bench(algorithm)),
            1 => {
                bus.starts += 1;
                bus.verifier = keyed(algorithm, bus.starts);
            }
            _ => {
                let sent = bus.send(id);
                count += sent.len();
                let waiting = std::mem::take(&mut late);
                for frame in sent {
                    match bus.random.random_range(0..100) {
                        0..10 => lost += 1,
                        10 => late.push(frame),
                        _ => drop(bus.come(&frame)),
                    }
                }
                for frame in waiting {
                    bus.come(&frame);
                }
                let last = bus.heard.len() - 1;
                let recent = bus.random.random_range(last.saturating_sub(60)..last);
                let old = bus.random.random_range(0..last);
                for at in [recent, recent + 1, old, old + 1] {
                    bus.come(&bus.heard[at].clone());
                }
                bus.step();
                continue;
            }
        }
        resets += 1;
        for id in ids {
            longest = longest.max(bus.resume(id));
        }
    }
    assert_eq!(bus.false_ones, 0, "taken twice, or nobody's");
    let taken = bus.taken.len();
    println!(
        "{count} frames, {taken} messages taken, {lost} frames lost, {resets} resets, back after {longest} ms at most"
    );
    assert!(
        resets > frames / 4000 && lost > frames / 20,
        "{resets} resets, {lost} lost"
    );
    // A proof lost, and its frame is; then an eavesdropper's frame takes the place of a true one that waits for its proof.
    assert!(taken > frames / 3, "{taken} of {frames}");
    // A status says that the ECU waits, and the offers of the messages follow, 50 ms apart.
    assert!(longest <= 350, "{longest} ms");
}

#[test]
fn of_a_million_frames_none_is_taken_twice() {
    drive(Algorithm::SipHash, 1_000_000);
}

#[test]
fn aes_does_it_too() {
    drive(Algorithm::AesCmac, 20_000);
}

/// The counts of every message and reason, from statuses alone.
fn refused(verifier: &mut Verifier) -> Vec<(u16, Refusal, u16)> {
    let statuses = (0..40).map(|turn| verifier.step(turn * 100 + 60).unwrap());
    let mut lines: Vec<_> = statuses
        .filter_map(|frame| Status::decode(&frame).unwrap().refused)
        .map(|line| (line.id, line.reason, line.count))
        .collect();
    lines.sort_by_key(|(id, reason, _)| (*id, *reason as u8));
    lines.dedup();
    lines
}

/// A verifier and a prover that have an epoch for everything.
fn pair() -> (Verifier, Prover) {
    let (mut verifier, mut prover) = (
        keyed(Algorithm::AesCmac, 9),
        Prover::new(&Keys::bench(Algorithm::AesCmac)),
    );
    for proven in PROVEN {
        prover.prove(&numbered(proven.info.id, 0));
    }
    let mut random = 0;
    for step in 0..400 {
        if let Some(frame) = verifier.step(step) {
            for question in prover.hear(&frame, || {
                random += 1;
                random
            }) {
                assert_eq!(verifier.receive(&question, Instant::from_us(0)), None);
            }
        }
        verifier.step(0);
    }
    (verifier, prover)
}

#[test]
fn a_frame_passes_as_the_bus_has_it_and_counts_as_heard_when_it_came() {
    let (mut verifier, mut prover) = pair();
    let vehicle = Vehicle::default().encode(3);
    let [frame, proof] = prover.prove(&vehicle)[..] else {
        panic!("two frames")
    };
    assert_eq!((frame, proof.id(), proof.data().len()), (vehicle, 0x121, 4));
    let came = Instant::from_us(70);
    assert_eq!(come(&mut verifier, &frame, came), None);
    let passed = come(&mut verifier, &proof, came.after(Micros::from_us(5000)));
    assert_eq!(passed, Some((vehicle, came)));
    // A microsecond later it is too late.
    let [frame, proof] = prover.prove(&vehicle)[..] else {
        panic!("two frames")
    };
    assert_eq!(come(&mut verifier, &frame, came), None);
    assert_eq!(
        come(&mut verifier, &proof, came.after(Micros::from_us(5001))),
        None
    );
    // A request has its proof within, its CRC fits, and its signals are what they were.
    let request = Request {
        engage: true,
        probe: true,
        authority: Ratio::ONE,
    };
    let [frame] = prover.prove(&request.encode(5))[..] else {
        panic!("one frame")
    };
    assert_eq!(come(&mut verifier, &frame, came), Some((frame, came)));
    assert_eq!(
        Request::decode(&mut { ReceiverState::TRUSTED }, &frame),
        Ok(request)
    );
    assert_eq!(come(&mut verifier, &frame, came), None, "twice");
    // What is not in the list is none of its business.
    let column = Column::default().encode(0);
    assert_eq!(come(&mut verifier, &column, came), Some((column, came)));
    assert_eq!(prover.prove(&column)[..], [column]);
    assert_eq!(
        refused(&mut verifier),
        [(0x120, Refusal::NoFrame, 1), (0x130, Refusal::Proof, 1)]
    );
}

/// Frames that pass every check of core, without a proof, with that of another frame, and cut.
#[test]
fn what_is_not_proven_is_refused_and_counted() {
    let (mut verifier, mut prover) = pair();
    let now = Instant::from_us(0);
    for proven in PROVEN {
        let id = proven.info.id;
        let frames = prover.prove(&numbered(id, 1));
        match proven.place {
            Place::Within => {
                assert_eq!(come(&mut verifier, &numbered(id, 2), now), None);
                for bit in 8..64 {
                    let mut data = frames[0].full_data().unwrap();
                    data[bit / 8] ^= 1 << (bit % 8);
                    assert_eq!(
                        come(&mut verifier, &Frame::full(id, data), now),
                        None,
                        "bit {bit}"
                    );
                    verifier.step(0);
                }
                assert_eq!(come(&mut verifier, &Frame::new(id, &[0; 7]).unwrap(), now), None);
            }
            Place::Behind(behind) => {
                for bit in 8..64 {
                    let mut data = frames[0].full_data().unwrap();
                    data[bit / 8] ^= 1 << (bit % 8);
                    assert_eq!(come(&mut verifier, &Frame::full(id, data), now), None);
                    assert_eq!(come(&mut verifier, &frames[1], now), None, "bit {bit}");
                    verifier.step(0);
                }
                assert_eq!(come(&mut verifier, &frames[0], now), None);
                assert_eq!(come(&mut verifier, &frames[0], now), None);
                assert_eq!(
                    come(&mut verifier, &Frame::new(behind, &[0; 3]).unwrap(), now),
                    None
                );
                assert_eq!(come(&mut verifier, &frames[1], now), None, "nothing waits");
            }
        }
    }
    let mut expected = Vec::new();
    for proven in PROVEN {
        let id = proven.info.id;
        expected.extend(match proven.place {
            Place::Within => vec![(id, Refusal::Proof, 57), (id, Refusal::Length, 1)],
            Place::Behind(_) => vec![
                (id, Refusal::Proof, 56),
                (id, Refusal::Unproven, 1),
                (id, Refusal::NoFrame, 1),
                (id, Refusal::Length, 1),
            ],
        });
    }
    assert_eq!(refused(&mut verifier), expected);
}

#[test]
fn a_sender_cannot_speak_for_another() {
    let (mut verifier, mut prover) = pair();
    let now = Instant::from_us(0);
    let [frame, proof] = prover.prove(&numbered(LanePreview::ID, 1))[..] else {
        panic!("two frames")
    };
    let as_vehicle = Frame::full(Vehicle::ID, frame.full_data().unwrap());
    assert_eq!(come(&mut verifier, &as_vehicle, now), None);
    let proof_as_vehicle = Frame::new(0x121, proof.data()).unwrap();
    assert_eq!(come(&mut verifier, &proof_as_vehicle, now), None);
    // The camera's key under the host's identifiers.
    let mut keys = Keys::bench(Algorithm::AesCmac);
    keys.host = keys.camera;
    let mut camera = Prover::new(&keys);
    for step in 0..400 {
        camera.prove(&numbered(Vehicle::ID, 2));
        if let Some(frame) = verifier.step(step) {
            for question in camera.hear(&frame, || step) {
                come(&mut verifier, &question, now);
            }
        }
        for frame in camera.prove(&numbered(Vehicle::ID, 3)) {
            assert_eq!(come(&mut verifier, &frame, now), None);
        }
    }
}

#[test]
fn a_flood_takes_no_more_macs_than_a_step_may_and_the_rest_waits() {
    let (mut verifier, mut prover) = pair();
    let now = Instant::from_us(0);
    for _ in 0..5 {
        assert_eq!(verifier.receive(&numbered(Request::ID, 5), now), None);
    }
    let [frame] = prover.prove(&numbered(Request::ID, 6))[..] else {
        panic!("one frame")
    };
    for _ in 0..2 {
        assert_eq!(come(&mut verifier, &frame, now), None, "the sixth and seventh");
    }
    verifier.step(0);
    assert_eq!(verifier.verified(), Some((frame, now)));
    assert_eq!(verifier.verified(), None, "twice");
    verifier.step(0);
    for _ in 0..9 {
        assert_eq!(verifier.receive(&numbered(Request::ID, 7), now), None);
    }
    for _ in 0..2 {
        assert_eq!(verifier.verified(), None);
        verifier.step(0);
    }
    assert_eq!(
        refused(&mut verifier),
        [(0x130, Refusal::Proof, 14), (0x130, Refusal::TooMany, 1)]
    );
}

/// A bus that is never silent for a bit: false requests, and false lanes with a false proof, in every gap that the true senders leave. The
/// ECU verifies behind its steps alone, as if it did nothing between them.
#[test]
fn on_a_full_bus_a_true_frame_waits_a_millisecond_at_most() {
    let (mut verifier, mut prover) = pair();
    let mut random = SmallRng::seed_from_u64(8);
    // Bits of a frame without a stuffed one, and the gap behind it, of 2 us each.
    let takes = |frame: &Frame| 2 * (47 + 8 * frame.data().len() as u32);
    let (mut us, mut steps, mut number) = (0, 0, 0);
    let (mut due, mut came) = (Vec::new(), Vec::new());
    let (mut passed, mut longest, mut false_ones) = (0, 0, 0);
    while steps < 30_000 {
        let turn = random.random_range(0..8);
        let false_frames = [
            Frame::full(LanePreview::ID, random.random()),
            Frame::new(0x101, &random.random::<[u8; 4]>()).unwrap(),
            Frame::full(Request::ID, random.random()),
        ];
        // A true one as soon as it can, or a little later.
        let next: Vec<Frame> = if due.is_empty() || turn == 0 {
            let lanes = if turn < 4 { 0..2 } else { 2..3 };
            false_ones += 1;
            false_frames[lanes].to_vec()
        } else {
            let frame = due.remove(0);
            let frames = prover.prove(&frame).to_vec();
            came.push((frames[0], us + takes(&frames[0])));
            frames
        };
        for frame in next {
            us += takes(&frame);
            // Steps that end before the frame does.
            while us > (steps + 1) * 1000 {
                steps += 1;
                while let Some((frame, at)) = verifier.verified() {
                    let place = came.iter().position(|(sent, _)| *sent == frame).unwrap();
                    let (_, began) = came.remove(place);
                    assert_eq!(at, Instant::from_us(began));
                    longest = longest.max(steps * 1000 - began);
                    passed += 1;
                }
                verifier.step(0);
                for (period, id) in [(8, LanePreview::ID), (10, Vehicle::ID), (10, Request::ID)] {
                    if steps % period == 0 {
                        number += 1;
                        due.push(numbered(id, number));
                    }
                }
            }
            assert_eq!(verifier.receive(&frame, Instant::from_us(us)), None);
        }
    }
    println!("{passed} true frames, {false_ones} false ones, {longest} us at most");
    assert!(passed > 9700 && false_ones > 85_000, "{passed}, {false_ones}");
    assert!(came.len() + due.len() <= 3, "{} lost", came.len());
    // A proof comes behind its frame.
    assert!(longest <= 1000 + 158, "{longest} us");
    let reasons = refused(&mut verifier);
    assert!(
        reasons.iter().all(|(_, reason, _)| *reason != Refusal::TooMany),
        "{reasons:?}"
    );
}

#[test]
fn without_keys_the_ecu_says_so_and_engages_on_the_bench_alone() {
    let now = Instant::from_us(0);
    let keys = Keys::bench(Algorithm::SipHash);
    let states = [
        (Credentials::Bench, State::Bench, true, true),
        (Credentials::None, State::NoKeys, false, true),
        (Credentials::Keys(keys, None), State::NoStart, false, false),
        // Epochs would come again.
        (
            Credentials::Keys(keys, Some(1 << 20)),
            State::NoStart,
            false,
            false,
        ),
        (Credentials::Keys(keys, Some(0)), State::SipHash, false, false),
    ];
    for (credentials, state, engages, takes) in states {
        let mut verifier = Verifier::new(credentials);
        let request = numbered(Request::ID, 1);
        assert_eq!(
            come(&mut verifier, &request, now),
            engages.then_some((request, now))
        );
        let unlock = numbered(ParameterUnlock::ID, 1);
        assert_eq!(come(&mut verifier, &unlock, now), takes.then_some((unlock, now)));
        let status = Status::decode(&verifier.step(60).unwrap()).unwrap();
        assert_eq!(status.state, state);
        assert_eq!(status.waiting, [state == State::SipHash; 5]);
    }
}

#[test]
fn somebody_who_speaks_as_the_ecu_is_reported() {
    let (mut verifier, _) = pair();
    for id in [OFFER, STATUS_ID] {
        assert_eq!(
            come(&mut verifier, &Frame::full(id, [0; 8]), Instant::from_us(0)),
            None
        );
    }
    assert_eq!(refused(&mut verifier), [(0x100, Refusal::Foreign, 2)]);
}

/// Inputs of a test with noise: `usual`, or HAPTIC_FUZZ_INPUTS of them.
fn inputs(usual: u64) -> u64 {
    std::env::var("HAPTIC_FUZZ_INPUTS").map_or(usual, |text| {
        text.parse().expect("HAPTIC_FUZZ_INPUTS is a number")
    })
}

/// Frames of any identifier around those of the list, any length and any bytes, at any time, among them true ones and what was true once;
/// offers and statuses of anybody's to the senders. What passes was sent by its sender, and no more than once.
#[test]
fn noise_passes_nothing_that_is_not_true_and_stops_nobody() {
    for algorithm in [Algorithm::SipHash, Algorithm::AesCmac] {
        let mut bus = Bus::new(algorithm);
        let ids: Vec<u16> = PROVEN
            .iter()
            .flat_map(|proven| {
                let behind = match proven.place {
                    Place::Behind(id) => id,
                    Place::Within => proven.info.id,
                };
                [proven.info.id, behind, proven.question]
            })
            .chain([OFFER, STATUS_ID])
            .collect();
        for _ in 0..inputs(300_000) {
            let random = &mut bus.random;
            let length = random.random_range(0..=8);
            let bytes: [u8; 8] = random.random();
            let id = ids[random.random_range(0..ids.len())];
            let noise = Frame::new(id, &bytes[..length]).unwrap();
            match random.random_range(0..20) {
                // True frames, of any message.
                0..4 => {
                    let id = PROVEN[random.random_range(0..PROVEN.len())].info.id;
                    for frame in bus.send(id) {
                        bus.come(&frame);
                    }
                }
                4..8 => bus.step(),
                8 if !bus.heard.is_empty() => {
                    let old = bus.heard[random.random_range(0..bus.heard.len())];
                    bus.come(&old);
                }
                9 => drop(bus.prover.hear(&noise, || bytes[0].into())),
                10 => bus.ms = bus.ms.wrapping_add(u32::from(bytes[0]) << (bytes[1] % 24)),
                _ => drop(bus.come(&noise)),
            }
        }
        assert_eq!(bus.false_ones, 0, "{algorithm:?}: taken twice, or nobody's");
        println!("{algorithm:?}: {} of {} taken", bus.taken.len(), bus.sent);
        for proven in PROVEN {
            bus.resume(proven.info.id);
        }
    }
}

/// The ECU and a request's true sender, with somebody who can keep its frames from the bus and has false ones refused in every step.
struct Besieged {
    verifier: Verifier,
    prover: Prover,
    random: SmallRng,
    ms: u32,
    epochs: HashSet<u32>,
}

impl Besieged {
    fn new() -> Self {
        Self {
            verifier: keyed(Algorithm::SipHash, 1),
            prover: Prover::new(&Keys::bench(Algorithm::SipHash)),
            random: SmallRng::seed_from_u64(11),
            ms: 0,
            epochs: HashSet::new(),
        }
    }

    /// A step: whether the true sender's frame, due in every tenth, passed, and whether a status had it wait.
    fn step(&mut self, is_kept_away: bool) -> (bool, bool) {
        self.ms += 1;
        let (now, mut waits) = (Instant::from_us(self.ms.wrapping_mul(1000)), false);
        if let Some(frame) = self.verifier.step(self.ms) {
            waits = Status::decode(&frame).is_some_and(|status| status.waiting[2]);
            if frame.id() == OFFER {
                let [.., a, b, c, d] = frame.full_data().unwrap();
                self.epochs.insert(u32::from_le_bytes([a, b, c, d]));
            }
            let random = &mut self.random;
            for question in self.prover.hear(&frame, || random.random()) {
                self.verifier.receive(&question, now);
            }
        }
        self.verifier.receive(&numbered(Request::ID, 0), now);
        if self.ms.is_multiple_of(10) {
            let [frame] = self.prover.prove(&numbered(Request::ID, self.ms))[..] else {
                panic!("one frame")
            };
            if !is_kept_away {
                self.verifier.receive(&frame, now);
            }
        }
        let passed = std::iter::from_fn(|| self.verifier.verified()).count();
        (passed > 0, waits)
    }

    /// Milliseconds until a true frame passes.
    fn resume(&mut self) -> u32 {
        (1..20_000).find(|_| self.step(false).0).expect("a frame passes")
    }
}

#[test]
fn refused_frames_beside_a_true_sender_use_up_no_epoch() {
    let mut bus = Besieged::new();
    bus.resume();
    bus.epochs.clear();
    let steps: Vec<_> = (0..60_000).map(|_| bus.step(false)).collect();
    assert!(steps.iter().all(|(_, waits)| !waits) && bus.epochs.is_empty());
    // Five frames are verified in a step, and of two the true one is among them.
    assert_eq!(steps.iter().filter(|(passed, _)| *passed).count(), 6000);
}

/// Somebody lets the true sender pass just when it has a new epoch, and keeps it away until it is told to ask for another.
#[test]
fn who_keeps_a_sender_away_again_and_again_uses_up_16_epochs_and_one_in_ten_seconds() {
    let mut bus = Besieged::new();
    let mut used = 0;
    for _ in 0..600_000 {
        let is_kept_away = bus.epochs.len() == used;
        if bus.step(is_kept_away).0 {
            used = bus.epochs.len();
        }
    }
    // 16 at once, and 60 in ten minutes.
    assert!((74..=76).contains(&used), "{used} epochs");
    // A sender that starts anew then is heard within ten seconds all the same.
    let mut longest = 0;
    for _ in 0..20 {
        bus.prover = Prover::new(&Keys::bench(Algorithm::SipHash));
        longest = longest.max(bus.resume());
    }
    assert!((5_000..=10_350).contains(&longest), "{longest} ms");
}
