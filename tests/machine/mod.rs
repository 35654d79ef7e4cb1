//! An image in QEMU, as a client on its bus meets it: lines of SLCAN, across resets.
//!
//! QEMU counts instructions, so the machine's time is that of its program and no load of this computer moves it.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// A target that says nothing for so long is stuck. It speaks every millisecond of its time.
const SILENCE: Duration = Duration::from_secs(60);
/// A reset closes the SLCAN channel, so it is opened again and again.
const OPEN_ANEW: Duration = Duration::from_millis(5);

/// A QEMU that ends with its owner.
pub(crate) struct Machine {
    qemu: Child,
    to: Sender<Vec<u8>>,
    from: Receiver<u8>,
}

impl Drop for Machine {
    fn drop(&mut self) {
        // Both fail only for a process that is gone already.
        let _ = self.qemu.kill();
        let _ = self.qemu.wait();
    }
}

impl Machine {
    /// Builds an image for a board and starts it; `argument` is its semihosting argument.
    pub(crate) fn start(board: &str, bin: &str, argument: &str) -> Self {
        Self::run(board, &image(board, bin), argument)
    }

    /// Starts an image.
    pub(crate) fn run(board: &str, elf: &Path, argument: &str) -> Self {
        let mut qemu = Command::new("qemu-system-arm")
            .args(["-machine", board, "-display", "none", "-monitor", "none"])
            .args(["-serial", "stdio", "-serial", "null"])
            .args(["-icount", "shift=5,sleep=off"])
            .arg("-semihosting-config")
            .arg(format!("enable=on,target=native,arg=image,arg={argument}"))
            .arg("-kernel")
            .arg(elf)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("qemu-system-arm is missing: apt-get install qemu-system-arm");
        let mut input = qemu.stdin.take().unwrap();
        let mut output = qemu.stdout.take().unwrap();
        let (to, lines) = channel::<Vec<u8>>();
        std::thread::spawn(move || {
            loop {
                let bytes = match lines.recv_timeout(OPEN_ANEW) {
                    Ok(bytes) => bytes,
                    Err(RecvTimeoutError::Timeout) => b"O\r".to_vec(),
                    Err(RecvTimeoutError::Disconnected) => return,
                };
                if input.write_all(&bytes).and_then(|()| input.flush()).is_err() {
                    return;
                }
            }
        });
        let (bytes, from) = channel();
        std::thread::spawn(move || {
            let mut buffer = [0; 4096];
            while let Ok(n @ 1..) = output.read(&mut buffer) {
                if buffer[..n].iter().any(|byte| bytes.send(*byte).is_err()) {
                    return;
                }
            }
        });
        Self { qemu, to, from }
    }

    /// Sends bytes.
    pub(crate) fn send(&self, bytes: &[u8]) {
        self.to.send(bytes.to_vec()).expect("QEMU is gone");
    }

    /// The identifier and the data, as a little-endian word, of the next full frame.
    pub(crate) fn frame(&mut self) -> (u16, u64) {
        loop {
            let mut line = Vec::new();
            loop {
                match self.from.recv_timeout(SILENCE).expect("the image fell silent") {
                    b'\r' => break,
                    byte => line.push(byte),
                }
            }
            let line = String::from_utf8_lossy(&line);
            if let Some((id, hex)) = line.strip_prefix('t').and_then(|rest| rest.split_once('8'))
                && let (3, 16) = (id.len(), hex.len())
            {
                let word = u64::from_str_radix(hex, 16).unwrap().swap_bytes();
                return (u16::from_str_radix(id, 16).unwrap(), word);
            }
        }
    }
}

/// Builds an image and returns a copy of its ELF that no other board's build overwrites.
pub(crate) fn image(board: &str, bin: &str) -> PathBuf {
    static BUILDS: Mutex<()> = Mutex::new(());
    let _one_at_a_time = BUILDS.lock();
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    // All are for the bench; the product as it leaves the house is `product`, and sealed.
    let (bin, features) = match bin {
        "broken" => (bin, format!("{board},bench,broken")),
        "product" => ("steering-ecu", board.to_owned()),
        "keys-siphash" | "keys-aes" => ("steering-ecu", format!("{board},{bin}")),
        _ => (bin, format!("{board},bench")),
    };
    let output = Command::new(cargo)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(["build", "--profile", "firmware"])
        .args(["-p", "haptic-firmware", "--bin", bin])
        .args(["--target", "thumbv7em-none-eabihf", "--features", &features])
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
    let copy = COPIES.fetch_add(1, Ordering::Relaxed);
    let name = format!("{bin}-{board}-{}-{copy}", std::process::id());
    let copy = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::copy(elf, &copy).unwrap();
    copy
}
