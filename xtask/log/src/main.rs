//! `xtask-log ELF < LOG`: decodes the log of the image ELF, as it arrives, and prints it on the standard error.

use std::env::args_os;
use std::fs;
use std::io::{Read, stdin};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use defmt_decoder::{DecodeError, StreamDecoder, Table};

fn main() -> Result<()> {
    let elf = args_os()
        .nth(1)
        .map(PathBuf::from)
        .context("xtask-log ELF < LOG")?;
    let table = table(&elf)?;
    let mut log = Log {
        decoder: table.new_stream_decoder(),
        can_recover: table.encoding().can_recover(),
    };
    let mut buffer = [0; 4096];
    loop {
        let count = stdin().read(&mut buffer).context("the log")?;
        if count == 0 {
            return Ok(());
        }
        log.print(&buffer[..count])?;
    }
}

fn table(elf: &Path) -> Result<Table> {
    let bytes = fs::read(elf).with_context(|| elf.display().to_string())?;
    Table::parse(&bytes)?.with_context(|| format!("{} has no log messages", elf.display()))
}

struct Log<'a> {
    decoder: Box<dyn StreamDecoder + 'a>,
    can_recover: bool,
}

impl Log<'_> {
    /// Prints the messages that `bytes` complete: time in seconds, level, text.
    fn print(&mut self, bytes: &[u8]) -> Result<()> {
        self.decoder.received(bytes);
        loop {
            match self.decoder.decode() {
                Ok(frame) => {
                    let time = frame
                        .display_timestamp()
                        .map(|time| time.to_string())
                        .unwrap_or_default();
                    let level = frame.level().map_or("", |level| level.as_str());
                    eprintln!("{time} {level} {}", frame.display_message());
                }
                Err(DecodeError::UnexpectedEof) => return Ok(()),
                Err(DecodeError::Malformed) if self.can_recover => eprintln!("(a damaged message)"),
                Err(DecodeError::Malformed) => bail!("the log does not fit the image"),
            }
        }
    }
}
