//! The product image in QEMU, as a client on its bus meets it: it boots, speaks SLCAN, guides when it is
//! asked to, steps a thousand times a second, and says in its log what it does.
//!
//! The client's clock is the ECU's: it sends what is due whenever a torque frame comes. Frames are taken apart
//! here by hand, from `core/haptic.dbc`.

use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdin, Command, Stdio};

use haptic_core::bus::Frame;
use haptic_core::bus::messages::{Column, LanePreview, Message, Request, Vehicle};
use haptic_core::bus::slcan;
use haptic_core::quantity::{Metres, Micros, Radians, Ratio, Speed, Torque};

/// `Guidance_Mode` of the DBC file.
pub(crate) const ACTIVE: u64 = 2;
const FAULT: u64 = 5;
/// Law (9) at rest: K_1*a1'*e_y' = 0.25*2*0.5 = 0.25 N.m, in LSBs of 2^-12 N.m.
pub(crate) const EXPECTED_RAW: i16 = 1024;
/// A boot has this many milliseconds to guide.
const PATIENCE: u32 = 8_000;
/// The machine counts instructions and is never late, but on a busy host this client may be: its frames are then too
/// old, and the ECU hands over. It may need another boot.
pub(crate) const BOOTS: u32 = 8;

/// The torque frame's signals.
pub(crate) struct Guidance {
    counter: u8,
    pub(crate) torque_raw: i16,
    pub(crate) mode: u64,
}

/// CRC-8, polynomial 0x2F, init and xorout 0xFF, bit by bit.
fn crc8(bytes: impl Iterator<Item = u8>) -> u8 {
    !bytes.fold(0xFF, |crc, byte| {
        (0..8).fold(crc ^ byte, |crc, _| {
            if crc & 0x80 == 0 {
                crc << 1
            } else {
                (crc << 1) ^ 0x2F
            }
        })
    })
}

/// A `t0C08..` line taken apart; None for any other line. Panics where the CRC does not fit.
pub(crate) fn guidance(line: &str) -> Option<Guidance> {
    const DATA_IDS: [u8; 16] = [
        0xD9, 0xAD, 0xC1, 0x0B, 0x75, 0xF8, 0xE0, 0x7C, 0x7A, 0xE6, 0xAE, 0x92, 0x9B, 0x3E, 0xEA, 0x5E,
    ];
    let hex = line.strip_prefix("t0C08")?;
    let data: Vec<u8> = (0..8)
        .map(|i| u8::from_str_radix(&hex[2 * i..2 * i + 2], 16).unwrap())
        .collect();
    let counter = data[1] & 0x0F;
    let data_id = DATA_IDS[usize::from(counter)] ^ 0x5A;
    assert_eq!(
        data[0],
        crc8(data[1..].iter().copied().chain([data_id])),
        "CRC of {line}"
    );
    let word = u64::from_le_bytes(data.try_into().unwrap());
    Some(Guidance {
        counter,
        torque_raw: (word >> 12) as u16 as i16,
        mode: (word >> 32) & 0x7,
    })
}

/// The image in QEMU. QEMU ends when its input does, which is at the latest when this test dies.
pub(crate) struct Ecu {
    runner: Child,
    to: Option<ChildStdin>,
    from: BufReader<std::process::ChildStdout>,
}

impl Ecu {
    fn start() -> Self {
        Self::run("3", &[])
    }

    /// Runs it at another pace of the machine's clock, with further options of `cargo xtask qemu`.
    pub(crate) fn run(icount: &str, options: &[&OsStr]) -> Self {
        let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
        let mut runner = Command::new(cargo)
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .args([
                "xtask",
                "qemu",
                "steering-ecu",
                "--can",
                "stdio",
                "--icount",
                icount,
                "--timeout",
                "300",
            ])
            .args(options)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let to = runner.stdin.take();
        let from = BufReader::new(runner.stdout.take().unwrap());
        Self { runner, to, from }
    }

    pub(crate) fn send(&mut self, bytes: &[u8]) {
        self.to
            .as_mut()
            .unwrap()
            .write_all(bytes)
            .expect("the image takes bytes");
    }

    pub(crate) fn line(&mut self) -> String {
        let mut line = Vec::new();
        self.from.read_until(b'\r', &mut line).unwrap();
        assert!(
            line.ends_with(b"\r"),
            "the image fell silent; its log:\n{}",
            self.rest_of_log()
        );
        String::from_utf8(line).unwrap().trim_end().to_owned()
    }

