//! The part of GDB's remote serial protocol that reads and writes a byte of a halted machine.
//!
//! A packet is `$text#cc`, `cc` the sum of the text's bytes; each is answered by `+`.
//!
//! It is written by hand because it needs three requests: the crates `gdbstub` and `gdb-protocol` are for the machine's side, and
//! `gdbc` has the right side behind a terminal's whole interface.

use std::io::{Error, Read, Result, Write};
use std::net::TcpStream;
use std::time::Duration;

/// Longest wait for an answer.
const REPLY_TIMEOUT: Duration = Duration::from_secs(10);

/// A machine that is halted as long as this lives.
pub(super) struct Gdb(TcpStream);

impl Gdb {
    /// QEMU halts its machine when somebody connects.
    pub(super) fn halt(port: u16) -> Result<Self> {
        let stream = TcpStream::connect(("127.0.0.1", port))?;
        stream.set_read_timeout(Some(REPLY_TIMEOUT))?;
        stream.set_nodelay(true)?;
        Ok(Self(stream))
    }

    pub(super) fn read(&mut self, address: u32) -> Result<u8> {
        let answer = self.request(&format!("m{address:x},1"))?;
        u8::from_str_radix(&answer, 16).map_err(|_| refused(&answer))
    }

    pub(super) fn write(&mut self, address: u32, byte: u8) -> Result<()> {
        match self.request(&format!("M{address:x},1:{byte:02x}"))?.as_str() {
            "OK" => Ok(()),
            answer => Err(refused(answer)),
        }
    }

    /// Detaches: the machine goes on.
    pub(super) fn resume(mut self) -> Result<()> {
        match self.request("D")?.as_str() {
            "OK" => Ok(()),
            answer => Err(refused(answer)),
        }
    }

    fn request(&mut self, text: &str) -> Result<String> {
        let sum = text.bytes().fold(0_u8, u8::wrapping_add);
        self.0.write_all(format!("${text}#{sum:02x}").as_bytes())?;
        loop {
            let packet = self.packet()?;
            // The news that the machine has halted may come first.
            if !packet.starts_with('T') {
                return Ok(packet);
            }
        }
    }

    fn packet(&mut self) -> Result<String> {
        while self.byte()? != b'$' {}
        let mut text = String::new();
        loop {
            match self.byte()? {
                b'#' => break,
                byte => text.push(char::from(byte)),
            }
        }
        // The sum of a local connection needs no check.
        self.byte()?;
        self.byte()?;
        self.0.write_all(b"+")?;
        Ok(text)
    }

    fn byte(&mut self) -> Result<u8> {
        let mut byte = [0];
        self.0.read_exact(&mut byte)?;
        Ok(byte[0])
    }
}

fn refused(answer: &str) -> Error {
    Error::other(format!("answered '{answer}'"))
}
