//! A bus as a client sees it: frames out, frames in, through an adapter that may close and open again.
//!
//! Not here: the way to the adapter (`adapter`), and what the frames mean.

use std::io::Write;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use haptic_core::bus::Frame;

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
        };
        if channel == Channel::Slcan {
            port.write(link::OPEN)?;
        }
        Ok(port)
    }

    /// All in one piece: what belongs together is not torn apart where this computer is busy.
    pub(super) fn send(&mut self, frames: &[Frame]) -> Result<(), PilError> {
        let bytes: Vec<u8> = frames
            .iter()
            .flat_map(|frame| link::encode(self.channel, frame))
            .collect();
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
                if let Some(frame) = self.decoder.push(byte)? {
                    return Ok(Some(frame));
                }
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
