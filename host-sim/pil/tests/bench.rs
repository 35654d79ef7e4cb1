//! The bus in real time, its milliseconds counted out by hand: who hears whom, and what the image in QEMU answers.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;

use haptic_core::bus::Frame;
use haptic_core::bus::Reject;
use haptic_core::bus::e2e::ReceiverState;
use haptic_core::bus::messages::{
    Guidance, Identity, LanePreview, Message, ParameterStatus, ParameterValue, Rejection, ResetCause,
    Vehicle, WriteOutcome,
};
use haptic_core::bus::slcan::{self, Line, Parser};
use haptic_core::controller::params::{PARAMETERS, Params};
use haptic_core::quantity::Speed;
use haptic_core::safety::faults::Fault;
use haptic_core::safety::modes::Mode;
use haptic_core::service::download;
use haptic_diag::isotp::Link;
use haptic_diag::security::{BENCH_KEY, mac};
use haptic_pil::PilError;
use haptic_pil::bench::{Algorithm, Bench};
use haptic_secoc::Keys;
use haptic_secoc::prover::Prover;

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
    let mut bench = Bench::start("127.0.0.1:0", None).unwrap();
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

/// Messages of one kind.
fn messages<M: Message>(frames: &[Frame]) -> Vec<M> {
    let of = frames.iter().filter(|frame| frame.id() == M::ID);
    of.map(|frame| M::decode(&mut { ReceiverState::TRUSTED }, frame).unwrap())
        .collect()
}

impl Client {
    fn say(&mut self, frame: &Frame) {
        self.stream.write_all(&slcan::format(frame)).unwrap();
    }

    /// What is heard in so many milliseconds, in which a vehicle of that speed says so every 10 ms.
    fn drive(&mut self, bench: &mut Bench, ms: u32, speed: Speed, counter: &mut u8) -> Vec<Frame> {
        let mut heard = Vec::new();
        for k in 0..ms {
            if k.is_multiple_of(10) {
                let vehicle = Vehicle {
                    speeds: [speed; 2],
                    yaw_rate: None,
                };
                self.say(&vehicle.encode(*counter));
                *counter = counter.wrapping_add(1);
            }
            bench.tick().unwrap();
            heard.extend(self.heard());
        }
        heard
    }
}

/// `host-sim ecu run --authenticate`: what it hears without a proof is nothing to it, and with one it is.
#[test]
fn a_bench_with_keys_hears_what_is_proven() {
    let mut bench = Bench::start("127.0.0.1:0", Some(Algorithm::AesCmac)).unwrap();
    let mut client = Client::join(&bench);
    let mut counter = 0;
    let speed = Speed::from_m_per_s(20.0);
    let heard = client.drive(&mut bench, 1000, speed, &mut counter);
    let is_missing = |heard: &[Frame]| {
        let told = guidance(heard);
        told.last().unwrap().faults.contains(Fault::SpeedTimeout)
    };
    assert!(is_missing(&heard));

    let mut prover = Prover::new(&Keys::bench(Algorithm::AesCmac));
    let (mut heard, mut number) = (Vec::new(), 0);
    for k in 0..1000 {
        if k % 10 == 0 {
            let vehicle = Vehicle {
                speeds: [speed; 2],
                yaw_rate: None,
            };
            let frames = prover.prove(&vehicle.encode(counter));
            frames.iter().for_each(|frame| client.say(frame));
            counter = counter.wrapping_add(1);
        }
        bench.tick().unwrap();
        for frame in client.heard() {
            let next = || {
                number += 1;
                number
            };
            let questions = prover.hear(&frame, next);
            questions.iter().for_each(|frame| client.say(frame));
            heard.push(frame);
        }
    }
    assert!(!is_missing(&heard));
    bench.end().unwrap();
}

fn near(values: &[ParameterValue], params: &Params) -> bool {
    let told: Vec<f32> = values.iter().map(|value| value.value).collect();
    let expected = params.to_values().map(|value| value as f32);
    (0..PARAMETERS.len()).all(|k| usize::from(values[k].index) == k) && told[..PARAMETERS.len()] == expected
}

