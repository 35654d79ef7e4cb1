//! A tester and an ECU of which only the server is real. The tester's frames are put together by hand.

use haptic_core::bus::Frame;
use haptic_core::bus::messages::ResetCause;
use haptic_core::controller::Command;
use haptic_core::controller::params::Params;
use haptic_core::quantity::Torque;
use haptic_core::safety::envelope::LimitReason;
use haptic_core::safety::faults::FaultSet;
use haptic_core::safety::modes::Mode;
use haptic_core::service::download::{Conditions, Download};
use haptic_core::service::stored::{Set, Stored};
use haptic_diag::security::Key;
use haptic_diag::server::{Server, Situation, Wish};
use haptic_diag::trouble::{Cells, EMPTY};

/// RFC 4493, section 4.
pub(crate) const KEY: Key = [
    0x2B, 0x7E, 0x15, 0x16, 0x28, 0xAE, 0xD2, 0xA6, 0xAB, 0xF7, 0x15, 0x88, 0x09, 0xCF, 0x4F, 0x3C,
];
const ASK: u16 = 0x730;
const ANSWER: u16 = 0x738;

pub(crate) struct Rig {
    pub(crate) server: Server,
    pub(crate) cells: Cells,
    pub(crate) now_ms: u32,
    pub(crate) command: Command,
    pub(crate) params: Option<Params>,
    pub(crate) stored: Option<Stored>,
    pub(crate) stands: bool,
    pub(crate) settled: bool,
    pub(crate) download: Download,
    /// What the download completed, and whether a reset was asked for.
    pub(crate) set: Option<Set>,
    pub(crate) is_reset: bool,
}

impl Rig {
    pub(crate) fn new() -> Self {
        Self::with(EMPTY, Some(KEY))
    }

    /// After a reset that left these cells.
    pub(crate) fn with(cells: Cells, key: Option<Key>) -> Self {
        Self {
            server: Server::new(&cells, key),
            cells,
            now_ms: 0,
            command: Command {
                torque: Torque::ZERO,
                probe: None,
                limit: LimitReason::None,
                mode: Mode::Standby,
                faults: FaultSet::NONE,
                warning: false,
                hands: None,
            },
            params: Some(Params::PAPER),
            stored: None,
            stands: true,
            settled: true,
            download: Download::NEW,
            set: None,
            is_reset: false,
        }
    }

    /// A millisecond; the data of a frame of the server's, if it sends one.
    pub(crate) fn step(&mut self) -> Option<[u8; 8]> {
        self.now_ms = self.now_ms.wrapping_add(1);
        let conditions = Conditions {
            mode: self.command.mode,
            stands: self.stands,
            settled: self.settled,
            in_use: self.stored.map(|stored| stored.sequence),
            now_ms: self.now_ms,
        };
        let outcome = self.download.status(self.stored.as_ref(), false).outcome;
        let (in_use, stored) = (self.params.as_ref(), self.stored.as_ref());
        let cycles = self.now_ms.wrapping_mul(170_001);
        let wish = self
            .server
            .step(&mut self.cells, &self.command, self.now_ms, || Situation {
                conditions,
                outcome,
                in_use,
                stored,
                is_damaged: false,
                is_image_whole: true,
                reset: ResetCause::PowerOn,
                rejected: 7,
                hardware: 0xCAFE_0001,
                cycles,
                software: "9.8.7",
                commit: "0123456789ab",
            });
        match wish {
            Wish::None => {}
            Wish::Download(frame) => self.set = self.download.receive(&frame, &conditions).or(self.set),
            Wish::Reset => self.is_reset = true,
        }
        let frame = self.server.frame(self.now_ms)?;
        self.server.sent(self.now_ms);
        assert_eq!(frame.id(), ANSWER);
        frame.full_data()
    }

    pub(crate) fn wait(&mut self, ms: u32) {
        for _ in 0..ms {
            assert_eq!(self.step(), None, "nobody asked");
        }
    }

    /// A frame of the tester's.
    pub(crate) fn say(&mut self, data: &[u8]) {
        self.server.receive(&Frame::new(ASK, data).unwrap(), self.now_ms);
    }

    /// Sends a message as ISO 15765-2 has it, and waits for flow control where that is due. False: the ECU wants no more of it.
    pub(crate) fn send(&mut self, message: &[u8]) -> bool {
        let length = message.len();
        if length <= 7 {
            let mut frame = vec![length as u8];
            frame.extend(message);
            self.say(&frame);
            return true;
        }
        let mut frame = vec![0x10 | (length >> 8) as u8, length as u8];
        frame.extend(&message[..6]);
        self.say(&frame);
        let mut left = 0;
        for (number, part) in message[6..].chunks(7).enumerate() {
            if left == 0 {
                let Some([0x30, block, ..]) = self.step() else {
                    return false;
                };
                left = block;
            }
            left -= 1;
            let mut frame = vec![0x20 | ((number + 1) & 0xF) as u8];
            frame.extend(part);
            self.say(&frame);
        }
        true
    }

    /// The answer, within P2 of 50 ms; its consecutive frames are asked for in blocks of three, 4 ms apart.
    pub(crate) fn answer(&mut self) -> Option<Vec<u8>> {
        let first = (0..50).find_map(|_| self.step())?;
        let (length, mut message) = match first[0] >> 4 {
            0 => return Some(first[1..=usize::from(first[0])].to_vec()),
            1 => (
                usize::from(first[0] & 0xF) << 8 | usize::from(first[1]),
                first[2..].to_vec(),
            ),
            _ => panic!("{first:02X?}"),
        };
        let mut number = 1;
        while message.len() < length {
            if (number - 1) % 3 == 0 {
                self.say(&[0x30, 3, 4]);
            }
            let before = self.now_ms;
            let frame = (0..50).find_map(|_| self.step()).expect("a consecutive frame");
            assert!((number - 1) % 3 == 0 || self.now_ms - before >= 4, "too early");
            assert_eq!(frame[0], 0x20 | (number & 0xF) as u8);
            message.extend(&frame[1..]);
            number += 1;
        }
        message.truncate(length);
        Some(message)
    }

    pub(crate) fn ask(&mut self, message: &[u8]) -> Option<Vec<u8>> {
        assert!(self.send(message));
        self.answer()
    }

    /// The answer begins with these bytes.
    pub(crate) fn expect(&mut self, message: &[u8], begins: &[u8]) -> Vec<u8> {
        let answer = self
            .ask(message)
            .unwrap_or_else(|| panic!("{message:02X?}: no answer"));
        assert!(
            answer.starts_with(begins),
            "{message:02X?}: {answer:02X?}, not {begins:02X?}"
        );
        answer
    }

    /// The negative answer of ISO 14229-1, annex A.
    pub(crate) fn refuses(&mut self, message: &[u8], code: u8) {
        let answer = self.ask(message);
        assert_eq!(answer, Some(vec![0x7F, message[0], code]), "{message:02X?}");
    }

    /// An extended session, unlocked.
    pub(crate) fn open(&mut self) {
        self.expect(&[0x10, 3], &[0x50, 3]);
        let challenge = self.expect(&[0x27, 1], &[0x67, 1]);
        let mut proof = vec![0x27, 2];
        proof.extend(haptic_diag::security::mac(&KEY, &challenge[2..]));
        self.expect(&proof, &[0x67, 2]);
    }
}
