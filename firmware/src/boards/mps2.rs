//! The reference board: ARM MPS2+ with the AN386 image (Cortex-M4F, 25 MHz), as QEMU's `mps2-an386`; and the same
//! board with the AN500 image (Cortex-M7), as `mps2-an500`.
//!
//! - UART0: the CAN bus, as SLCAN. UART1: the log. Both transmit at 25 MHz / 16 = 1.5625 Mbaud.
//! - SysTick: the 1 kHz tick. FPGAIO counter: microseconds. CMSDK timer 0: cycles. LED 0: status.
//! - The pseudo-static RAM plays the flash, which this board does not have ([`crate::nor`]): QEMU keeps it in a file if it is
//!   given one (`cargo xtask qemu --flash`), and through a reset in any case.
//! - CMSDK watchdog: a non-maskable interrupt after half its time, the reset after all of it.
//!
//! Registers as in ARM DAI 0386 (AN386) and the Cortex-M System Design Kit's UART, timer and watchdog. The actuator
//! sits on the bus and takes silence as zero torque, so zero torque here is a silent bus (how soon:
//! `docs/explanation/monitor-and-memory.md`).

use core::convert::Infallible;

use cortex_m::interrupt::InterruptNumber;

use cortex_m::peripheral::{NVIC, Peripherals, SCB, SYST};
use cortex_m_rt::exception;
use embedded_hal::digital::{self, OutputPin};
use embedded_hal_nb::nb;
use embedded_hal_nb::serial::{self, Read, Write};
use haptic_core::quantity::Instant;
use haptic_secoc::Keys;
use haptic_secoc::fresh::Algorithm;
use volatile_register::{RO, RW};

use super::{Board, WATCHDOG, start_systick};
use crate::nor::{Nor, PAGE};
use crate::slcan_can::SlcanCan;
use crate::{keys, reset, stack};

const CORE_CLOCK_HZ: u32 = 25_000_000;
/// Cycles between two looks for work, 2.5 us.
const BETWEEN_GLANCES: u32 = 64;

/// The board's peripherals, taken.
pub struct Mps2 {
    can: SlcanCan<Uart>,
    led: Led,
    flash: Nor<&'static mut Pages>,
    systick: SYST,
    /// Whether the watchdog runs.
    watched: bool,
}

impl Board for Mps2 {
    type Can = SlcanCan<Uart>;
    type Status = Led;
    type Flash = Nor<&'static mut Pages>;

    const NAME: &'static str = if cfg!(feature = "mps2-an500") {
        "mps2-an500"
    } else {
        "mps2-an386"
    };

    fn start() -> Self {
        cortex_m::interrupt::disable();
        let mut cortex = Peripherals::take().expect("the board is started once");
        stack::protect(&mut cortex.MPU);
        FPGAIO.get().write_prescale(CORE_CLOCK_HZ / 1_000_000 - 1);
        TIMER0.get().run();
        UART1.get().start(TRANSMIT);
        UART0.get().start(TRANSMIT | RECEIVE | INTERRUPTS);
        for irq in [Irq::Uart0Receive, Irq::Uart0Transmit] {
            // SAFETY: interrupts are masked for good, so unmasking one in the NVIC only lets it wake the core.
            unsafe { NVIC::unmask(irq) };
        }
        Self {
            can: SlcanCan::new(Uart(UART0)),
            led: Led,
            flash: Nor::new(pages()),
            systick: cortex.SYST,
            watched: false,
        }
    }

    fn can(&mut self) -> &mut Self::Can {
        &mut self.can
    }

    fn status(&mut self) -> &mut Self::Status {
        &mut self.led
    }

    fn hardware() -> u32 {
        // Every machine of QEMU's is alike.
        0
    }

    fn flash(&mut self) -> &mut Self::Flash {
        &mut self.flash
    }

    fn now() -> Instant {
        Instant::from_us(FPGAIO.get().counter.read())
    }

    fn cycles() -> u32 {
        // The timer counts down.
        !TIMER0.get().value.read()
    }

    fn reset_source(&mut self) -> reset::Hardware {
        // QEMU has no register that says.
        reset::Hardware::Unknown
    }

    fn start_watchdog(&mut self) {
        self.watched = true;
        // It counts its load twice: to the interrupt, and from there to the reset.
        WATCHDOG_BLOCK
            .get()
            .start(WATCHDOG.us() / 2 * (CORE_CLOCK_HZ / 1_000_000));
    }

    fn feed_watchdog(&mut self) {
        WATCHDOG_BLOCK.get().feed();
    }

    fn is_hung_up(&self) -> bool {
        !self.can.is_open()
    }

    fn start_tick(&mut self) {
        start_systick(&mut self.systick, CORE_CLOCK_HZ);
    }

    fn tick(&mut self) -> bool {
        self.systick.has_wrapped()
    }

    fn sleep(&mut self) {
        // Where time matters, not `wfi`: QEMU wakes an idle core as late as the host's scheduler lets it, and moves the
        // machine's clock on by that much. A core that never idles keeps its ticks under `-icount`, however busy the
        // host is. In lock step an idle core leaves the host's to the port, and frames pass more than twice as fast.
        while !(SCB::is_pendst_pending()
            || NVIC::is_pending(Irq::Uart0Receive)
            || NVIC::is_pending(Irq::Uart0Transmit))
        {
            if self.watched {
                cortex_m::asm::delay(BETWEEN_GLANCES);
            } else {
                cortex_m::asm::wfi();
            }
        }
        // Cleared before the caller looks for work, so that what arrives after that pends anew.
        SCB::clear_pendst();
        UART0.get().clear_interrupts();
        NVIC::unpend(Irq::Uart0Receive);
        NVIC::unpend(Irq::Uart0Transmit);
    }

    fn zero_torque() {
        UART0.get().start(RECEIVE);
        FPGAIO.get().write_led(0);
    }

    fn log(bytes: &[u8]) {
        for byte in bytes {
            let _ = nb::block!(UART1.get().send(*byte));
        }
    }
}

