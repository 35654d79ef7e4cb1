//! CRC, counter and trust: published check values, a table made by another implementation, and the
//! error-detection claims of `e2e.rs` by exhaustion.

use haptic_core::bus::Reject;
use haptic_core::bus::e2e::{Protection, ReceiverState, crc8};

const PUBLISHED_LIST: [u8; 16] = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16];

#[test]
fn published_check_values() {
    assert_eq!(crc8(b"123456789"), 0xDF);
    let protection = Protection::with_list(PUBLISHED_LIST);
    for (counter, expected) in [(0, [0x0E, 0x00]), (1, [0x1B, 0x01]), (2, [0x98, 0x02])] {
        let mut data = [0; 8];
        protection.protect(&mut data, counter);
        assert_eq!(data[..2], expected);
    }
}

/// `tests/data/e2e_profile2.csv` was made by the Python package `autosar-e2e` (tests/tools/make_e2e_table.py): frames of eight
/// bytes, and of 12, 48 and 64.
#[test]
fn frames_of_another_implementation() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data/e2e_profile2.csv");
    let mut rows = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .from_path(path)
        .unwrap();
    let hex = |text: &str| -> Vec<u8> {
        (0..text.len())
            .step_by(2)
            .map(|i| u8::from_str_radix(&text[i..i + 2], 16).unwrap())
            .collect()
    };
    let mut count = 0;
    for row in rows.records() {
        let row = row.unwrap();
        let protection = Protection::with_list(hex(&row[0]).try_into().unwrap());
        let counter = u8::from_str_radix(&row[1], 16).unwrap();
        let theirs = hex(&row[2]);
        assert!(protection.is_intact(&theirs), "{row:?}");
        let mut ours = theirs.clone();
        (ours[0], ours[1]) = (!theirs[0], theirs[1] & 0xF0);
        protection.protect(&mut ours, counter);
        assert_eq!(ours, theirs);
        count += 1;
    }
    assert_eq!(count, 320 + 3 * 16);
}

#[test]
fn every_flip_of_up_to_three_bits_is_detected() {
    // The CRC is linear, so zero payload stands for all payloads except through the counter's choice of ID.
    for constant in [0x11, 0x22, 0x33, 0x44, 0x5A, 0x66, 0x77] {
        let protection = Protection::new(constant);
        for counter in 0..16 {
            let mut data = [0; 8];
            protection.protect(&mut data, counter);
            let word = u64::from_le_bytes(data);
            let intact = |flips: u64| protection.is_intact(&(word ^ flips).to_le_bytes());
            assert!(intact(0));
            for a in 0..64 {
                assert!(!intact(1 << a));
                for b in 0..a {
                    assert!(!intact(1 << a | 1 << b));
                    for c in 0..b {
                        assert!(!intact(1 << a | 1 << b | 1 << c), "{counter} {a} {b} {c}");
                    }
                }
            }
        }
    }
}

/// What the header of `e2e.rs` says of longer frames: so many flips are always detected, and one more is not.
#[test]
fn longer_frames_detect_fewer_flips() {
    let protection = Protection::new(0x11);
    for (bytes, detected) in [(8, 3), (12, 3), (16, 1), (64, 1)] {
        let mut data = vec![0; bytes];
        protection.protect(&mut data, 0);
        // Linear: a set of flips goes unseen where its changes of the CRC cancel. Bits of the counter pick another data ID.
        let bits: Vec<usize> = (0..8 * bytes).filter(|bit| !(8..12).contains(bit)).collect();
        let change = |bit: &usize| {
            let mut flipped = data.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            protection.protect(&mut flipped, 0);
            let crc = flipped[0] ^ data[0];
            if *bit < 8 { 1 << bit } else { crc }
        };
        let changes: Vec<u8> = bits.iter().map(change).collect();
        let mut ways = [[0_u64; 256]; 5];
        ways[0][0] = 1;
        for change in &changes {
            for flips in (1..5).rev() {
                for crc in 0..256 {
                    ways[flips][crc] += ways[flips - 1][crc ^ usize::from(*change)];
                }
            }
        }
        let unseen = (1..5).position(|flips| ways[flips][0] != 0);
        assert_eq!(unseen, Some(detected), "{bytes} bytes");
    }
}

#[test]
fn a_frame_of_another_message_always_fails() {
    for (sent, heard) in (0..=255)
        .flat_map(|a| (0..=255).map(move |b| (a, b)))
        .filter(|(a, b)| a != b)
    {
        for counter in 0..16 {
            let mut data = [7; 8];
            Protection::new(sent).protect(&mut data, counter);
            assert!(!Protection::new(heard).is_intact(&data));
        }
    }
}

/// Feeds frames with these counters to a receiver that tolerates two lost ones.
fn hear(state: &mut ReceiverState, counters: &[u8]) -> Vec<Result<(), Reject>> {
    let protection = Protection::new(0x11);
    let hear = |counter: &u8| {
        let mut data = [0; 8];
        protection.protect(&mut data, *counter);
        state.accept(&protection, &data, 3)
    };
    counters.iter().map(hear).collect()
}

#[test]
fn three_clean_frames_to_trust() {
    use Reject::NotTrusted;
    let mut state = ReceiverState::NEW;
    assert_eq!(
        hear(&mut state, &[14, 15, 0, 1]),
        [Err(NotTrusted), Err(NotTrusted), Ok(()), Ok(())]
    );
    state = ReceiverState::NEW;
    // A gap, a repetition and a step back each start the count anew.
    assert_eq!(hear(&mut state, &[2, 3, 5, 6, 6, 7, 5, 6]), [Err(NotTrusted); 8]);
    // From then on a lost frame is bridged, the very next one too.
    assert_eq!(hear(&mut state, &[7, 9]), [Ok(()), Ok(())]);
}

#[test]
fn lost_repeated_and_disordered_frames() {
    use Reject::{Jump, Repeated};
    let mut state = ReceiverState::NEW;
    hear(&mut state, &[0, 1, 2]);
    assert_eq!(
        hear(&mut state, &[3, 6, 6, 7]),
        [Ok(()), Ok(()), Err(Repeated), Ok(())]
    );
    // Four ahead is one too many; what follows in order is judged against the last accepted frame.
    assert_eq!(
        hear(&mut state, &[11, 10, 9, 11]),
        [Err(Jump), Ok(()), Err(Jump), Ok(())]
    );
}

#[test]
fn a_wrong_crc_does_not_move_the_counter() {
    let mut state = ReceiverState::NEW;
    hear(&mut state, &[0, 1, 2]);
    let mut data = [0; 8];
    Protection::new(0x11).protect(&mut data, 3);
    data[7] ^= 1;
    assert_eq!(state.accept(&Protection::new(0x11), &data, 3), Err(Reject::Crc));
    assert_eq!(hear(&mut state, &[3]), [Ok(())]);
}
