//! Why the processor started, told across resets.
//!
//! A record in memory that a reset leaves alone says what a handler announced before it reset the processor,
//! and how many resets there were. With what the hardware knows it makes the [`Boot`] of the
//! controller, which tells the bus and locks after too many. Faults of class C that were latched cross a reset in it
//! too: they last until power-up, and a watchdog that nobody fed because the monitor forbade it is none.
//!
//! Codes of faults cross a reset here too (`haptic_diag::trouble`).
//!
//! New parameters cross a reset here too: they are stored at a start, when nothing moves and no watchdog runs.
//!
//! The record is kept twice, the second copy inverted, each with a CRC-32. One copy is enough. Without a whole one, what
//! lies there is either a record that was damaged, which is a fault of the memory ([`Fault::Memory`], latched), or the
//! noise of a power-up, which looks like none: of the 64 bits that begin a copy, noise has about half wrong.
//!
//! Two counts lead to Locked. "Of late" is within 10 s of running: [`settled`] forgets them. All since power-up, those
//! for new parameters too, are never forgotten: what resets once in a while cannot go on for ever.

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use haptic_core::bus::messages::ResetCause;
use haptic_core::ecu::{Boot, RESETS_TO_LOCK};
use haptic_core::safety::faults::{Fault, FaultSet};

/// So many resets since power-up lock the ECU, however far apart they are.
const RESETS_SINCE_POWER_UP_TO_LOCK: u32 = 10;

/// Steps of 1 ms after which earlier resets no longer count: 10 s.
pub const STEPS_TO_SETTLE: u32 = 10_000;

/// Whether a start has run long enough for new parameters, which cost a reset: one after power-up has at once.
pub fn has_settled(cause: ResetCause, steps: u32) -> bool {
    cause == ResetCause::PowerOn || steps >= STEPS_TO_SETTLE
}

/// What the hardware says about the last reset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hardware {
    /// The supply came, or fell so low that the processor was held.
    Supply,
    /// Somebody pressed the button or has a debugger.
    Operator,
    /// The watchdog.
    Watchdog,
    /// The machine has no register that says. As the watchdog, but for memory without a record: that is a power-up.
    Unknown,
}

/// What survives a reset.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Record {
    /// A [`ResetCause`], or 0 for none.
    announced: u32,
    /// Resets of late.
    recent: u32,
    /// Resets since power-up.
    total: u32,
    /// [`Boot::latched`], as bits.
    latched: u32,
}

/// Words of a copy: the magic number, the record, the CRC.
const COPY: usize = 7;
/// Both copies as they lie in memory.
type Words = [u32; 2 * COPY];
/// The magic number has as many ones as zeros, and is far from any pattern that a memory test writes.
const MAGIC: [u32; 2] = [0x57A8_1E56, 0x9C63_B12D];
/// A magic number with fewer wrong bits of 64 is a damaged one. Noise has 32 on average; one power-up of millions has
/// 12.
const NEAR_BITS: u32 = 12;
const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// What lies in the memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Found {
    Whole(Record),
    /// There was a record, and no copy of it is whole.
    Damaged,
    /// Noise.
    Nothing,
}

impl Record {
    /// Both copies.
    fn words(self) -> Words {
        let Self {
            announced,
            recent,
            total,
            latched,
        } = self;
        let body = [MAGIC[0], MAGIC[1], announced, recent, total, latched];
        let mut words = [0; 2 * COPY];
        for (i, word) in body.into_iter().chain([checksum(body)]).enumerate() {
            words[i] = word;
            words[COPY + i] = !word;
        }
        words
    }

    /// The record of a copy, if it is whole.
    fn from_words([a, b, announced, recent, total, latched, crc]: [u32; COPY]) -> Option<Self> {
        let body = [a, b, announced, recent, total, latched];
        ([a, b] == MAGIC && crc == checksum(body)).then_some(Self {
            announced,
            recent,
            total,
            latched,
        })
    }

    /// What two whole copies say together: a reset may have come between their writes.
    fn with(self, other: Self) -> Self {
        Self {
            announced: if self.announced == 0 {
                other.announced
            } else {
                self.announced
            },
            recent: self.recent.max(other.recent),
            total: self.total.max(other.total),
            latched: self.latched | other.latched,
        }
    }

