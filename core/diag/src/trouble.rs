//! Diagnostic trouble codes: one for each fault of the list in `haptic_core::safety::faults`, with its status, a count and a
//! snapshot of its last appearance.
//!
//! They lie in [`Cells`], memory that a reset leaves alone and that a loss of supply does not: each cell has a CRC-32, and
//! one that is not whole says nothing. A status is that of ISO 14229-1, annex D, of which [`AVAILABLE`] are the bits that
//! are kept. A code is confirmed at once, as the controller has judged the fault before it declares it.
//!
//! Not here: what a fault leads to, as clearing a code ends no fault; and the flash that keeps cells through a loss of supply
//! (`haptic-firmware`).

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use haptic_core::controller::Command;
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;

use crate::data::Heard;

/// Words of a cell; the last is its CRC.
const WORDS: usize = 9;
/// A code, and beside them what security access remembers.
pub type Cell = [u32; WORDS];
/// How many cells there are.
pub const CELLS: usize = Fault::COUNT + 1;
/// Memory that a reset leaves alone. Any pattern of bits is allowed.
pub type Cells = [Cell; CELLS];
/// Cells that say nothing.
pub const EMPTY: Cells = [[0; WORDS]; CELLS];

/// Counts up with every change of what a cell holds: one of another layout is an empty one.
const LAYOUT: u32 = 1;
const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// The fault is present.
pub const TEST_FAILED: u8 = 0x01;
/// It was since the start.
pub const FAILED_THIS_CYCLE: u8 = 0x02;
/// The code is stored.
pub const CONFIRMED: u8 = 0x08;
/// It was since the codes were cleared.
pub const FAILED_SINCE_CLEAR: u8 = 0x20;
/// The bits of a status that are kept.
pub const AVAILABLE: u8 = TEST_FAILED | FAILED_THIS_CYCLE | CONFIRMED | FAILED_SINCE_CLEAR;

/// The group of all codes.
pub const ALL: u32 = 0xFF_FFFF;
/// C1100 of ISO 15031-6, a chassis code of the manufacturer's; faults count up from it. The failure type is 0: no more is said.
const FIRST: u32 = 0x51_0000;

/// The code of a fault, in 24 bits.
#[must_use]
#[expect(clippy::as_conversions, reason = "a code is its discriminant")]
pub const fn code_of(fault: Fault) -> u32 {
    FIRST | ((fault as u32) << 8)
}

/// The fault of a code.
#[must_use]
pub fn fault_of(code: u32) -> Option<Fault> {
    Fault::ALL.into_iter().find(|fault| code_of(*fault) == code)
}

/// What was so when a fault last appeared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Snapshot {
    /// The mode.
    pub mode: Mode,
    /// Time since the start, ms.
    pub at_ms: u32,
    /// The faults present.
    pub faults: FaultSet,
    /// T_h, N.m.
    pub torque_nm: f32,
    /// What the bus had said last.
    pub heard: Heard,
}

/// What is kept of a fault.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Record {
    /// How often it appeared since the codes were cleared, saturating.
    pub count: u8,
    /// At its last appearance.
    pub snapshot: Snapshot,
}

/// What security access remembers across a reset.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Attempts {
    /// Challenges so far.
    pub challenges: u32,
    /// Wrong answers since the last right one.
    pub wrong: u32,
}

/// Which faults have a code, and which are to be stored.
#[derive(Debug, Clone)]
pub struct Troubles {
    present: FaultSet,
    this_cycle: FaultSet,
    stored: FaultSet,
    /// Appeared, and not yet stored: one in a step is, since a CRC takes its time.
    due: FaultSet,
}

impl Troubles {
    /// What the cells hold at a start.
    #[must_use]
    pub fn new(cells: &Cells) -> Self {
        let mut stored = FaultSet::NONE;
        for fault in Fault::ALL {
            stored.insert_if(record(cells, fault).is_some(), fault);
        }
        Self {
            present: FaultSet::NONE,
            this_cycle: FaultSet::NONE,
            stored,
            due: FaultSet::NONE,
        }
    }

    /// Takes the faults of a step, and stores one of those that appeared.
    pub fn step(&mut self, cells: &mut Cells, command: &Command, heard: impl FnOnce() -> Heard, now_ms: u32) {
        let appeared = command.faults.difference(self.present);
        self.present = command.faults;
        self.this_cycle = self.this_cycle.union(appeared);
        self.due = self.due.union(appeared);
        let Some(fault) = Fault::ALL.into_iter().find(|fault| self.due.contains(*fault)) else {
            return;
        };
        self.due.set(false, fault);
        self.stored.insert(fault);
        let before = record(cells, fault).map_or(0, |record| record.count);
        let record = Record {
            count: before.saturating_add(1),
            snapshot: Snapshot {
                mode: command.mode,
                at_ms: now_ms,
                faults: command.faults,
                torque_nm: nm(command),
                heard: heard(),
            },
        };
        write(cells, fault, &record);
    }

