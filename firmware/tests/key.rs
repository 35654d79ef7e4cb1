//! The key for security access in the flash page before the parameters.

use haptic_firmware::nor::{Nor, PAGE};
use haptic_firmware::storage::key;

/// Bytes 0 to 15, and the CRC-32 of them by zlib.
const PAGE_OF_A_KEY: [u8; 20] = [
    0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 0x88, 0xE2, 0xCE, 0xCE,
];

fn flash(bytes: &[u8]) -> Nor<Vec<u8>> {
    let mut memory = vec![0xFF; 8 * PAGE];
    memory[3 * PAGE..][..bytes.len()].copy_from_slice(bytes);
    Nor::new(memory)
}

#[test]
fn a_key_is_there_whole_or_not_at_all() {
    let expected: [u8; 16] = std::array::from_fn(|k| k as u8);
    assert_eq!(key(&mut flash(&PAGE_OF_A_KEY)), Some(expected));
    for bit in 0..8 * PAGE_OF_A_KEY.len() {
        let mut spoiled = PAGE_OF_A_KEY;
        spoiled[bit / 8] ^= 1 << (bit % 8);
        assert_eq!(key(&mut flash(&spoiled)), None, "bit {bit}");
    }
    assert_eq!(key(&mut flash(&[])), None, "blank");
    assert_eq!(key(&mut Nor::new(vec![0xFF; 4 * PAGE])), None, "no such page");
}
