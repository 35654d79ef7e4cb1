//! Runs an image in QEMU: its log, decoded, on standard error; its bus on any of QEMU's character devices.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitCode, Stdio};
use std::str::FromStr;
use std::sync::mpsc::{Sender, channel};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use clap::Args;

use crate::boards::Board;
use crate::image::Image;
use crate::tool::{self, Usage};

/// Exit code of a run that was stopped by its time-out, as that of timeout(1).
const TIMED_OUT: u8 = 124;
/// Seconds of a run without a bus, unless the user says otherwise.
const TIMEOUT_S: u64 = 60;
/// 2^5 ns an instruction: 31 million a second, near the board's 25 MHz.
const BOARD_SPEED: u8 = 5;
/// How often the machine is looked at while its log is silent.
const GLANCE: Duration = Duration::from_millis(20);

/// Options of `cargo xtask qemu`.
#[derive(Args)]
pub(crate) struct Options {
    /// The image to build and run.
    #[arg(default_value = "steering-ecu")]
    image: Image,
    /// The machine.
    #[arg(long, default_value = "mps2-an386")]
    board: Board,
    /// Run this ELF instead of building one (cargo's runner does).
    #[arg(long)]
    elf: Option<PathBuf>,
    /// Where the bus (SLCAN) goes: `null`, `stdio`, or any QEMU character device such as `pty` or
    /// `tcp:127.0.0.1:3333,server,nowait`. With `stdio` the run ends with the input.
    #[arg(long, default_value = "null")]
    can: String,
    /// The machine's clock: `paced`, the default of steering-ecu on a bus: it counts instructions, 32 ns each, about the
    /// board's speed, and waits for real time where it is ahead; a host too busy for that is told. SHIFT, 0 to 10: it
    /// counts instructions, 2^SHIFT ns each, as fast as the host can; a smaller one gives whoever is on the bus more
    /// time to answer. `off`: the host's clock; then the watchdog fires whenever the host pauses for 16 ms. lockstep
    /// takes its time from the bus: off.
    #[arg(long, value_name = "paced|SHIFT|off")]
    icount: Option<Clock>,
    /// Keep the flash of steering-ecu (parameters, codes of faults) in this file, which is made if it is not there; otherwise it is
    /// blank at the start and gone at the end.
    #[arg(long, value_name = "FILE")]
    flash: Option<PathBuf>,
    /// Stop after this many seconds, with exit code 124. Default: 60 with `--can null`; else the run lasts until
    /// Ctrl-C.
    #[arg(long, value_name = "SECONDS")]
    timeout: Option<u64>,
}

/// What the machine's time is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Clock {
    Host,
    /// 2^n ns an instruction.
    Instructions(u8),
    /// 2^[`BOARD_SPEED`] ns an instruction, and no faster than real time.
    Paced,
}

impl FromStr for Clock {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match (text, text.parse()) {
            ("off", _) => Ok(Self::Host),
            ("paced", _) => Ok(Self::Paced),
            (_, Ok(shift @ 0..=10)) => Ok(Self::Instructions(shift)),
            _ => Err("neither paced, nor off, nor a number from 0 to 10".to_owned()),
        }
    }
}

impl Options {
    fn clock(&self) -> Clock {
        self.icount.unwrap_or(match self.image {
            // Nobody is there whose time it would be.
            Image::SteeringEcu if matches!(self.can.as_str(), "null" | "stdio") => {
                Clock::Instructions(BOARD_SPEED)
            }
            Image::SteeringEcu => Clock::Paced,
            Image::Lockstep => Clock::Host,
        })
    }

    fn timeout(&self) -> Option<Duration> {
        let default = (self.can == "null").then_some(TIMEOUT_S);
        self.timeout.or(default).map(Duration::from_secs)
    }
}

/// What the threads around QEMU see.
enum Event {
    Log(Vec<u8>),
    /// A line of QEMU's own.
    Said(String),
    InputEnded,
    /// Ctrl-C, or somebody asks us to terminate.
    Interrupted,
}

/// Exit code of a run that was interrupted, as a shell has it for Ctrl-C.
const INTERRUPTED: u8 = 130;
/// Begins QEMU's line about a paced machine that is behind.
const LATE: &str = "Warning: The guest is now late by";

/// A QEMU that ends with its owner.
struct Machine(Child);

