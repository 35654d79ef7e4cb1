use std::cell::Cell;

use haptic_diag::isotp::{Bytes, Link};
use proptest::bool::weighted;
use proptest::collection::vec;
use proptest::prelude::*;

use crate::cases::cases;

type Small = Link<40, 100>;

/// What is due at a time, and it leaves.
fn next<const R: usize, const S: usize>(link: &mut Link<R, S>, now_ms: u32) -> Option<Bytes> {
    link.age(now_ms);
    let frame = link.frame(now_ms);
    if frame.is_some() {
        link.sent(now_ms);
    }
    frame
}

#[test]
fn a_single_frame_is_a_message_and_what_is_shorter_than_it_says_is_none() {
    for length in 1..=7_u8 {
        let mut link = Small::NEW;
        let data: Vec<u8> = [length].into_iter().chain(1..=length).collect();
        link.receive(&data[..data.len() - 1], 0);
        assert_eq!(link.message(), None);
        link.receive(&data, 0);
        let message = link.message().unwrap();
        assert_eq!((message.bytes, message.length), (&data[1..], u16::from(length)));
        // The next is taken when this one is done with.
        link.receive(&[1, 0xEE], 0);
        assert_eq!(link.message().unwrap().bytes, &data[1..]);
        link.done();
        assert_eq!(link.message(), None);
    }
    let mut link = Small::NEW;
    for nothing in [
        &[][..],
        &[0],
        &[8, 1, 2, 3, 4, 5, 6, 7],
        &[0xF0, 1],
        &[0x40],
        &[0x21, 1],
    ] {
        link.receive(nothing, 0);
        assert_eq!((link.message(), link.frame(0)), (None, None), "{nothing:02X?}");
    }
}

#[test]
fn a_long_message_comes_in_blocks_of_eight() {
    let mut link = Small::NEW;
    let mut link_says = Vec::new();
    let message: Vec<u8> = (0..150).collect();
    link.receive(&[0x10, 150, 0, 1, 2, 3, 4, 5], 0);
    for (number, part) in message[6..].chunks(7).enumerate() {
        link_says.extend(next(&mut link, 0).map(|frame| (number, frame)));
        let data: Vec<u8> = [0x20 | ((number as u8 + 1) & 0xF)]
            .into_iter()
            .chain(part.iter().copied())
            .collect();
        link.receive(&data, 0);
    }
    let go = [0x30, 8, 2, 0xCC, 0xCC, 0xCC, 0xCC, 0xCC];
    assert_eq!(link_says, [(0, go), (8, go), (16, go)]);
    // What has no place is counted.
    let got = link.message().unwrap();
    assert_eq!((got.bytes, got.length), (&message[..40], 150));
}

/// A consecutive frame is due within a second, in its number and whole; otherwise the message is none.
#[test]
fn what_does_not_go_on_in_order_and_time_is_no_message() {
    let begin = |at| {
        let mut link = Small::NEW;
        link.receive(&[0x10, 12, 0, 1, 2, 3, 4, 5], at);
        next(&mut link, at).unwrap();
        link
    };
    let last = [0x21, 6, 7, 8, 9, 10, 11];
    for (data, at, is_good) in [
        (&last[..], 1000, true),
        (&last[..], 1001, false),
        (&[0x22, 6, 7, 8, 9, 10, 11][..], 1, false),
        (&[0x20, 6, 7, 8, 9, 10, 11][..], 1, false),
        (&last[..6], 1, false),
    ] {
        // Also where the clock wraps.
        for start in [0, u32::MAX - 500] {
            let mut link = begin(start);
            link.receive(data, start.wrapping_add(at));
            assert_eq!(link.message().is_some(), is_good, "{data:02X?} after {at} ms");
            link.receive(&last, start.wrapping_add(at));
            assert_eq!(link.message().is_some(), is_good);
        }
    }
    let mut link = begin(0);
    link.age(1001);
    link.receive(&last, 1001);
    assert_eq!(link.message(), None, "given up");
    // A new beginning ends the old one.
    for beginning in [&[2, 0xAA, 0xBB][..], &[0x10, 12, 20, 21, 22, 23, 24, 25]] {
        let mut link = begin(0);
        link.receive(beginning, 1);
        link.receive(&last, 2);
        let first = link.message().unwrap().bytes[0];
        assert_eq!(first, beginning[if beginning.len() == 3 { 1 } else { 2 }]);
    }
}

