//! The ECU in QEMU as a node on a bus that anybody can join: SLCAN over TCP, a millisecond for each of the wall's.
//!
//! QEMU's own serial port passes a byte at a time and cannot carry the bus of a car in real time. So the lock-step image
//! runs behind a pipe, and this side is the bus: it takes what its clients sent in a millisecond, has the ECU step, and
//! hands its answer to every client, as a bus does. Clients hear each other too. A host that is too busy to keep time is
//! told, and the ECU's clock waits meanwhile.
//!
//! The ECU says what a product says: its parameters, which set and which processor it has, and what it did not use. It
//! takes a set of parameters and starts anew with it, and keeps it until it ends. Where frames are authenticated, that is done
//! here, in front of the image, by what a product does it with. Not here: a product's flash and its
//! watchdog, which the lock-step image has not (`cargo xtask qemu`).

use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

use haptic_core::bus::Frame;
use haptic_core::bus::slcan::{self, Line, Parser};
use haptic_core::controller::params::Params;
use haptic_core::quantity;
use haptic_lockstep::{Start, StartState, is_of_a_lock_step_run};
use haptic_secoc::Keys;
pub use haptic_secoc::fresh::Algorithm;
use haptic_secoc::verifier::{Credentials, Verifier};

use super::PilError;
use super::stepped::Stepped;

const TICK: Duration = Duration::from_millis(1);
/// A host that is behind by less catches up; a signal's age limit is 30 ms.
const CATCHES_UP: Duration = Duration::from_millis(10);
/// So many frames pass in a millisecond: eight bytes take at least 222 us at 500 kbit/s. Others wait, as they do for a bus. Of more clients one frame each
/// passes.
const PER_TICK: usize = 4;
/// A client that does not read loses what is said to it beyond so many bytes, three seconds of the bus.
const UNREAD: usize = 1 << 16;

/// The bus: the ECU, and whoever joined.
pub struct Bench {
    ecu: Stepped,
    listener: TcpListener,
    clients: Vec<Client>,
    time_us: u32,
    verifier: Option<Verifier>,
}

/// Somebody on the bus.
struct Client {
    stream: TcpStream,
    parser: Parser,
    /// Frames pass while the client has the channel open.
    open: bool,
    /// Frames that wait for the bus.
    waiting: VecDeque<Frame>,
    unsent: Vec<u8>,
}

impl Bench {
    /// Builds the image, starts it and listens: `127.0.0.1:3333`, port 0 for any. Frames that command the ECU need a proof where a
    /// MAC is named, by the keys that everybody knows.
    ///
    /// # Errors
    /// What is missing, or why nobody can listen there.
    pub fn start(address: &str, authenticate: Option<Algorithm>) -> Result<Self, PilError> {
        let cannot = |e: std::io::Error| PilError::Failed(format!("cannot listen on {address}: {e}"));
        // A wrong address is told before the image is built, and nobody waits at the door while it is.
        drop(TcpListener::bind(address).map_err(cannot)?);
        let mut ecu = Stepped::start(false)?;
        let start = Start {
            state: StartState::Product,
            at: quantity::Instant::from_us(0),
        };
        ecu.begin(&Params::PAPER, start)?;
        let listener = TcpListener::bind(address).map_err(cannot)?;
        listener.set_nonblocking(true).map_err(cannot)?;
        Ok(Self {
            ecu,
            listener,
            clients: Vec::new(),
            time_us: 0,
            // Its first start, since it begins with a blank flash.
            verifier: authenticate
                .map(|algorithm| Verifier::new(Credentials::Keys(Keys::bench(algorithm), Some(0)))),
        })
    }

    /// Where clients join.
    ///
    /// # Errors
    /// The socket's.
    pub fn address(&self) -> Result<SocketAddr, PilError> {
        self.listener
            .local_addr()
            .map_err(|e| PilError::Failed(format!("the port of the bus: {e}")))
    }

