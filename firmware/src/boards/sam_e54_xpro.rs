//! Microchip SAM E54 Xplained Pro (ATSAME54P20A, Cortex-M4F, 120 MHz), through atsamd-hal and mcan.
//!
//! | signal | pin | connector | what |
//! |---|---|---|---|
//! | CAN receive, transmit | PB13, PB12 | CAN | CAN1, classic frames at 500 kbit/s, by the board's transceiver |
//! | transceiver's standby | PC13 | | low: awake |
//! | status | PC18 | LED0 | on while guidance acts (the light is on when the pin is low) |
//!
//! Column and motor are on the bus: nothing is wired to the board, so that there is no pin whose state a reset leaves
//! open. The log goes to the debug probe (RTT). SysTick is the tick, TC0 with TC1 the microseconds, DWT the cycles, WDT
//! the watchdog. Compiled and linked in CI; it has never met the board.
//!
//! Registers, where the HAL has no words for them: the pair of timers (it knows them with 16 bits only), the cache, and
//! whether the watchdog is still busy. The watchdog counts 16 cycles of 1,024 Hz and needs two or three of them to take
//! a feeding; what comes meanwhile is lost. So it bites up to 19 ms after the last.

use core::convert::Infallible;

use atsamd_hal::can::Dependencies;
use atsamd_hal::clock::v2::clock_system_at_reset;
use atsamd_hal::clock::v2::dpll::Dpll;
use atsamd_hal::clock::v2::gclk::{Gclk, Gclk1Id, GclkDiv16};
use atsamd_hal::clock::v2::pclk::Pclk;
use atsamd_hal::clock::v2::types::Can1;
use atsamd_hal::clock::v2::xosc::Xosc;
use atsamd_hal::fugit::RateExtU32;
use atsamd_hal::gpio::{AlternateH, Output, PB12, PB13, PC13, PC18, Pin, Pins, PushPull};
use atsamd_hal::nvm::{self, BLOCKSIZE, Nvm, QUADWORDSIZE, WriteGranularity, retrieve_flash_size};
use atsamd_hal::pac::{self, Interrupt, NVIC};
use atsamd_hal::prelude::{_embedded_hal_watchdog_Watchdog, _embedded_hal_watchdog_WatchdogEnable};
use atsamd_hal::watchdog::{Watchdog, WatchdogTimeout};
use atsamd_hal::{ResetCause, reset_cause};
use cortex_m::peripheral::{DWT, SCB, SYST};
use embedded_can::nb::Can;
use embedded_can::{Error, ErrorKind};
use embedded_hal::digital::{ErrorType, OutputPin};
use embedded_hal_nb::nb;
use embedded_storage::nor_flash::{
    ErrorType as FlashErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase,
    check_read, check_write,
};
use haptic_core::bus::Frame;
use haptic_core::quantity::Instant;
use mcan::config::{BitTiming, TxQueueMode};
use mcan::filter::{Action, Filter};
use mcan::generic_array::typenum::consts::{U0, U1, U16, U64};
use mcan::interrupt::state::EnabledLine0;
use mcan::interrupt::{Interrupt as CanInterrupt, OwnedInterruptSet};
use mcan::message::{rx, tx};
use mcan::messageram::{Capacities, SharedMemory};
use mcan::prelude::*;
use rtt_target::{ChannelMode, rtt_init};

use super::{Board, log_to_probe, start_systick};
use crate::{image, reset, stack};

const CORE_CLOCK_HZ: u32 = 120_000_000;

/// The board's peripherals, taken.
pub struct SamE54Xpro {
    can: Mcan,
    led: ActiveLow,
    flash: Flash,
    watchdog: Watchdog,
    hardware: reset::Hardware,
    systick: SYST,
}

impl Board for SamE54Xpro {
    type Can = Mcan;
    type Status = ActiveLow;
    type Flash = Flash;

    const NAME: &'static str = "sam-e54-xpro";

