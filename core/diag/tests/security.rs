use haptic_diag::security::{BENCH_KEY, mac};
use haptic_diag::trouble::EMPTY;

use crate::rig::{KEY, Rig};

fn bytes(hex: &str) -> Vec<u8> {
    let digits: Vec<char> = hex.chars().filter(|digit| !digit.is_whitespace()).collect();
    digits
        .chunks(2)
        .map(|pair| u8::from_str_radix(&String::from_iter(pair), 16).unwrap())
        .collect()
}

/// RFC 4493, section 4: its four examples.
#[test]
fn the_mac_is_that_of_rfc_4493() {
    let message = "6bc1bee22e409f96e93d7e117393172aae2d8a571e03ac9c9eb76fac45af8e51\
                   30c81c46a35ce411e5fbc1191a0a52eff69f2445df4f9b17ad2b417be66c3710";
    for (length, expected) in [
        (0, "bb1d6929e95937287fa37d129b756746"),
        (16, "070a16b46b4d4144f79bdd9dd04a287c"),
        (40, "dfa66747de9ae63030ca32611497c827"),
        (64, "51f0bebf7e3b9d92fc49741779363cfe"),
    ] {
        assert_eq!(mac(&KEY, &bytes(message)[..length]).to_vec(), bytes(expected));
    }
    assert_eq!(BENCH_KEY, KEY);
}

#[test]
fn access_is_by_the_right_order_session_and_key_alone() {
    let mut rig = Rig::new();
    rig.refuses(&[0x27, 1], 0x7F);
    rig.expect(&[0x10, 3], &[0x50, 3]);
    // An answer to nothing, of a wrong length, and of a level that there is not.
    let nothing = [&[0x27, 2][..], &[0; 16]].concat();
    rig.refuses(&nothing, 0x24);
    rig.refuses(&nothing[..17], 0x13);
    rig.refuses(&[0x27, 3], 0x12);
    let challenge = rig.expect(&[0x27, 1], &[0x67, 1]);
    assert_eq!(challenge.len(), 18);
    // Every bit counts, and a wrong answer costs its challenge.
    let right = [&[0x27, 2][..], &mac(&KEY, &challenge[2..])].concat();
    let mut wrong = right.clone();
    wrong[17] ^= 1;
    rig.refuses(&wrong, 0x35);
    rig.refuses(&right, 0x24);
    rig.refuses(&[0x2E, 0x10, 0, 0, 0, 0, 0], 0x33);
    rig.open();
    assert_eq!(rig.expect(&[0x27, 1], &[0x67, 1])[2..], [0; 16], "open already");
    // A session begins locked, also the same one.
    rig.expect(&[0x10, 3], &[0x50, 3]);
    rig.refuses(&[0x11, 1], 0x33);
}

#[test]
fn no_challenge_comes_twice() {
    let mut seen = std::collections::HashSet::new();
    let mut cells = EMPTY;
    for _ in 0..10 {
        let mut rig = Rig::with(cells, Some(KEY));
        rig.expect(&[0x10, 3], &[0x50, 3]);
        for _ in 0..10 {
            assert!(seen.insert(rig.expect(&[0x27, 1], &[0x67, 1])));
        }
        cells = rig.cells;
    }
}

/// Three for nothing, then one in ten seconds; a reset does not help.
#[test]
fn who_guesses_waits() {
    let mut rig = Rig::new();
    rig.expect(&[0x10, 3], &[0x50, 3]);
    let guess = [&[0x27, 2][..], &[0x5A; 16]].concat();
    for code in [0x35, 0x35, 0x36] {
        rig.expect(&[0x27, 1], &[0x67, 1]);
        rig.refuses(&guess, code);
    }
    let mut guesses = 3;
    for guess_of_many in 0..1000 {
        if guess_of_many == 500 {
            rig = Rig::with(rig.cells, Some(KEY));
        }
        rig.expect(&[0x10, 3], &[0x50, 3]);
        let answer = rig.ask(&[0x27, 1]).unwrap();
        if answer[0] == 0x67 {
            rig.refuses(&guess, 0x36);
            guesses += 1;
        } else {
            assert_eq!(answer, [0x7F, 0x27, 0x37]);
        }
        rig.wait(90);
    }
    // A thousand attempts take less than 100 s.
    assert!((8..=13).contains(&guesses), "{guesses}");
    rig.wait(10_000);
    rig.open();
    // A right one ends the delay.
    rig.expect(&[0x10, 3], &[0x50, 3]);
    rig.expect(&[0x27, 1], &[0x67, 1]);
}

#[test]
fn without_a_key_nothing_is_unlocked() {
    let mut rig = Rig::with(EMPTY, None);
    rig.expect(&[0x10, 3], &[0x50, 3]);
    rig.refuses(&[0x27, 1], 0x22);
    rig.refuses(&[&[0x27, 2][..], &[0; 16]].concat(), 0x22);
    // Which the self-test says.
    assert_eq!(rig.expect(&[0x31, 1, 2, 1], &[0x71, 1, 2, 1]), [0x71, 1, 2, 1, 4]);
}
