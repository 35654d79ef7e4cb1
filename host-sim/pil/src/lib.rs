//! Processor in the loop: the same frames to the controller of this host and to the ELF in QEMU, and every
//! frame of their answers compared byte for byte.
//!
//! The closed loop runs here with its own `Ecu`; its caller reports each tick with [`Pil::tick`]. The
//! target gets the frames of the tick and then the time, steps, and answers with its own. Since both
//! controllers must answer the same, the host need not wait: over the pipe (*fifo*) thousands of ticks are
//! under way at once, over SLCAN one, as an outside client of the bus would do it.
//!
//! A board takes the machine's place ([`Target::Board`]): its lock-step image on a real bus behind an adapter, the
//! same frames, the same comparison.
//!
//! - [`image`]: builds the lock-step image. - [`qemu`]: the machine. - `adapter`: the way to a board.
//! - `link`: frames as bytes.
//! - [`comparator`]: compares the answers, on its own thread. - [`cost`]: what authentication costs. - [`stepped`]: a target for a caller that compares by itself,
//!   and may reach into its memory. - [`mod@bench`]: a bus that keeps the time of the wall. - [`parameters`]: a product's, over
//!   the same adapters. - [`diagnosis`]: a workshop's tester. - [`live`]: what goes over a bus.
//!
//! ```
//! use haptic_pil::{Channel, PilError};
//!
//! // Over pipes thousands of ticks are under way at once; SLCAN is what an outside client speaks.
//! assert_eq!("slcan".parse(), Ok(Channel::Slcan));
//! let unknown: Result<Channel, _> = "usb".parse();
//! assert_eq!(unknown.unwrap_err().to_string(), "channel 'usb' is neither fifo nor slcan");
//! // What is missing says what to install or to plug in.
//! let missing = haptic_pil::parameters::Product::on("no-such-interface");
//! assert!(matches!(missing, Err(PilError::Missing(_) | PilError::Failed(_))));
//! ```
//!
//! Not here: the plant and the scenario.

mod adapter;
pub mod bench;
pub mod comparator;
pub mod cost;
pub mod diagnosis;
mod gdb;
pub mod image;
mod link;
pub mod live;
pub mod parameters;
mod port;
pub mod qemu;
mod responses;
pub mod stepped;

use std::fmt;
use std::io::{BufWriter, Write};
use std::str::FromStr;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

use haptic_core::bus::Frame;
use haptic_core::controller::params::Params;
use haptic_core::quantity::Instant;
use haptic_lockstep::SimTime;
use haptic_lockstep::{Start, parameter_frames};
use serde::Serialize;

use comparator::{Comparator, Counter, Expected};
pub use comparator::{Mismatch, Spent};
pub use qemu::Machine;
use qemu::{Extras, Qemu};
use responses::ResponseStream;

/// How frames reach the target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Channel {
    /// Binary records on pipes, by semihosting: fast.
    Fifo,
    /// SLCAN lines on the board's bus port: what an outside client does.
    Slcan,
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Fifo => "fifo",
            Self::Slcan => "slcan",
        })
    }
}

impl FromStr for Channel {
    type Err = PilError;

    fn from_str(text: &str) -> Result<Self, PilError> {
        match text {
            "fifo" => Ok(Self::Fifo),
            "slcan" => Ok(Self::Slcan),
            _ => Err(PilError::Unknown {
                what: "channel",
                name: text.into(),
                known: "fifo nor slcan",
            }),
        }
    }
}

/// What is compared with the host's controller.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Target {
    /// An image that is built and started in QEMU.
    Qemu {
        /// The board.
        machine: Machine,
        /// How frames reach it.
        channel: Channel,
        /// Whether its clock counts instructions.
        count: bool,
    },
    /// A board that runs the image, on a bus behind a CAN adapter: a network interface (`can0`, SocketCAN), a serial
    /// port (`/dev/ttyUSB0`, SLCAN), or `tcp:HOST:PORT` (SLCAN). Frames go and come one tick at a time.
    Board(String),
}

/// Ticks under way at once over pipes: many more than one write buffer holds.
const WINDOW: usize = 4096;

/// What went wrong, in one line, with what to do about it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PilError {
    /// Something that has to be installed or plugged in first.
    #[error("{0}")]
    Missing(String),
    /// The image does not build, or the target does not start, answer or end as it should.
    #[error("{0}")]
    Failed(String),
    /// A name that is none of those known.
    #[error("{what} '{name}' is neither {known}")]
    Unknown {
        /// What is named.
        what: &'static str,
        /// The name.
        name: String,
        /// The names there are.
        known: &'static str,
    },
}

/// What a run showed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// How frames reached the target.
    pub channel: Channel,
    /// Steps of the controller, 1 ms each.
    pub steps: u64,
    /// Frames of the answers compared: a torque frame each step, and what goes with some.
    pub frames_compared: u64,
    /// Frames that differed in a byte, or that only one controller sent.
    pub mismatches: u64,
    /// Steps in a second of wall time, from the first tick on.
    pub steps_per_second: f64,
    /// Bytes of its stack that the target has used by the last whole thousand of steps; 0 in a shorter run.
    pub stack_bytes: u32,
    /// What a step cost the target, if it was counted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub instructions: Option<Spent>,
    /// What it cost a board, in cycles of its core.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cycles: Option<Spent>,
    /// The first difference.
    #[serde(skip)]
    pub first_mismatch: Option<Mismatch>,
}