    fn start() -> Self {
        cortex_m::interrupt::disable();
        let mut cortex = cortex_m::Peripherals::take().expect("the board is started once");
        stack::protect(&mut cortex.MPU);
        cortex.DCB.enable_trace();
        cortex.DWT.enable_cycle_counter();
        let mut p = pac::Peripherals::take().expect("the board is started once");
        rtt_init! { up: { 0: { size: 1024, mode: ChannelMode::NoBlockSkip, name: "defmt" } } };

        // 12 MHz from the board's crystal to 120 MHz for the core and 8 MHz for bus and clock.
        let pins = Pins::new(p.port);
        let (mut buses, clocks, tokens) =
            clock_system_at_reset(p.oscctrl, p.osc32kctrl, p.gclk, p.mclk, &mut p.nvmctrl);
        let crystal = Xosc::from_crystal(tokens.xosc1, pins.pb22, pins.pb23, 12.MHz()).enable();
        let (pll, _crystal) = Dpll::from_xosc(tokens.dpll0, crystal);
        let pll = pll.prediv(4).loop_div(40, 0).enable();
        while !pll.is_ready() {}
        let (gclk0, _dfll, pll) = clocks.gclk0.swap_sources(clocks.dfll, pll);
        let (gclk1, _pll) = Gclk::from_source(tokens.gclks.gclk1, pll);
        let gclk1 = gclk1.div(GclkDiv16::Div(15)).enable();
        let (timer, gclk1) = Pclk::enable(tokens.pclks.tc0_tc1, gclk1);
        let (bus, _gclk1) = Pclk::enable(tokens.pclks.can1, gclk1);
        let _running = (
            buses.apb.enable(tokens.apbs.tc0),
            buses.apb.enable(tokens.apbs.tc1),
            timer,
        );
        start_clock(&p.tc0);

        let (dependencies, _gclk0) = Dependencies::new(
            gclk0,
            bus,
            clocks.ahbs.can1,
            pins.pb13.into_mode(),
            pins.pb12.into_mode(),
            p.can1,
        );
        Self {
            can: Mcan::new(dependencies, pins.pc13.into_push_pull_output()),
            led: ActiveLow::off(pins.pc18.into_push_pull_output()),
            flash: Flash(Nvm::new(p.nvmctrl)),
            watchdog: Watchdog::new(p.wdt),
            hardware: match reset_cause(&p.rstc) {
                ResetCause::POR | ResetCause::BOD12 | ResetCause::BOD33 => reset::Hardware::Supply,
                ResetCause::External | ResetCause::System => reset::Hardware::Operator,
                _ => reset::Hardware::Watchdog,
            },
            systick: cortex.SYST,
        }
    }

    /// No blocks at the end of the flash given to the chip's own emulation of an EEPROM, and all of 1 MiB there.
    fn has_expected_options(&self) -> bool {
        // SAFETY: a look at what the HAL's driver owns.
        let nvmctrl = unsafe { pac::Nvmctrl::steal() };
        nvmctrl.seestat().read().sblk().bits() == 0 && retrieve_flash_size() == 1024 * 1024
    }

    fn hardware() -> u32 {
        /// The serial number (SAM D5x/E5x data sheet, section 9.6), 128 bits.
        const SERIAL: [*const u32; 4] = [
            0x0080_61FC as *const _,
            0x0080_6010 as *const _,
            0x0080_6014 as *const _,
            0x0080_6018 as *const _,
        ];
        // SAFETY: always readable, and never written.
        image::number_of(&SERIAL.map(|word| unsafe { word.read_volatile() }))
    }

    fn can(&mut self) -> &mut Self::Can {
        &mut self.can
    }

    fn status(&mut self) -> &mut Self::Status {
        &mut self.led
    }

    fn flash(&mut self) -> &mut Self::Flash {
        &mut self.flash
    }

    fn now() -> Instant {
        // SAFETY: one core, interrupts masked: reading the clock is the only thing done to it since its start.
        let timer = unsafe { pac::Tc0::steal() };
        let timer = timer.count32();
        timer.ctrlbset().write(|w| w.cmd().readsync());
        while timer.syncbusy().read().ctrlb().bit_is_set() || !timer.ctrlbset().read().cmd().is_none() {}
        Instant::from_us(timer.count().read().bits())
    }

    fn cycles() -> u32 {
        DWT::cycle_count()
    }

    /// The chip keeps the last cause only, and forgets it at the next.
    fn reset_source(&mut self) -> reset::Hardware {
        self.hardware
    }

    fn start_tick(&mut self) {
        // From here on nobody writes the flash behind the cache's back.
        // SAFETY: nothing else has the cache.
        unsafe { pac::Cmcc::steal() }.ctrl().write(|w| w.cen().set_bit());
        start_systick(&mut self.systick, CORE_CLOCK_HZ);
    }

