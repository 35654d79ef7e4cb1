//! Parameters in flash, on the image in QEMU: a set that is sent over the bus in Standby is stored and in use after
//! the restart that it causes; one that is wrong changes nothing; and power lost at every step of a write, hundreds
//! of times, never loses the last good set.
//!
//! The status frames are taken apart by hand, from `core/haptic.dbc`. What `host-sim ecu parameters` does over an adapter
//! is done to the same image behind a serial port.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};

use crate::machine::{Machine, image};
use haptic_core::bus::Frame;
use haptic_core::bus::messages::{Identity, Message, Vehicle, WriteOutcome};
use haptic_core::bus::slcan;
use haptic_core::controller::params::Params;
use haptic_core::quantity::Speed;
use haptic_core::service::download;
use haptic_pil::live::{Listener, View};
use haptic_pil::parameters::Product;
use haptic_secoc::Keys;
use haptic_secoc::fresh::Algorithm;

const BOARD: &str = "mps2-an386";
const STANDBY: u64 = 1;
/// Values of `Guidance_Reset`.
const POWER_ON: u64 = 0;
const NEW_PARAMETERS: u64 = 6;
/// Values of `ParameterStatus_Outcome`.
const NONE: u64 = 0;
const OUT_OF_ORDER: u64 = 3;
const OUT_OF_RANGE: u64 = 4;
const NOT_STANDING: u64 = 6;
const NOT_UNLOCKED: u64 = 7;
/// The machine does not wait for its client, whose speeds may be too old when a set comes: then it is sent again.
const ATTEMPTS: usize = 60;

/// `ParameterStatus`: stored, damaged, outcome, sequence.
#[derive(Debug, PartialEq)]
struct Status {
    stored: bool,
    damaged: bool,
    outcome: u64,
    sequence: u64,
}

/// The next status of the parameters, and the reset cause and the mode of the last torque frame before it.
fn status(machine: &mut Machine) -> (Status, u64, u64) {
    let (mut cause, mut mode) = (u64::MAX, u64::MAX);
    loop {
        match machine.frame() {
            (0x0C0, word) => (cause, mode) = ((word >> 61) & 0x7, (word >> 32) & 0xF),
            (0x320, word) if mode != u64::MAX => {
                let status = Status {
                    stored: (word >> 12) & 1 != 0,
                    damaged: (word >> 13) & 1 != 0,
                    outcome: (word >> 16) & 0xF,
                    sequence: word >> 32,
                };
                return (status, cause, mode);
            }
            _ => {}
        }
    }
}

/// Ten seconds after a reset an ECU takes the next set, by its statuses of a second each.
const SETTLES_WITHIN: usize = 11;

/// Sends a set, without the field `without`, as a client on a bench does: at standstill, unlocked by the number of the
/// set in use.
fn send(machine: &mut Machine, params: &Params, in_use: u32, without: Option<usize>) {
    let standing = Vehicle {
        speeds: [Speed::ZERO; 2],
        yaw_rate: None,
    };
    // A hundred messages in a row, behind the three of a new sender.
    let mut counter = 0;
    let mut send = |frame: Option<&Frame>| {
        let frames = [standing.encode(counter)].into_iter().chain(frame.copied());
        counter = counter.wrapping_add(1);
        machine.send(
            &frames
                .flat_map(|frame| slcan::format(&frame))
                .collect::<Vec<u8>>(),
        );
        // Ten milliseconds of the machine's time: torque frames come one in each.
        for _ in 0..10 {
            while machine.frame().0 != 0x0C0 {}
        }
    };
    for _ in 0..104 {
        send(None);
    }
    send(Some(&download::unlock(in_use, 0)));
    for (index, frame) in download::frames(params).iter().enumerate() {
        if without != Some(index) {
            send(Some(frame));
        }
    }
}

const IN_USE: fn(u64, u64) -> Status = |sequence, outcome| Status {
    stored: sequence > 0,
    damaged: false,
    outcome,
    sequence,
};

