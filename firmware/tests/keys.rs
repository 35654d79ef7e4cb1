//! Keys of the authentication, and the count of starts under cuts of the supply.

use haptic_firmware::keys::{bytes, credentials};
use haptic_firmware::nor::{Nor, PAGE};
use haptic_secoc::Keys;
use haptic_secoc::fresh::Algorithm;
use haptic_secoc::verifier::Credentials;

/// AES-CMAC with keys of 0x11 and 0x22, and the CRC-32 of all that by zlib.
fn stored() -> [u8; 40] {
    let mut bytes = [0x22; 40];
    bytes[..4].copy_from_slice(&[2, 0, 0, 0]);
    bytes[4..20].fill(0x11);
    bytes[36..].copy_from_slice(&CRC.to_le_bytes());
    bytes
}

const CRC: u32 = 0x6982_EA9D;

const PAGES: usize = 8;

fn memory(stored: &[u8]) -> Vec<u8> {
    let mut memory = vec![0xFF; PAGES * PAGE];
    memory[(PAGES - 5) * PAGE + 64..][..stored.len()].copy_from_slice(stored);
    memory
}

/// The number of the start, None where it was not counted.
fn start(memory: &mut Vec<u8>, cut_after: Option<u32>) -> Option<u32> {
    let mut flash = Nor::new(std::mem::take(memory));
    if let Some(operations) = cut_after {
        flash.cut_after(operations);
    }
    let found = credentials(&mut flash);
    *memory = flash.into_memory();
    match found {
        Credentials::Keys(_, number) => number,
        _ => None,
    }
}

#[test]
fn keys_are_there_whole_or_not_at_all() {
    let keys = Keys {
        algorithm: Algorithm::AesCmac,
        camera: [0x11; 16],
        host: [0x22; 16],
    };
    assert_eq!(bytes(&keys), stored());
    let of = |stored: &[u8]| credentials(&mut Nor::new(memory(stored)));
    assert!(matches!(of(&stored()), Credentials::Keys(found, Some(0)) if found == keys));
    for bit in 0..8 * 40 {
        let mut spoiled = stored();
        spoiled[bit / 8] ^= 1 << (bit % 8);
        // Not for the bench, in any image: it had keys.
        assert!(matches!(of(&spoiled), Credentials::None), "bit {bit}");
    }
    let blank = of(&[]);
    if cfg!(feature = "bench") {
        assert!(matches!(blank, Credentials::Bench));
    } else {
        assert!(matches!(blank, Credentials::None));
    }
    let no_page = credentials(&mut Nor::new(vec![0xFF; 4 * PAGE]));
    assert!(matches!(no_page, Credentials::None));
}

#[test]
fn starts_count_up_over_both_pages_and_touch_nothing_else() {
    let mut memory = memory(&stored());
    let rest = memory[(PAGES - 5) * PAGE..].to_vec();
    for number in 0..1000 {
        assert_eq!(start(&mut memory, None), Some(number));
    }
    assert_eq!(memory[(PAGES - 5) * PAGE..], rest);
    assert!(memory[..PAGE].iter().all(|byte| *byte == 0xFF));
}

/// Every start's first and second operation is cut in turn, on top of what the last cut left: no number comes twice.
#[test]
fn no_cut_of_the_supply_makes_a_number_come_again() {
    let mut memory = memory(&stored());
    let (mut last, mut cuts, mut counted) = (None, 0, 0);
    for turn in 0..3000_u32 {
        let cut = [None, Some(1), Some(2), Some(3)][(turn.wrapping_mul(0x9E37_79B9) >> 30) as usize];
        match start(&mut memory, cut) {
            Some(number) => {
                assert!(Some(number) > last, "{number} after {last:?}");
                (last, counted) = (Some(number), counted + 1);
            }
            None => cuts += 1,
        }
    }
    assert!(cuts > 1000 && counted > 1000, "{cuts} cuts, {counted} counted");
}