    fn tick(&mut self) -> bool {
        self.systick.has_wrapped()
    }

    /// Interrupts stay masked: they wake the core, and no handler runs.
    fn sleep(&mut self) {
        cortex_m::asm::wfi();
        SCB::clear_pendst();
        self.can.clear_interrupts();
    }

    fn start_watchdog(&mut self) {
        self.watchdog.start(WatchdogTimeout::Cycles16 as u8);
    }

    fn feed_watchdog(&mut self) {
        // SAFETY: a look at what the HAL's driver owns.
        let is_busy = unsafe { pac::Wdt::steal() }
            .syncbusy()
            .read()
            .clear()
            .bit_is_set();
        if !is_busy {
            self.watchdog.feed();
        }
    }

    /// Nothing is wired to the board: an actuator on the bus gives up when the frames stop.
    fn zero_torque() {}

    fn log(bytes: &[u8]) {
        log_to_probe(bytes);
    }
}

/// TC0 and TC1 as one counter of 32 bits, 8 MHz through 8.
fn start_clock(timer: &pac::Tc0) {
    let timer = timer.count32();
    timer.ctrla().write(|w| w.mode().count32().prescaler().div8());
    timer.ctrla().modify(|_, w| w.enable().set_bit());
    while timer.syncbusy().read().enable().bit_is_set() {}
}

/// A light that is on when its pin is low.
pub struct ActiveLow(Pin<PC18, Output<PushPull>>);

impl ActiveLow {
    fn off(pin: Pin<PC18, Output<PushPull>>) -> Self {
        let mut light = Self(pin);
        let Ok(()) = light.set_low();
        light
    }
}

impl ErrorType for ActiveLow {
    type Error = Infallible;
}

impl OutputPin for ActiveLow {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.set_high()
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.set_low()
    }
}

/// The whole flash, as `embedded-storage` has it.
pub struct Flash(Nvm);

/// What the driver says of an access that failed.
#[derive(Debug)]
pub enum FlashError {
    /// The caller's.
    Access(NorFlashErrorKind),
    /// The memory's.
    Memory(nvm::Error),
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Access(kind) => *kind,
            Self::Memory(_) => NorFlashErrorKind::Other,
        }
    }
}

impl FlashErrorType for Flash {
    type Error = FlashError;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        check_read(self, offset, bytes.len()).map_err(FlashError::Access)?;
        let place = core::ptr::with_exposed_provenance::<u8>(offset as usize);
        for (i, byte) in bytes.iter_mut().enumerate() {
            // SAFETY: within the flash, which begins at 0 and is always readable.
            *byte = unsafe { place.add(i).read_volatile() };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        retrieve_flash_size() as usize
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = QUADWORDSIZE as usize;
    const ERASE_SIZE: usize = BLOCKSIZE as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        check_erase(self, from, to).map_err(FlashError::Access)?;
        let place = core::ptr::with_exposed_provenance_mut(from as usize);
        // SAFETY: the memory map keeps the image out of the blocks that hold the parameters.
        unsafe { self.0.erase_flash(place, (to - from) / BLOCKSIZE) }.map_err(FlashError::Memory)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        check_write(self, offset, bytes.len()).map_err(FlashError::Access)?;
        let (quads, _) = bytes.as_chunks::<{ Self::WRITE_SIZE }>();
        for (at, quad) in (offset..).step_by(Self::WRITE_SIZE).zip(quads) {
            let (words, _) = quad.as_chunks();
            let words: [u32; 4] = core::array::from_fn(|i| u32::from_le_bytes(words[i]));
            let place = core::ptr::with_exposed_provenance_mut(at as usize);
            // SAFETY: as in `erase`.
            unsafe {
                self.0
                    .write_flash_from_slice(place, &words, WriteGranularity::QuadWord)
            }
            .map_err(FlashError::Memory)?;
        }
        Ok(())
    }
}

/// What the CAN controller keeps in memory: frames of up to eight bytes, those with an 11-bit identifier in one queue.
struct Memory;

