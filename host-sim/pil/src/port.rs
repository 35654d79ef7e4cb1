//! A bus as a client sees it: frames out, frames in, through an adapter that may close and open again.
//!
//! Not here: the way to the adapter (`adapter`), and what the frames mean.

use std::hash::{BuildHasher, RandomState};
use std::io::Write;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use haptic_core::bus::Frame;
use haptic_secoc::Keys;
use haptic_secoc::prover::Prover;

use super::adapter::{self, Adapter};
use super::link::{self, Decoder, Unread};
use super::responses::pump;
use super::{Channel, PilError};

/// A port that is silent for so long may belong to an ECU that speaks SLCAN itself and has just started anew.
const REOPEN: Duration = Duration::from_millis(100);

/// An open way to a bus.
pub(super) struct Port {
    input: Box<dyn Write + Send>,
    bytes: Receiver<Vec<u8>>,
    pending: std::vec::IntoIter<u8>,
    decoder: Decoder,
    channel: Channel,
    prover: Option<Prover>,
}

impl Port {
    pub(super) fn open(adapter: &str) -> Result<Self, PilError> {
        let Adapter {
            channel,
            input,
            output,
        } = adapter::open(adapter)?;
        let mut port = Self {
            input,
            bytes: pump(output),
            pending: Vec::new().into_iter(),
            decoder: Decoder::new(channel),
            channel,
            prover: None,
        };
        if channel == Channel::Slcan {
            port.write(link::OPEN)?;
        }
        Ok(port)
    }

    /// Sends with proofs under these keys from now on.
    pub(super) fn prove(&mut self, keys: &Keys) {
        self.prover = Some(Prover::new(keys));
    }

    pub(super) fn proves(&self) -> bool {
        self.prover.is_some()
    }

    /// All in one piece: what belongs together is not torn apart where this computer is busy.
    pub(super) fn send(&mut self, frames: &[Frame]) -> Result<(), PilError> {
        match &mut self.prover {
            None => self.send_as_they_are(frames),
            Some(prover) => {
                let proven: Vec<Frame> = frames.iter().flat_map(|frame| prover.prove(frame)).collect();
                self.send_as_they_are(&proven)
            }
        }
    }

    fn send_as_they_are(&mut self, frames: &[Frame]) -> Result<(), PilError> {
        let bytes = frames.iter().flat_map(|frame| link::encode(self.channel, frame));
        let bytes: Vec<u8> = bytes.collect();
        self.write(&bytes)
    }

    /// What the adapter wrote beside frames of this bus.
    pub(super) fn unread(&self) -> Unread {
        self.decoder.unread()
    }

    /// The next frame; None when none came for [`REOPEN`].
    pub(super) fn frame(&mut self) -> Result<Option<Frame>, PilError> {
        loop {
            for byte in self.pending.by_ref() {
                let Some(frame) = self.decoder.push(byte)? else {
                    continue;
                };
                if let Some(prover) = &mut self.prover {
                    // A number that was not given before: states begin by chance, and differ.
                    let questions = prover.hear(&frame, || RandomState::new().hash_one(0_u8) as u32);
                    self.send_as_they_are(&questions)?;
                }
                return Ok(Some(frame));
            }
            match self.bytes.recv_timeout(REOPEN) {
                Ok(bytes) => self.pending = bytes.into_iter(),
                Err(RecvTimeoutError::Timeout) => {
                    if self.channel == Channel::Slcan {
                        self.write(link::REOPEN)?;
                    }
                    return Ok(None);
                }
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(PilError::Failed("the adapter is gone".into()));
                }
            }
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), PilError> {
        let written = self.input.write_all(bytes).and_then(|()| self.input.flush());
        written.map_err(|e| PilError::Failed(format!("the adapter takes no frames: {e}")))
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        if self.channel == Channel::Slcan {
            // An adapter that is gone is closed.
            let _ = self.write(link::CLOSE);
        }
    }
}
