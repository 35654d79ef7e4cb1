//! Why the processor started, told across resets.
//!
//! A record in memory that a reset leaves alone says what a handler announced before it reset the processor,
//! and how many resets there were of late. With what the hardware knows it makes the [`Boot`] of the
//! controller, which tells the bus and locks after too many.
//!
//! New parameters cross a reset here too: they are stored at a start, when nothing moves and no watchdog runs.
//!
//! "Of late" is within 10 s of running: [`settled`] forgets. So resets that are 10 s apart never lock.

use haptic_core::bus::messages::ResetCause;
use haptic_core::ecu::Boot;

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
    /// The three above, inverted and summed: memory after power-up is none of it.
    check: u32,
}

impl Record {
    const MAGIC: u32 = 0x57A8_1E55;

    const fn new(announced: u32, recent: u32) -> Self {
        Self {
            magic: Self::MAGIC,
            announced,
            recent,
            check: Self::check(announced, recent),
        }
    }

    const fn check(announced: u32, recent: u32) -> u32 {
        !Self::MAGIC.wrapping_add(announced).wrapping_add(recent)
    }

    /// How the controller comes up after a reset with this record in memory.
    fn boot(self, hardware: Hardware) -> Boot {
        let is_whole = self.magic == Self::MAGIC && self.check == Self::check(self.announced, self.recent);
        let announced = ResetCause::from_code(i64::from(self.announced));
        let reset = match (hardware, announced) {
            _ if !is_whole => ResetCause::PowerOn,
            // The memory is whole, so the supply was only low.
            (Hardware::Supply, _) => ResetCause::BrownOut,
            (_, Some(cause)) if cause != ResetCause::PowerOn => cause,
            (Hardware::Operator, _) => ResetCause::PowerOn,
            (Hardware::Watchdog, _) => ResetCause::Watchdog,
        };
        let recent_resets = match reset {
            ResetCause::PowerOn => 0,
            // Somebody asked for it: it neither counts nor clears.
            ResetCause::NewParameters => u8::try_from(self.recent).unwrap_or(u8::MAX),
            _ => u8::try_from(self.recent).unwrap_or(u8::MAX).saturating_add(1),
        };
        Boot { reset, recent_resets }
    }
}

#[cfg(target_os = "none")]
pub use on_target::{boot, restart, restart_with, settled, take_parameters};

#[cfg(target_os = "none")]
mod on_target {
    use core::mem::MaybeUninit;

    use haptic_core::params::Params;
    use haptic_core::stored::{self, BYTES};

    use super::{Boot, Hardware, Record, ResetCause};

    #[unsafe(link_section = ".uninit.reset")]
    static mut RECORD: MaybeUninit<Record> = MaybeUninit::uninit();

    /// A set of parameters for the next start to store, as one of its copies: its CRC tells it from noise.
    #[unsafe(link_section = ".uninit.parameters")]
    static mut PARAMETERS: MaybeUninit<[u8; BYTES]> = MaybeUninit::uninit();

    fn write(record: Record) {
        // SAFETY: one core, interrupts masked: only a handler that never returns comes between.
        unsafe { (&raw mut RECORD).cast::<Record>().write_volatile(record) }
    }

    /// How the controller comes up. To be called once, first.
    pub fn boot(hardware: Hardware) -> Boot {
        // SAFETY: as for `write`; every pattern of bits is a record, and the compiler does not see which.
        let record = unsafe { (&raw const RECORD).cast::<Record>().read_volatile() };
        let boot = record.boot(hardware);
        write(Record::new(0, u32::from(boot.recent_resets)));
        boot
    }

    /// The image has run for 10 s: earlier resets no longer count.
    pub fn settled() {
        write(Record::new(0, 0));
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
        // SAFETY: as in `boot`.
        let bytes = unsafe { place.read_volatile() };
        // SAFETY: as for `write`. Whatever happens next must not find it again.
        unsafe { place.write_volatile([0; BYTES]) };
        stored::load([&bytes, &[]]).map(|stored| stored.params)
    }

    /// Resets the processor and has the next start say why.
    pub fn restart(cause: ResetCause) -> ! {
        // SAFETY: as in `boot`; it was called before anything that can fail.
        let record = unsafe { (&raw const RECORD).cast::<Record>().read_volatile() };
        write(Record::new(cause as u32, record.recent));
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
        let mut record = Record::new(ResetCause::Panic as u32, 2);
        record.check ^= 1;
        for hardware in [Hardware::Supply, Hardware::Operator, Hardware::Watchdog] {
            assert_eq!(boot(record, hardware), (ResetCause::PowerOn, 0));
        }
    }

    #[test]
    fn the_cause_that_was_announced_counts_and_every_reset_is_counted() {
        let announced = Record::new(ResetCause::StackOverflow as u32, 1);
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
        let silent = Record::new(0, 2);
        assert_eq!(boot(silent, Hardware::Watchdog), (ResetCause::Watchdog, 3));
        assert_eq!(boot(silent, Hardware::Supply), (ResetCause::BrownOut, 3));
        assert_eq!(boot(silent, Hardware::Operator), (ResetCause::PowerOn, 0));
        assert_eq!(
            boot(Record::new(0, 400), Hardware::Watchdog),
            (ResetCause::Watchdog, 255)
        );
    }

    /// Asked for over the bus: no step towards locking, and none away from it.
    #[test]
    fn new_parameters_do_not_count_as_a_reset() {
        let announced = Record::new(ResetCause::NewParameters as u32, 2);
        assert_eq!(
            boot(announced, Hardware::Operator),
            (ResetCause::NewParameters, 2)
        );
        assert_eq!(
            boot(announced, Hardware::Watchdog),
            (ResetCause::NewParameters, 2)
        );
    }
}