#[test]
fn the_ecu_says_what_it_did_not_use_and_which_parameters_it_has() {
    let mut bench = Bench::start("127.0.0.1:0", None).unwrap();
    let mut client = Client::join(&bench);
    let mut counter = 0;
    let mut heard = client.drive(&mut bench, 500, Speed::from_m_per_s(0.0), &mut counter);
    // A flipped bit, and a frame that would end the ECU's millisecond if it were taken for one of the lock step.
    let mut damaged = LanePreview::default().encode(0).full_data().unwrap();
    damaged[7] ^= 1;
    client.say(&Frame::full(LanePreview::ID, damaged));
    client.say(&Frame::full(0x7F0, [0; 8]));
    client.say(&Frame::full(0x7C0, [0; 8]));
    heard.extend(client.drive(&mut bench, 2600, Speed::from_m_per_s(0.0), &mut counter));
    let rejections = messages::<Rejection>(&heard);
    let expected = Rejection {
        id: LanePreview::ID,
        reason: Reject::Crc,
        count: 1,
    };
    assert!(rejections.len() >= 20, "{}", rejections.len());
    assert!(rejections.contains(&expected), "{rejections:?}");
    assert!(
        rejections
            .iter()
            .all(|line| [LanePreview::ID, Vehicle::ID].contains(&line.id))
    );
    let (statuses, identities) = (messages::<ParameterStatus>(&heard), messages::<Identity>(&heard));
    assert!((2..=4).contains(&statuses.len()) && statuses.len() == identities.len());
    assert!(
        statuses
            .iter()
            .all(|status| !status.stored && status.sequence == 0)
    );
    let values = messages::<ParameterValue>(&heard);
    let first = values.iter().position(|value| value.index == 0).unwrap();
    assert!(values.len() >= 28 && near(&values[first..], &Params::PAPER));
    bench.end().unwrap();
}

#[test]
fn parameters_can_be_tried() {
    let mut bench = Bench::start("127.0.0.1:0", None).unwrap();
    let mut client = Client::join(&bench);
    let (mut counter, still) = (0, Speed::from_m_per_s(0.0));
    let params = Params {
        k_1: 0.125,
        torque_limit_nm: 3.0,
        ..Params::PAPER
    };
    let send = |client: &mut Client, bench: &mut Bench, in_use: u32, speed: Speed, counter: &mut u8| {
        let fields = download::frames(&params);
        for frame in [download::unlock(in_use, 77)].iter().chain(&fields) {
            client.say(frame);
            client.drive(bench, 10, speed, counter);
        }
    };
    let last = |heard: &[Frame]| *messages::<ParameterStatus>(heard).last().unwrap();
    // Not in a vehicle that moves, and not by the number of another set.
    for (speed, in_use, outcome) in [
        (Speed::from_m_per_s(5.0), 0, WriteOutcome::NotStanding),
        (still, 3, WriteOutcome::NotUnlocked),
    ] {
        // A jump from 5 m/s to nothing is held for 0.33 s, and a hundred messages say that it stands.
        client.drive(&mut bench, 2000, speed, &mut counter);
        send(&mut client, &mut bench, in_use, speed, &mut counter);
        let heard = client.drive(&mut bench, 1100, speed, &mut counter);
        assert_eq!(last(&heard).outcome, outcome);
        assert!(!last(&heard).stored);
    }
    send(&mut client, &mut bench, 0, still, &mut counter);
    let heard = client.drive(&mut bench, 3500, still, &mut counter);
    assert_eq!((last(&heard).stored, last(&heard).sequence), (true, 1));
    assert_eq!(messages::<Identity>(&heard).last().unwrap().vehicle, 77);
    assert_eq!(guidance(&heard).last().unwrap().reset, ResetCause::NewParameters);
    let values = messages::<ParameterValue>(&heard);
    let restart = values.iter().rposition(|value| value.index == 0).unwrap();
    let restart = if values.len() - restart < PARAMETERS.len() {
        restart - PARAMETERS.len()
    } else {
        restart
    };
    assert!(near(&values[restart..], &params), "{values:?}");
    // Every start takes a set after ten seconds at the earliest.
    send(&mut client, &mut bench, 1, still, &mut counter);
    let heard = client.drive(&mut bench, 1100, still, &mut counter);
    assert_eq!(last(&heard).outcome, WriteOutcome::TooSoon);
    bench.end().unwrap();
}

/// A tester beside a vehicle that stands, a millisecond at a time.
struct Tester {
    client: Client,
    link: Link<256, 64>,
    counter: u8,
    ms: u32,
}

impl Tester {
    /// A millisecond; whatever the ECU says beside its answers is dropped.
    fn tick(&mut self, bench: &mut Bench) {
        while let Some(bytes) = self.link.frame(self.ms) {
            self.client.say(&Frame::full(haptic_diag::REQUEST_ID, bytes));
            self.link.sent(self.ms);
        }
        let still = Speed::from_m_per_s(0.0);
        // Of ten milliseconds one has the vehicle's message.
        let ms = if self.ms.is_multiple_of(10) { 1 } else { 0 };
        let mut heard = self.client.drive(bench, ms, still, &mut self.counter);
        if ms == 0 {
            bench.tick().unwrap();
            heard.extend(self.client.heard());
        }
        for frame in heard
            .iter()
            .filter(|frame| frame.id() == haptic_diag::RESPONSE_ID)
        {
            self.link.receive(frame.data(), self.ms);
        }
        self.ms += 1;
    }

