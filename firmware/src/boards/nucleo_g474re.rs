//! ST NUCLEO-G474RE (STM32G474RE, Cortex-M4F, 170 MHz), through embassy-stm32 without an executor.
//!
//! | signal | pin | connector | what |
//! |---|---|---|---|
//! | CAN receive, transmit | PA11, PA12 | morpho CN10-14, CN10-12 | FDCAN1, classic frames at 500 kbit/s, to a transceiver |
//! | motor demand | PA4 | Arduino A2 | DAC: 1.65 V is zero, 0.3 V a N.m |
//! | motor enable | PB5 | Arduino D4 | high while the demand counts; pull it down at the motor stage |
//! | driver torque 1, 2 | PA0, PA1 | Arduino A0, A1 | ADC: 1.65 V is zero, +-0.15 V a N.m, mirrored |
//! | wheel angle | PC1 | Arduino A4 | ADC: 1.65 V is zero, 0.15 V a rad |
//! | motor torque | PC0 | Arduino A5 | ADC: 1.65 V is zero, 0.3 V a N.m |
//! | status | PA5 | LD2 | on while guidance acts |
//!
//! Not PB8 for CAN, which the Arduino header offers: it is the boot pin, and an idle bus would start the boot loader.
//!
//! The log goes to the debug probe (RTT). SysTick is the tick, TIM2 the microseconds, DWT the cycles, IWDG the
//! watchdog. Compiled and linked in CI; it has never met the board.
//!
//! The flash is one of two banks, as the chip is delivered (option bit DBANK, which is looked at); codes, starts,
//! keys and parameters are in the last nine pages of the second. A word whose programming lost power reads as an error that no code of correction
//! mends: the chip then raises the non-maskable interrupt. Among these what was read fails its CRC, and that is
//! all; anywhere else it is code or a constant, and the torque goes to zero and the processor is reset.
//!
//! The column's sensors are read with the feature `nucleo-g474re-sensors` alone, since pins that float read anything.
//! Without it the column is on the bus.

use core::future::Future;
use core::pin::pin;
use core::task::{Context, Poll, Waker};

use cortex_m::peripheral::{DWT, Peripherals, SCB, SYST};
use cortex_m_rt::exception;
use embassy_stm32::adc::{Adc, SampleTime};
use embassy_stm32::can::enums::BusError;
use embassy_stm32::can::{self, CanConfigurator};
use embassy_stm32::dac::{DacChannel, Value};
use embassy_stm32::flash::{self, Bank2Region, Flash};
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::peripherals::{ADC1, FDCAN1, IWDG, PA0, PA1, PB5, PC0, PC1};
use embassy_stm32::rcc::{self, mux};
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::Timer;
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Peri, bind_interrupts, pac};
use embedded_can::nb::Can;
use embedded_can::{Error, ErrorKind};
use embedded_hal_nb::nb;
use haptic_core::bus::Frame;
use haptic_core::bus::messages::{Column, ResetCause};
use haptic_core::quantity::{Instant, Torque};
use rtt_target::{ChannelMode, rtt_init};

use super::{Board, WATCHDOG, log_to_probe, start_systick};
use crate::{analogue, eccr, image, reset, stack};

const CORE_CLOCK_HZ: u32 = 170_000_000;
const BITRATE: u32 = 500_000;

bind_interrupts!(struct Interrupts {
    FDCAN1_IT0 => can::IT0InterruptHandler<FDCAN1>;
    FDCAN1_IT1 => can::IT1InterruptHandler<FDCAN1>;
});

/// The board's peripherals, taken.
pub struct NucleoG474re {
    can: FdCan,
    led: Output<'static>,
    flash: Bank2Region<'static, flash::Blocking>,
    motor_enable: Output<'static>,
    adc: Adc<'static, ADC1>,
    /// Driver torque 1 and 2, wheel angle, motor torque. By name: the HAL's nameless channels bring a panic along, for
    /// those that do not exist.
    sensors: (
        Peri<'static, PA0>,
        Peri<'static, PA1>,
        Peri<'static, PC1>,
        Peri<'static, PC0>,
    ),
    watchdog: Option<IndependentWatchdog<'static, IWDG>>,
    systick: SYST,
}

