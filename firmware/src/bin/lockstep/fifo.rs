//! Frames as binary records on QEMU's standard input and output, by semihosting: the fast channel.
//!
//! A read returns what the pipe holds and waits only when it is empty, and answers are written before such a
//! wait; so a client may send one tick and wait for its answer, or send thousands ahead.

use cortex_m_semihosting::syscall;
use embedded_can::nb::Can;
use embedded_can::{Error, ErrorKind};
use embedded_hal_nb::nb;
use haptic_core::bus::Frame;
use haptic_firmware::host;
use haptic_lockstep::{RECORD_LEN, from_record, to_record};

/// Bytes of a buffer: few calls of the host, which cost a microsecond each and more.
const BUFFER: usize = 8192;

/// A semihosting file.
struct File(usize);

impl File {
    fn open(name: &'static [u8], mode: usize) -> Self {
        // SAFETY: name, mode and length as SYS_OPEN expects; the name ends with a zero.
        let handle = unsafe { syscall!(OPEN, name.as_ptr(), mode, name.len() - 1) };
        assert!(
            handle != usize::MAX,
            "QEMU's standard input or output does not open"
        );
        Self(handle)
    }

    /// Bytes read into `buffer`; 0 at the end of the file.
    fn read(&self, buffer: &mut [u8]) -> usize {
        // SAFETY: the host writes at most `buffer.len()` bytes.
        let missing = unsafe { syscall!(READ, self.0, buffer.as_mut_ptr(), buffer.len()) };
        buffer.len().saturating_sub(missing)
    }

    fn write_all(&self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            // SAFETY: the host reads `bytes.len()` bytes.
            let missing = unsafe { syscall!(WRITE, self.0, bytes.as_ptr(), bytes.len()) };
            assert!(missing < bytes.len(), "QEMU's standard output is closed");
            bytes = &bytes[bytes.len() - missing..];
        }
    }
}

/// The end of the input: the client has closed its pipe.
#[derive(Debug)]
pub(crate) struct EndOfInput;

impl Error for EndOfInput {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

/// Both pipes.
pub(crate) struct Fifo {
    input: File,
    received: [u8; BUFFER],
    /// Bytes of `received` that hold records: from, to.
    unread: (usize, usize),
    output: File,
    sent: heapless::Vec<u8, BUFFER>,
}

/// Serves the pipes if QEMU's semihosting arguments ask for them.
pub(crate) fn serve_if_asked(serve: impl FnOnce(&mut Fifo)) {
    // A static and not on the stack, whose budget is the controller's.
    static mut FIFO: Option<Fifo> = None;
    let mut buffer = [0; 128];
    let mut arguments = host::command_line(&mut buffer).split(' ');
    if arguments.any(|argument| argument == "fifo") {
        let fifo = &raw mut FIFO;
        // SAFETY: called once, from `main`; no interrupt has a handler.
        serve(unsafe { (*fifo).insert(Fifo::open()) });
    }
}

impl Fifo {
    /// Opens the pipes.
    fn open() -> Self {
        // Modes of SYS_OPEN, as fopen's: 1 is "rb", 5 is "wb".
        Self {
            input: File::open(b"/dev/stdin\0", 1),
            received: [0; BUFFER],
            unread: (0, 0),
            output: File::open(b"/dev/stdout\0", 5),
            sent: heapless::Vec::new(),
        }
    }

    fn flush(&mut self) {
        self.output.write_all(&self.sent);
        self.sent.clear();
    }

    /// Reads until a whole record is there.
    fn fill(&mut self) -> Result<(), EndOfInput> {
        let (from, to) = self.unread;
        self.received.copy_within(from..to, 0);
        self.unread = (0, to - from);
        while self.unread.1 < RECORD_LEN {
            match self.input.read(&mut self.received[self.unread.1..]) {
                0 => return Err(EndOfInput),
                n => self.unread.1 += n,
            }
        }
        Ok(())
    }
}

impl Can for Fifo {
    type Frame = Frame;
    type Error = EndOfInput;

    fn transmit(&mut self, frame: &Frame) -> nb::Result<Option<Frame>, EndOfInput> {
        if self.sent.capacity() - self.sent.len() < RECORD_LEN {
            self.flush();
        }
        let Ok(()) = self.sent.extend_from_slice(&to_record(frame)) else {
            unreachable!("the buffer was flushed")
        };
        Ok(None)
    }

    /// The next frame; waits for it.
    fn receive(&mut self) -> nb::Result<Frame, EndOfInput> {
        if self.unread.1 - self.unread.0 < RECORD_LEN {
            self.flush();
            self.fill()?;
        }
        let mut record = [0; RECORD_LEN];
        record.copy_from_slice(&self.received[self.unread.0..self.unread.0 + RECORD_LEN]);
        self.unread.0 += RECORD_LEN;
        from_record(&record).map_or_else(|| panic!("not a frame's record: {record:?}"), Ok)
    }
}
