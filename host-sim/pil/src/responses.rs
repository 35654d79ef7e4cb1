//! What the target answers, frame by frame, and what its silence means.

use std::io::Read;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use haptic_core::bus::Frame;

use super::link::Decoder;
use super::qemu::Qemu;
use super::{Channel, PilError};

/// Longest wait for the next bytes of a target that owes an answer. Starting takes a tenth of a second.
const RESPONSE_TIMEOUT: Duration = Duration::from_secs(20);
/// Longest wait for a target to quit after its run.
const EXIT: Duration = Duration::from_secs(5);

/// The answers of a machine, which ends with them, or of a board, which stays.
pub(super) struct ResponseStream {
    /// None: a board.
    qemu: Option<Qemu>,
    bytes: Receiver<Vec<u8>>,
    decoder: Decoder,
    pending: std::vec::IntoIter<u8>,
    /// Steps answered so far, for messages.
    pub(super) steps: u64,
}

impl ResponseStream {
    pub(super) fn new(qemu: Option<Qemu>, output: impl Read + Send + 'static, channel_kind: Channel) -> Self {
        Self {
            qemu,
            bytes: pump(output),
            decoder: Decoder::new(channel_kind),
            pending: Vec::new().into_iter(),
            steps: 0,
        }
    }

    /// The next frame from the target.
    pub(super) fn frame(&mut self) -> Result<Frame, PilError> {
        loop {
            for byte in self.pending.by_ref() {
                match self.decoder.push(byte) {
                    Ok(Some(frame)) => return Ok(frame),
                    Ok(None) => {}
                    Err(what) => return Err(self.gone(&format!("answered with {what}"))),
                }
            }
            self.pending = match self.bytes.recv_timeout(RESPONSE_TIMEOUT) {
                Ok(bytes) => bytes.into_iter(),
                Err(RecvTimeoutError::Timeout) => {
                    return Err(self.gone(&format!("was silent for {} s", RESPONSE_TIMEOUT.as_secs())));
                }
                Err(RecvTimeoutError::Disconnected) => return Err(self.gone("quit")),
            };
        }
    }

    pub(super) fn gone(&mut self, what: &str) -> PilError {
        let Some(qemu) = &mut self.qemu else {
            return PilError::Failed(format!(
                "the board {what} after {} steps: is this the adapter's port and not the debug probe's, does the \
                 board run the lockstep image, is the bus terminated, and do adapter and board both run at 500 kbit/s?",
                self.steps
            ));
        };
        let status = qemu
            .wait(Duration::from_millis(500))
            .map_or(String::new(), |status| format!(" ({status})"));
        PilError::Failed(format!(
            "the target {what} after {} steps{status}; its log: cargo xtask log {}",
            self.steps,
            qemu.log().display()
        ))
    }

    /// Waits for the machine to end by itself, as it does after its input.
    pub(super) fn end(&mut self) -> Result<(), PilError> {
        let Some(qemu) = &mut self.qemu else {
            return Ok(());
        };
        match qemu.wait(EXIT) {
            Some(status) if status.success() => Ok(()),
            Some(_) => Err(self.gone("failed at the end of the run")),
            None => Err(self.gone("does not end")),
        }
    }

    /// The run went well: its log is not needed.
    pub(super) fn discard_log(&self) {
        if let Some(qemu) = &self.qemu {
            qemu.discard_log();
        }
    }
}

/// Reads on a thread of its own, so that waiting for bytes can have a limit.
pub(super) fn pump(mut output: impl Read + Send + 'static) -> Receiver<Vec<u8>> {
    let (to, from) = channel();
    std::thread::spawn(move || {
        let mut buffer = [0; 65536];
        while let Ok(n @ 1..) = output.read(&mut buffer) {
            if to.send(buffer[..n].to_vec()).is_err() {
                return;
            }
        }
    });
    from
}
