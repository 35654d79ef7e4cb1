//! The product image in QEMU with keys: guided by senders that prove their frames, and attacked by somebody who knows all of the bus
//! but the keys. His frames pass every check of `core/haptic.dbc`.

use std::collections::BTreeMap;
use std::ffi::OsStr;

use haptic_core::bus::messages::{LanePreview, Message, ParameterStatus, Request, Vehicle};
use haptic_core::bus::slcan::{self, Line, Parser};
use haptic_core::bus::{Frame, e2e::ReceiverState};
use haptic_core::controller::params::Params;
use haptic_core::quantity::{Metres, Micros, Radians, Ratio, Speed};
use haptic_core::service::download;
use haptic_secoc::Keys;
use haptic_secoc::fresh::Algorithm;
use haptic_secoc::messages::{Refusal, State, Status};
use haptic_secoc::prover::Prover;
use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};

use crate::machine::image;
use crate::product_image::{ACTIVE, BOOTS, EXPECTED_RAW, Ecu, frames, guidance};

/// Milliseconds of an attack.
const ATTACK: u32 = 1000;
/// Milliseconds in which each of a dozen counts that are not zero has its turn.
const TOLD: u32 = 1200;
/// QEMU passes a serial port's bytes one by one: the machine's time has to wait for the proofs and the attacker's frames.
const PACE: &str = "0";
/// Milliseconds until something has to have happened.
const PATIENCE: u32 = 4000;

/// The ECU, its true senders, and all that was said.
struct Bus {
    ecu: Ecu,
    prover: Prover,
    random: SmallRng,
    ms: u32,
    torque_raw: i16,
    mode: u64,
    state: Option<State>,
    waits: bool,
    /// What was refused, by message and reason.
    refused: BTreeMap<(u16, u8), u16>,
    parameters: Option<ParameterStatus>,
    said: Vec<Frame>,
}

impl Bus {
    fn start(features: &str, algorithm: Algorithm) -> Self {
        let elf = image("mps2-an386", features);
        let mut ecu = Ecu::run(PACE, &[OsStr::new("--elf"), elf.as_os_str()]);
        ecu.send(b"C\rS6\rO\r");
        Self {
            ecu,
            prover: Prover::new(&Keys::bench(algorithm)),
            random: SmallRng::seed_from_u64(47),
            ms: 0,
            torque_raw: 0,
            mode: 0,
            state: None,
            waits: true,
            refused: BTreeMap::new(),
            parameters: None,
            said: Vec::new(),
        }
    }

    fn send(&mut self, frames: &[Frame]) {
        let bytes: Vec<u8> = frames
            .iter()
            .flat_map(|frame| slcan::format(frame).to_vec())
            .collect();
        self.ecu.send(&bytes);
    }

    /// A millisecond of the ECU's: what it said is taken, the true senders send, then the attacker.
    fn ms(&mut self, engage: bool, attack: Option<Attack>) {
        loop {
            let line = self.ecu.line();
            if let Some(now) = guidance(&line) {
                (self.torque_raw, self.mode) = (now.torque_raw, now.mode);
                break;
            }
            self.hear(&line);
        }
        let mut sent = Vec::new();
        for frame in frames(self.ms, self.torque_raw, engage) {
            sent.extend(self.prover.prove(&frame));
        }
        if let Some(attack) = attack {
            sent.extend(self.attack(attack));
        }
        self.send(&sent);
        self.said.extend(sent);
        self.ms += 1;
    }

    /// Whether something happens within so many milliseconds.
    fn within(&mut self, ms: u32, mut happens: impl FnMut(&mut Self) -> bool) -> bool {
        (0..ms).any(|_| happens(self))
    }

    fn hear(&mut self, line: &str) {
        let mut parser = Parser::default();
        let heard = line
            .bytes()
            .chain(*b"\r")
            .filter_map(|byte| parser.push(byte))
            .last();
        let Some(Line::Frame(frame)) = heard else {
            return;
        };
        if let Some(status) = Status::decode(&frame) {
            self.state = Some(status.state);
            self.waits = status.waiting[..3].contains(&true);
            if let Some(line) = status.refused {
                self.refused.insert((line.id, line.reason as u8), line.count);
            }
        }
        if frame.id() == ParameterStatus::ID {
            let status = ParameterStatus::decode(&mut { ReceiverState::TRUSTED }, &frame).unwrap();
            // Nothing became of any set, as nothing of one was ever heard.
            assert_eq!(*self.parameters.get_or_insert(status), status);
        }
        let random = &mut self.random;
        let questions = self.prover.hear(&frame, || random.random());
        self.send(&questions);
    }