/// 24 MHz from the board's crystal to 170 MHz; the buses run at the same.
fn clocks() -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    config.rcc.hse = Some(rcc::Hse {
        freq: Hertz(24_000_000),
        mode: rcc::HseMode::Oscillator,
    });
    config.rcc.pll = Some(rcc::Pll {
        source: rcc::PllSource::HSE,
        prediv: rcc::PllPreDiv::DIV6,
        mul: rcc::PllMul::MUL85,
        divp: None,
        divq: None,
        divr: Some(rcc::PllRDiv::DIV2),
    });
    config.rcc.sys = rcc::Sysclk::PLL1_R;
    config.rcc.boost = true;
    config.rcc.mux.fdcansel = mux::Fdcansel::PCLK1;
    config.rcc.mux.adc12sel = mux::Adcsel::SYS;
    config
}

impl Board for NucleoG474re {
    type Can = FdCan;
    type Status = Output<'static>;
    type Flash = Bank2Region<'static, flash::Blocking>;

    const NAME: &'static str = "nucleo-g474re";
    const HAS_COLUMN: bool = cfg!(feature = "nucleo-g474re-sensors");

    fn start() -> Self {
        cortex_m::interrupt::disable();
        let mut cortex = Peripherals::take().expect("the board is started once");
        stack::protect(&mut cortex.MPU);
        cortex.DCB.enable_trace();
        cortex.DWT.enable_cycle_counter();
        let p = embassy_stm32::init(clocks());
        // The watchdog stands still with a core that a debugger halts.
        pac::DBGMCU.apb1lfzr().modify(|w| w.set_iwdg(true));
        let motor_enable = Output::new(p.PB5, Level::Low, Speed::Low);
        let mut motor = DacChannel::new_blocking(p.DAC1, p.PA4);
        motor.set(Value::Bit12Right(analogue::MID));
        // Dropping it would switch the channel off.
        core::mem::forget(motor);
        rtt_init! { up: { 0: { size: 1024, mode: ChannelMode::NoBlockSkip, name: "defmt" } } };
        let mut clock = Timer::new(p.TIM2);
        clock.set_tick_freq(Hertz(1_000_000));
        clock.start();
        // Dropping it would stop the clock.
        core::mem::forget(clock);
        let mut can = CanConfigurator::new(p.FDCAN1, p.PA11, p.PA12, Interrupts);
        can.set_bitrate(BITRATE);
        Self {
            can: FdCan(can.into_normal_mode()),
            led: Output::new(p.PA5, Level::Low, Speed::Low),
            flash: Flash::new_blocking(p.FLASH).into_blocking_regions().bank2_region,
            motor_enable,
            adc: Adc::new(p.ADC1, Default::default()),
            sensors: (p.PA0, p.PA1, p.PC1, p.PC0),
            watchdog: Some(IndependentWatchdog::new(p.IWDG, WATCHDOG.us())),
            systick: cortex.SYST,
        }
    }

    fn can(&mut self) -> &mut Self::Can {
        &mut self.can
    }

    fn status(&mut self) -> &mut Self::Status {
        &mut self.led
    }

    fn has_expected_options(&self) -> bool {
        pac::FLASH.optr().read().dbank()
    }

    fn hardware() -> u32 {
        /// The unique device identifier (RM0440, section 48.1), 96 bits.
        const UID: *const [u32; 3] = 0x1FFF_7590 as *const _;
        // SAFETY: always readable, and never written.
        image::number_of(&unsafe { UID.read_volatile() })
    }

    fn flash(&mut self) -> &mut Self::Flash {
        &mut self.flash
    }

    fn now() -> Instant {
        Instant::from_us(pac::TIM2.cnt().read())
    }

    fn cycles() -> u32 {
        DWT::cycle_count()
    }

    fn reset_source(&mut self) -> reset::Hardware {
        let flags = pac::RCC.csr().read();
        pac::RCC.csr().modify(|w| w.set_rmvf(true));
        if flags.borrstf() {
            reset::Hardware::Supply
        } else if flags.iwdgrstf() {
            reset::Hardware::Watchdog
        } else {
            reset::Hardware::Operator
        }
    }

    fn start_tick(&mut self) {
        start_systick(&mut self.systick, CORE_CLOCK_HZ);
    }

    fn tick(&mut self) -> bool {
        self.systick.has_wrapped()
    }

    fn sleep(&mut self) {
        cortex_m::asm::wfi();
        SCB::clear_pendst();
        // The one moment in which handlers run: the driver's clears the flags that woke the core.
        // SAFETY: nothing is borrowed here that a handler uses.
        unsafe { cortex_m::interrupt::enable() };
        cortex_m::asm::isb();
        cortex_m::interrupt::disable();
    }

    fn start_watchdog(&mut self) {
        if let Some(watchdog) = &mut self.watchdog {
            watchdog.unleash();
        }
    }

