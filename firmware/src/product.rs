//! The product's loop: every millisecond one step of the controller, its inputs and its torque on the bus.
//!
//! What is broken does not steer: a panic or a fault brings the torque to zero and resets the processor with
//! the cause on record; a loop that hangs, or that the monitor does not permit, loses the watchdog. The
//! controller comes up in Standby, or in the Fault that it had latched, says why on the bus, and locks after three
//! resets within 10 s, or ten since power-up.
//!
//! Its parameters are the newest good set of the flash. Without any, both copies blank or damaged, it locks and waits
//! for a set over the bus; an image for the bench (feature `bench`) takes the paper's on a blank flash. A set that comes
//! over the bus is stored at the restart that it causes: the flash is not erased while the loop runs, since that
//! takes longer than the watchdog waits. At every start a copy that cannot be read is written anew.
//!
//! Codes of faults are stored at every start, and while the bus is silent, as it is when the ignition is off ([`crate::codes`]).
//!
//! What commands it has to be proven ([`haptic_secoc`]); without keys it never engages, unless it is an image for the bench.
//!
//! An image that is not as it was built begins in Fault ([`image`]); a chip with other options than the memory map's
//! locks, and its flash is not touched.

use embedded_can::nb::Can;
use embedded_hal::digital::OutputPin;
use embedded_hal_nb::nb;
use haptic_core::bus::messages::{Column, Message, ResetCause};
use haptic_core::controller::Command;
use haptic_core::controller::config::Setup;
use haptic_core::controller::params::Params;
use haptic_core::ecu::{Boot, Ecu, Step};
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;
use haptic_core::service::rejections::Rejections;
use haptic_diag::trouble::Cells;
use haptic_secoc::messages::State;
use haptic_secoc::verifier::{Credentials, Passed, Verifier};

use crate::boards::{Board, ThisBoard};
use crate::codes::Codes;
use crate::service::{Origin, Restart, Service};
use crate::storage::{self, Found};
use crate::{analogue, image, keys, reset, stack};

/// Steps between two lines of the log: one second.
const STEPS_PER_REPORT: u32 = 1000;
/// Frames taken at once: at 500 kbit/s the shortest takes 94 us, so that eleven come in a tick.
const MOST_FRAMES: u32 = 32;
/// A bus on which nobody said anything for so many steps is silent: 5 s. No sender's time-out is longer, nor a tester's.
const STEPS_OF_SILENCE: u32 = 5000;
/// Steps between two codes that are stored: programming one may delay a step by less than a millisecond.
const STEPS_PER_CODE: u32 = 10;

/// What the log says once a second.
#[derive(Default)]
struct Counts {
    steps: u32,
    /// Since a frame came.
    silent_steps: u32,
    received: u32,
    rejected: Rejections,
    /// What the bus controller reported in place of a frame.
    bus_errors: u32,
    unsent: u32,
    /// Cycles of the frames received since the last step, and the most that they and a step took.
    receiving: u32,
    worst_cycles: u32,
    /// Faults that the record of resets holds already.
    latched: FaultSet,
}

