//! Power lost while parameters are written: the image cuts the supply of its own flash in the middle of a write,
//! resets the processor, and looks what the next start finds: the set before the write or the new one, whole. It
//! does so at every step of a write, hundreds of times, each on top of what the last cut left behind, and says on
//! QEMU's console how often.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("power-loss runs in QEMU: `cargo test -p haptic-guidance parameters::`");
}

#[cfg(target_os = "none")]
mod target {
    use core::mem::MaybeUninit;

    use cortex_m::peripheral::SCB;
    use cortex_m_rt::{ExceptionFrame, entry, exception};
    use cortex_m_semihosting::hprintln;
    use haptic_core::controller::params::Params;
    use haptic_core::service::stored::Set;
    use haptic_firmware::boards::{Board, ThisBoard};
    use haptic_firmware::{host, storage};

    /// Starts with a cut behind them.
    const CUTS: u32 = 250;
    /// A write takes fewer operations; so each is cut at, and some writes are not cut.
    const OPERATIONS: u32 = 110;

    /// How far the campaign is, across resets.
    #[derive(Clone, Copy)]
    struct Progress {
        magic: u32,
        cuts: u32,
        writes: u32,
        turn: u32,
        /// The set that was in use before the last write: its sequence number.
        before: u32,
    }

    const MAGIC: u32 = 0x0FF0_0FF0;

    #[unsafe(link_section = ".uninit.progress")]
    static mut PROGRESS: MaybeUninit<Progress> = MaybeUninit::uninit();

    /// A set that its sequence number tells apart.
    fn set(number: u32) -> Set {
        let params = Params {
            k_1: 0.25 + f64::from(number) / 4096.0,
            ..Params::PAPER
        };
        Set {
            params,
            vehicle: core::num::NonZeroU32::new(number),
        }
    }

    #[entry]
    fn main() -> ! {
        let mut board = ThisBoard::start();
        let place = (&raw mut PROGRESS).cast::<Progress>();
        // SAFETY: nothing else uses it; any pattern of bits is a value.
        let mut progress = unsafe { place.read_volatile() };
        if progress.magic != MAGIC {
            progress = Progress {
                magic: MAGIC,
                cuts: 0,
                writes: 0,
                turn: 0,
                before: 0,
            };
        }
        if progress.cuts == CUTS {
            hprintln!("{} cuts, {} writes", progress.cuts, progress.writes);
            host::exit(true);
        }
        let flash = board.flash();
        let found = storage::load(flash, ThisBoard::hardware());
        let number = found.stored.map_or(0, |stored| stored.sequence);
        let is_whole = found.stored.is_none_or(|stored| stored.set == set(number));
        if !is_whole || (number != progress.before && number != progress.before + 1) {
            let Progress { cuts, before, .. } = progress;
            hprintln!("after {} cuts: set {} instead of {}", cuts, number, before);
            host::exit(false);
        }
        progress.before = number;
        progress.turn += 1;
        flash.cut_after(1 + progress.turn * 29 % OPERATIONS);
        let result = storage::save(
            flash,
            &set(number + 1),
            found.stored.as_ref(),
            ThisBoard::hardware(),
        );
        progress.cuts += u32::from(result.is_err());
        progress.writes += u32::from(result.is_ok());
        // SAFETY: as above.
        unsafe { place.write_volatile(progress) };
        // A write that was not cut is followed by a reset too.
        SCB::sys_reset()
    }

    #[panic_handler]
    fn panic(info: &core::panic::PanicInfo) -> ! {
        hprintln!("{}", info);
        host::exit(false)
    }

    #[exception]
    unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
        hprintln!("fault at {:#010x}", frame.pc());
        host::exit(false)
    }
}
