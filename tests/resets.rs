//! What becomes of a product that breaks: the image `broken` in QEMU hangs, panics, faults or outgrows its stack half
//! a second after power-up. Each must reset it, by the watchdog or by its own handler, and the next start must say
//! why on the bus; one that breaks after every start must lock. The guard of the stack and the watchdog are shown on
//! a second core too (Cortex-M7).
//!
//! QEMU counts instructions, so the machine's time is that of its program and no load of this computer moves it.
//! The torque frames are taken apart by hand, from `core/haptic.dbc`.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// The reference board, and the same with another core.
const M4F: &str = "mps2-an386";
const M7: &str = "mps2-an500";
/// A value of `Guidance_Mode`.
const LOCKED: u64 = 6;
/// Values of `Guidance_Reset`.
const POWER_ON: u64 = 0;
const WATCHDOG: u64 = 1;
const HARD_FAULT: u64 = 2;
const PANIC: u64 = 3;
const STACK_OVERFLOW: u64 = 4;
/// The step that breaks (`firmware/src/bin/broken.rs`).
const BREAKS_AT: usize = 500;
/// A target that says nothing for so long is stuck. It speaks every millisecond of its time.
const SILENCE: Duration = Duration::from_secs(60);

struct Machine {
    qemu: Child,
    bytes: Receiver<u8>,
}

impl Drop for Machine {
    fn drop(&mut self) {
        // Both fail only for a process that is gone already.
        let _ = self.qemu.kill();
        let _ = self.qemu.wait();
    }
}

/// The reset cause and the mode of a torque frame.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Status {
    cause: u64,
    mode: u64,
}

impl Machine {
    fn start(board: &str, flaw: &str) -> Self {
        let mut qemu = Command::new("qemu-system-arm")
            .args(["-machine", board, "-display", "none", "-monitor", "none"])
            .args(["-serial", "stdio", "-serial", "null"])
            .args(["-icount", "shift=5,sleep=off"])
            .arg("-semihosting-config")
            .arg(format!("enable=on,target=native,arg=broken,arg={flaw}"))
            .arg("-kernel")
            .arg(image(board))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("qemu-system-arm is missing: apt-get install qemu-system-arm");
        let mut input = qemu.stdin.take().unwrap();
        let mut output = qemu.stdout.take().unwrap();
        // A reset closes the SLCAN channel, so it is opened again and again.
        std::thread::spawn(move || {
            while input.write_all(b"O\r").and_then(|()| input.flush()).is_ok() {
                std::thread::sleep(Duration::from_millis(5));
            }
        });
        let (to, bytes) = channel();
        std::thread::spawn(move || {
            let mut buffer = [0; 4096];
            while let Ok(n @ 1..) = output.read(&mut buffer) {
                if buffer[..n].iter().any(|byte| to.send(*byte).is_err()) {
                    return;
                }
            }
        });
        Self { qemu, bytes }
    }

    /// The next torque frame's status.
    fn status(&mut self) -> Status {
        loop {
            let mut line = Vec::new();
            loop {
                match self.bytes.recv_timeout(SILENCE).expect("the image fell silent") {
                    b'\r' => break,
                    byte => line.push(byte),
                }
            }
            let line = String::from_utf8_lossy(&line);
            if let Some(hex) = line.strip_prefix("t0C08") {
                let word = u64::from_str_radix(hex, 16).unwrap().swap_bytes();
                return Status {
                    cause: (word >> 52) & 0x7,
                    mode: (word >> 32) & 0xF,
                };
            }
        }
    }

    /// Reads on until the status is another; returns it and how many frames had the one before.
    fn next_other(&mut self, status: Status) -> (Status, usize) {
        for frames in 1..100_000 {
            let next = self.status();
            if next != status {
                return (next, frames);
            }
        }
        panic!("{status:?} for 100 s");
    }
}

/// Builds the image of a board and returns a copy of its ELF that no other board's build overwrites.
fn image(board: &str) -> PathBuf {
    static BUILDS: Mutex<()> = Mutex::new(());
    let _one_at_a_time = BUILDS.lock();
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(["build", "--release", "-p", "haptic-firmware", "--bin", "broken"])
        .args(["--target", "thumbv7em-none-eabihf", "--features", board])
        .arg("--message-format=json-render-diagnostics")
        .stderr(Stdio::inherit())
        .output()
        .unwrap();
    assert!(output.status.success(), "the image does not build");
    let elf = String::from_utf8_lossy(&output.stdout)
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        .find_map(|message| message["executable"].as_str().map(PathBuf::from))
        .unwrap();
    // A name for each call: tests run side by side.
    static COPIES: AtomicU32 = AtomicU32::new(0);
    let name = format!("broken-{board}-{}", COPIES.fetch_add(1, Ordering::Relaxed));
    let copy = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::copy(elf, &copy).unwrap();
    copy
}

/// Power-up, the flaw, and the start after it, which must give `cause` and last.
fn comes_back(board: &str, flaw: &str, cause: u64) {
    let mut machine = Machine::start(board, flaw);
    let first = machine.status();
    assert_eq!(first.cause, POWER_ON);
    let (second, frames) = machine.next_other(first);
    assert_eq!(second.cause, cause, "after {flaw}: {second:?}");
    // The client may open the channel late, but the machine does not speak again before it breaks.
    assert!(frames <= BREAKS_AT, "{flaw} after {frames} frames");
    for _ in 0..2 * BREAKS_AT {
        assert_eq!(machine.status(), second, "the start after {flaw} does not last");
    }
}

#[test]
fn a_loop_that_hangs_meets_the_watchdog() {
    comes_back(M4F, "hang", WATCHDOG);
}

#[test]
fn a_panic_resets_and_says_so() {
    comes_back(M4F, "panic", PANIC);
}

#[test]
fn a_fault_resets_and_says_so() {
    comes_back(M4F, "fault", HARD_FAULT);
}

/// Caught by the guard below the stack, before it overwrites data.
#[test]
fn a_stack_that_outgrows_its_budget_resets_and_says_so() {
    comes_back(M4F, "overflow", STACK_OVERFLOW);
}

#[test]
fn another_core_has_the_same_guard_and_watchdog() {
    comes_back(M7, "overflow", STACK_OVERFLOW);
    comes_back(M7, "hang", WATCHDOG);
}

#[test]
fn three_resets_within_ten_seconds_lock() {
    let mut machine = Machine::start(M4F, "hang-always");
    let mut status = machine.status();
    assert_eq!(status.cause, POWER_ON);
    let mut frames = 0;
    while status.mode != LOCKED {
        let (next, n) = machine.next_other(status);
        assert_eq!(next.cause, WATCHDOG);
        (status, frames) = (next, frames + n);
    }
    // Power-up and two more starts before the third reset.
    assert!(frames <= 3 * BREAKS_AT, "locked after {frames} frames");
}
