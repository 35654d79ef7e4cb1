//! The law `driver_limit` is the rule of opendbc's C, in ten million random cases: with the answers of that C in one number, and
//! with the C itself from a checkout of commaai/opendbc:
//!
//! `OPENDBC=PATH cargo test --release -p haptic-sim --test all driver_limit -- --ignored`

use std::io::{Read, Write};
use std::path::Path;
use std::process::{Command, Stdio};

use haptic_sim::laws::Limits;

const CASES: usize = 10_000_000;
/// So many cases `tests/tools/driver_limit.c` answers at once.
const BLOCK: usize = 10_000;

/// Torque, last torque, MAX, rates up and down, allowance, factor, least and largest torque of the driver.
type Case = [i32; 9];

/// Knuth's generator, so that any language has the same cases.
fn cases(mut state: u64) -> impl Iterator<Item = Case> {
    std::iter::repeat_with(move || {
        let mut draw = |low: i32, high: i32| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            low + ((state >> 33) % (high - low + 1) as u64) as i32
        };
        let [max, up, down, allowance, factor] =
            [(1, 400), (0, 20), (0, 40), (0, 120), (0, 5)].map(|(a, b)| draw(a, b));
        let (last, one, other) = (draw(-max, max), draw(-500, 500), draw(-500, 500));
        let torque = last + draw(-45, 45);
        [
            torque,
            last,
            max,
            up,
            down,
            allowance,
            factor,
            one.min(other),
            one.max(other),
        ]
    })
    .take(CASES)
}

fn is_allowed(case: Case) -> bool {
    let [torque, last, max, up, down, allowance, factor, least, largest] = case.map(f64::from);
    let limits = Limits {
        max,
        up,
        down,
        allowance,
        factor,
    };
    let [low, high] = limits.allowed(last, [least, largest]);
    (low..=high).contains(&torque)
}

/// How many cases are allowed, and all answers in one number (FNV-1a).
fn digest(answers: impl Iterator<Item = bool>) -> (u32, u64) {
    answers.fold((0, 0xCBF2_9CE4_8422_2325), |(allowed, hash), answer| {
        let hash = (hash ^ u64::from(answer)).wrapping_mul(1_099_511_628_211);
        (allowed + u32::from(answer), hash)
    })
}

/// What the C answers: compiled with gcc 12 from commit 7343a66.
const ANSWERS: (u32, u64) = (4_957_746, 1_224_648_373_446_199_849);

#[test]
fn the_driver_limit_is_opendbc_s_rule() {
    assert_eq!(digest(cases(1).map(is_allowed)), ANSWERS);
}

#[test]
#[ignore = "needs a checkout of commaai/opendbc, in the variable OPENDBC, and gcc"]
fn the_driver_limit_is_the_c_of_a_checkout() {
    let checkout = std::env::var("OPENDBC").expect("OPENDBC names a checkout of commaai/opendbc");
    let header = Path::new(&checkout).join("opendbc/safety/lateral.h");
    assert!(header.exists(), "OPENDBC: there is no {}", header.display());
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join("driver_limit");
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/tools/driver_limit.c");
    let compiled = Command::new("gcc")
        .args(["-std=gnu11", "-O2", "-w", "-I", &checkout, source, "-o"])
        .arg(&program)
        .status();
    assert!(compiled.expect("gcc").success());
    let mut c = Command::new(&program)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let (mut to, mut from) = (c.stdin.take().unwrap(), c.stdout.take().unwrap());
    let all: Vec<Case> = cases(1).collect();
    let mut answers = Vec::with_capacity(CASES);
    for block in all.chunks(BLOCK) {
        let bytes: Vec<u8> = block
            .as_flattened()
            .iter()
            .flat_map(|n| n.to_ne_bytes())
            .collect();
        to.write_all(&bytes).unwrap();
        let mut said = vec![0; block.len()];
        from.read_exact(&mut said).unwrap();
        for (case, said) in block.iter().zip(said) {
            assert_eq!(is_allowed(*case), said != 0, "{case:?}");
            answers.push(said != 0);
        }
    }
    drop(to);
    assert!(c.wait().unwrap().success());
    let digest = digest(answers.into_iter());
    println!("{CASES} cases, 0 different, {} allowed", digest.0);
    assert_eq!(digest, ANSWERS, "the answers in this file are another version's");
}
