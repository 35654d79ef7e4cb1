//! The attacks of `docs/security.md` on an ECU whose frames are proven: its answers are to the bit those of a drive in which nobody
//! attacks. Without proofs each of these attacks changes them.

use haptic_core::bus::Frame;
use haptic_core::bus::messages::{Column, LanePreview, Message, Request, Vehicle};
use haptic_core::controller::config::Setup;
use haptic_core::ecu::{Boot, Ecu};
use haptic_core::quantity::{Instant, Metres, Micros, Radians, Ratio, Speed, Torque};
use haptic_core::safety::modes::Mode;
use haptic_secoc::Keys;
use haptic_secoc::fresh::Algorithm;
use haptic_secoc::prover::Prover;
use haptic_secoc::verifier::{Credentials, Verifier};
use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};

const STEPS: u32 = 8000;
/// From here on somebody attacks: first in Standby, then, from 2 s on, in Active.
const FROM: u32 = 1000;

/// What an attacker sends.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Attack {
    /// The next counter of each message, before its sender has it, with values of a whole vehicle of his own.
    Masquerade,
    /// Six requests between two true ones, their counters in order, for the opposite of what the host asks for.
    WalkedCounter,
    /// One request, which asks to be engaged.
    ForgedRequest,
    /// A lane that moves by 4 m within 160 ms.
    Lane,
    /// All that was said lately, again.
    Replay,
    /// False frames of every message, each with a proof by chance.
    Guess,
}

impl Attack {
    const ALL: [Self; 6] = [
        Self::Masquerade,
        Self::WalkedCounter,
        Self::ForgedRequest,
        Self::Lane,
        Self::Replay,
        Self::Guess,
    ];
}

fn lane(e_y: f64) -> LanePreview {
    LanePreview {
        e_y: Metres::from_m(e_y),
        e_theta: Radians::ZERO,
        age: Micros::from_us(0),
        valid: true,
    }
}

fn vehicle(speed: f64) -> Vehicle {
    Vehicle {
        speeds: [Speed::from_m_per_s(speed); 2],
        yaw_rate: None,
    }
}

fn request(engage: bool) -> Request {
    Request {
        engage,
        authority: Ratio::ONE,
        probe: false,
    }
}

/// What the true senders have to say in a millisecond; the column obeys.
fn drive(ms: u32, torque: Torque) -> Vec<Frame> {
    let count = |period: u32| (ms / period) as u8;
    let column = Column {
        motor_torque: torque,
        ..Column::default()
    };
    let all = [
        (8, lane(0.5).encode(count(8))),
        (2, column.encode(count(2))),
        (10, vehicle(20.0).encode(count(10))),
        (10, request((2000..7000).contains(&ms)).encode(count(10))),
    ];
    let due = all.into_iter().filter(|(period, _)| ms.is_multiple_of(*period));
    due.map(|(_, frame)| frame).collect()
}

/// What comes before and behind the true frames of a millisecond.
fn attack(attack: Attack, ms: u32, said: &[Frame], random: &mut SmallRng) -> [Vec<Frame>; 2] {
    let count = |period: u32| (ms / period) as u8;
    let (is_engaged, at) = ((2000..7000).contains(&ms), ms % 10);
    match attack {
        Attack::Masquerade if ms.is_multiple_of(40) => {
            let frames = [
                lane(-2.0).encode(count(8)),
                vehicle(40.0).encode(count(10)),
                request(!is_engaged).encode(count(10)),
            ];
            [frames.to_vec(), vec![]]
        }
        Attack::WalkedCounter if (1..7).contains(&at) => [
            vec![],
            vec![request(!is_engaged).encode(count(10).wrapping_add(at as u8))],
        ],
        Attack::ForgedRequest if ms == 1510 => [vec![request(true).encode(count(10))], vec![]],
        Attack::Lane if ms.is_multiple_of(8) => {
            let moved = f64::from(((ms - FROM) / 8).min(20)) * 0.175;
            [vec![lane(0.5 + moved).encode(count(8))], vec![]]
        }
        Attack::Replay if !said.is_empty() => {
            let from = said.len().saturating_sub(400);
            let at = random.random_range(from..said.len());
            [vec![], said[at..].iter().take(3).copied().collect()]
        }
        Attack::Guess if at == 5 => {
            let proof = |id: u16, random: &mut SmallRng| {
                let bytes: [u8; 4] = random.random();
                Frame::new(id, &bytes).unwrap()
            };
            let mut engage = request(!is_engaged)
                .encode(count(10).wrapping_add(1))
                .full_data()
                .unwrap();
            let room: [u8; 4] = random.random();
            engage[4..].copy_from_slice(&room);
            Request::PROTECTION.protect(&mut engage, count(10).wrapping_add(1));
            let frames = vec![
                lane(-3.0).encode(count(8).wrapping_add(1)),
                proof(0x101, random),
                vehicle(0.0).encode(count(10).wrapping_add(1)),
                proof(0x121, random),
                Frame::full(Request::ID, engage),
            ];
            [vec![], frames]
        }
        _ => [vec![], vec![]],
    }
}

