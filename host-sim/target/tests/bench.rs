//! The bus in real time, its milliseconds counted out by hand: who hears whom, and what the image in QEMU answers.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;

use haptic_core::bus::Frame;
use haptic_core::bus::e2e::ReceiverState;
use haptic_core::bus::messages::{Guidance, Message};
use haptic_core::bus::slcan::{self, Line, Parser};
use haptic_core::faults::Fault;
use haptic_core::modes::Mode;
use haptic_target::PilError;
use haptic_target::bench::Bench;

/// The ECU's warning, in somebody else's name.
const FOREIGN: u16 = 0x0D0;

struct Client {
    stream: TcpStream,
    parser: Parser,
}

impl Client {
    fn join(bench: &Bench) -> Self {
        let mut stream = TcpStream::connect(bench.address().unwrap()).unwrap();
        stream.set_nonblocking(true).unwrap();
        stream.write_all(b"S6\rO\r").unwrap();
        Self {
            stream,
            parser: Parser::default(),
        }
    }

    fn heard(&mut self) -> Vec<Frame> {
        let mut bytes = Vec::new();
        let end = self.stream.read_to_end(&mut bytes).unwrap_err();
        assert_eq!(end.kind(), ErrorKind::WouldBlock, "the bus is open");
        let lines = bytes.iter().filter_map(|byte| self.parser.push(*byte));
        lines
            .filter_map(|line| match line {
                Line::Frame(frame) => Some(frame),
                _ => None,
            })
            .collect()
    }
}

fn guidance(frames: &[Frame]) -> Vec<Guidance> {
    let mut host = ReceiverState::TRUSTED;
    let frames = frames.iter().filter(|frame| frame.id() == Guidance::ID);
    frames
        .map(|frame| Guidance::decode(&mut host, frame).unwrap())
        .collect()
}

#[test]
fn clients_and_the_ecu_hear_each_other_and_nobody_himself() {
    let mut bench = Bench::start("127.0.0.1:0").unwrap();
    let (mut one, mut other) = (Client::join(&bench), Client::join(&bench));
    // What a socket has taken is there for its other end a moment later.
    let (mut by_one, mut by_other) = (0, 0);
    while by_one < 3 || by_other < 3 {
        bench.tick().unwrap();
        by_one += one.heard().len();
        by_other += other.heard().len();
    }

    let frame = Frame::new(FOREIGN, &[0; 8]).unwrap();
    one.stream.write_all(&slcan::format(&frame)).unwrap();
    let (mut by_one, mut by_other) = (Vec::new(), Vec::new());
    for _ in 0..2000 {
        bench.tick().unwrap();
        by_one.extend(one.heard());
        by_other.extend(other.heard());
    }
    let foreign = |frames: &[Frame]| frames.iter().filter(|heard| **heard == frame).count();
    assert_eq!((foreign(&by_one), foreign(&by_other)), (0, 1));
    // The ECU hears its identifier from somebody else, and says so for a second.
    let told = guidance(&by_one);
    assert!(told.len() >= 1990, "{} torque frames in 2 s", told.len());
    let count = |faulty: &[Guidance]| {
        let faulty = faulty.iter().filter(|g| g.faults.contains(Fault::OwnIdentifier));
        faulty.count()
    };
    assert!((990..=1010).contains(&count(&told)), "{}", count(&told));
    assert!(
        told.iter()
            .all(|g| g.mode == Mode::Standby && g.torque.nm() == 0.0)
    );

    // A flood waits for the bus, which carries four frames in a millisecond, and nothing of it is lost.
    let flood: Vec<u8> = (0..400_u16)
        .flat_map(|k| slcan::format(&Frame::new(0x700, &k.to_le_bytes()).unwrap()))
        .collect();
    one.stream.write_all(&flood).unwrap();
    let mut passed = Vec::new();
    for _ in 0..200 {
        bench.tick().unwrap();
        let now: Vec<Frame> = other.heard().into_iter().filter(|f| f.id() == 0x700).collect();
        assert!(now.len() <= 4, "{} in a millisecond", now.len());
        passed.extend(now);
    }
    let order: Vec<u16> = passed
        .iter()
        .map(|frame| u16::from_le_bytes([frame.data()[0], frame.data()[1]]))
        .collect();
    assert_eq!(order, (0..400).collect::<Vec<_>>());
    let _ = one.heard();

    // One leaves; the bus goes on for the other.
    drop(one);
    let mut heard = 0;
    while heard < 10 {
        bench.tick().unwrap();
        heard += other.heard().len();
    }
    bench.end().unwrap();
}

#[test]
fn an_address_that_is_taken_or_none_is_told() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let taken = taken.local_addr().unwrap().to_string();
    for address in [taken.as_str(), "nowhere"] {
        match Bench::start(address) {
            Err(PilError::Failed(why)) => assert!(why.contains(address), "{why}"),
            _ => panic!("{address}: nobody can listen there"),
        }
    }
}