    /// The status of a code.
    #[must_use]
    pub fn status(&self, fault: Fault) -> u8 {
        let bit = |set: FaultSet, bit: u8| if set.contains(fault) { bit } else { 0 };
        bit(self.present, TEST_FAILED)
            | bit(self.this_cycle, FAILED_THIS_CYCLE)
            | bit(self.stored, CONFIRMED | FAILED_SINCE_CLEAR)
    }

    /// Forgets a code. One whose fault is present appears anew.
    pub fn clear(&mut self, cells: &mut Cells, fault: Fault) {
        for set in [
            &mut self.present,
            &mut self.this_cycle,
            &mut self.stored,
            &mut self.due,
        ] {
            set.set(false, fault);
        }
        // Whole, so that what the flash holds of it counts no more.
        seal(cells, place(fault), [0; WORDS - 1]);
    }
}

#[expect(clippy::as_conversions, reason = "a tester reads a binary32")]
pub(crate) fn nm(command: &Command) -> f32 {
    command.torque.nm() as f32
}

#[expect(clippy::as_conversions, reason = "a code is its discriminant")]
const fn place(fault: Fault) -> usize {
    fault as usize
}

/// What is kept of a fault, if it appeared since the codes were cleared.
#[must_use]
pub fn record(cells: &Cells, fault: Fault) -> Option<Record> {
    let [head, at_ms, faults, torque, driver, wheel, speed, lateral] = read(cells, place(fault))?;
    let [count, mode, ..] = head.to_le_bytes();
    (count > 0).then_some(())?;
    Some(Record {
        count,
        snapshot: Snapshot {
            mode: Mode::from_code(u32::from(mode))?,
            at_ms,
            faults: FaultSet::from_bits(faults),
            torque_nm: f32::from_bits(torque),
            heard: Heard {
                driver_torque_nm: f32::from_bits(driver),
                wheel_angle_rad: f32::from_bits(wheel),
                speed_m_per_s: f32::from_bits(speed),
                lateral_error_m: f32::from_bits(lateral),
            },
        },
    })
}

#[expect(clippy::as_conversions, reason = "a mode's code is its discriminant")]
fn write(cells: &mut Cells, fault: Fault, record: &Record) {
    let Snapshot {
        mode,
        at_ms,
        faults,
        torque_nm,
        heard,
    } = record.snapshot;
    let words = [
        u32::from_le_bytes([record.count, mode as u8, 0, 0]),
        at_ms,
        faults.bits(),
        torque_nm.to_bits(),
        heard.driver_torque_nm.to_bits(),
        heard.wheel_angle_rad.to_bits(),
        heard.speed_m_per_s.to_bits(),
        heard.lateral_error_m.to_bits(),
    ];
    seal(cells, place(fault), words);
}

/// What security access remembers.
#[must_use]
pub fn attempts(cells: &Cells) -> Attempts {
    let [challenges, wrong, ..] = read(cells, Fault::COUNT).unwrap_or_default();
    Attempts { challenges, wrong }
}

/// Keeps it.
pub fn keep_attempts(cells: &mut Cells, attempts: Attempts) {
    let Attempts { challenges, wrong } = attempts;
    seal(cells, Fault::COUNT, [challenges, wrong, 0, 0, 0, 0, 0, 0]);
}

/// The CRC of a cell in its place, if it is whole.
#[must_use]
pub fn mark([words @ .., crc]: &Cell, place: usize) -> Option<u32> {
    (*crc == checksum(words, place)).then_some(*crc)
}

/// The words of a cell that is whole.
fn read(cells: &Cells, place: usize) -> Option<[u32; WORDS - 1]> {
    let cell = cells.get(place)?;
    let [words @ .., _] = cell;
    mark(cell, place).map(|_| *words)
}

fn seal(cells: &mut Cells, place: usize, words: [u32; WORDS - 1]) {
    if let Some([to @ .., crc]) = cells.get_mut(place) {
        (*to, *crc) = (words, checksum(&words, place));
    }
}

/// The CRC of a cell in its place, in this layout.
#[expect(clippy::as_conversions, reason = "an index of at most 32")]
fn checksum(words: &[u32; WORDS - 1], place: usize) -> u32 {
    let mut digest = CRC.digest();
    for word in [LAYOUT, place as u32].iter().chain(words) {
        digest.update(&word.to_le_bytes());
    }
    digest.finalize()
}
