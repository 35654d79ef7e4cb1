//! Every length of every service, in both sessions: the answer is the one that ISO 14229-1 asks for.

use crate::rig::Rig;

/// What a service asks for: how its requests begin, the lengths that it takes, and its answer to one of those.
struct Service {
    begins: &'static [u8],
    fits: fn(usize) -> bool,
    /// Positive (None) or a code.
    answer: Option<u8>,
}

const IN_BOTH: [Service; 4] = [
    // The session goes on as it is: the same one.
    service(&[0x3E, 0], |length| length == 2, None),
    service(
        &[0x22, 0xF1, 0x86, 0xF1, 0x86],
        |length| length % 2 == 1 && (3..=17).contains(&length),
        None,
    ),
    service(&[0x19, 0x0A], |length| length == 2, None),
    service(&[0x19, 0x02, 0xFF], |length| length == 3, None),
];

const IN_EXTENDED: [Service; 5] = [
    service(&[0x11, 1], |length| length == 2, Some(0x33)),
    service(&[0x14, 0xFF, 0xFF, 0xFF], |length| length == 4, None),
    service(&[0x27, 1], |length| length == 2, None),
    service(&[0x31, 1, 2, 0], |length| length == 4, Some(0x33)),
    service(&[0x2E, 0x10, 0], |length| (4..=18).contains(&length), Some(0x33)),
];

const fn service(begins: &'static [u8], fits: fn(usize) -> bool, answer: Option<u8>) -> Service {
    Service { begins, fits, answer }
}

/// A request of a length that begins so, and goes on with identifiers that there are.
fn request(begins: &[u8], length: usize) -> Vec<u8> {
    let more = [0xF1, 0x86]
        .into_iter()
        .cycle()
        .skip(begins.len().saturating_sub(1) % 2);
    begins.iter().copied().chain(more).take(length).collect()
}

fn check(rig: &mut Rig, service: &Service, lengths: impl Iterator<Item = usize>) {
    let sid = service.begins[0];
    for length in lengths {
        let request = request(service.begins, length);
        let answer = rig
            .ask(&request)
            .unwrap_or_else(|| panic!("{sid:02X} of {length}: no answer"));
        let expected = match service.answer {
            _ if !(service.fits)(length) => Some(0x13),
            answer => answer,
        };
        match expected {
            Some(code) => assert_eq!(answer, [0x7F, sid, code], "{sid:02X} of {length}"),
            None => assert_eq!(answer[0], sid | 0x40, "{sid:02X} of {length}: {answer:02X?}"),
        }
    }
}

#[test]
fn every_length_of_every_service_is_answered_as_the_standard_has_it() {
    let some = || (1..=40).chain((41..=4095).step_by(61)).chain(4090..=4095);
    let mut rig = Rig::new();
    for service in &IN_BOTH {
        check(&mut rig, service, some());
    }
    for service in &IN_EXTENDED {
        for length in some() {
            rig.refuses(&request(service.begins, length), 0x7F);
        }
    }
    rig.expect(&[0x10, 3], &[0x50, 3]);
    for service in IN_EXTENDED.iter().chain(&IN_BOTH) {
        check(&mut rig, service, 1..=4095);
    }
    // Both sessions themselves.
    for length in some() {
        let answer = rig.ask(&request(&[0x10, 3], length)).unwrap();
        let expected: &[u8] = if length == 2 {
            &[0x50, 3, 0, 50, 1, 0xF4]
        } else {
            &[0x7F, 0x10, 0x13]
        };
        assert_eq!(answer, expected, "{length}");
    }
}

#[test]
fn a_service_that_there_is_not_is_refused_whatever_it_says() {
    let mut rig = Rig::new();
    let there = [0x10, 0x11, 0x14, 0x19, 0x22, 0x27, 0x2E, 0x31, 0x3E];
    for session in [1, 3] {
        for sid in (0..=255).filter(|sid| !there.contains(sid)) {
            rig.expect(&[0x10, session], &[0x50, session]);
            for length in [1, 2, 7, 8, 18, 19, 200] {
                rig.refuses(&request(&[sid, 0], length), 0x11);
            }
        }
    }
}

#[test]
fn every_sub_function_that_there_is_not_is_refused() {
    let mut rig = Rig::new();
    rig.expect(&[0x10, 3], &[0x50, 3]);
    let there: [(u8, &[u8]); 6] = [
        (0x10, &[1, 3]),
        (0x11, &[1]),
        (0x19, &[1, 2, 4, 6, 10]),
        (0x27, &[1, 2]),
        (0x31, &[1, 3]),
        (0x3E, &[0]),
    ];
    for (sid, codes) in there {
        for code in (0..=255_u8).filter(|code| !codes.contains(&(code & 0x7F))) {
            // Silence is for positive answers alone.
            rig.refuses(&[sid, code], 0x12);
        }
    }
}
