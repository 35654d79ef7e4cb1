//! The messages of the authentication against `authentication.dbc`, through a parser that knows nothing of their layout.

use can_dbc::{Dbc, MessageId};
use haptic_core::bus::Frame;
use haptic_core::bus::messages::{MESSAGES, Message, Request};
use haptic_core::quantity::{Instant, Ratio};
use haptic_secoc::Keys;
use haptic_secoc::fresh::Algorithm;
use haptic_secoc::messages::{OFFER_ID, PROVEN, Place, Refusal, Refused, STATUS_ID, State, Status};
use haptic_secoc::prover::Prover;
use haptic_secoc::verifier::{Credentials, Verifier};

fn dbc() -> Dbc {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/authentication.dbc");
    Dbc::try_from(std::fs::read_to_string(path).unwrap().as_str()).unwrap()
}

/// A signal's raw value, as the DBC file says where it lies.
fn raw(dbc: &Dbc, frame: &Frame, name: &str) -> u64 {
    let id = MessageId::Standard(frame.id());
    let message = dbc.messages.iter().find(|message| message.id == id).unwrap();
    assert_eq!(message.size, frame.data().len() as u64, "{}", message.name);
    let name = format!("{}_{name}", message.name);
    let signal = message.signals.iter().find(|signal| signal.name == name).unwrap();
    let bits = (0..signal.size).map(|i| {
        let bit = (signal.start_bit + i) as usize;
        u64::from(frame.data()[bit / 8] >> (bit % 8) & 1) << i
    });
    bits.sum()
}

#[test]
fn the_file_has_every_message_and_no_other() {
    let mut expected = vec![
        (OFFER_ID, "Offer".to_owned()),
        (STATUS_ID, "Authentication".to_owned()),
    ];
    for proven in PROVEN {
        let name = proven.info.name;
        expected.push((proven.question, format!("{name}Question")));
        expected.push(match proven.place {
            Place::Within => (proven.info.id, name.to_owned()),
            Place::Behind(id) => (id, format!("{name}Proof")),
        });
    }
    expected.sort();
    let dbc = dbc();
    let mut there: Vec<_> = dbc
        .messages
        .iter()
        .map(|message| {
            let MessageId::Standard(id) = message.id else {
                panic!("29 bits")
            };
            (id, message.name.clone())
        })
        .collect();
    there.sort();
    assert_eq!(there, expected);
    // No identifier is another message's.
    let clash = |id: &u16| MESSAGES.iter().any(|info| info.id == *id);
    let clashes: Vec<u16> = there.iter().map(|(id, _)| *id).filter(clash).collect();
    assert_eq!(clashes, [Request::ID]);
}

#[test]
fn a_status_says_what_it_is_told() {
    let dbc = dbc();
    for (k, reason) in Refusal::ALL.into_iter().enumerate() {
        for waits in 0..5 {
            let status = Status {
                state: State::AesCmac,
                waiting: std::array::from_fn(|place| place == waits),
                refused: Some(Refused {
                    id: 0x148,
                    reason,
                    count: 60_000,
                }),
            };
            let frame = status.encode(13);
            assert_eq!(Status::decode(&frame), Some(status));
            let of = |name: &str| raw(&dbc, &frame, name);
            assert_eq!((of("State"), of("Counter"), of("Message")), (4, 13, 0x148));
            assert_eq!((of("Reason"), of("Count")), (k as u64, 60_000));
            for (place, proven) in PROVEN.iter().enumerate() {
                let name = format!("Waiting_{}", proven.info.name);
                assert_eq!(of(&name), u64::from(place == waits));
            }
            for bit in 0..64 {
                let mut data = frame.full_data().unwrap();
                data[bit / 8] ^= 1 << (bit % 8);
                assert_eq!(Status::decode(&Frame::full(STATUS_ID, data)), None, "bit {bit}");
            }
        }
    }
}

/// The first frames of an epoch, whose count is 1, and the offer of start 3, whose first epoch is 12,288.
#[test]
fn proofs_questions_and_offers_lie_where_the_file_says() {
    let dbc = dbc();
    let keys = Keys::bench(Algorithm::SipHash);
    let (mut verifier, mut prover) = (
        Verifier::new(Credentials::Keys(keys, Some(3))),
        Prover::new(&keys),
    );
    let request = Request {
        engage: true,
        probe: false,
        authority: Ratio::ONE,
    }
    .encode(0);
    assert_eq!(prover.prove(&request)[..], [request], "no epoch yet");
    let status = verifier.step(60).unwrap();
    let [question] = prover.hear(&status, || 0x1234_5678)[..] else {
        panic!("one question")
    };
    assert_eq!(
        (question.id(), raw(&dbc, &question, "Number")),
        (0x530, 0x1234_5678)
    );
    verifier.receive(&question, Instant::from_us(0));
    let offer = verifier.step(85).unwrap();
    assert_eq!(
        (raw(&dbc, &offer, "Message"), raw(&dbc, &offer, "Epoch")),
        (2, 12_288)
    );
    prover.hear(&offer, || 0);
    let [proven] = prover.prove(&request)[..] else {
        panic!("one frame")
    };
    let of = |name| raw(&dbc, &proven, name);
    assert_eq!(
        (of("ProofCount"), of("Engage"), of("Authority"), of("Probe")),
        (1, 1, 128, 0)
    );
    let now = Instant::from_us(0);
    assert_eq!(verifier.receive(&proven, now), None);
    assert_eq!(verifier.verified(), Some((proven, now)));
}
