//! The product with a flaw, to show what becomes of it: half a second after power-up, and in one case after every
//! start, the loop hangs, panics, faults, or outgrows its stack; or a bit of the monitor flips, which then permits nothing
//! any more. QEMU's semihosting argument says which.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("broken runs in QEMU: `cargo test -p haptic-guidance resets::`");
}

#[cfg(target_os = "none")]
mod target {
    use cortex_m_rt::entry;
    use haptic_core::bus::messages::ResetCause;
    use haptic_core::ecu::Ecu;
    use haptic_core::ecu::injection::Region;
    use haptic_firmware::service::Service;
    use haptic_firmware::{host, product};
    use haptic_secoc::verifier::Verifier;

    /// The step that breaks.
    const AT: u32 = 500;

    #[entry]
    fn main() -> ! {
        static mut ECU: Option<Ecu> = None;
        static mut SERVICE: Option<Service> = None;
        static mut VERIFIER: Option<Verifier> = None;
        let mut buffer = [0; 128];
        let arguments = host::command_line(&mut buffer);
        let flaw = match arguments.split(' ').next_back() {
            Some("hang") => Flaw::Hang,
            Some("panic") => Flaw::Panic,
            Some("fault") => Flaw::Fault,
            Some("overflow") => Flaw::Overflow,
            Some("veto") => Flaw::Veto,
            _ => Flaw::HangAlways,
        };
        product::run(ECU, SERVICE, VERIFIER, move |ecu, boot, step| {
            if step == AT && (boot.reset == ResetCause::PowerOn || flaw == Flaw::HangAlways) {
                break_down(flaw, ecu);
            }
        })
    }

    #[derive(Clone, Copy, PartialEq)]
    enum Flaw {
        Hang,
        HangAlways,
        Panic,
        Fault,
        Overflow,
        Veto,
    }

    fn break_down(flaw: Flaw, ecu: &mut Ecu) {
        match flaw {
            Flaw::Hang | Flaw::HangAlways => loop {
                cortex_m::asm::nop();
            },
            Flaw::Panic => panic!("on purpose"),
            Flaw::Fault => cortex_m::asm::udf(),
            Flaw::Overflow => drop(deeper(0)),
            Flaw::Veto => ecu.flip_bit(Region::Monitor, 0),
        }
    }

    /// Never ends, and no two levels share a frame.
    #[expect(unconditional_recursion)]
    #[inline(never)]
    fn deeper(level: u32) -> u32 {
        let frame = core::hint::black_box([level; 16]);
        deeper(frame[3].wrapping_add(1)).wrapping_add(frame[7])
    }

    haptic_firmware::stop_on_panic_and_fault!();
}
