//! The machine: one QEMU process, killed when its owner is dropped.
//!
//! The bytes of the channel travel on the process's own standard input and output: by semihosting for the fifo,
//! as the board's UART for SLCAN. So when this program dies in whatever way, the fifo's image reads the end of
//! its input and quits; a terminal's interrupt reaches QEMU as well as this program.

use std::fmt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::str::FromStr;
use std::time::{Duration, Instant};

use super::{Channel, PilError};

const PROGRAM: &str = "qemu-system-arm";

/// Nanoseconds of the target's clock in one instruction, and in one cycle of its 25 MHz counter, when QEMU
/// counts instructions with `-icount shift=10`.
const NS_PER_INSTRUCTION: u64 = 1 << 10;
const NS_PER_CYCLE: u64 = 40;

/// Instructions in a span of counter cycles, to the nearest.
#[must_use]
pub fn instructions(cycles: u32) -> u32 {
    let ns = u64::from(cycles) * NS_PER_CYCLE;
    u32::try_from((ns + NS_PER_INSTRUCTION / 2) / NS_PER_INSTRUCTION).unwrap_or(u32::MAX)
}

/// Boards that QEMU has. The names are QEMU's, and those of the firmware's features.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Machine {
    /// The reference board, Cortex-M4F.
    #[default]
    An386,
    /// The board with a Cortex-M7.
    An500,
}

impl Machine {
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::An386 => "mps2-an386",
            Self::An500 => "mps2-an500",
        }
    }
}

impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Machine {
    type Err = PilError;

    fn from_str(text: &str) -> Result<Self, PilError> {
        [Self::An386, Self::An500]
            .into_iter()
            .find(|machine| machine.name() == text)
            .ok_or_else(|| PilError::Unknown {
                what: "machine",
                name: text.into(),
                known: "mps2-an386 nor mps2-an500",
            })
    }
}

/// What a machine does beside running.
#[derive(Debug, Clone, Copy, Default)]
pub struct Extras {
    /// Counts instructions.
    pub count: bool,
    /// Serves a debugger on this port of the local host.
    pub gdb: Option<u16>,
}

/// A running machine.
pub struct Qemu {
    child: Child,
    log: PathBuf,
}

impl Qemu {
    /// Whether QEMU is installed.
    ///
    /// # Errors
    /// It is not, or does not start.
    pub fn check() -> Result<(), PilError> {
        let version = Command::new(PROGRAM).arg("--version").output();
        version.map(|_| ()).map_err(|e| unstarted(&e))
    }

    /// Starts the lock-step image. Its log goes, still encoded, to a file beside the ELF.
    ///
    /// # Errors
    /// QEMU is not installed or does not start.
    pub fn start(
        machine: Machine,
        elf: &Path,
        channel: Channel,
        extras: Extras,
    ) -> Result<(Self, ChildStdin, ChildStdout), PilError> {
        let log = elf.with_file_name(format!("{machine}-{channel}-{}.log", std::process::id()));
        let mut command = Command::new(PROGRAM);
        command.args(["-machine", machine.name(), "-display", "none", "-monitor", "none"]);
        command.arg("-serial").arg(match channel {
            Channel::Fifo => "null",
            Channel::Slcan => "stdio",
        });
        command.arg("-serial").arg(format!("file:{}", log.display()));
        command
            .arg("-semihosting-config")
            .arg(format!("enable=on,target=native,arg=lockstep,arg={channel}"));
        if extras.count {
            command.args(["-icount", "shift=10"]);
        }
        if let Some(port) = extras.gdb {
            command.arg("-gdb").arg(format!("tcp:127.0.0.1:{port}"));
        }
        command.arg("-kernel").arg(elf);
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|e| unstarted(&e))?;
        let pipes = child.stdin.take().zip(child.stdout.take());
        let qemu = Self { child, log };
        let (input, output) = pipes.ok_or_else(|| PilError::Failed(format!("{PROGRAM} has no pipes")))?;
        Ok((qemu, input, output))
    }

    /// Where the encoded log is.
    #[must_use]
    pub fn log(&self) -> &Path {
        &self.log
    }

    /// Waits for the machine to quit by itself; None if it does not within `limit`.
    pub fn wait(&mut self, limit: Duration) -> Option<ExitStatus> {
        let start = Instant::now();
        while start.elapsed() < limit {
            if let Ok(Some(status)) = self.child.try_wait() {
                return Some(status);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        None
    }

    /// The run went well: its log is not needed.
    pub fn discard_log(&self) {
        let _ = std::fs::remove_file(&self.log);
    }
}

fn unstarted(error: &std::io::Error) -> PilError {
    match error.kind() {
        std::io::ErrorKind::NotFound => {
            PilError::Missing(format!("{PROGRAM} is missing: apt-get install {PROGRAM}"))
        }
        _ => PilError::Failed(format!("{PROGRAM} does not start: {error}")),
    }
}

impl Drop for Qemu {
    fn drop(&mut self) {
        // Both fail only for a process that is gone already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::instructions;

    /// At `shift=10` an instruction lasts 1024 ns, 25.6 cycles of 40 ns.
    #[test]
    fn cycles_are_whole_instructions() {
        assert_eq!(instructions(0), 0);
        assert_eq!(instructions(26), 1);
        assert_eq!(instructions(256), 10);
        assert_eq!(instructions(25_600), 1000);
        assert_eq!(instructions(u32::MAX), 167_772_160);
    }
}