    /// What is left of a record that was damaged: it is known that there was one.
    fn damaged() -> Self {
        let mut latched = FaultSet::NONE;
        latched.insert(Fault::Memory);
        Self {
            latched: latched.bits(),
            ..Self::default()
        }
    }

    /// The record with a cause to announce.
    fn announcing(self, cause: ResetCause) -> Self {
        Self {
            announced: cause as u32,
            ..self
        }
    }

    /// The record with faults that last until power-up.
    fn latching(self, faults: FaultSet) -> Self {
        Self {
            latched: self.latched | faults.bits(),
            ..self
        }
    }

    /// Without the resets of late.
    fn settled(self) -> Self {
        Self {
            announced: 0,
            recent: 0,
            ..self
        }
    }
}

fn checksum(body: [u32; COPY - 1]) -> u32 {
    let mut digest = CRC.digest();
    for word in body {
        digest.update(&word.to_le_bytes());
    }
    digest.finalize()
}

impl Found {
    fn from_words(words: &Words) -> Self {
        let mut plain = [0; COPY];
        let mut inverted = [0; COPY];
        for i in 0..COPY {
            (plain[i], inverted[i]) = (words[i], !words[COPY + i]);
        }
        let is_near = |copy: [u32; COPY]| {
            let wrong = (copy[0] ^ MAGIC[0]).count_ones() + (copy[1] ^ MAGIC[1]).count_ones();
            wrong <= NEAR_BITS
        };
        match (Record::from_words(plain), Record::from_words(inverted)) {
            (Some(a), Some(b)) => Self::Whole(a.with(b)),
            (Some(one), None) | (None, Some(one)) => Self::Whole(one),
            (None, None) if is_near(plain) || is_near(inverted) => Self::Damaged,
            (None, None) => Self::Nothing,
        }
    }

    /// The record to go on with, when there must be one because this start has written it.
    fn written(self) -> Record {
        match self {
            Self::Whole(record) => record,
            Self::Damaged | Self::Nothing => Record::damaged(),
        }
    }

    /// The record to go on with before this start has written one.
    fn early(self) -> Record {
        match self {
            Self::Nothing => Record::default(),
            found => found.written(),
        }
    }

    /// How the controller comes up after a reset with this in memory, and the record of the new start.
    fn boot(self, hardware: Hardware) -> (Boot, Record) {
        let record = match (self, hardware) {
            (Self::Whole(record), _) => record,
            // A watchdog's reset leaves the memory alone: what is gone was destroyed.
            (Self::Damaged, _) | (Self::Nothing, Hardware::Watchdog) => Record::damaged(),
            (Self::Nothing, _) => return (Boot::default(), Record::default()),
        };
        let announced = ResetCause::from_code(i64::from(record.announced));
        let reset = match (hardware, announced) {
            // The memory is whole, so the supply was only low.
            (Hardware::Supply, _) => ResetCause::BrownOut,
            (_, Some(cause)) if cause != ResetCause::PowerOn => cause,
            (Hardware::Operator, _) => ResetCause::PowerOn,
            (Hardware::Watchdog | Hardware::Unknown, _) => ResetCause::Watchdog,
        };
        // Whoever presses the button stands beside it; but a record that is not whole vouches for no button.
        if reset == ResetCause::PowerOn && matches!(self, Self::Whole(_)) {
            return (Boot::default(), Record::default());
        }
        let next = Record {
            announced: 0,
            recent: match reset {
                // Asked for over the bus: of those the count since power-up has an end.
                ResetCause::NewParameters => record.recent,
                _ => record.recent.saturating_add(1),
            },
            total: record.total.saturating_add(1),
            latched: record.latched,
        };
        let recent = u8::try_from(next.recent).unwrap_or(u8::MAX);
        let boot = Boot {
            reset,
            recent_resets: if next.total >= RESETS_SINCE_POWER_UP_TO_LOCK {
                recent.max(RESETS_TO_LOCK)
            } else {
                recent
            },
            latched: FaultSet::from_bits(record.latched),
        };
        (boot, next)
    }
}

#[cfg(target_os = "none")]
pub use on_target::{boot, cells, latch, restart, restart_with, settled, take_parameters};

#[cfg(target_os = "none")]
mod on_target {
    use core::mem::MaybeUninit;
    use core::sync::atomic::{AtomicBool, Ordering};

    use haptic_core::service::stored::{self, BYTES, Set};
    use haptic_diag::trouble::Cells;

