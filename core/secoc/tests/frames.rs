//! Both sides against a talk that another program made with the PyPI package `cryptography` (tests/tools/check_authentication.py).

use haptic_core::bus::Frame;
use haptic_core::quantity::Instant;
use haptic_secoc::Keys;
use haptic_secoc::fresh::Algorithm;
use haptic_secoc::prover::Prover;
use haptic_secoc::verifier::{Credentials, Verifier};

fn lines() -> Vec<(&'static str, Frame)> {
    let line = |line: &'static str| {
        let [who, id, data] = line.split(',').collect::<Vec<_>>()[..] else {
            panic!("{line}")
        };
        let bytes = (0..data.len()).step_by(2);
        let bytes: Vec<u8> = bytes
            .map(|at| u8::from_str_radix(&data[at..at + 2], 16).unwrap())
            .collect();
        (
            who,
            Frame::new(u16::from_str_radix(id, 16).unwrap(), &bytes).unwrap(),
        )
    };
    include_str!("frames.csv").lines().map(line).collect()
}

#[test]
fn another_program_makes_the_same_frames() {
    let keys = Keys::bench(Algorithm::AesCmac);
    let mut verifier = Verifier::new(Credentials::Keys(keys, Some(3)));
    let mut prover = Prover::new(&keys);
    // What the Rust side of the senders says next, and the frame whose proof is complete with the last of it.
    let mut expected = std::collections::VecDeque::new();
    let mut sent = None;
    let (mut number, mut is_synchronised, mut passed) = (0x0102_0304_u32, false, 0);
    for (who, frame) in lines() {
        match (who, frame.id()) {
            ("sender", _) => {
                assert_eq!(expected.len(), 0);
                expected.extend(prover.prove(&frame));
                sent = is_synchronised.then_some(frame.id());
            }
            ("bus", _) => {
                assert_eq!(expected.pop_front(), Some(frame));
                let heard = if is_synchronised || frame.id() >= 0x500 {
                    let passed = verifier.receive(&frame, Instant::from_us(0));
                    passed.or_else(|| verifier.verified())
                } else {
                    None
                };
                if let (true, Some(id)) = (expected.is_empty(), sent) {
                    assert_eq!(heard.map(|(frame, _)| frame.id()), Some(id));
                    passed += 1;
                    verifier.step(0);
                }
            }
            (_, 0x360) => {
                assert_eq!(verifier.step(60), Some(frame));
                expected.extend(prover.hear(&frame, || {
                    let given = number;
                    number += 0x1111_1111;
                    given
                }));
                sent = None;
            }
            _ => {
                assert_eq!(verifier.step(35), Some(frame));
                prover.hear(&frame, || 0);
                is_synchronised = expected.is_empty();
            }
        }
    }
    assert_eq!(passed, 5 * 39);
}
