//! The way to a board: a CAN adapter that this computer sees as a network interface (SocketCAN) or as a serial line
//! that speaks SLCAN.
//!
//! SocketCAN's frames travel as the pipe's records, so that code that reads and writes bytes need not know.
//! Not here: the interface's bit rate, which `ip link` sets.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use super::{Channel, PilError};

/// A serial adapter over USB takes any rate; one with a real UART, such as a Lawicel CAN232, this one.
const BAUD: u32 = 115_200;
/// A run that hears nothing for so long is over anyway.
const READ_LIMIT: Duration = Duration::from_secs(60);

/// An open adapter.
pub(super) struct Adapter {
    pub(super) channel: Channel,
    pub(super) input: Box<dyn Write + Send>,
    pub(super) output: Box<dyn Read + Send>,
}

/// Opens `tcp:HOST:PORT`, the path of a serial port, or a network interface.
pub(super) fn open(name: &str) -> Result<Adapter, PilError> {
    if let Some(address) = name.strip_prefix("tcp:") {
        return tcp(address).map_err(|e| PilError::Missing(format!("{name}: {e}")));
    }
    if name.contains(['/', '\\']) || name.starts_with("COM") {
        return serial(name)
            .map_err(|e| PilError::Missing(format!("serial port {name}: {e}; is the adapter plugged in?")));
    }
    interface(name)
}

fn tcp(address: &str) -> std::io::Result<Adapter> {
    let stream = TcpStream::connect(address)?;
    // A tick is a few bytes, and its answer is waited for.
    stream.set_nodelay(true)?;
    Ok(Adapter {
        channel: Channel::Slcan,
        output: Box::new(stream.try_clone()?),
        input: Box::new(stream),
    })
}

fn serial(path: &str) -> std::io::Result<Adapter> {
    let mut port = serial2::SerialPort::open(path, BAUD)?;
    port.set_read_timeout(READ_LIMIT)?;
    Ok(Adapter {
        channel: Channel::Slcan,
        output: Box::new(port.try_clone()?),
        input: Box::new(port),
    })
}

#[cfg(not(target_os = "linux"))]
fn interface(name: &str) -> Result<Adapter, PilError> {
    Err(PilError::Missing(format!(
        "interface {name}: only Linux has SocketCAN; name an SLCAN adapter's serial port"
    )))
}

#[cfg(target_os = "linux")]
use socket::interface;

#[cfg(target_os = "linux")]
mod socket {
    use std::io::{self, Read, Write};
    use std::sync::Arc;

    use embedded_can::{Frame as _, Id};
    use haptic_core::bus::Frame;
    use haptic_lockstep::{RECORD_LEN, from_record, to_record};
    use socketcan::{CanFrame, CanSocket, Socket};

    use super::{Adapter, Channel, PilError};

    pub(super) fn interface(name: &str) -> Result<Adapter, PilError> {
        let socket = CanSocket::open(name).map_err(|e| {
            PilError::Missing(format!(
                "CAN interface {name}: {e}; a network interface of that name must be up: \
                 ip link set {name} up type can bitrate 500000"
            ))
        })?;
        // One socket for both ways: a second one would hear what the first one sends.
        let socket = Arc::new(socket);
        Ok(Adapter {
            channel: Channel::Fifo,
            output: Box::new(Records {
                socket: Arc::clone(&socket),
                bytes: Vec::new(),
            }),
            input: Box::new(Records {
                socket,
                bytes: Vec::new(),
            }),
        })
    }

    /// One way of a socket, as records.
    struct Records {
        socket: Arc<CanSocket>,
        /// Written: the start of a record. Read: what of a record was not yet taken.
        bytes: Vec<u8>,
    }

    impl Write for Records {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.bytes.extend_from_slice(bytes);
            while let Some(record) = self.bytes.first_chunk::<RECORD_LEN>() {
                let frame = from_record(record).ok_or(io::ErrorKind::InvalidData)?;
                let frame = CanFrame::new(embedded_can::Frame::id(&frame), frame.data())
                    .ok_or(io::ErrorKind::InvalidData)?;
                self.socket.write_frame_insist(&frame)?;
                self.bytes.drain(..RECORD_LEN);
            }
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Read for Records {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            while self.bytes.is_empty() {
                // Frames of other kinds are none of this bus.
                if let CanFrame::Data(frame) = self.socket.read_frame()?
                    && let Id::Standard(id) = frame.id()
                    && let Some(frame) = Frame::new(id.as_raw(), frame.data())
                {
                    self.bytes.extend(to_record(&frame));
                }
            }
            let taken = buffer.len().min(self.bytes.len());
            buffer[..taken].copy_from_slice(&self.bytes[..taken]);
            self.bytes.drain(..taken);
            Ok(taken)
        }
    }
}