/// The ECU's torque frames, and how many frames were refused.
fn run(what: Option<Attack>, algorithm: Option<Algorithm>) -> (Vec<Frame>, u32, Vec<Mode>) {
    let mut ecu = Ecu::new(Some(&Setup::PAPER), Boot::default(), Instant::from_us(0));
    let keys = Keys::bench(algorithm.unwrap_or(Algorithm::SipHash));
    let credentials = match algorithm {
        Some(_) => Credentials::Keys(keys, Some(5)),
        None => Credentials::Bench,
    };
    let (mut verifier, mut prover) = (Verifier::new(credentials), Prover::new(&keys));
    let mut random = SmallRng::seed_from_u64(3);
    let (mut said, mut guidance, mut modes) = (Vec::new(), Vec::new(), Vec::new());
    let (mut questions, mut torque) = (Vec::new(), Torque::ZERO);
    let mut before = 0;
    for ms in 0..STEPS {
        let now = Instant::from_us(ms * 1000);
        let [first, last] = match what.filter(|_| ms >= FROM) {
            Some(what) => attack(what, ms, &said, &mut random),
            None => Default::default(),
        };
        let mut own = std::mem::take(&mut questions);
        for frame in drive(ms, torque) {
            own.extend(prover.prove(&frame));
        }
        // The column is not proven: what it said is not said again, as it would be believed.
        said.extend(own.iter().filter(|frame| frame.id() != Column::ID));
        for frame in first.iter().chain(&own).chain(&last) {
            let passed = verifier.receive(frame, now);
            for (frame, at) in passed
                .into_iter()
                .chain(std::iter::from_fn(|| verifier.verified()))
            {
                let _ = ecu.receive(&frame, at);
            }
        }
        if ms == FROM {
            before = verifier.total();
        }
        let step = ecu.step(now);
        torque = step.command.torque;
        guidance.push(step.guidance);
        modes.push(step.command.mode);
        if let Some(frame) = verifier.step(ms) {
            questions.extend(prover.hear(&frame, || random.random()));
        }
    }
    (guidance, verifier.total() - before, modes)
}

#[test]
fn nobody_without_keys_changes_a_bit_of_what_the_ecu_says() {
    for algorithm in [Algorithm::SipHash, Algorithm::AesCmac] {
        let (quiet, refused, modes) = run(None, Some(algorithm));
        assert_eq!(refused, 0);
        let active = modes.iter().filter(|mode| **mode == Mode::Active).count();
        assert!(active > 4900, "{active} ms of guidance");
        for what in Attack::ALL {
            let (attacked, refused, _) = run(Some(what), Some(algorithm));
            println!("{what:?}: {refused} frames refused");
            let same = attacked.iter().zip(&quiet).take_while(|(a, b)| a == b).count();
            assert_eq!(same, quiet.len(), "{what:?} from step {same} on");
            assert!(refused >= 1, "{what:?}");
        }
    }
}

#[test]
fn without_proofs_each_of_the_attacks_does_something() {
    let (quiet, ..) = run(None, None);
    for what in Attack::ALL {
        let (attacked, refused, _) = run(Some(what), None);
        assert_eq!(refused, 0, "all frames pass");
        assert_ne!(attacked, quiet, "{what:?}");
    }
}

/// Somebody who sends a frame between each frame and its proof takes the input away, as a flood does, and no more: it is counted, and the
/// controller hands over.
#[test]
fn a_frame_before_each_proof_costs_the_input_and_nothing_else() {
    let keys = Keys::bench(Algorithm::SipHash);
    let (mut verifier, mut prover) = (
        Verifier::new(Credentials::Keys(keys, Some(1))),
        Prover::new(&keys),
    );
    let now = Instant::from_us(0);
    let mut number = 0;
    for ms in 0..400 {
        prover.prove(&lane(0.5).encode(0));
        if let Some(frame) = verifier.step(ms) {
            for question in prover.hear(&frame, || {
                number += 1;
                number
            }) {
                verifier.receive(&question, now);
            }
        }
    }
    let refused = verifier.total();
    for count in 0..100 {
        let [frame, proof] = prover.prove(&lane(0.5).encode(count))[..] else {
            panic!("two frames")
        };
        assert_eq!(verifier.receive(&frame, now), None);
        assert_eq!(verifier.receive(&lane(-4.0).encode(count), now), None);
        assert_eq!(verifier.receive(&proof, now), None);
        assert_eq!(verifier.verified(), None);
        verifier.step(0);
    }
    assert_eq!(verifier.total() - refused, 200);
}