    fn wait(&mut self, bench: &mut Bench, ms: u32) {
        (0..ms).for_each(|_| self.tick(bench));
    }

    fn ask(&mut self, bench: &mut Bench, request: &[u8]) -> Vec<u8> {
        assert!(self.link.send(request));
        for _ in 0..1000 {
            self.tick(bench);
            if let Some(message) = self.link.message() {
                let answer = message.bytes.to_vec();
                self.link.done();
                return answer;
            }
        }
        panic!("{request:02X?}: no answer in a second");
    }

    fn unlock(&mut self, bench: &mut Bench) {
        assert_eq!(self.ask(bench, &[0x10, 3])[0], 0x50);
        let challenge = self.ask(bench, &[0x27, 1]);
        let proof = [&[0x27, 2][..], &mac(&BENCH_KEY, &challenge[2..])].concat();
        assert_eq!(self.ask(bench, &proof), [0x67, 2]);
    }
}

/// C1111, that somebody sends under the ECU's own identifier, which is the fault that this test makes.
#[test]
fn a_tester_finds_a_fault_after_a_reset_and_has_a_parameter_stored() {
    let mut bench = Bench::start("127.0.0.1:0", None).unwrap();
    let mut tester = Tester {
        client: Client::join(&bench),
        link: Link::NEW,
        counter: 0,
        ms: 0,
    };
    tester.wait(&mut bench, 1500);
    let [codes, clear, limit, sequence]: [&[u8]; 4] = [
        &[0x19, 6, 0x51, 0x11, 0, 1],
        &[0x14, 0xFF, 0xFF, 0xFF],
        &[0x22, 0x10, 6],
        &[0x22, 2, 1],
    ];
    assert_eq!(tester.ask(&mut bench, codes), [0x59, 6, 0x51, 0x11, 0, 0]);
    tester.client.say(&Frame::new(FOREIGN, &[0; 8]).unwrap());
    tester.wait(&mut bench, 20);
    assert_eq!(
        tester.ask(&mut bench, codes),
        [0x59, 6, 0x51, 0x11, 0, 0x2B, 1, 1]
    );
    assert_eq!(tester.ask(&mut bench, limit)[3..], 5_f32.to_be_bytes());
    // The fault lasts for a second, in which the ECU hands over; then it is in Standby again.
    tester.wait(&mut bench, 3500);
    let write = [&[0x2E, 0x10, 6][..], &3_f32.to_be_bytes()].concat();
    assert_eq!(tester.ask(&mut bench, &[0x10, 3])[0], 0x50);
    assert_eq!(tester.ask(&mut bench, &write), [0x7F, 0x2E, 0x33]);
    tester.unlock(&mut bench);
    assert_eq!(tester.ask(&mut bench, &write), [0x6E, 0x10, 6]);
    assert_eq!(tester.ask(&mut bench, &[0x31, 1, 2, 0]), [0x71, 1, 2, 0]);
    tester.wait(&mut bench, 500);
    assert_eq!(tester.ask(&mut bench, sequence)[3..], [0, 0, 0, 1]);
    assert_eq!(tester.ask(&mut bench, limit)[3..], 3_f32.to_be_bytes());
    // It has started anew, and the code is there; cleared it is not.
    assert_eq!(
        tester.ask(&mut bench, codes),
        [0x59, 6, 0x51, 0x11, 0, 0x28, 1, 1]
    );
    tester.wait(&mut bench, 1500);
    tester.unlock(&mut bench);
    assert_eq!(tester.ask(&mut bench, &[0x11, 1]), [0x51, 1]);
    tester.wait(&mut bench, 200);
    let uptime = tester.ask(&mut bench, &[0x22, 3, 4]);
    assert!(uptime[3..6] == [0, 0, 0], "a start within 256 ms: {uptime:02X?}");
    assert_eq!(tester.ask(&mut bench, limit)[3..], 3_f32.to_be_bytes());
    assert_eq!(tester.ask(&mut bench, codes)[5], 0x28);
    assert_eq!(tester.ask(&mut bench, &[0x10, 3])[0], 0x50);
    assert_eq!(tester.ask(&mut bench, clear), [0x54]);
    assert_eq!(tester.ask(&mut bench, codes), [0x59, 6, 0x51, 0x11, 0, 0]);
    bench.end().unwrap();
}

#[test]
fn an_address_that_is_taken_or_none_is_told() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let taken = taken.local_addr().unwrap().to_string();
    for address in [taken.as_str(), "nowhere"] {
        match Bench::start(address, None) {
            Err(PilError::Failed(why)) => assert!(why.contains(address), "{why}"),
            _ => panic!("{address}: nobody can listen there"),
        }
    }
}