/// Runs the product. `disturb` is called before each step with its number: the product has nothing to say there,
/// the image that breaks itself has.
pub fn run(
    ecu: &'static mut Option<Ecu>,
    service: &'static mut Option<Service>,
    verifier: &'static mut Option<Verifier>,
    mut disturb: impl FnMut(&mut Ecu, Boot, u32),
) -> ! {
    stack::paint();
    let mut board = ThisBoard::start();
    let mut boot = reset::boot(board.reset_source());
    let image = image::check();
    boot.latched.insert_if(!image.is_good(), Fault::Memory);
    let is_sound = image.is_good() && board.has_expected_options();
    let found = if is_sound {
        parameters(&mut board)
    } else {
        Found::default()
    };
    let params = params(&found).filter(|_| is_sound);
    let setup = params.and_then(|params| Setup::new(&params).ok());
    let ecu = begin(ecu, setup.as_ref(), boot);
    let cells = reset::cells();
    let mut codes = is_sound.then(|| stored_codes(&mut board, cells)).flatten();
    let origin = Origin {
        boot,
        is_image_whole: image == image::State::Whole,
        key: is_sound.then(|| storage::key(board.flash())).flatten(),
    };
    let service = serve(service, found, params, origin, cells);
    let verifier = authenticate(verifier, &mut board, is_sound);
    let mut counts = Counts::default();
    defmt::info!(
        "steering-ecu on {=str}, reset cause {=u8}, resets of late {=u8}, parameters {=u32}",
        ThisBoard::NAME,
        boot.reset as u8,
        boot.recent_resets,
        found.stored.map_or(0, |stored| stored.sequence)
    );
    match verifier.state() {
        State::SipHash | State::AesCmac => defmt::info!("frames are authenticated"),
        state => defmt::warn!(
            "no frame is authenticated, state {=u8} (docs/reference/bus.md)",
            state as u8
        ),
    }
    match image {
        image::State::Whole => {}
        image::State::Unsealed => defmt::warn!("nobody sealed this image (cargo xtask seal)"),
        image::State::Damaged => defmt::error!("the image is not as it was built"),
    }
    if !board.has_expected_options() {
        defmt::error!("the chip's options are not those of the memory map: the flash is left alone");
    }
    board.start_tick();
    board.start_watchdog();
    loop {
        board.sleep();
        receive(&mut board, ecu, service, verifier, &mut counts);
        if board.tick() {
            disturb(ecu, boot, counts.steps);
            let mode = step(&mut board, ecu, service, verifier, cells, &mut counts);
            keep_codes(&mut board, codes.as_mut(), cells, mode, &mut counts);
        }
        // Behind the step, which no MAC delays.
        let start = ThisBoard::cycles();
        while let Some(passed) = verifier.verified() {
            hear(passed, ecu, service, &mut counts);
        }
        let cycles = ThisBoard::cycles().wrapping_sub(start);
        counts.receiving = counts.receiving.wrapping_add(cycles);
    }
}

/// Takes what has arrived, as much as may have within three ticks: a bus that never falls silent must not keep the step from
/// its turn.
fn receive(
    board: &mut ThisBoard,
    ecu: &mut Ecu,
    service: &mut Service,
    verifier: &mut Verifier,
    counts: &mut Counts,
) {
    for _ in 0..MOST_FRAMES {
        let frame = match board.can().receive() {
            Ok(frame) => frame,
            Err(nb::Error::WouldBlock) => break,
            Err(nb::Error::Other(_)) => {
                counts.bus_errors = counts.bus_errors.saturating_add(1);
                continue;
            }
        };
        counts.received = counts.received.wrapping_add(1);
        counts.silent_steps = 0;
        // Two senders under one counter would pass each other's frames off.
        if ThisBoard::HAS_COLUMN && frame.id() == Column::ID {
            continue;
        }
        let start = ThisBoard::cycles();
        if let Some(passed) = verifier.receive(&frame, ThisBoard::now()) {
            hear(passed, ecu, service, counts);
        }
        let cycles = ThisBoard::cycles().wrapping_sub(start);
        counts.receiving = counts.receiving.wrapping_add(cycles);
    }
}

/// Hands on what may command.
fn hear(passed: Passed, ecu: &mut Ecu, service: &mut Service, counts: &mut Counts) {
    if let Some(set) = service.receive(passed, ecu, &mut counts.rejected, counts.steps) {
        ThisBoard::zero_torque();
        reset::restart_with(&set);
    }
}