    /// What somebody without keys sends in this millisecond: counters that go on between two true frames, a false lane with any
    /// proof, a standstill, what was said a while ago, and a set of parameters.
    fn attack(&mut self, Attack { engage }: Attack) -> Vec<Frame> {
        let (ms, phase) = (self.ms, self.ms % 10);
        let mut sent = Vec::new();
        if (1..7).contains(&phase) {
            let request = Request {
                engage,
                authority: Ratio::ONE,
                probe: true,
            };
            sent.push(request.encode((ms / 10 + phase) as u8));
        }
        if ms % 8 == 4 {
            let lane = LanePreview {
                e_y: Metres::from_m(-4.0),
                e_theta: Radians::ZERO,
                age: Micros::from_us(0),
                valid: true,
            };
            sent.push(lane.encode((ms / 8 + 1) as u8));
            let proof: [u8; 4] = self.random.random();
            sent.extend(Frame::new(0x101, &proof));
        }
        if phase == 7 {
            let vehicle = Vehicle {
                speeds: [Speed::from_m_per_s(0.0); 2],
                yaw_rate: None,
            };
            sent.push(vehicle.encode((ms / 10 + 1) as u8));
        }
        if phase == 8 {
            let set = download::frames(&Params {
                torque_limit_nm: 1.0,
                ..Params::PAPER
            });
            let turn = (ms / 10) as usize;
            sent.push(if turn.is_multiple_of(8) {
                download::unlock(0, 0)
            } else {
                set[turn % set.len()]
            });
        }
        if phase == 9 {
            let back = self.random.random_range(2..self.said.len());
            sent.extend_from_slice(&self.said[self.said.len() - back..][..2]);
        }
        sent
    }
}

#[derive(Clone, Copy)]
struct Attack {
    /// What the forged requests ask for: the opposite of what the host does.
    engage: bool,
}

/// How an image withstands, and guides then: the log's worst step, or None where this host was too busy.
fn withstands(features: &str, algorithm: Algorithm) -> Option<String> {
    let mut bus = Bus::start(features, algorithm);
    if !bus.within(PATIENCE, |bus| {
        bus.ms(false, None);
        !bus.waits
    }) {
        println!("not synchronised: {:?}", bus.refused);
        return None;
    }
    let expected = match algorithm {
        Algorithm::SipHash => State::SipHash,
        Algorithm::AesCmac => State::AesCmac,
    };
    assert_eq!(bus.state, Some(expected));
    for _ in 0..ATTACK {
        bus.ms(false, Some(Attack { engage: true }));
        assert_eq!(bus.torque_raw, 0, "a torque that nobody asked for");
        assert_ne!(bus.mode, ACTIVE, "engaged by somebody without keys");
    }
    // Until each count has been told once more.
    for _ in 0..TOLD {
        bus.ms(false, None);
    }
    let counted = |bus: &Bus, id: u16, reason: Refusal| {
        let count = bus.refused.get(&(id, reason as u8));
        u32::from(count.copied().unwrap_or(0))
    };
    let mut settled = 0;
    let guides = bus.within(PATIENCE, |bus| {
        let attack = (bus.mode == ACTIVE).then_some(Attack { engage: false });
        // A request that rises.
        bus.ms(bus.ms % 2000 >= 800, attack);
        let is_law = (bus.torque_raw - EXPECTED_RAW).abs() <= 4;
        assert!(settled == 0 || bus.mode != ACTIVE || is_law, "{}", bus.torque_raw);
        settled = if bus.mode == ACTIVE && is_law {
            settled + 1
        } else {
            0
        };
        settled == 100
    });
    if !guides {
        println!("no guidance: mode {}, refused {:?}", bus.mode, bus.refused);
        return None;
    }
    println!("refused: {:?}", bus.refused);
    assert!(counted(&bus, 0x130, Refusal::Proof) > ATTACK / 3, "requests");
    // The false lane has a proof.
    assert!(counted(&bus, 0x100, Refusal::Proof) > ATTACK / 25, "lanes");
    assert!(counted(&bus, 0x120, Refusal::Unproven) > ATTACK / 20, "speeds");
    assert!(
        counted(&bus, 0x140, Refusal::Unproven) > ATTACK / 50,
        "parameters"
    );
    assert!(counted(&bus, 0x148, Refusal::Unproven) >= 1, "unlocking");
    assert!(bus.parameters.is_some_and(|status| !status.stored));
    let log = bus.ecu.end();
    let last = log
        .lines()
        .rev()
        .find(|line| line.contains("worst step"))
        .unwrap();
    Some(last.to_owned())
}

fn attacked(features: &str, algorithm: Algorithm) {
    let line = (0..BOOTS).find_map(|_| withstands(features, algorithm));
    println!("{}", line.expect("guidance is kept in one of the boots"));
}

#[test]
fn nobody_without_keys_moves_an_ecu_with_siphash() {
    attacked("keys-siphash", Algorithm::SipHash);
}

#[test]
fn nobody_without_keys_moves_an_ecu_with_aes() {
    attacked("keys-aes", Algorithm::AesCmac);
}