#[test]
fn a_length_beyond_4095_is_refused_and_one_that_is_a_single_frames_is_ignored() {
    let mut link = Small::NEW;
    link.receive(&[0x10, 0, 0, 1, 0, 0, 1, 2], 0);
    assert_eq!(next(&mut link, 0).unwrap()[0], 0x32);
    for length in 1..=7 {
        link.receive(&[0x10, length, 1, 2, 3, 4, 5, 6], 0);
        assert_eq!(next(&mut link, 0), None);
    }
    link.receive(&[0x10, 8, 1, 2, 3, 4, 5], 0);
    assert_eq!(next(&mut link, 0), None, "a first frame is full");
}

fn sending() -> (Small, Vec<u8>) {
    let mut link = Small::NEW;
    let message: Vec<u8> = (100..200).collect();
    assert!(link.send(&message));
    assert_eq!(
        next(&mut link, 0),
        Some([0x10, 100, 100, 101, 102, 103, 104, 105])
    );
    assert_eq!(next(&mut link, 0), None, "flow control is due");
    (link, message)
}

#[test]
fn what_is_sent_keeps_the_separation_and_the_blocks_that_the_peer_asks_for() {
    // The separation's codes of table 20, and what they mean in ms; reserved ones are the longest.
    for (code, ms) in [
        (0, 0),
        (5, 5),
        (0x7F, 127),
        (0xF1, 1),
        (0xF9, 1),
        (0x80, 127),
        (0xFA, 127),
    ] {
        for block in [0, 3] {
            let (mut link, message) = sending();
            let mut got = message[..6].to_vec();
            let (mut now, mut in_block, mut number) = (10_u32, 0, 1);
            link.receive(&[0x30, block, code], now);
            while got.len() < message.len() {
                if block > 0 && in_block == block {
                    assert_eq!(next(&mut link, now + 500), None, "flow control is due");
                    (now, in_block) = (now + 500, 0);
                    link.receive(&[0x30, block, code], now);
                }
                if in_block > 0 && ms > 0 {
                    assert_eq!(next(&mut link, now + ms - 1), None, "code {code:02X}: too early");
                    now += ms;
                }
                let frame = next(&mut link, now).unwrap();
                assert_eq!(frame[0], 0x20 | (number & 0xF));
                got.extend(&frame[1..]);
                (in_block, number) = (in_block + 1, number + 1);
            }
            assert_eq!(got[..100], message);
            assert!(!link.is_sending() && got[100..].iter().all(|byte| *byte == 0xCC));
        }
    }
}

#[test]
fn a_peer_that_is_silent_waits_for_ever_or_has_no_room_is_given_up() {
    let (mut link, _) = sending();
    link.age(1000);
    assert!(link.is_sending());
    link.age(1001);
    assert!(!link.is_sending(), "silent");
    for (status, name) in [(2, "no room"), (3, "reserved"), (15, "reserved")] {
        let (mut link, _) = sending();
        link.receive(&[0x30 | status, 0, 0], 1);
        assert!(!link.is_sending(), "{name}");
    }
    let (mut link, _) = sending();
    for wait in 1..=10 {
        link.receive(&[0x31, 0, 0], wait * 900);
        link.age(wait * 900 + 900);
        assert!(link.is_sending(), "{wait} waits");
    }
    link.receive(&[0x31, 0, 0], 9901);
    assert!(!link.is_sending(), "waits for ever");
    // Flow control that is too short, or that nobody asked for, is none.
    let (mut link, _) = sending();
    link.receive(&[0x30, 0], 1);
    assert_eq!(next(&mut link, 1), None);
    let mut idle = Small::NEW;
    idle.receive(&[0x30, 0, 0], 1);
    assert_eq!(next(&mut idle, 1), None);
}

