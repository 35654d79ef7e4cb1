//! A serial port as a CAN controller: SLCAN below, `embedded-can` above, so that the loop of an image is the
//! same with this port and with a real controller.
//!
//! Frames pass in both directions only while the client has the channel open, as on a Lawicel adapter.
//! Not here: the protocol itself (`haptic_core::bus::slcan`).

use embedded_can::nb::Can;
use embedded_can::{Error, ErrorKind};
use embedded_hal_nb::nb;
use embedded_hal_nb::serial::{Read, Write};
use haptic_core::bus::Frame;
use haptic_core::bus::slcan::{self, Line, Parser};
use heapless::Deque;

/// Bytes that wait for the port: five frames.
const OUT_MAX: usize = 5 * 22;

/// A CAN controller on a serial port.
#[derive(Debug)]
pub struct SlcanCan<P> {
    port: P,
    parser: Parser,
    open: bool,
    out: Deque<u8, OUT_MAX>,
}

/// Why a frame was neither sent nor received.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SlcanError {
    /// The client has not opened the channel, or has closed it.
    Closed,
    /// The serial port reports an error.
    Port,
}

impl Error for SlcanError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

impl<P: Read<u8> + Write<u8>> SlcanCan<P> {
    /// A closed channel on `port`.
    pub fn new(port: P) -> Self {
        Self {
            port,
            parser: Parser::default(),
            open: false,
            out: Deque::new(),
        }
    }

    /// Whether the client has the channel open.
    pub const fn is_open(&self) -> bool {
        self.open
    }

    /// Hands waiting bytes to the port, as many as it takes.
    fn flush(&mut self) -> nb::Result<(), SlcanError> {
        while let Some(byte) = self.out.front() {
            self.port.write(*byte).map_err(port_error)?;
            self.out.pop_front();
        }
        Ok(())
    }

    /// Queues all of `bytes` or none.
    fn send(&mut self, bytes: &[u8]) -> nb::Result<(), SlcanError> {
        if self.out.capacity() - self.out.len() < bytes.len() {
            return Err(nb::Error::WouldBlock);
        }
        self.out.extend(bytes.iter().copied());
        Ok(())
    }

    fn take(&mut self, line: Line) -> Option<Frame> {
        let mut answer = line.answer();
        let mut frame = None;
        match line {
            Line::Open => self.open = true,
            Line::Close => self.open = false,
            Line::Frame(received) if self.open => frame = Some(received),
            Line::Frame(_) => answer = slcan::ERROR,
            _ => {}
        }
        // A client that does not read loses answers; frames it sent are received all the same.
        let _ = self.send(answer);
        frame
    }
}

/// Whatever the port's error is, only its kind matters here.
fn port_error<E>(error: nb::Error<E>) -> nb::Error<SlcanError> {
    error.map(|_| SlcanError::Port)
}

impl<P: Read<u8> + Write<u8>> Can for SlcanCan<P> {
    type Frame = Frame;
    type Error = SlcanError;

    /// Queues a frame; `WouldBlock` when the port is behind.
    fn transmit(&mut self, frame: &Frame) -> nb::Result<Option<Frame>, SlcanError> {
        if !self.open {
            return Err(nb::Error::Other(SlcanError::Closed));
        }
        let sent = self.send(&slcan::format(frame));
        match self.flush() {
            Err(nb::Error::Other(error)) => Err(nb::Error::Other(error)),
            _ => sent.map(|()| None),
        }
    }

    /// The next frame in the port's bytes; sends what waits and answers commands on the way.
    fn receive(&mut self) -> nb::Result<Frame, SlcanError> {
        loop {
            match self.flush() {
                Ok(()) | Err(nb::Error::WouldBlock) => {}
                Err(error) => return Err(error),
            }
            let byte = self.port.read().map_err(port_error)?;
            if let Some(frame) = self.parser.push(byte).and_then(|line| self.take(line)) {
                return Ok(frame);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_hal_nb::serial::ErrorType;
    use std::collections::VecDeque;
    use std::convert::Infallible;

    /// A port with a limit on the bytes that it takes.
    struct Port {
        input: VecDeque<u8>,
        output: Vec<u8>,
        room: usize,
    }

    impl ErrorType for Port {
        type Error = Infallible;
    }

    impl Read<u8> for Port {
        fn read(&mut self) -> nb::Result<u8, Infallible> {
            self.input.pop_front().ok_or(nb::Error::WouldBlock)
        }
    }

    impl Write<u8> for Port {
        fn write(&mut self, byte: u8) -> nb::Result<(), Infallible> {
            if self.output.len() == self.room {
                return Err(nb::Error::WouldBlock);
            }
            self.output.push(byte);
            Ok(())
        }

        fn flush(&mut self) -> nb::Result<(), Infallible> {
            Ok(())
        }
    }

    fn can(input: &[u8], room: usize) -> SlcanCan<Port> {
        SlcanCan::new(Port {
            input: input.iter().copied().collect(),
            output: Vec::new(),
            room,
        })
    }

    /// The lines that python-can's slcan interface sends on opening, and a frame.
    #[test]
    fn a_client_opens_the_channel_and_frames_pass() {
        let mut can = can(b"C\rS6\rO\rt1002AB01\r", 1000);
        let frame = Frame::new(0x100, &[0xAB, 0x01]).unwrap();
        assert_eq!(can.receive(), Ok(frame));
        assert_eq!(can.receive(), Err(nb::Error::WouldBlock));
        assert_eq!(can.transmit(&Frame::new(0x0C0, &[0x5A]).unwrap()), Ok(None));
        assert_eq!(can.port.output, b"\r\r\rz\rt0C015A\r");
    }

    #[test]
    fn a_closed_channel_passes_nothing() {
        let mut can = can(b"t1002AB01\r", 1000);
        assert_eq!(can.receive(), Err(nb::Error::WouldBlock));
        let frame = Frame::new(0x0C0, &[]).unwrap();
        assert_eq!(can.transmit(&frame), Err(nb::Error::Other(SlcanError::Closed)));
        assert_eq!(can.port.output, b"\x07");
    }

    #[test]
    fn a_port_that_is_behind_gets_whole_lines_or_none() {
        let mut can = can(b"O\r", 4);
        assert_eq!(can.receive(), Err(nb::Error::WouldBlock));
        let frame = Frame::new(0x0C0, &[0; 8]).unwrap();
        // The port takes 3 of the first line's 22 bytes; 19 + 4*22 = 107 of 110 wait when the sixth comes.
        for _ in 0..5 {
            assert_eq!(can.transmit(&frame), Ok(None));
        }
        assert_eq!(can.transmit(&frame), Err(nb::Error::WouldBlock));
        can.port.room = 1000;
        assert_eq!(can.receive(), Err(nb::Error::WouldBlock));
        assert_eq!(
            can.port.output,
            [b"\r".as_slice(), &b"t0C080000000000000000\r".repeat(5)].concat()
        );
    }
}
