//! Why the processor started, told across resets.
//!
//! A record in memory that a reset leaves alone says what a handler announced before it reset the processor,
//! and how many resets there were of late. With what the hardware knows it makes the [`Boot`] of the
//! controller, which tells the bus and locks after too many. Faults of class C that were latched cross a reset in it
//! too: they last until power-up, and a watchdog that nobody fed because the monitor forbade it is none.
//!
//! New parameters cross a reset here too: they are stored at a start, when nothing moves and no watchdog runs.
//!
//! "Of late" is within 10 s of running: [`settled`] forgets. So resets that are 10 s apart never lock.

use haptic_core::bus::messages::ResetCause;
use haptic_core::ecu::Boot;
use haptic_core::faults::FaultSet;

/// What the hardware says about the last reset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hardware {
    /// The supply came, or fell so low that the processor was held.
    Supply,
    /// Somebody pressed the button or has a debugger.
    Operator,
    /// The watchdog, or nothing is known.
    Watchdog,
}

/// What survives a reset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
struct Record {
    magic: u32,
    /// A [`ResetCause`], or 0 for none.
    announced: u32,
    recent: u32,
    /// [`Boot::latched`], as bits.
    latched: u32,
    /// The four above, inverted and summed: memory after power-up is none of it.
    check: u32,
}

impl Record {
    const MAGIC: u32 = 0x57A8_1E56;
    /// Nothing happened since power-up.
    const NONE: Self = Self::new(0, 0, 0);

    const fn new(announced: u32, recent: u32, latched: u32) -> Self {
        Self {
            magic: Self::MAGIC,
            announced,
            recent,
            latched,
            check: Self::check(announced, recent, latched),
        }
    }

    const fn check(announced: u32, recent: u32, latched: u32) -> u32 {
        !Self::MAGIC
            .wrapping_add(announced)
            .wrapping_add(recent)
            .wrapping_add(latched)
    }

    /// Itself, if it is one.
    fn whole(self) -> Option<Self> {
        (self == Self::new(self.announced, self.recent, self.latched)).then_some(self)
    }

    /// With a cause to announce. What was no record before holds no number of resets either.
    fn announcing(self, cause: ResetCause) -> Self {
        let Self { recent, latched, .. } = self.whole().unwrap_or(Self::NONE);
        Self::new(cause as u32, recent, latched)
    }

    /// With faults that last until power-up.
    fn latching(self, faults: FaultSet) -> Self {
        let Self {
            announced,
            recent,
            latched,
            ..
        } = self.whole().unwrap_or(Self::NONE);
        Self::new(announced, recent, latched | faults.bits())
    }

    /// Without the resets of late.
    fn settled(self) -> Self {
        Self::new(0, 0, self.whole().unwrap_or(Self::NONE).latched)
    }

    /// How the controller comes up after a reset with this record in memory.
    fn boot(self, hardware: Hardware) -> Boot {
        let whole = self.whole();
        let record = whole.unwrap_or(Self::NONE);
        let announced = ResetCause::from_code(i64::from(record.announced));
        let reset = match (hardware, announced) {
            _ if whole.is_none() => ResetCause::PowerOn,
            // The memory is whole, so the supply was only low.
            (Hardware::Supply, _) => ResetCause::BrownOut,
            (_, Some(cause)) if cause != ResetCause::PowerOn => cause,
            (Hardware::Operator, _) => ResetCause::PowerOn,
            (Hardware::Watchdog, _) => ResetCause::Watchdog,
        };
        if reset == ResetCause::PowerOn {
            return Boot::default();
        }
        let recent = u8::try_from(record.recent).unwrap_or(u8::MAX);
        Boot {
            reset,
            recent_resets: match reset {
                // Somebody asked for it: it neither counts nor clears.
                ResetCause::NewParameters => recent,
                _ => recent.saturating_add(1),
            },
            latched: FaultSet::from_bits(record.latched),
        }
    }
}

#[cfg(target_os = "none")]
pub use on_target::{boot, latch, restart, restart_with, settled, take_parameters};

#[cfg(target_os = "none")]
mod on_target {
    use core::mem::MaybeUninit;

    use haptic_core::params::Params;
    use haptic_core::stored::{self, BYTES};

    use super::{Boot, FaultSet, Hardware, Record, ResetCause};

    #[unsafe(link_section = ".uninit.reset")]
    static mut RECORD: MaybeUninit<Record> = MaybeUninit::uninit();

    /// A set of parameters for the next start to store, as one of its copies: its CRC tells it from noise.
    #[unsafe(link_section = ".uninit.parameters")]
    static mut PARAMETERS: MaybeUninit<[u8; BYTES]> = MaybeUninit::uninit();

    /// Whatever lies there: a record, or noise before the first [`boot`].
    fn read() -> Record {
        // SAFETY: one core, interrupts masked: only a handler that never returns comes between; every pattern of bits
        // is a value, and the compiler does not see which.
        unsafe { (&raw const RECORD).cast::<Record>().read_volatile() }
    }