/// A run under way. Dropping it ends the target.
pub struct Pil {
    /// None once the run is over: closing it tells the target so.
    input: Option<BufWriter<Box<dyn Write + Send>>>,
    expected: Option<SyncSender<Expected>>,
    /// Closed by the comparator when no answer is missing any more, or none will come.
    answered: Receiver<()>,
    comparator: Option<JoinHandle<Result<Report, PilError>>>,
    channel: Channel,
}

impl Pil {
    /// Builds the image and starts it in QEMU, or opens the way to a board, and starts the target's controller as
    /// the host's ([`Start::ecu`]).
    ///
    /// # Errors
    /// What is missing or fails on the way to a running image.
    pub fn on(target: &Target, params: &Params, start: Start) -> Result<Self, PilError> {
        let (channel, input, comparator, window) = match target {
            &Target::Qemu {
                machine,
                channel,
                count,
            } => {
                // Before the build, which takes longer than to say what is missing.
                Qemu::check()?;
                let elf = image::build(machine)?;
                let (qemu, input, output) = Qemu::start(machine, &elf, channel, Extras { count, gdb: None })?;
                let counter = if count {
                    Counter::Instructions
                } else {
                    Counter::Nothing
                };
                let comparator =
                    Comparator::new(ResponseStream::new(Some(qemu), output, channel), channel, counter);
                let window = match channel {
                    Channel::Fifo => WINDOW,
                    Channel::Slcan => 0,
                };
                let input: Box<dyn Write + Send> = Box::new(input);
                (channel, input, comparator, window)
            }
            Target::Board(adapter) => {
                let adapter::Adapter {
                    channel,
                    input,
                    output,
                } = adapter::open(adapter)?;
                let comparator = Comparator::new(
                    ResponseStream::new(None, output, channel),
                    channel,
                    Counter::Cycles,
                );
                (channel, input, comparator, 0)
            }
        };
        let (expected, expectations) = sync_channel(window);
        let (answering, answered) = sync_channel(0);
        let mut pil = Self {
            input: Some(BufWriter::new(input)),
            expected: Some(expected),
            answered,
            comparator: Some(std::thread::spawn(move || {
                comparator.run(&expectations, answering)
            })),
            channel,
        };
        pil.handshake(params, start)?;
        Ok(pil)
    }

    fn handshake(&mut self, params: &Params, start: Start) -> Result<(), PilError> {
        if self.channel == Channel::Slcan {
            self.write(link::OPEN)?;
        }
        for frame in parameter_frames(params) {
            self.send(&frame)?;
        }
        self.send(&start.encode())
    }

    /// Reports one tick of the host's loop: the frames that its ECU received at `now`, in order, and the frames
    /// that it then answered with: guidance first, then the others of its step.
    ///
    /// # Errors
    /// Why the target stopped answering. A wrong answer is no error: the report counts it.
    pub fn tick(&mut self, now: Instant, frames: &[Frame], answer: &[Frame]) -> Result<(), PilError> {
        let Some(sender) = &self.expected else {
            return Err(self.failure());
        };
        let sent = match sender.try_send(Expected::new(now, answer)) {
            // Wait for answers, which cannot come to what still lies in the buffer.
            Err(TrySendError::Full(expected)) => {
                let flushed = self.input.as_mut().map_or(Ok(()), Write::flush);
                flushed.is_ok() && sender.send(expected).is_ok()
            }
            result => result.is_ok(),
        };
        if !sent {
            return Err(self.failure());
        }
        for frame in frames {
            self.send(frame)?;
        }
        self.send(&SimTime(now).encode())
    }

    /// Waits for the last answers and ends the target.
    ///
    /// # Errors
    /// Why the target stopped answering.
    pub fn finish(mut self) -> Result<Report, PilError> {
        self.end()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), PilError> {
        let bytes = link::encode(self.channel, frame);
        self.write(&bytes)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), PilError> {
        match self.input.as_mut().map(|input| input.write_all(bytes)) {
            Some(Ok(())) => Ok(()),
            _ => Err(self.failure()),
        }
    }

    /// Why the other end is gone: the comparator knows.
    fn failure(&mut self) -> PilError {
        match self.end() {
            Err(error) => error,
            Ok(report) => PilError::Failed(format!(
                "the target ended the run by itself after {} steps",
                report.steps
            )),
        }
    }

    /// Says that no more is expected, closes the target's input, and takes the report of the comparator.
    fn end(&mut self) -> Result<Report, PilError> {
        self.expected = None;
        if let Some(mut input) = self.input.take() {
            // What is lost is lost only if the target is gone, which the comparator will report.
            let _ = input.flush();
            // A serial port forgets what was not yet read when its other end, told to end, closes it.
            let _ = self.answered.recv();
            if self.channel == Channel::Slcan {
                let _ = input.write_all(link::CLOSE);
            }
        }
        let comparator = self
            .comparator
            .take()
            .ok_or_else(|| PilError::Failed("the run is over".into()))?;
        comparator.join().unwrap_or_else(|_| {
            Err(PilError::Failed(
                "the thread that reads the target panicked".into(),
            ))
        })
    }
}

impl Drop for Pil {
    fn drop(&mut self) {
        if self.comparator.is_some() {
            // An error elsewhere broke the run off: what the comparator found is of no interest, only that QEMU ends.
            let _ = self.end();
        }
    }
}