    use super::{Boot, COPY, FaultSet, Found, Hardware, Record, ResetCause, Words};

    #[unsafe(link_section = ".uninit.reset")]
    static mut RECORD: MaybeUninit<Words> = MaybeUninit::uninit();

    /// Whether this start has written the record: from then on it must be there. Cleared at every start.
    static WRITTEN: AtomicBool = AtomicBool::new(false);

    /// A set of parameters for the next start to store, as one of its copies: its CRC tells it from noise.
    #[unsafe(link_section = ".uninit.parameters")]
    static mut PARAMETERS: MaybeUninit<[u8; BYTES]> = MaybeUninit::uninit();

    /// Codes of faults, each with its own CRC.
    #[unsafe(link_section = ".uninit.cells")]
    static mut CELLS: MaybeUninit<Cells> = MaybeUninit::uninit();

    /// The codes of faults, as the last start left them. To be called once.
    pub fn cells() -> &'static mut Cells {
        let cells = (&raw mut CELLS).cast::<Cells>();
        // SAFETY: the only access, once; every pattern of bits is a value. What was there is read and written back as
        // volatile, so that the compiler does not reason about what it does not see being written.
        unsafe {
            cells.write_volatile(cells.read_volatile());
            &mut *cells
        }
    }

    /// What lies in the record's memory.
    fn read_record() -> Found {
        // SAFETY: one core, interrupts masked: only a handler that never returns comes between; every pattern of bits
        // is a value, and the compiler does not see which.
        Found::from_words(&unsafe { (&raw const RECORD).cast::<Words>().read_volatile() })
    }

    fn read() -> Record {
        if WRITTEN.load(Ordering::Relaxed) {
            read_record().written()
        } else {
            read_record().early()
        }
    }

    /// One copy after the other, so that a reset between them finds one whole.
    fn write(record: Record) {
        let words = record.words();
        for copy in [0..COPY, COPY..2 * COPY] {
            for (i, word) in words.iter().enumerate().filter(|(i, _)| copy.contains(i)) {
                // SAFETY: as for `look`; within the array.
                unsafe { (&raw mut RECORD).cast::<u32>().add(i).write_volatile(*word) }
            }
        }
        WRITTEN.store(true, Ordering::Relaxed);
    }

    /// How the controller comes up. To be called once.
    pub fn boot(hardware: Hardware) -> Boot {
        let (boot, record) = read_record().boot(hardware);
        write(record);
        boot
    }

    /// The image has run for 10 s: earlier resets are no longer of late.
    pub fn settled() {
        write(read().settled());
    }
    /// These faults last until power-up, whatever resets come before.
    pub fn latch(faults: FaultSet) {
        write(read().latching(faults));
    }

    /// Resets the processor and leaves the next start a set to store.
    pub fn restart_with(set: &Set) -> ! {
        // It does not leave this processor.
        let bytes = stored::save(set, 0, 0);
        // SAFETY: as for `look`.
        unsafe { (&raw mut PARAMETERS).cast::<[u8; BYTES]>().write_volatile(bytes) };
        restart(ResetCause::NewParameters)
    }

    /// The set that [`restart_with`] left, once.
    pub fn take_parameters() -> Option<Set> {
        let place = (&raw mut PARAMETERS).cast::<[u8; BYTES]>();
        // SAFETY: as for `look`.
        let bytes = unsafe { place.read_volatile() };
        // SAFETY: as for `look`. Whatever happens next must not find it again.
        unsafe { place.write_volatile([0; BYTES]) };
        stored::load([&bytes, &[]], 0).map(|stored| stored.set)
    }

    /// Resets the processor and has the next start say why.
    pub fn restart(cause: ResetCause) -> ! {
        write(read().announcing(cause));
        cortex_m::peripheral::SCB::sys_reset()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RESETTERS: [Hardware; 3] = [Hardware::Supply, Hardware::Watchdog, Hardware::Unknown];

    fn record(announced: u32, recent: u32) -> Record {
        Record {
            announced,
            recent,
            ..Record::default()
        }
    }

    /// The requirement says ten seconds, and a step is a millisecond.
    #[test]
    fn a_start_after_a_reset_has_settled_after_ten_seconds() {
        for cause in [ResetCause::Watchdog, ResetCause::Panic] {
            assert!(!has_settled(cause, 9_999), "{cause:?}");
            assert!(has_settled(cause, 10_000), "{cause:?}");
        }
        assert!(has_settled(ResetCause::PowerOn, 0));
        assert_eq!(STEPS_TO_SETTLE, 10_000);
    }

    /// How the next start comes up when this record lies in memory.
    fn start(record: Record, hardware: Hardware) -> Boot {
        Found::from_words(&record.words()).boot(hardware).0
    }

    fn boot(record: Record, hardware: Hardware) -> (ResetCause, u8) {
        let boot = start(record, hardware);
        (boot.reset, boot.recent_resets)
    }

    fn latched(fault: Fault) -> FaultSet {
        let mut faults = FaultSet::NONE;
        faults.insert(fault);
        faults
    }

    /// Memory after power-up: all zeros in QEMU, anything on a board (xorshift).
    fn noise() -> impl Iterator<Item = Words> {
        let mut x = 0x9E37_79B9_u32;
        let random = core::iter::repeat_with(move || {
            core::array::from_fn(|_| {
                x ^= x << 13;
                x ^= x >> 17;
                x ^= x << 5;
                x
            })
        });
        [[0; 2 * COPY], [u32::MAX; 2 * COPY]]
            .into_iter()
            .chain(random.take(100_000))
    }

    #[test]
    fn noise_is_a_power_up() {
        for words in noise() {
            for hardware in [Hardware::Supply, Hardware::Operator, Hardware::Unknown] {
                let (boot, record) = Found::from_words(&words).boot(hardware);
                assert_eq!((boot, record), (Boot::default(), Record::default()), "{words:x?}");
            }
            assert_eq!(Found::from_words(&words).early(), Record::default());
        }
    }

    /// No reset but that of the supply and the operator destroys the memory; and what this start has written is there.
    #[test]
    fn a_record_that_is_gone_is_a_fault_where_it_must_be_there() {
        let memory = latched(Fault::Memory);
        for words in noise().take(100) {
            assert_eq!(
                Found::from_words(&words).boot(Hardware::Watchdog).0.latched,
                memory
            );
            assert_eq!(Found::from_words(&words).written(), Record::damaged());
        }
    }

    /// It used to be taken for a power-up, which cleared the fault: one bit and a reset, and the ECU would engage again.
    /// With one copy whole nothing is lost; with none, that there was a record is reason enough for Fault.
    #[test]
    fn no_flipped_bit_clears_a_latched_fault() {
        let words = record(0, 2).latching(latched(Fault::Monitor)).words();
        let bits = 32 * words.len();
        let flip = |words: &mut Words, bit: usize| words[bit / 32] ^= 1 << (bit % 32);
        for bit in 0..bits {
            let mut flipped = words;
            flip(&mut flipped, bit);
            for hardware in RESETTERS {
                let boot = Found::from_words(&flipped).boot(hardware).0;
                assert_eq!(
                    (boot.latched, boot.recent_resets),
                    (latched(Fault::Monitor), 3),
                    "bit {bit}"
                );
            }
            // A second one in the other copy.
            for other in bits / 2..bits {
                let mut both = flipped;
                flip(&mut both, other);
                for hardware in [
                    Hardware::Supply,
                    Hardware::Watchdog,
                    Hardware::Unknown,
                    Hardware::Operator,
                ] {
                    let (boot, record) = Found::from_words(&both).boot(hardware);
                    let is_kept = boot.latched == latched(Fault::Monitor);
                    let is_faulty = boot.latched == latched(Fault::Memory);
                    let by_hand =
                        hardware == Hardware::Operator && Found::from_words(&both) != Found::Damaged;
                    assert!(is_kept || is_faulty || by_hand, "bits {bit}, {other}: {boot:?}");
                    // And the start after that one knows it too.
                    assert_eq!(
                        Found::from_words(&record.words())
                            .boot(Hardware::Watchdog)
                            .0
                            .latched,
                        boot.latched
                    );
                }
            }
        }
    }

    #[test]
    fn a_reset_between_the_writes_of_the_copies_loses_nothing() {
        let old = record(0, 1).latching(latched(Fault::Monitor)).words();
        let new = record(ResetCause::Panic as u32, 2)
            .latching(latched(Fault::Actuator))
            .words();
        for written in 0..=2 * COPY {
            let mut words = old;
            words[..written].copy_from_slice(&new[..written]);
            let boot = Found::from_words(&words).boot(Hardware::Watchdog).0;
            let faults = boot.latched;
            let both = latched(Fault::Monitor).union(latched(Fault::Actuator));
            let expected = match written {
                // Of the new copy some words are those of the old one: it may be whole early.
                0..COPY => [latched(Fault::Monitor), both],
                COPY..14 => [both, latched(Fault::Actuator)],
                _ => [latched(Fault::Actuator); 2],
            };
            assert!(expected.contains(&faults), "{written} words: {faults:?}");
        }
    }

    #[test]
    fn the_cause_that_was_announced_counts_and_every_reset_is_counted() {
        let announced = record(ResetCause::StackOverflow as u32, 1);
        assert_eq!(
            boot(announced, Hardware::Watchdog),
            (ResetCause::StackOverflow, 2)
        );
        // A handler resets by request, as a debugger does.
        assert_eq!(
            boot(announced, Hardware::Operator),
            (ResetCause::StackOverflow, 2)
        );
        assert_eq!(boot(announced, Hardware::Supply), (ResetCause::BrownOut, 2));
    }

    #[test]
    fn without_an_announcement_the_hardware_counts() {
        let silent = record(0, 2);
        assert_eq!(boot(silent, Hardware::Watchdog), (ResetCause::Watchdog, 3));
        assert_eq!(boot(silent, Hardware::Unknown), (ResetCause::Watchdog, 3));
        assert_eq!(boot(silent, Hardware::Supply), (ResetCause::BrownOut, 3));
        assert_eq!(boot(silent, Hardware::Operator), (ResetCause::PowerOn, 0));
        assert_eq!(
            boot(record(0, 400), Hardware::Watchdog),
            (ResetCause::Watchdog, 255)
        );
    }

    /// Asked for over the bus: no step towards locking within 10 s, and none away from it.
    #[test]
    fn new_parameters_are_no_reset_of_late() {
        let announced = record(ResetCause::NewParameters as u32, 2);
        for hardware in [Hardware::Operator, Hardware::Watchdog] {
            assert_eq!(boot(announced, hardware), (ResetCause::NewParameters, 2));
        }
    }

    /// Each start runs for longer than 10 s, so that none is of late; the tenth reset locks all the same, those for new
    /// parameters counted too.
    #[test]
    fn resets_that_come_again_and_again_lock() {
        for cause in [0, ResetCause::NewParameters as u32, ResetCause::Panic as u32] {
            let mut now = Record::default();
            for reset in 1..=12 {
                let found = Found::from_words(
                    &Record {
                        announced: cause,
                        ..now
                    }
                    .words(),
                );
                let (boot, next) = found.boot(Hardware::Watchdog);
                let is_locking = boot.recent_resets >= RESETS_TO_LOCK;
                assert_eq!(is_locking, reset >= 10, "reset {reset} of cause {cause}");
                now = next.settled();
            }
            // Until power-up.
            assert_eq!(boot(now, Hardware::Operator), (ResetCause::PowerOn, 0));
        }
    }

    /// A start that fails before anybody looked at the memory announces its cause, and vouches for nothing else there.
    #[test]
    fn noise_does_not_become_a_record() {
        for words in noise().take(100) {
            let after = Found::from_words(&words).early().announcing(ResetCause::Panic);
            assert_eq!(boot(after, Hardware::Operator), (ResetCause::Panic, 1));
            assert_eq!(start(after, Hardware::Operator).latched, FaultSet::NONE);
        }
    }

    #[test]
    fn latched_faults_end_with_power_up_alone() {
        let [monitor, actuator] = [Fault::Monitor, Fault::Actuator].map(latched);
        let record = record(0, 2).latching(monitor).latching(actuator);
        let both = monitor.union(actuator);
        for hardware in RESETTERS {
            for record in [record, record.settled(), record.announcing(ResetCause::Panic)] {
                assert_eq!(start(record, hardware).latched, both);
            }
        }
        assert_eq!(boot(record, Hardware::Watchdog), (ResetCause::Watchdog, 3));
        assert_eq!(
            boot(record.settled(), Hardware::Watchdog),
            (ResetCause::Watchdog, 1)
        );
        assert_eq!(start(record, Hardware::Operator).latched, FaultSet::NONE);
    }
}
