//! The gate: this image links only if no panic is reachable from `Ecu::receive` and `Ecu::step`, because its
//! panic handler calls a function that does not exist. Built for a core without floating-point hardware, it
//! also shows every float operation as a call of a library function. `cargo xtask gate` builds it both ways
//! and looks.
//!
//! The inputs come from volatile memory, so that the compiler can assume nothing about them. The features
//! `gate-with-panic`, `gate-with-wrap` and `gate-with-float` put a violation behind the step: the gate must find it.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("gate is only linked, never run: `cargo xtask gate`");
}

#[cfg(target_os = "none")]
mod target {
    use core::ptr::{addr_of, addr_of_mut, read_volatile, write_volatile};

    use cortex_m_rt::entry;
    use haptic_core::bus::Frame;
    use haptic_core::controller::config::Setup;
    use haptic_core::ecu::{Boot, Ecu};
    use haptic_core::quantity::Instant;

    static mut INPUT: (u16, usize, [u8; 8], u32) = (0, 0, [0; 8], 0);
    static mut OUTPUT: [u8; 8] = [0; 8];

    #[entry]
    fn main() -> ! {
        let mut ecu = Ecu::new(Some(&Setup::PAPER), Boot::default(), Instant::default());
        loop {
            // SAFETY: nothing else runs; volatile only so that the values are unknown to the compiler.
            let (id, len, data, now) = unsafe { read_volatile(addr_of!(INPUT)) };
            let now = Instant::from_us(now);
            if let Some(frame) = data.get(..len).and_then(|data| Frame::new(id, data)) {
                let _ = ecu.receive(&frame, now);
            }
            let step = ecu.step(now);
            let mut output = [0; 8];
            for frame in core::iter::once(&step.guidance).chain(&step.others) {
                for (to, from) in output.iter_mut().zip(frame.data()) {
                    *to ^= *from;
                }
            }
            #[cfg(feature = "gate-with-panic")]
            {
                output[0] = output[usize::from(output[1])];
            }
            #[cfg(feature = "gate-with-wrap")]
            {
                output[0] += output[1];
            }
            #[cfg(feature = "gate-with-float")]
            {
                output[0] = (step.command.torque.nm() * f64::from(output[1])) as u8;
            }
            // SAFETY: as above.
            unsafe { write_volatile(addr_of_mut!(OUTPUT), output) };
        }
    }

    #[cfg(feature = "gate-that-links")]
    #[panic_handler]
    fn panic(_: &core::panic::PanicInfo) -> ! {
        loop {
            cortex_m::asm::nop();
        }
    }

    #[cfg(not(feature = "gate-that-links"))]
    #[panic_handler]
    fn panic(_: &core::panic::PanicInfo) -> ! {
        unsafe extern "C" {
            fn a_panic_is_reachable_from_the_controller() -> !;
        }
        // SAFETY: never linked.
        unsafe { a_panic_is_reachable_from_the_controller() }
    }
}