    fn write(record: Record) {
        // SAFETY: as for `read`.
        unsafe { (&raw mut RECORD).cast::<Record>().write_volatile(record) }
    }

    /// How the controller comes up. To be called once.
    pub fn boot(hardware: Hardware) -> Boot {
        let boot = read().boot(hardware);
        let latched = boot.latched.bits();
        write(Record::new(0, u32::from(boot.recent_resets), latched));
        boot
    }

    /// The image has run for 10 s: earlier resets no longer count.
    pub fn settled() {
        write(read().settled());
    }

    /// These faults last until power-up, whatever resets come before.
    pub fn latch(faults: FaultSet) {
        write(read().latching(faults));
    }

    /// Resets the processor and leaves the next start a set to store.
    pub fn restart_with(params: &Params) -> ! {
        let bytes = stored::save(params, 0);
        // SAFETY: as for `write`.
        unsafe { (&raw mut PARAMETERS).cast::<[u8; BYTES]>().write_volatile(bytes) };
        restart(ResetCause::NewParameters)
    }

    /// The set that [`restart_with`] left, once.
    pub fn take_parameters() -> Option<Params> {
        let place = (&raw mut PARAMETERS).cast::<[u8; BYTES]>();
        // SAFETY: as for `read`.
        let bytes = unsafe { place.read_volatile() };
        // SAFETY: as for `write`. Whatever happens next must not find it again.
        unsafe { place.write_volatile([0; BYTES]) };
        stored::load([&bytes, &[]]).map(|stored| stored.params)
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

    fn boot(record: Record, hardware: Hardware) -> (ResetCause, u8) {
        let boot = record.boot(hardware);
        (boot.reset, boot.recent_resets)
    }

    #[test]
    fn memory_without_a_record_is_a_power_up() {
        let mut record = Record::new(ResetCause::Panic as u32, 2, 0);
        record.check ^= 1;
        for hardware in [Hardware::Supply, Hardware::Operator, Hardware::Watchdog] {
            assert_eq!(boot(record, hardware), (ResetCause::PowerOn, 0));
        }
    }

    #[test]
    fn the_cause_that_was_announced_counts_and_every_reset_is_counted() {
        let announced = Record::new(ResetCause::StackOverflow as u32, 1, 0);
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
        let silent = Record::new(0, 2, 0);
        assert_eq!(boot(silent, Hardware::Watchdog), (ResetCause::Watchdog, 3));
        assert_eq!(boot(silent, Hardware::Supply), (ResetCause::BrownOut, 3));
        assert_eq!(boot(silent, Hardware::Operator), (ResetCause::PowerOn, 0));
        assert_eq!(
            boot(Record::new(0, 400, 0), Hardware::Watchdog),
            (ResetCause::Watchdog, 255)
        );
    }

    /// Asked for over the bus: no step towards locking, and none away from it.
    #[test]
    fn new_parameters_do_not_count_as_a_reset() {
        let announced = Record::new(ResetCause::NewParameters as u32, 2, 0);
        assert_eq!(
            boot(announced, Hardware::Operator),
            (ResetCause::NewParameters, 2)
        );
        assert_eq!(
            boot(announced, Hardware::Watchdog),
            (ResetCause::NewParameters, 2)
        );
    }

    /// A start that fails before anybody looked at the memory announces its cause, and vouches for nothing else there.
    #[test]
    fn noise_does_not_become_a_record() {
        let mut noise = Record::new(0xDEAD_BEEF, 0xCAFE_F00D, 0xFFFF);
        noise.check ^= 1;
        let after = noise.announcing(ResetCause::Panic);
        assert_eq!(boot(after, Hardware::Operator), (ResetCause::Panic, 1));
        assert_eq!(after.boot(Hardware::Operator).latched, FaultSet::NONE);
        assert_eq!(noise.settled().boot(Hardware::Watchdog).latched, FaultSet::NONE);
    }

    #[test]
    fn latched_faults_end_with_power_up_alone() {
        let [monitor, actuator] = [1 << 9, 1 << 11].map(FaultSet::from_bits);
        let record = Record::new(0, 2, 0).latching(monitor).latching(actuator);
        let both = monitor.union(actuator);
        for hardware in [Hardware::Watchdog, Hardware::Supply] {
            assert_eq!(record.boot(hardware).latched, both);
            assert_eq!(record.settled().boot(hardware).latched, both);
            assert_eq!(record.announcing(ResetCause::Panic).boot(hardware).latched, both);
        }
        assert_eq!(boot(record, Hardware::Watchdog), (ResetCause::Watchdog, 3));
        assert_eq!(
            boot(record.settled(), Hardware::Watchdog),
            (ResetCause::Watchdog, 1)
        );
        assert_eq!(record.boot(Hardware::Operator).latched, FaultSet::NONE);
        let mut spoilt = record;
        spoilt.latched ^= 1 << 9;
        assert_eq!(spoilt.boot(Hardware::Watchdog).latched, FaultSet::NONE);
    }
}