/// Interrupts of AN386, table 3-5.
#[derive(Clone, Copy)]
enum Irq {
    Uart0Receive = 0,
    Uart0Transmit = 1,
}

// SAFETY: the numbers are those of the board and below the M4's 240.
unsafe impl InterruptNumber for Irq {
    fn number(self) -> u16 {
        self as u16
    }
}

/// The flash's memory.
type Pages = [u8; 9 * PAGE];

/// The flash's memory and, once it is delivered, a mark, at the beginning of a memory that the linker does not know.
const FLASH: *mut (u32, Pages) = if cfg!(feature = "mps2-an500") {
    0x6000_0000
} else {
    0x2100_0000
} as *mut _;

/// Which MAC the keys are for that the flash is delivered with.
const DELIVERED: Option<Algorithm> = if cfg!(feature = "keys-aes") {
    Some(Algorithm::AesCmac)
} else if cfg!(feature = "keys-siphash") {
    Some(Algorithm::SipHash)
} else {
    None
};

fn deliver(pages: &mut Pages, algorithm: Algorithm) {
    let bytes = keys::bytes(&Keys::bench(algorithm));
    let place = keys::place(&Nor::new(&mut *pages)).map_or(0, |place| place as usize);
    if let Some(room) = pages.get_mut(place..place + bytes.len()) {
        room.copy_from_slice(&bytes);
    }
}

/// The flash's memory as the last start left it; blank at power-up, as delivered. To be called once.
fn pages() -> &'static mut Pages {
    const MARK: u32 = 0xF1A5_0001;
    // SAFETY: the only access, once, to memory of the board that nothing else uses; every pattern of bits is a value.
    let (mark, pages) = unsafe { &mut *FLASH };
    if *mark != MARK {
        pages.fill(0xFF);
        if let Some(algorithm) = DELIVERED {
            deliver(pages, algorithm);
        }
    }
    *mark = MARK;
    pages
}

/// A block of registers at its address.
#[derive(Debug, Clone, Copy)]
struct At<T>(*const T);

impl<T> At<T> {
    const fn get(&self) -> &'static T {
        // SAFETY: the constants below are the only values; each is the address of such a block on this board,
        // aligned and always mapped, and its registers are only accessed as volatile.
        unsafe { &*self.0 }
    }
}

const TIMER0: At<TimerBlock> = At(0x4000_0000 as *const _);
const UART0: At<UartBlock> = At(0x4000_4000 as *const _);
const UART1: At<UartBlock> = At(0x4000_5000 as *const _);
const WATCHDOG_BLOCK: At<WatchdogBlock> = At(0x4000_8000 as *const _);
const FPGAIO: At<FpgaIoBlock> = At(0x4002_8000 as *const _);

