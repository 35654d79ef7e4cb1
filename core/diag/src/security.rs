//! The proof that has to be given before anything is written: the ECU sends a challenge, and the tester answers with its
//! AES-CMAC (RFC 4493) under the key that both have.
//!
//! A wrong answer costs its challenge; after [`MOST_WRONG`] of them each further attempt waits for [`DELAY_MS`], also across a reset.
//! A challenge is itself a MAC over a count that resets leave alone, and over when it was asked for: it is not foreseen without
//! the key. The processors used here have no source of random numbers that is read, so after a loss of supply a challenge
//! comes again if it is asked for in the same count of the processor's clock.

use aes::Aes128;
use cmac::{Cmac, Mac};

/// A key, a challenge and an answer are so long.
pub const BYTES: usize = 16;
/// The key.
pub type Key = [u8; BYTES];
/// So many wrong answers are free.
pub const MOST_WRONG: u32 = 3;
/// Then one costs so many ms (ISO 14229-1, NRC 0x37).
pub const DELAY_MS: u32 = 10_000;

/// The key of an image for the bench that has no other: everybody knows it (RFC 4493, section 4).
pub const BENCH_KEY: Key = *b"\x2b\x7e\x15\x16\x28\xae\xd2\xa6\xab\xf7\x15\x88\x09\xcf\x4f\x3c";

/// AES-CMAC of a message.
#[must_use]
pub fn mac(key: &Key, message: &[u8]) -> [u8; BYTES] {
    let mut mac = begin(key);
    mac.update(message);
    mac.finalize().into_bytes().into()
}

/// Whether an answer is the MAC of its challenge, in a time that does not depend on where it is wrong.
#[must_use]
pub fn is_answer(key: &Key, challenge: &[u8; BYTES], answer: &[u8]) -> bool {
    let mut mac = begin(key);
    mac.update(challenge);
    mac.verify_slice(answer).is_ok()
}

fn begin(key: &Key) -> Cmac<Aes128> {
    Mac::new(key.into())
}
