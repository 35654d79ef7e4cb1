//! The product's loop: every millisecond one step of the controller, its inputs and its torque on the bus.
//!
//! What is broken does not steer: a panic or a fault brings the torque to zero and resets the processor with
//! the cause on record; a loop that hangs, or that the monitor does not permit, loses the watchdog. The
//! controller comes up in Standby, or in the Fault that it had latched, says why on the bus, and locks after three
//! resets within 10 s.
//!
//! Its parameters are the newest good set of the flash. Without any it has those built into the image, unless both
//! copies are damaged: then it locks. A set that comes over the bus is stored at the restart that it causes: the
//! flash is never touched while the loop runs, since an erase takes longer than the watchdog waits.

use embedded_can::nb::Can;
use embedded_hal::digital::OutputPin;
use haptic_core::bus::messages::{Column, Message, ParameterStatus, ResetCause};
use haptic_core::config::Setup;
use haptic_core::download::Download;
use haptic_core::ecu::{Boot, Ecu, Step};
use haptic_core::faults::FaultSet;
use haptic_core::modes::Mode;

use crate::boards::{Board, ThisBoard};
use crate::storage::{self, Found};
use crate::{analogue, reset, stack};

/// Steps between two lines of the log: one second.
const STEPS_PER_REPORT: u32 = 1000;
/// Steps after which earlier resets no longer count: 10 s.
const STEPS_TO_SETTLE: u32 = 10_000;

/// What the log says once a second.
#[derive(Default)]
struct Counts {
    steps: u32,
    received: u32,
    rejected: u32,
    unsent: u32,
    /// Cycles of the frames received since the last step, and the most that they and a step took.
    receiving: u32,
    worst_cycles: u32,
}

/// What has to do with parameters.
struct Service {
    download: Download,
    /// The mode of the last step.
    mode: Mode,
    found: Found,
}

impl Service {
    fn status(&self) -> ParameterStatus {
        let is_damaged = self.found.damaged != [false, false];
        self.download.status(self.found.stored.as_ref(), is_damaged)
    }
}

/// Runs the product. `disturb` is called before each step with its number: the product has nothing to say there,
/// the image that breaks itself has.
pub fn run(ecu: &'static mut Option<Ecu>, mut disturb: impl FnMut(&mut Ecu, Boot, u32)) -> ! {
    stack::paint();
    let mut board = ThisBoard::start();
    let boot = reset::boot(board.reset_source());
    let found = parameters(&mut board);
    let ecu = begin(ecu, &found, boot);
    let mut service = Service {
        download: Download::NEW,
        mode: Mode::Boot,
        found,
    };
    let mut counts = Counts::default();
    defmt::info!(
        "steering-ecu on {=str}, reset cause {=u8}, resets of late {=u8}, parameters {=u32}",
        ThisBoard::NAME,
        boot.reset as u8,
        boot.recent_resets,
        found.stored.map_or(0, |stored| stored.sequence)
    );
    board.start_tick();
    board.start_watchdog();
    loop {
        board.sleep();
        while let Ok(frame) = board.can().receive() {
            counts.received = counts.received.wrapping_add(1);
            // Two senders under one counter would pass each other's frames off.
            if ThisBoard::HAS_COLUMN && frame.id() == Column::ID {
                continue;
            }
            let start = ThisBoard::cycles();
            if ecu.receive(&frame, ThisBoard::now()).is_err() {
                counts.rejected = counts.rejected.wrapping_add(1);
            }
            let cycles = ThisBoard::cycles().wrapping_sub(start);
            counts.receiving = counts.receiving.wrapping_add(cycles);
            if let Some(params) = service.download.receive(&frame, service.mode) {
                ThisBoard::zero_torque();
                reset::restart_with(&params);
            }
        }
        if board.tick() {
            disturb(ecu, boot, counts.steps);
            step(&mut board, ecu, &mut service, &mut counts);
        }
    }
}

/// Stores the set that the last run left, if it did, and looks at what there is.
#[inline(never)]
fn parameters(board: &mut ThisBoard) -> Found {
    let found = storage::load(board.flash());
    let Some(params) = reset::take_parameters() else {
        return found;
    };
    if storage::save(board.flash(), &params, found.stored.as_ref()).is_err() {
        defmt::error!("the parameters could not be stored");
    }
    storage::load(board.flash())
}

/// A function of its own, so that what an ECU takes to be put together is not on the stack of every step.
#[inline(never)]
fn begin(ecu: &'static mut Option<Ecu>, found: &Found, boot: Boot) -> &'static mut Ecu {
    ecu.insert(Ecu::new(setup(found).as_ref(), boot, ThisBoard::now()))
}

/// What the controller starts with; None locks it.
fn setup(found: &Found) -> Option<Setup> {
    match found.stored {
        Some(stored) => Setup::new(&stored.params).ok(),
        None if found.damaged == [true, true] => None,
        None => Some(Setup::PAPER),
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
        if ecu.receive(&frame, ThisBoard::now()).is_err() {
            counts.rejected = counts.rejected.wrapping_add(1);
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
    if step.command.faults.intersects(FaultSet::CRITICAL) {
        reset::latch(step.command.faults.common(FaultSet::CRITICAL));
    }
    step
}

fn step(board: &mut ThisBoard, ecu: &mut Ecu, service: &mut Service, counts: &mut Counts) {
    let step = control(board, ecu, counts);
    // A frame that finds no room is lost; the next follows in a millisecond, and the receiver's time-out
    // judges a bus that stays closed.
    for frame in core::iter::once(&step.guidance).chain(&step.others) {
        if board.can().transmit(frame).is_err() {
            counts.unsent = counts.unsent.wrapping_add(1);
        }
    }
    service.mode = step.command.mode;
    // The torque is on its way; what follows may take its time.
    let status = counts.steps.is_multiple_of(STEPS_PER_REPORT).then(|| {
        let turn = counts.steps / STEPS_PER_REPORT;
        service.status().encode(turn as u8)
    });
    for frame in ecu.background_step().iter().chain(&status) {
        if board.can().transmit(frame).is_err() {
            counts.unsent = counts.unsent.wrapping_add(1);
        }
    }
    // A light that fails is no reason to stop.
    let _ = board
        .status()
        .set_state(step.command.mode.may_have_torque().into());
    counts.steps = counts.steps.wrapping_add(1);
    if counts.steps == STEPS_TO_SETTLE {
        reset::settled();
    }
    if counts.steps.is_multiple_of(STEPS_PER_REPORT) {
        defmt::info!(
            "steps {=u32}, received {=u32}, rejected {=u32}, unsent {=u32}, worst step {=u32} cycles, stack {=u32} of {=u32}",
            counts.steps,
            counts.received,
            counts.rejected,
            counts.unsent,
            counts.worst_cycles,
            stack::used(),
            stack::budget()
        );
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