/// Stores the set that the last run left, if it did, looks at what there is, and repairs it.
#[inline(never)]
fn parameters(board: &mut ThisBoard) -> Found {
    let hardware = ThisBoard::hardware();
    let mut found = storage::load(board.flash(), hardware);
    if let Some(set) = reset::take_parameters() {
        if storage::save(board.flash(), &set, found.stored.as_ref(), hardware).is_err() {
            defmt::error!("the parameters could not be stored");
        }
        found = storage::load(board.flash(), hardware);
    }
    if storage::repair(board.flash(), &found, hardware).is_err() {
        defmt::error!("a copy of the parameters could not be repaired");
    }
    storage::load(board.flash(), hardware)
}

/// Reads the codes that were stored, and stores those that came between the last time and a reset.
fn stored_codes(board: &mut ThisBoard, cells: &mut Cells) -> Option<Codes> {
    let mut codes = Codes::begin(board.flash(), cells)?;
    while codes.keep(board.flash(), cells) {}
    Some(codes)
}

/// Stores a code where the bus is silent and nothing waits for a step.
fn keep_codes(
    board: &mut ThisBoard,
    codes: Option<&mut Codes>,
    cells: &Cells,
    mode: Mode,
    counts: &mut Counts,
) {
    counts.silent_steps = counts.silent_steps.saturating_add(1);
    let is_time = counts.silent_steps >= STEPS_OF_SILENCE && counts.steps.is_multiple_of(STEPS_PER_CODE);
    if is_time
        && !mode.may_have_torque()
        && let Some(codes) = codes
    {
        codes.keep(board.flash(), cells);
    }
}

/// A function of its own, so that what an ECU takes to be put together is not on the stack of every step.
#[inline(never)]
fn begin(ecu: &'static mut Option<Ecu>, setup: Option<&Setup>, boot: Boot) -> &'static mut Ecu {
    ecu.insert(Ecu::new(setup, boot, ThisBoard::now()))
}

/// Puts the service together, apart for the reason of [`begin`].
#[inline(never)]
fn serve(
    service: &'static mut Option<Service>,
    found: Found,
    params: Option<Params>,
    origin: Origin,
    cells: &Cells,
) -> &'static mut Service {
    service.insert(Service::new(found, params, origin, cells))
}

/// Puts the verifier together, apart for the reason of [`begin`].
#[inline(never)]
fn authenticate(
    verifier: &'static mut Option<Verifier>,
    board: &mut ThisBoard,
    is_sound: bool,
) -> &'static mut Verifier {
    let credentials = if is_sound {
        keys::credentials(board.flash())
    } else {
        Credentials::None
    };
    verifier.insert(Verifier::new(credentials))
}

/// What the controller starts with; None locks it.
fn params(found: &Found) -> Option<Params> {
    match found.stored {
        Some(stored) => Some(stored.set.params),
        None if found.damaged == [true, true] => None,
        // A vehicle that was set up for less must not get the paper's 5 N.m because its flash was erased.
        None => cfg!(feature = "bench").then_some(Params::PAPER),
    }
}

/// The torque path, from the board's sensors to its motor stage. A function of its own, which the gate follows on
/// every board (`cargo xtask boards`): no panic and no float in it.
#[inline(never)]
fn control(board: &mut ThisBoard, ecu: &mut Ecu, counts: &mut Counts) -> Step {
    if ThisBoard::HAS_COLUMN
        && let Some(column) = board.column()
    {
        // By the codec, as from the bus: what judges a sample there judges it here.
        let frame = column.encode(counts.steps as u8);
        if let Err(reason) = ecu.receive(&frame, ThisBoard::now()) {
            counts.rejected.count(frame.id(), reason);
        }
    }
    let start = ThisBoard::cycles();
    let step = ecu.step(ThisBoard::now());
    let cycles = ThisBoard::cycles()
        .wrapping_sub(start)
        .wrapping_add(counts.receiving);
    counts.receiving = 0;
    counts.worst_cycles = counts.worst_cycles.max(cycles);
    board.set_torque(analogue::drive(&step));
    if step.permitted {
        board.feed_watchdog();
    }
    let critical = step.command.faults.common(FaultSet::CRITICAL);
    if critical != counts.latched {
        // Once: it stays in the record, whose checks cost more than a look at what was written.
        counts.latched = critical;
        reset::latch(critical);
    }
    step
}