impl Capacities for Memory {
    type StandardFilters = U1;
    type ExtendedFilters = U0;
    type RxBufferMessage = rx::Message<8>;
    type DedicatedRxBuffers = U0;
    type RxFifo0Message = rx::Message<8>;
    type RxFifo0 = U64;
    type RxFifo1Message = rx::Message<8>;
    type RxFifo1 = U0;
    type TxMessage = tx::Message<8>;
    type TxBuffers = U16;
    type DedicatedTxBuffers = U0;
    type TxEventFifo = U0;
}

type CanDependencies = Dependencies<Can1, Gclk1Id, Pin<PB13, AlternateH>, Pin<PB12, AlternateH>, pac::Can1>;

/// CAN1 by polling.
pub struct Mcan {
    can: mcan::bus::Can<'static, Can1, CanDependencies, Memory>,
    interrupts: OwnedInterruptSet<Can1, EnabledLine0>,
    /// Keeps the transceiver awake.
    _standby: Pin<PC13, Output<PushPull>>,
}

impl Mcan {
    fn new(dependencies: CanDependencies, mut standby: Pin<PC13, Output<PushPull>>) -> Self {
        static mut MEMORY: SharedMemory<Memory> = SharedMemory::new();
        let Ok(()) = standby.set_low();
        let memory = &raw mut MEMORY;
        // SAFETY: called once, with the one owner of the CAN controller.
        let memory = unsafe { &mut *memory };
        let mut can = mcan::bus::CanConfigurable::new(500.kHz(), dependencies, memory)
            .expect("the memory map keeps to what the CAN controller reaches");
        // 16 quanta of 8 MHz; the sample at 87.5 % of the bit, where the other boards have theirs.
        can.config().nominal_timing = BitTiming {
            sjw: 2,
            phase_seg_1: 13,
            phase_seg_2: 2,
            bitrate: 500.kHz(),
        };
        can.config().tx.tx_queue_submode = TxQueueMode::Priority;
        let everything = Filter::Classic {
            action: Action::StoreFifo0,
            filter: embedded_can::StandardId::ZERO,
            mask: embedded_can::StandardId::ZERO,
        };
        assert!(
            can.filters_standard().push(everything).is_ok(),
            "there is room for one"
        );
        let mut can = can.finalize().expect("500 kbit/s is 8 MHz through 16");
        let received = [CanInterrupt::RxFifo0NewMessage].into_iter().collect();
        let received = can.interrupts.split(received).expect("nobody has it yet");
        let interrupts = can.interrupt_configuration.enable_line_0(received);
        // SAFETY: interrupts are masked for good: it only wakes the core.
        unsafe { NVIC::unmask(Interrupt::CAN1) };
        Self {
            can,
            interrupts,
            _standby: standby,
        }
    }

    fn clear_interrupts(&mut self) {
        self.interrupts
            .clear_interrupts(self.interrupts.interrupt_flags());
        NVIC::unpend(Interrupt::CAN1);
    }
}

/// The frame cannot be sent: it is none of this bus.
#[derive(Debug)]
pub struct CanError;

impl Error for CanError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

impl Can for Mcan {
    type Frame = Frame;
    type Error = CanError;

    /// Hands a frame to the controller, which sends what waits in the order of priority.
    fn transmit(&mut self, frame: &Frame) -> nb::Result<Option<Frame>, CanError> {
        // Too many errors took the controller off the bus. Asked back, it waits as long as the standard wants.
        if !self.can.aux.is_operational() {
            self.can.aux.operational_mode();
        }
        let message = tx::MessageBuilder {
            id: embedded_can::Frame::id(frame),
            frame_type: tx::FrameType::Classic(tx::ClassicFrameType::Data(frame.data())),
            store_tx_event: None,
        };
        let message = message.build().map_err(|_| nb::Error::Other(CanError))?;
        let sent = self.can.tx.transmit_queued(message);
        sent.map(|()| None).map_err(|error| error.map(|_| CanError))
    }

    /// The next frame that this bus carries; others are passed over.
    fn receive(&mut self) -> nb::Result<Frame, CanError> {
        loop {
            let message = self.can.rx_fifo_0.receive().map_err(|_| nb::Error::WouldBlock)?;
            let is_data = !message.is_remote_frame() && !message.fd_format();
            if let Some(frame) = embedded_can::Frame::new(message.id(), message.data()).filter(|_| is_data) {
                return Ok(frame);
            }
        }
    }
}