    fn rest_of_log(&mut self) -> String {
        let mut log = String::new();
        self.runner
            .stderr
            .take()
            .unwrap()
            .read_to_string(&mut log)
            .unwrap();
        log
    }

    /// Hangs up and returns the log.
    pub(crate) fn end(mut self) -> String {
        drop(self.to.take());
        std::io::copy(&mut self.from, &mut std::io::sink()).unwrap();
        let log = self.rest_of_log();
        assert!(self.runner.wait().unwrap().success(), "{log}");
        log
    }
}

/// What the other senders put on the bus at millisecond `k`: half a metre to the left of the target's line, car
/// and wheel at rest relative to it.
pub(crate) fn frames(k: u32, motor_raw: i16, engage: bool) -> Vec<Frame> {
    let mut frames = Vec::new();
    if k.is_multiple_of(8) {
        let lane = LanePreview {
            e_y: Metres::from_m(0.5),
            e_theta: Radians::ZERO,
            age: Micros::from_us(0),
            valid: true,
        };
        frames.push(lane.encode((k / 8) as u8));
    }
    if k.is_multiple_of(2) {
        let column = Column {
            driver_torque: Torque::ZERO,
            wheel_angle: Radians::ZERO,
            motor_torque: Torque::from_nm(f64::from(motor_raw) / 4096.0),
        };
        frames.push(column.encode((k / 2) as u8));
    }
    if k.is_multiple_of(10) {
        frames.push(
            Vehicle {
                speeds: [Speed::from_m_per_s(20.0); 2],
                yaw_rate: None,
            }
            .encode((k / 10) as u8),
        );
        frames.push(
            Request {
                engage,
                authority: Ratio::from_si(1.0),
                probe: false,
            }
            .encode((k / 10) as u8),
        );
    }
    frames
}

#[test]
fn the_product_guides_on_its_bus() {
    for _ in 0..BOOTS {
        let mut ecu = Ecu::start();
        let guided = guide(&mut ecu);
        let log = ecu.end();
        assert!(log.contains("steering-ecu on mps2-an386"), "{log}");
        if guided {
            return;
        }
    }
    panic!("the torque of the law was not reached in {BOOTS} boots");
}

/// Plays the other senders until the torque has been the law's for 100 steps.
fn guide(ecu: &mut Ecu) -> bool {
    ecu.send(b"C\rS6\rO\r");
    let (mut last, mut seen_active, mut settled) = (None, false, 0);
    let mut k = 0;
    while k < PATIENCE {
        let Some(now) = guidance(&ecu.line()) else {
            continue;
        };
        if let Some(last) = last {
            assert_eq!(now.counter, (last + 1) % 16, "a torque frame is missing at {k}");
        }
        last = Some(now.counter);
        seen_active |= now.mode == ACTIVE;
        assert!(
            seen_active || now.torque_raw == 0,
            "torque before guidance is active"
        );
        settled += u32::from(now.mode == ACTIVE && (now.torque_raw - EXPECTED_RAW).abs() <= 4);
        if settled == 100 {
            return true;
        }
        if now.mode == FAULT {
            return false;
        }
        // Guidance is asked for anew every two seconds.
        for frame in frames(k, now.torque_raw, k % 2000 >= 800) {
            ecu.send(&slcan::format(&frame));
        }
        k += 1;
    }
    false
}

/// By the board's own clocks: the log's time comes from one, the steps from another.
#[test]
fn the_product_steps_a_thousand_times_a_second() {
    let mut ecu = Ecu::start();
    let log = BufReader::new(ecu.runner.stderr.take().unwrap());
    let mut last: Option<(f64, f64)> = None;
    // "1.000123 info steps 1000, received .."
    for line in log.lines().map_while(Result::ok) {
        let Some((time, rest)) = line.split_once(" info steps ") else {
            continue;
        };
        let steps = rest.split(',').next().unwrap_or("");
        let now = (time.parse::<f64>().unwrap(), steps.parse::<f64>().unwrap());
        if let Some(last) = last.replace(now) {
            let rate_hz = (now.1 - last.1) / (now.0 - last.0);
            assert!((rate_hz - 1000.0).abs() < 1.0, "{rate_hz} steps a second");
            return;
        }
    }
    panic!("the log has no two counts of steps");
}