    fn feed_watchdog(&mut self) {
        if let Some(watchdog) = &mut self.watchdog {
            watchdog.pet();
        }
    }

    fn set_torque(&mut self, torque: Option<Torque>) {
        let demand = analogue::demand(torque.unwrap_or(Torque::ZERO));
        // By register: the HAL looks at each call, with a panic behind, whether the channel exists.
        pac::DAC1.dhr12r(0).write(|w| w.set_dhr(demand));
        self.motor_enable.set_level(torque.is_some().into());
    }

    fn column(&mut self) -> Option<Column> {
        const SAMPLE: SampleTime = SampleTime::CYCLES47_5;
        let Self { adc, sensors, .. } = self;
        let counts = [
            adc.blocking_read(&mut sensors.0, SAMPLE),
            adc.blocking_read(&mut sensors.1, SAMPLE),
            adc.blocking_read(&mut sensors.2, SAMPLE),
            adc.blocking_read(&mut sensors.3, SAMPLE),
        ];
        analogue::column(counts)
    }

    fn zero_torque() {
        // SAFETY: whoever calls this never hands control back to the owner of the pin.
        let enable = Output::new(unsafe { PB5::steal() }, Level::Low, Speed::Low);
        // Dropping it would let the pin float.
        core::mem::forget(enable);
    }

    fn log(bytes: &[u8]) {
        log_to_probe(bytes);
    }
}

/// Nothing is told to raise this interrupt here but a word of the flash that cannot be corrected. A lost crystal is
/// not: nobody watches it but the watchdog, which has a clock of its own.
#[exception]
unsafe fn NonMaskableInt() {
    let error = pac::FLASH.eccr().read();
    let place = (error.bk_ecc(), error.sysf_ecc(), error.addr_ecc());
    if error.eccd() && !error.eccd2() && eccr::is_in_parameters(place) {
        pac::FLASH.eccr().modify(|w| w.set_eccd(true));
        return;
    }
    NucleoG474re::zero_torque();
    reset::restart(ResetCause::HardFault)
}

/// The tick is looked for with [`Board::tick`]; its interrupt only wakes the core.
#[exception]
fn SysTick() {}

/// FDCAN1 by polling: the driver's futures are asked once and dropped, which loses nothing.
pub struct FdCan(can::Can<'static>);

/// Answers at once or not at all.
fn poll<T>(future: impl Future<Output = T>) -> nb::Result<T, CanError> {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(result) => Ok(result),
        Poll::Pending => Err(nb::Error::WouldBlock),
    }
}

/// What the controller reports of the bus, or a frame that this bus does not carry.
#[derive(Debug)]
pub struct CanError(Option<BusError>);

impl Error for CanError {
    fn kind(&self) -> ErrorKind {
        match self.0 {
            Some(BusError::Stuff) => ErrorKind::Stuff,
            Some(BusError::Form) => ErrorKind::Form,
            Some(BusError::Acknowledge) => ErrorKind::Acknowledge,
            Some(BusError::BitRecessive | BusError::BitDominant) => ErrorKind::Bit,
            Some(BusError::Crc) => ErrorKind::Crc,
            Some(BusError::Software) | None => ErrorKind::Other,
        }
    }
}

/// The frame, if it is one that this bus carries: classic data under an 11-bit identifier.
fn carried(frame: &can::frame::Frame) -> Option<Frame> {
    let header = frame.header();
    let is_data = !header.rtr() && !header.fdcan();
    <Frame as embedded_can::Frame>::new(*header.id(), frame.data()).filter(|_| is_data)
}

impl Can for FdCan {
    type Frame = Frame;
    type Error = CanError;

    /// Hands a frame to the controller. A waiting frame of lower priority may have to make room; it is returned.
    fn transmit(&mut self, frame: &Frame) -> nb::Result<Option<Frame>, CanError> {
        let out = can::frame::Frame::new_data(embedded_can::Frame::id(frame), frame.data())
            .map_err(|_| nb::Error::Other(CanError(None)))?;
        let displaced = poll(self.0.write(&out))?;
        Ok(displaced.and_then(|frame| carried(&frame)))
    }

    /// The next frame that this bus carries; others are passed over.
    fn receive(&mut self) -> nb::Result<Frame, CanError> {
        loop {
            let envelope = poll(self.0.read())?.map_err(|e| nb::Error::Other(CanError(Some(e))))?;
            if let Some(frame) = carried(&envelope.frame) {
                return Ok(frame);
            }
        }
    }
}