    /// One millisecond of the bus.
    ///
    /// # Errors
    /// The target is gone.
    pub fn tick(&mut self) -> Result<(), PilError> {
        while let Ok((stream, _)) = self.listener.accept() {
            self.clients.extend(Client::new(stream));
        }
        let heard = self.on_the_bus();
        // A client must not end the ECU's millisecond.
        let for_the_ecu = heard.iter().map(|(_, frame)| *frame);
        let now = quantity::Instant::from_us(self.time_us);
        let mut frames = Vec::new();
        for frame in for_the_ecu.filter(|frame| !is_of_a_lock_step_run(frame)) {
            frames.extend(match &mut self.verifier {
                Some(verifier) => verifier.receive(&frame, now),
                None => Some((frame, now)),
            });
        }
        // Frames spread over the millisecond: the last step is done when they come.
        frames.extend(std::iter::from_fn(|| self.verifier.as_mut()?.verified()));
        let frames: Vec<Frame> = frames.into_iter().map(|(frame, _)| frame).collect();
        self.ecu.tick(now, &frames)?;
        let mut answer = self.ecu.answer()?;
        let verifier = self.verifier.as_mut();
        answer.extend(verifier.and_then(|verifier| verifier.step(self.time_us / 1000)));
        self.time_us = self.time_us.wrapping_add(1000);
        for (index, client) in self.clients.iter_mut().enumerate() {
            let others = heard.iter().filter(|(from, _)| *from != index);
            others.for_each(|(_, frame)| client.send(frame));
            answer.iter().for_each(|frame| client.send(frame));
        }
        self.clients.retain_mut(Client::flush);
        Ok(())
    }

    /// The frames of this millisecond, each with its client: the clients take turns.
    fn on_the_bus(&mut self) -> Vec<(usize, Frame)> {
        self.clients.iter_mut().for_each(Client::receive);
        let mut heard = Vec::new();
        while heard.len() < PER_TICK {
            let before = heard.len();
            for (index, client) in self.clients.iter_mut().enumerate() {
                heard.extend(client.waiting.pop_front().map(|frame| (index, frame)));
            }
            if heard.len() == before {
                break;
            }
        }
        heard
    }

    /// Keeps the time of the wall until `ended`; `late` is told by how much this host was behind whenever the ECU's clock
    /// had to wait for it.
    ///
    /// # Errors
    /// The target is gone.
    pub fn run(&mut self, ended: impl Fn() -> bool, mut late: impl FnMut(Duration)) -> Result<(), PilError> {
        let mut due = Instant::now();
        while !ended() {
            self.tick()?;
            due += TICK;
            let now = Instant::now();
            let behind = now.saturating_duration_since(due);
            if behind > CATCHES_UP {
                late(behind);
                due = now;
            }
            std::thread::sleep(due.saturating_duration_since(now));
        }
        Ok(())
    }

    /// Ends the machine.
    ///
    /// # Errors
    /// It does not end well.
    pub fn end(self) -> Result<(), PilError> {
        self.ecu.end()
    }
}

impl Client {
    /// None for a client that is gone already.
    fn new(stream: TcpStream) -> Option<Self> {
        stream.set_nonblocking(true).ok()?;
        // A frame that waits for the last one's acknowledgement is 40 ms old.
        stream.set_nodelay(true).ok()?;
        Some(Self {
            stream,
            parser: Parser::default(),
            open: false,
            waiting: VecDeque::new(),
            unsent: Vec::new(),
        })
    }

    /// Takes what came, and answers as the protocol has it. Who sends more than the bus carries has to wait.
    fn receive(&mut self) {
        if self.waiting.len() >= PER_TICK {
            return;
        }
        let mut bytes = [0; 4096];
        // A client that is gone says so when something is sent to it.
        let Ok(count) = self.stream.read(&mut bytes) else {
            return;
        };
        for byte in &bytes[..count] {
            let Some(line) = self.parser.push(*byte) else {
                continue;
            };
            let mut answer = line.answer();
            match line {
                Line::Open => self.open = true,
                Line::Close => self.open = false,
                Line::Frame(frame) if self.open => self.waiting.push_back(frame),
                Line::Frame(_) => answer = slcan::ERROR,
                _ => {}
            }
            self.say(answer);
        }
    }

    fn send(&mut self, frame: &Frame) {
        if self.open {
            self.say(&slcan::format(frame));
        }
    }

    fn say(&mut self, bytes: &[u8]) {
        if self.unsent.len() < UNREAD {
            self.unsent.extend_from_slice(bytes);
        }
    }

    /// Hands over what waits; false where nobody is there any more.
    fn flush(&mut self) -> bool {
        while !self.unsent.is_empty() {
            match self.stream.write(&self.unsent) {
                Ok(count @ 1..) => drop(self.unsent.drain(..count)),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return true,
                Ok(0) | Err(_) => return false,
            }
        }
        // Nothing was sent to a client with a closed channel: is it there?
        self.open || !matches!(self.stream.peek(&mut [0]), Ok(0))
    }
}