/// CMSDK timer: counts down at the core clock.
#[repr(C)]
struct TimerBlock {
    ctrl: RW<u32>,
    value: RO<u32>,
    reload: RW<u32>,
}

impl TimerBlock {
    fn run(&self) {
        // SAFETY: counts from the largest value, no interrupt.
        unsafe {
            self.reload.write(u32::MAX);
            self.ctrl.write(1);
        }
    }
}

/// CMSDK watchdog: counts down at the core clock, interrupts at zero, loads anew, and resets at the next zero.
#[repr(C)]
struct WatchdogBlock {
    load: RW<u32>,
    value: RO<u32>,
    control: RW<u32>,
    /// Any write loads the counter and clears the interrupt.
    clear: RW<u32>,
}

impl WatchdogBlock {
    fn start(&self, load: u32) {
        // SAFETY: bit 0 counts and interrupts, bit 1 resets. Both only stop a program that does not feed.
        unsafe {
            self.load.write(load);
            self.control.write(0b11);
        }
    }

    fn feed(&self) {
        // SAFETY: as above.
        unsafe { self.clear.write(1) }
    }
}

/// The watchdog is half through: silence, also from a loop that hangs with a frame in its hands.
#[exception]
unsafe fn NonMaskableInt() {
    Mps2::zero_torque();
    loop {
        cortex_m::asm::nop();
    }
}

/// The board's input and output block, as far as it is used.
#[repr(C)]
struct FpgaIoBlock {
    led: RW<u32>,
    _reserved: [u32; 5],
    counter: RO<u32>,
    prescale: RW<u32>,
}

impl FpgaIoBlock {
    fn write_led(&self, on: u32) {
        // SAFETY: switches lights.
        unsafe { self.led.write(on) }
    }

    fn write_prescale(&self, reload: u32) {
        // SAFETY: sets the rate of the counter.
        unsafe { self.prescale.write(reload) }
    }
}

/// CMSDK UART: one byte of buffer in each direction.
#[repr(C)]
struct UartBlock {
    data: RW<u32>,
    state: RO<u32>,
    ctrl: RW<u32>,
    interrupts: RW<u32>,
    baud_divider: RW<u32>,
}

/// Control: enable the transmitter, the receiver, the interrupts of both.
const TRANSMIT: u32 = 1;
const RECEIVE: u32 = 1 << 1;
const INTERRUPTS: u32 = 0b11 << 2;
/// State: the transmit buffer is full, the receive buffer is full.
const TX_FULL: u32 = 1;
const RX_FULL: u32 = 1 << 1;

impl UartBlock {
    fn start(&self, control: u32) {
        // SAFETY: 16 is the least divider that the UART takes.
        unsafe {
            self.baud_divider.write(16);
            self.ctrl.write(control);
        }
    }

    fn clear_interrupts(&self) {
        // SAFETY: writing ones clears both.
        unsafe { self.interrupts.write(0b11) }
    }

    fn send(&self, byte: u8) -> nb::Result<(), Infallible> {
        if self.state.read() & TX_FULL != 0 {
            return Err(nb::Error::WouldBlock);
        }
        // SAFETY: the buffer has room.
        unsafe { self.data.write(u32::from(byte)) };
        Ok(())
    }
}

/// UART0, of which there is one owner.
pub struct Uart(At<UartBlock>);

impl serial::ErrorType for Uart {
    type Error = Infallible;
}

impl Read<u8> for Uart {
    fn read(&mut self) -> nb::Result<u8, Infallible> {
        let uart = self.0.get();
        if uart.state.read() & RX_FULL == 0 {
            return Err(nb::Error::WouldBlock);
        }
        Ok(uart.data.read() as u8)
    }
}

impl Write<u8> for Uart {
    fn write(&mut self, byte: u8) -> nb::Result<(), Infallible> {
        self.0.get().send(byte)
    }

    fn flush(&mut self) -> nb::Result<(), Infallible> {
        match self.0.get().state.read() & TX_FULL {
            0 => Ok(()),
            _ => Err(nb::Error::WouldBlock),
        }
    }
}

/// LED 0, active high.
pub struct Led;

impl digital::ErrorType for Led {
    type Error = Infallible;
}

impl OutputPin for Led {
    fn set_low(&mut self) -> Result<(), Infallible> {
        FPGAIO.get().write_led(0);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        FPGAIO.get().write_led(1);
        Ok(())
    }
}