fn step(
    board: &mut ThisBoard,
    ecu: &mut Ecu,
    service: &mut Service,
    verifier: &mut Verifier,
    cells: &mut Cells,
    counts: &mut Counts,
) -> Mode {
    let step = control(board, ecu, counts);
    // A frame that finds no room is lost; the next follows in a millisecond, and the receiver's time-out
    // judges a bus that stays closed.
    for frame in core::iter::once(&step.guidance).chain(&step.others) {
        if board.can().transmit(frame).is_err() {
            counts.unsent = counts.unsent.wrapping_add(1);
        }
    }
    // The torque is on its way; what follows may take its time.
    let report = service.frames(&step.command, &mut counts.rejected, counts.steps);
    let authentication = verifier.step(counts.steps);
    for frame in ecu.background_step().iter().chain(&report).chain(&authentication) {
        if board.can().transmit(frame).is_err() {
            counts.unsent = counts.unsent.wrapping_add(1);
        }
    }
    diagnose(board, ecu, service, cells, &step.command, counts);
    // A light that fails is no reason to stop.
    let _ = board
        .status()
        .set_state(step.command.mode.may_have_torque().into());
    counts.steps = counts.steps.wrapping_add(1);
    if counts.steps == reset::STEPS_TO_SETTLE {
        reset::settled();
    }
    if counts.steps.is_multiple_of(STEPS_PER_REPORT) {
        defmt::info!(
            "steps {=u32}, received {=u32}, rejected {=u32}, refused {=u32}, bus errors {=u32}, unsent {=u32}, worst step {=u32} cycles, stack {=u32} of {=u32}",
            counts.steps,
            counts.received,
            counts.rejected.total(),
            verifier.total(),
            counts.bus_errors,
            counts.unsent,
            counts.worst_cycles,
            stack::used(),
            stack::budget()
        );
    }
    step.command.mode
}

/// Answers a tester: one request and one frame in a step.
fn diagnose(
    board: &mut ThisBoard,
    ecu: &Ecu,
    service: &mut Service,
    cells: &mut Cells,
    command: &Command,
    counts: &Counts,
) {
    let restart = service.diagnose(cells, command, ecu, &counts.rejected, counts.steps);
    if let Some(frame) = service.answer(counts.steps)
        && board.can().transmit(&frame).is_ok()
    {
        service.answered(counts.steps);
    }
    if let Some(restart) = restart {
        ThisBoard::zero_torque();
        match restart {
            Restart::With(set) => reset::restart_with(&set),
            // As new parameters are: asked for over the bus, and no step towards locking within 10 s.
            Restart::AsIs => reset::restart(ResetCause::NewParameters),
        }
    }
}

/// What a panic leads to.
pub fn on_panic(info: &core::panic::PanicInfo) -> ! {
    ThisBoard::zero_torque();
    defmt::error!("panic: {}", defmt::Display2Format(info));
    reset::restart(ResetCause::Panic)
}

/// What a fault of the processor leads to.
pub fn on_fault() -> ! {
    ThisBoard::zero_torque();
    reset::restart(if stack::overflowed() {
        ResetCause::StackOverflow
    } else {
        ResetCause::HardFault
    })
}

/// The handlers of an image that runs the product: a panic or a fault brings the torque to zero and resets.
#[macro_export]
macro_rules! stop_on_panic_and_fault {
    () => {
        #[panic_handler]
        fn panic(info: &core::panic::PanicInfo) -> ! {
            $crate::product::on_panic(info)
        }

        #[cortex_m_rt::exception]
        unsafe fn HardFault(_: &cortex_m_rt::ExceptionFrame) -> ! {
            $crate::product::on_fault()
        }
    };
}