/// A bus that takes nothing: the answer is out of date by then.
#[test]
fn a_frame_that_does_not_leave_is_given_up() {
    for request in [&[][..], &[0x10, 20, 0, 1, 2, 3, 4, 5]] {
        let mut link = Small::NEW;
        link.receive(request, 0);
        if request.is_empty() {
            assert!(link.send(&[1, 2, 3]));
        }
        for now in 0..=1000 {
            link.age(now);
            assert!(link.frame(now).is_some(), "{now} ms");
        }
        link.age(1001);
        assert_eq!((link.frame(1001), link.is_sending()), (None, false));
    }
}

#[test]
fn a_message_without_a_place_is_not_begun() {
    let mut link = Small::NEW;
    assert!(!link.send(&[]) && !link.send(&[0; 101]) && !link.is_sending());
    assert_eq!(link.frame(0), None);
}

/// Two ends, and a bus that now and then loses a frame: what arrives is what was sent, or nothing.
#[test]
fn two_ends_on_a_bus_that_loses_frames_tell_nothing_false() {
    let counts = [0, 0].map(Cell::new);
    // Of the frames in their order; there are 34 at most.
    let sent = (vec(any::<u8>(), 1..=200), vec(weighted(0.05), 0..=34));
    cases(47, 2000, &sent, |(message, losses)| {
        let (mut one, mut other) = (Link::<200, 200>::NEW, Link::<200, 200>::NEW);
        prop_assert!(one.send(&message));
        let (mut losses, mut is_lost) = (losses.into_iter(), false);
        for now in 0..3000 {
            for is_forth in [true, false] {
                let (from, to) = if is_forth {
                    (&mut one, &mut other)
                } else {
                    (&mut other, &mut one)
                };
                match next(from, now) {
                    Some(_) if losses.next() == Some(true) => is_lost = true,
                    Some(frame) => to.receive(&frame, now),
                    None => {}
                }
            }
            if !one.is_sending() && other.message().is_some() {
                break;
            }
        }
        let got = other.message().map(|got| (got.bytes, usize::from(got.length)));
        prop_assert!(
            got.is_none_or(|got| got == (&message[..], message.len())),
            "{got:?}"
        );
        prop_assert!(got.is_some() || is_lost);
        prop_assert!(!one.is_sending(), "given up or done");
        counts[usize::from(got.is_none())].update(|count| count + 1);
        Ok(())
    });
    let [whole, lost] = counts.map(Cell::into_inner);
    assert!(whole >= 1000 && lost > 100, "{whole} whole, {lost} lost");
}

/// Anything at all: no panic, no message longer than it says, and at most a frame for each that came, but flow control.
#[test]
fn noise_makes_no_panic() {
    let data = (vec(any::<u8>(), 0..=8), weighted(0.7));
    let heard = vec((data, 0..3_u32, weighted(0.1)), 0..=20_000);
    let messages = Cell::new(0);
    cases(4747, 30, &heard, |heard| {
        let (mut link, mut now) = (Small::NEW, u32::MAX - 5000);
        for ((mut data, is_near), passes, sends) in heard {
            if let (Some(head), true) = (data.first_mut(), is_near) {
                *head &= 0x33;
            }
            link.receive(&data, now);
            now = now.wrapping_add(passes);
            if sends {
                link.send(&data);
            }
            next(&mut link, now);
            if let Some(message) = link.message() {
                let length = message.bytes.len();
                prop_assert!(length <= 40 && length <= usize::from(message.length));
                messages.update(|count| count + 1);
                link.done();
            }
        }
        Ok(())
    });
    assert!(messages.get() > 1000, "{messages:?}");
}