#[test]
fn a_set_sent_in_standby_is_in_use_after_a_restart() {
    let mut machine = Machine::start(BOARD, "steering-ecu", "none");
    assert_eq!(status(&mut machine), (IN_USE(0, NONE), POWER_ON, STANDBY));
    for sequence in 1..=3 {
        let params = Params {
            torque_limit_nm: 3.0 + sequence as f64 / 8.0,
            ..Params::PAPER
        };
        if sequence > 1 {
            for _ in 0..SETTLES_WITHIN {
                status(&mut machine);
            }
        }
        let stored = (0..ATTEMPTS).find_map(|_| {
            send(&mut machine, &params, sequence as u32 - 1, None);
            // What was under way when the set was sent still says the last one.
            (0..5)
                .map(|_| status(&mut machine))
                .find(|(now, ..)| now.sequence == sequence)
        });
        assert_eq!(
            stored,
            Some((IN_USE(sequence, NONE), NEW_PARAMETERS, STANDBY)),
            "set {sequence}"
        );
    }
}

#[test]
fn a_set_that_is_wrong_changes_nothing_and_is_told() {
    let mut machine = Machine::start(BOARD, "steering-ecu", "none");
    let (first, ..) = status(&mut machine);
    assert_eq!(first, IN_USE(0, NONE));
    let too_much = Params {
        torque_limit_nm: 5.5,
        ..Params::PAPER
    };
    for (params, without, outcome) in [
        (too_much, None, OUT_OF_RANGE),
        (Params::PAPER, Some(7), OUT_OF_ORDER),
    ] {
        let heard = (0..ATTEMPTS).find_map(|_| {
            send(&mut machine, &params, 0, without);
            let heard: Vec<_> = (0..5).map(|_| status(&mut machine)).collect();
            // Two seconds behind its unlocking a set is late too.
            let late = [NOT_STANDING, NOT_UNLOCKED];
            let is_late = heard.iter().any(|(now, ..)| late.contains(&now.outcome));
            (!is_late).then_some(heard)
        });
        let heard = heard.expect("speeds in time, in one attempt of many");
        let told = heard.contains(&(IN_USE(0, outcome), POWER_ON, STANDBY));
        assert!(told, "outcome {outcome} within 5 s, not {heard:?}");
    }
}

/// The image behind a serial port, and a client of it.
fn on_a_serial_port(bin: &str) -> (Child, Product) {
    let mut qemu = Command::new("qemu-system-arm")
        .args(["-machine", BOARD, "-display", "none", "-monitor", "none"])
        .args(["-serial", "pty", "-serial", "null"])
        // Its client has a clock of its own, and the machine must not run ahead of that while it sleeps.
        .args(["-icount", "shift=5,sleep=on"])
        .args(["-semihosting-config", "enable=on,target=native"])
        .arg("-kernel")
        .arg(image(BOARD, bin))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .expect("qemu-system-arm is missing: apt-get install qemu-system-arm");
    let mut line = String::new();
    let mut said = BufReader::new(qemu.stdout.take().unwrap());
    said.read_line(&mut line).unwrap();
    // "char device redirected to /dev/pts/3 (label serial0)"
    let port = line.split_whitespace().find(|word| word.starts_with("/dev/"));
    let product = Product::on(port.unwrap_or_else(|| panic!("QEMU says: {line}"))).unwrap();
    (qemu, product)
}

const SOFTER: Params = Params {
    torque_limit_nm: 3.0,
    ..Params::PAPER
};

#[test]
fn an_ecu_with_keys_stores_a_set_with_proofs_alone() {
    let (mut qemu, mut product) = on_a_serial_port("keys-siphash");
    let refused = product.store(&SOFTER, 7).unwrap_err().to_string();
    assert!(refused.contains("still has set 0 in use"), "{refused}");
    // A sender of another algorithm proves nothing either.
    product.prove(Some(&Keys::bench(Algorithm::AesCmac)));
    assert!(product.store(&SOFTER, 7).is_err());
    product.prove(Some(&Keys::bench(Algorithm::SipHash)));
    let stored = (0..ATTEMPTS).find_map(|_| product.store(&SOFTER, 7).ok());
    assert!(stored.is_some_and(|stored| stored.stored), "{stored:?}");
    assert_eq!(product.values().unwrap().torque_limit_nm, 3.0);
    qemu.kill().unwrap();
    qemu.wait().unwrap();
}