impl Drop for Machine {
    fn drop(&mut self) {
        // Both fail only for a process that is gone already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

pub(crate) fn run(options: &Options) -> Result<ExitCode> {
    if options.board.chip().is_some() {
        let board = options.board.feature();
        return Err(Usage(format!("{board} is no machine of QEMU: cargo xtask run {board}")).into());
    }
    tool::ensure(&[("qemu-system-arm", "qemu-system-arm")])?;
    let elf = match &options.elf {
        Some(elf) => elf.clone(),
        None => options.board.build(options.image)?,
    };
    let mut log = Log::of(&elf)?;
    let (events, seen) = channel();
    let interrupted = events.clone();
    // QEMU ends with us, also when we are asked to.
    ctrlc::set_handler(move || drop(interrupted.send(Event::Interrupted))).context("signals")?;
    let mut machine = start(&elf, options, &events)?;
    let start = Instant::now();
    let code = loop {
        match seen.recv_timeout(GLANCE) {
            Ok(Event::Log(bytes)) => log.print(&bytes)?,
            Ok(Event::Said(line)) => pass_on(&line),
            Ok(Event::InputEnded) => break ExitCode::SUCCESS,
            Ok(Event::Interrupted) => break ExitCode::from(INTERRUPTED),
            // The other end keeps a sender, so this is a time-out: a moment to look around.
            Err(_) => {
                if let Some(status) = machine.0.try_wait()? {
                    break status
                        .code()
                        .map_or(ExitCode::FAILURE, |code| ExitCode::from(code as u8));
                }
            }
        }
        if let Some(timeout) = options.timeout().filter(|timeout| start.elapsed() > *timeout) {
            eprintln!("stopped after {} s (--timeout)", timeout.as_secs());
            break ExitCode::from(TIMED_OUT);
        }
    };
    drop(machine);
    while let Ok(event) = seen.recv_timeout(GLANCE) {
        if let Event::Log(bytes) = event {
            log.print(&bytes)?;
        }
    }
    log.end()?;
    Ok(code)
}

fn start(elf: &Path, options: &Options, events: &Sender<Event>) -> Result<Machine> {
    let log = TcpListener::bind("127.0.0.1:0").context("a port for the log")?;
    let mut command = Command::new("qemu-system-arm");
    command
        .args(machine(options))
        .args(["-display", "none", "-monitor", "none"])
        .args(["-serial", &bus(&options.can)])
        .args(["-serial", &format!("tcp:{}", log.local_addr()?)])
        // For the lock-step image, which takes its channel from here.
        .args("-semihosting-config enable=on,target=native,arg=image,arg=slcan".split(' '))
        .arg("-kernel")
        .arg(elf)
        .stdin(if options.can == "stdio" {
            Stdio::piped()
        } else {
            Stdio::null()
        })
        .stdout(if options.can == "stdio" {
            Stdio::inherit()
        } else {
            Stdio::piped()
        });
    match options.clock() {
        Clock::Host => {}
        Clock::Instructions(shift) => drop(command.args(["-icount", &format!("shift={shift}")])),
        Clock::Paced => drop(command.args(["-icount", &format!("shift={BOARD_SPEED},align=on")])),
    }
    let mut child = command.spawn().context("qemu-system-arm does not start")?;
    if let Some(from) = child.stdout.take() {
        forward_words(from, events.clone());
    }
    if let Some(to) = child.stdin.take() {
        forward_input(to, events.clone());
    }
    forward_log(log, events.clone());
    Ok(Machine(child))
}

/// QEMU's options of the machine, and of its memory that plays the flash (`firmware/src/boards/mps2.rs`), if that is in a file.
fn machine(options: &Options) -> Vec<String> {
    let board = options.board.feature();
    let Some(file) = &options.flash else {
        return vec!["-machine".into(), board.into()];
    };
    let file = file.display().to_string().replace(',', ",,");
    let memory = format!("memory-backend-file,id=flash,size=16M,mem-path={file},share=on");
    let machine = format!("{board},memory-backend=flash");
    vec!["-object".into(), memory, "-machine".into(), machine]
}

/// QEMU's name of the bus. On TCP without Nagle's algorithm, which holds a frame back until the last one was acknowledged:
/// a client in lock step would see 21 ticks a second instead of 1,100.
fn bus(can: &str) -> String {
    let is_tcp = can.starts_with("tcp:");
    if is_tcp && !can.contains("nodelay") {
        format!("{can},nodelay=on")
    } else {
        can.to_owned()
    }
}

/// Prints a line of QEMU's; that of a paced machine which is behind, in words that say what it means.
fn pass_on(line: &str) {
    // "Warning: The guest is now late by 0.0 to 1.0 seconds"
    let late = line.strip_prefix(LATE).and_then(|rest| rest.split_once(" to "));
    match late {
        Some((_, most)) => eprintln!(
            "(this host is too busy: the machine is up to {} behind real time; a client on the clock of the wall may be \
             too early or too late for it)",
            most.trim_end_matches("econds").trim_end()
        ),
        None => eprintln!("{line}"),
    }
}

fn forward_words(from: ChildStdout, events: Sender<Event>) {
    std::thread::spawn(move || {
        for line in BufReader::new(from).lines().map_while(Result::ok) {
            if events.send(Event::Said(line)).is_err() {
                return;
            }
        }
    });
}

/// Passes our standard input on and tells when it ends: with it whoever started this run is gone.
fn forward_input(mut to: ChildStdin, events: Sender<Event>) {
    std::thread::spawn(move || {
        let mut buffer = [0; 4096];
        while let Ok(n @ 1..) = std::io::stdin().read(&mut buffer) {
            if to.write_all(&buffer[..n]).and_then(|()| to.flush()).is_err() {
                return;
            }
        }
        let _ = events.send(Event::InputEnded);
    });
}

fn forward_log(from: TcpListener, events: Sender<Event>) {
    std::thread::spawn(move || {
        let Ok((mut log, _)) = from.accept() else { return };
        let mut buffer = [0; 4096];
        while let Ok(n @ 1..) = log.read(&mut buffer) {
            if events.send(Event::Log(buffer[..n].to_vec())).is_err() {
                return;
            }
        }
    });
}

/// Decodes and prints a log that was kept in a file.
pub(crate) fn print_log(file: &Path, elf: Option<PathBuf>) -> Result<()> {
    let elf = match elf {
        Some(elf) => elf,
        None => Board::Mps2An386.build(Image::Lockstep)?,
    };
    let bytes = fs::read(file).with_context(|| file.display().to_string())?;
    let mut log = Log::of(&elf)?;
    log.print(&bytes)?;
    log.end()
}

/// The program that prints an image's log, fed with what arrives of it.
struct Log {
    decoder: Child,
    to: Option<ChildStdin>,
}

impl Log {
    /// Builds the program first, if it is not there.
    fn of(elf: &Path) -> Result<Self> {
        tool::run(tool::cargo().args(["build", "--release", "-q", "-p", "xtask-log"]))?;
        let program = tool::root().join("target/release/xtask-log");
        let mut command = Command::new(&program);
        command.arg(elf).stdin(Stdio::piped());
        // Ctrl-C is for us: the log is printed to its end.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut decoder = command.spawn().with_context(|| program.display().to_string())?;
        let to = decoder.stdin.take();
        Ok(Self { decoder, to })
    }

    /// An error is that of the program, which said itself what was wrong.
    fn print(&mut self, bytes: &[u8]) -> Result<()> {
        let to = self.to.as_mut().context("the log has ended")?;
        to.write_all(bytes).context("the log does not fit the image")
    }

    /// Waits until all is printed.
    fn end(mut self) -> Result<()> {
        drop(self.to.take());
        let status = self.decoder.wait().context("xtask-log")?;
        ensure!(status.success(), "the log could not be printed");
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bus_on_tcp_has_no_delay_unless_the_user_says_otherwise() {
        let tcp = "tcp:127.0.0.1:3333,server,nowait";
        assert_eq!(bus(tcp), "tcp:127.0.0.1:3333,server,nowait,nodelay=on");
        assert_eq!(bus(&format!("{tcp},nodelay=off")), format!("{tcp},nodelay=off"));
        assert_eq!(bus("pty"), "pty");
    }

    #[test]
    fn clocks_by_name() {
        assert_eq!("paced".parse(), Ok(Clock::Paced));
        assert_eq!("off".parse(), Ok(Clock::Host));
        assert_eq!("10".parse(), Ok(Clock::Instructions(10)));
        for wrong in ["11", "-1", "", "fast"] {
            assert!(wrong.parse::<Clock>().unwrap_err().contains("paced"), "{wrong}");
        }
    }
}
