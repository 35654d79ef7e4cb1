//! A target that takes ticks and gives back its answers, for a caller that compares them by itself; and whose memory can be
//! changed between two ticks, as a particle would.

use std::io::{BufWriter, Write};
use std::net::TcpListener;
use std::process::ChildStdin;

use haptic_core::bus::Frame;
use haptic_core::controller::params::Params;
use haptic_core::quantity::Instant;
use haptic_lockstep::SimTime;
use haptic_lockstep::{Authenticated, StackUse, Start, StepCost, parameter_frames};
use haptic_secoc::fresh::Algorithm;
use object::{Object, ObjectSymbol};

use super::gdb::Gdb;
use super::qemu::{Extras, Machine, Qemu};
use super::responses::ResponseStream;
use super::{Channel, PilError, image, link};

/// Name of the static that holds the controller (`firmware/src/bin/lockstep`).
const CONTROLLER: &str = "3ECU";

/// The lock-step image in QEMU. Any number of runs, one after the other; dropping it ends the machine.
pub struct Stepped {
    // Declared first, so that the machine's input closes before its end is waited for.
    input: BufWriter<ChildStdin>,
    responses: ResponseStream,
    channel: Channel,
    /// Port of the debugger's stub.
    port: Option<u16>,
    /// Address and bytes of the controller.
    controller: (u32, u32),
    cost: StepCost,
    stack_bytes: u32,
}

impl Stepped {
    /// Builds the image and starts it. With `memory` its memory can be reached; QEMU then has to be on the bus
    /// channel, for a machine that waits in a pipe's read answers no debugger.
    ///
    /// # Errors
    /// What is missing or fails on the way to a running image.
    pub fn start(memory: bool) -> Result<Self, PilError> {
        Self::launch(memory, false)
    }

    /// Builds the image and starts it on a machine that counts instructions ([`Stepped::cost`]).
    ///
    /// # Errors
    /// What is missing or fails on the way to a running image.
    pub fn counting() -> Result<Self, PilError> {
        Self::launch(false, true)
    }

    fn launch(memory: bool, count: bool) -> Result<Self, PilError> {
        Qemu::check()?;
        let elf = image::build(Machine::default())?;
        let controller = symbol(&elf)?;
        let channel = if memory { Channel::Slcan } else { Channel::Fifo };
        // The port is free now; QEMU takes it at once.
        let port = memory
            .then(|| TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr()))
            .transpose()
            .map_err(|e| PilError::Failed(format!("no port for the debugger's stub: {e}")))?
            .map(|address| address.port());
        let extras = Extras { count, gdb: port };
        let (qemu, input, output) = Qemu::start(Machine::default(), &elf, channel, extras)?;
        let mut stepped = Self {
            input: BufWriter::new(input),
            responses: ResponseStream::new(Some(qemu), output, channel),
            channel,
            port,
            controller,
            cost: StepCost {
                cycles: 0,
                background_cycles: 0,
            },
            stack_bytes: 0,
        };
        if channel == Channel::Slcan {
            stepped.write(link::OPEN)?;
        }
        Ok(stepped)
    }

    /// A new controller, with these parameters.
    ///
    /// # Errors
    /// The target is gone.
    pub fn begin(&mut self, params: &Params, start: Start) -> Result<(), PilError> {
        for frame in parameter_frames(params) {
            self.send(&frame)?;
        }
        self.send(&start.encode())
    }

    /// What commands the target needs a proof from now on.
    ///
    /// # Errors
    /// The target is gone.
    pub fn authenticate(&mut self, algorithm: Algorithm) -> Result<(), PilError> {
        self.send(&Authenticated(algorithm).encode())
    }

    /// Sends a tick: the frames that come, and the time at which the controller takes them and steps.
    ///
    /// # Errors
    /// The target is gone.
    pub fn tick(&mut self, now: Instant, frames: &[Frame]) -> Result<(), PilError> {
        for frame in frames {
            self.send(frame)?;
        }
        self.send(&SimTime(now).encode())
    }

    /// The answer to the earliest tick that has none yet.
    ///
    /// # Errors
    /// Why there is none.
    pub fn answer(&mut self) -> Result<Vec<Frame>, PilError> {
        if self.input.flush().is_err() {
            return Err(self.responses.gone("closed its input"));
        }
        let mut answer = Vec::new();
        loop {
            let frame = self.responses.frame()?;
            if let Some(cost) = StepCost::decode(&frame) {
                self.responses.steps += 1;
                self.cost = cost;
                return Ok(answer);
            }
            match StackUse::decode(&frame) {
                Some(StackUse { bytes }) => self.stack_bytes = bytes,
                None => answer.push(frame),
            }
        }
    }

    /// What the step of the last answer took; [`super::qemu::instructions`] counts it.
    #[must_use]
    pub const fn cost(&self) -> StepCost {
        self.cost
    }

    /// Bytes of its stack that the target has used, by the last whole thousand of steps.
    #[must_use]
    pub const fn stack_bytes(&self) -> u32 {
        self.stack_bytes
    }

    /// Bits of the controller's memory.
    #[must_use]
    pub const fn bits(&self) -> u32 {
        8 * self.controller.1
    }

    /// Flips a bit of the controller's memory, through the debugger's stub, between two ticks: no answer may be due.
    ///
    /// # Errors
    /// The stub's.
    pub fn flip(&mut self, bit: u32) -> Result<(), PilError> {
        let port = self
            .port
            .ok_or_else(|| PilError::Failed("the target was started without a debugger's stub".into()))?;
        let address = self.controller.0 + bit / 8;
        let flip = || -> std::io::Result<()> {
            let mut gdb = Gdb::halt(port)?;
            let byte = gdb.read(address)?;
            gdb.write(address, byte ^ (1 << (bit % 8)))?;
            gdb.resume()
        };
        flip().map_err(|e| PilError::Failed(format!("the debugger's stub of QEMU: {e}")))
    }

    /// Ends the machine.
    ///
    /// # Errors
    /// It does not end well.
    pub fn end(mut self) -> Result<(), PilError> {
        if self.channel == Channel::Slcan {
            self.write(link::CLOSE)?;
        }
        let Self {
            input, mut responses, ..
        } = self;
        drop(input);
        responses.end()?;
        responses.discard_log();
        Ok(())
    }

    fn send(&mut self, frame: &Frame) -> Result<(), PilError> {
        let bytes = link::encode(self.channel, frame);
        self.write(&bytes)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), PilError> {
        match self.input.write_all(bytes) {
            Ok(()) => Ok(()),
            Err(_) => Err(self.responses.gone("closed its input")),
        }
    }
}

/// Address and length of the controller in the image.
fn symbol(elf: &std::path::Path) -> Result<(u32, u32), PilError> {
    let bad = |what: String| PilError::Failed(format!("{}: {what}", elf.display()));
    let bytes = std::fs::read(elf).map_err(|e| bad(e.to_string()))?;
    let file = object::File::parse(&*bytes).map_err(|e| bad(e.to_string()))?;
    file.symbols()
        .find(|symbol| symbol.name().is_ok_and(|name| name.contains(CONTROLLER)))
        .map(|symbol| (symbol.address() as u32, symbol.size() as u32))
        .ok_or_else(|| bad("has no symbol for the controller".into()))
}