#[test]
fn the_workbench_stores_a_set_over_a_serial_adapter() {
    let (mut qemu, mut product) = on_a_serial_port("steering-ecu");
    let status = product.status().unwrap();
    assert_eq!(
        (status.stored, status.damaged, status.sequence),
        (false, false, 0)
    );
    // Under load, a set may come late: the machine does not wait for its client.
    let stored = (0..ATTEMPTS).find_map(|_| product.store(&SOFTER, 654_321).ok());
    let stored = stored.expect("a set in time, in one attempt of many");
    assert_eq!((stored.stored, stored.damaged), (true, false));
    // Not within ten seconds of the restart, lest somebody wears the flash out. An attempt that comes later than that is
    // stored, and causes the restart of the next.
    let refused = (0..ATTEMPTS).find_map(|_| {
        let why = product.store(&SOFTER, 654_321).err()?.to_string();
        why.contains("ten seconds after a reset").then_some(why)
    });
    assert!(refused.is_some(), "no attempt of many was refused");
    // QEMU's machines have no number of their own.
    assert_eq!(
        product.identity().unwrap(),
        Identity {
            vehicle: 654_321,
            hardware: 0
        }
    );
    // As the bus rounds it: 3 is a binary32.
    assert_eq!(product.values().unwrap().torque_limit_nm, 3.0);
    // Not even sent: the ECU's answer would be "out of range".
    let too_much = Params {
        torque_limit_nm: 5.5,
        ..Params::PAPER
    };
    assert!(product.store(&too_much, 0).is_err());
    assert_eq!(product.status().unwrap().outcome, WriteOutcome::TooSoon);
    listen(Listener::after(product));
    qemu.kill().unwrap();
    qemu.wait().unwrap();
}

/// An ECU that nobody else talks to any more waits, and says what it misses.
fn listen(mut listener: Listener) {
    let mut view = View::default();
    let mut changes = Vec::new();
    for _ in 0..5000 {
        let frame = listener.frame().unwrap();
        if let Some(frame) = frame {
            changes.extend(view.take(0.0, &frame));
        }
    }
    assert_eq!(changes[0], "mode Standby, last start: NewParameters");
    let status = view.status();
    assert_eq!((status.torque_nm, status.warning), (Some(0.0), false));
    assert_eq!(status.speed_m_per_s, None, "nobody sends one");
    assert!(status.faults.contains(&"SpeedTimeout".to_owned()), "{status:?}");
    assert_eq!((view.counts().damaged, view.counts().foreign), (0, 0));
}

/// The image cuts the supply of its flash at every number of operations, resets, and looks (`power_loss.rs`).
#[test]
fn power_lost_at_every_step_of_a_write_never_loses_the_last_good_set() {
    let output = Command::new("qemu-system-arm")
        .args(["-machine", BOARD, "-display", "none", "-monitor", "none"])
        .args(["-serial", "null", "-serial", "null"])
        .args(["-icount", "shift=5,sleep=off"])
        .args(["-semihosting-config", "enable=on,target=native"])
        .arg("-kernel")
        .arg(image(BOARD, "power-loss"))
        .output()
        .expect("qemu-system-arm is missing: apt-get install qemu-system-arm");
    let said = [output.stdout, output.stderr].concat();
    let said = String::from_utf8_lossy(&said);
    assert!(output.status.success(), "{said}");
    // "250 cuts, 61 writes"
    let numbers: Vec<u32> = said
        .split(|c: char| !c.is_ascii_digit())
        .filter_map(|n| n.parse().ok())
        .collect();
    let [cuts, writes] = numbers[..] else {
        panic!("the image says: {said}")
    };
    assert!(cuts >= 200 && writes >= 50, "{said}");
}
