//! The product: every millisecond one step of the controller, its inputs and its torque on the CAN bus.
//!
//! A panic or a fault brings the torque to zero, says so in the log, and stays there: what is broken does not
//! steer again without a reset.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("steering-ecu runs on a target: `cargo xtask qemu steering-ecu`");
}

#[cfg(target_os = "none")]
mod target {
    use cortex_m_rt::{ExceptionFrame, entry, exception};
    use embedded_can::nb::Can;
    use embedded_hal::digital::OutputPin;
    use haptic_core::ecu::{Boot, Ecu};
    use haptic_core::modes::Mode;
    use haptic_core::params::Setup;
    use haptic_firmware::boards::{Board, ThisBoard};

    /// Steps between two lines of the log: one second.
    const STEPS_PER_REPORT: u32 = 1000;

    /// What the log says once a second.
    #[derive(Default)]
    struct Counts {
        steps: u32,
        received: u32,
        rejected: u32,
        unsent: u32,
    }

    #[entry]
    fn main() -> ! {
        // A static and not on the stack, so that its size shows in the image's RAM.
        static mut ECU: Option<Ecu> = None;
        let mut board = ThisBoard::start();
        let ecu = ECU.insert(Ecu::new(Some(&Setup::PAPER), Boot::default(), ThisBoard::now()));
        let mut counts = Counts::default();
        defmt::info!("steering-ecu on {=str}", ThisBoard::NAME);
        board.start_tick();
        loop {
            board.sleep();
            while let Ok(frame) = board.can().receive() {
                counts.received = counts.received.wrapping_add(1);
                if ecu.receive(&frame, ThisBoard::now()).is_err() {
                    counts.rejected = counts.rejected.wrapping_add(1);
                }
            }
            if board.tick() {
                step(&mut board, ecu, &mut counts);
            }
        }
    }

    fn step(board: &mut ThisBoard, ecu: &mut Ecu, counts: &mut Counts) {
        let step = ecu.step(ThisBoard::now());
        // A frame that finds no room is lost; the next follows in a millisecond, and the receiver's time-out
        // judges a bus that stays closed.
        for frame in core::iter::once(&step.guidance).chain(&step.others) {
            if board.can().transmit(frame).is_err() {
                counts.unsent = counts.unsent.wrapping_add(1);
            }
        }
        // The torque is on its way; what follows may take its time.
        if let Some(frame) = ecu.advise()
            && board.can().transmit(&frame).is_err()
        {
            counts.unsent = counts.unsent.wrapping_add(1);
        }
        let guiding = matches!(step.command.mode, Mode::Active | Mode::Fade | Mode::Handover);
        let Ok(()) = board.status().set_state(guiding.into());
        counts.steps = counts.steps.wrapping_add(1);
        if counts.steps.is_multiple_of(STEPS_PER_REPORT) {
            defmt::info!(
                "steps {=u32}, received {=u32}, rejected {=u32}, unsent {=u32}",
                counts.steps,
                counts.received,
                counts.rejected,
                counts.unsent
            );
        }
    }

    fn stay_at_zero() -> ! {
        loop {
            cortex_m::asm::wfi();
        }
    }

    #[panic_handler]
    fn panic(info: &core::panic::PanicInfo) -> ! {
        ThisBoard::zero_torque();
        defmt::error!("panic: {}", defmt::Display2Format(info));
        stay_at_zero()
    }

    #[exception]
    unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
        ThisBoard::zero_torque();
        defmt::error!("fault at {=u32:#010x}", frame.pc());
        stay_at_zero()
    }
}
