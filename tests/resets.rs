//! What becomes of a product that breaks: the image `broken` in QEMU hangs, panics, faults or outgrows its stack half
//! a second after power-up, or its monitor withdraws the permission. Each must reset it, by the watchdog or by its own
//! handler, and the next start must say why on the bus; one that breaks after every start must lock, and what the
//! monitor forbade must stay forbidden. The guard of the stack and the watchdog are shown on
//! a second core too (Cortex-M7).
//!
//! The torque frames are taken apart by hand, from `core/haptic.dbc`.

use crate::machine::Machine;

/// The reference board, and the same with another core.
const M4F: &str = "mps2-an386";
const M7: &str = "mps2-an500";
/// Values of `Guidance_Mode`.
const STANDBY: u64 = 1;
const FAULT: u64 = 5;
const LOCKED: u64 = 6;
/// Values of `Guidance_Reset`.
const POWER_ON: u64 = 0;
const WATCHDOG: u64 = 1;
const HARD_FAULT: u64 = 2;
const PANIC: u64 = 3;
const STACK_OVERFLOW: u64 = 4;
/// The step that breaks (`firmware/src/bin/broken.rs`).
const BREAKS_AT: usize = 500;

/// What a torque frame says beside its counter.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Status {
    cause: u64,
    mode: u64,
    monitor_disagreed: bool,
}

/// The next torque frame's status.
fn status(machine: &mut Machine) -> Status {
    loop {
        if let (0x0C0, word) = machine.frame() {
            return Status {
                cause: (word >> 61) & 0x7,
                mode: (word >> 32) & 0xF,
                monitor_disagreed: (word >> 46) & 1 != 0,
            };
        }
    }
}

/// Reads on until the status is another; returns it and how many frames had the one before.
fn next_other(machine: &mut Machine, last: Status) -> (Status, usize) {
    for frames in 1..100_000 {
        let next = status(machine);
        if next != last {
            return (next, frames);
        }
    }
    panic!("{last:?} for 100 s");
}

/// Power-up, the flaw, and the start after it, which must give `cause` and last.
fn comes_back(board: &str, flaw: &str, cause: u64) {
    let mut machine = Machine::start(board, "broken", flaw);
    let first = status(&mut machine);
    assert_eq!(first.cause, POWER_ON);
    let (second, frames) = next_other(&mut machine, first);
    assert_eq!(second.cause, cause, "after {flaw}: {second:?}");
    // The client may open the channel late, but the machine does not speak again before it breaks.
    assert!(frames <= BREAKS_AT, "{flaw} after {frames} frames");
    for _ in 0..2 * BREAKS_AT {
        assert_eq!(
            status(&mut machine),
            second,
            "the start after {flaw} does not last"
        );
    }
}

#[test]
fn a_loop_that_hangs_meets_the_watchdog() {
    comes_back(M4F, "hang", WATCHDOG);
}

#[test]
fn a_panic_resets_and_says_so() {
    comes_back(M4F, "panic", PANIC);
}

#[test]
fn a_fault_resets_and_says_so() {
    comes_back(M4F, "fault", HARD_FAULT);
}

/// Caught by the guard below the stack, before it overwrites data.
#[test]
fn a_stack_that_outgrows_its_budget_resets_and_says_so() {
    comes_back(M4F, "overflow", STACK_OVERFLOW);
}

/// Without permission nobody feeds the watchdog; and the start after it is no power-up, so that the fault is still there.
#[test]
fn a_veto_of_the_monitor_lasts_beyond_the_reset_that_it_causes() {
    let mut machine = Machine::start(M4F, "broken", "veto");
    let first = status(&mut machine);
    let standby = |cause| Status {
        cause,
        mode: STANDBY,
        monitor_disagreed: false,
    };
    let fault = |cause| Status {
        cause,
        mode: FAULT,
        monitor_disagreed: true,
    };
    assert_eq!(first, standby(POWER_ON));
    let (mut next, _) = next_other(&mut machine, first);
    // The last frames before the reset may have been lost with the channel, or not.
    if next == fault(POWER_ON) {
        let (after, frames) = next_other(&mut machine, next);
        // The watchdog's 16 ms.
        assert!(frames <= 16, "{frames} steps without permission");
        next = after;
    }
    assert_eq!(next, fault(WATCHDOG));
    for _ in 0..3 * BREAKS_AT {
        assert_eq!(status(&mut machine), fault(WATCHDOG));
    }
}

#[test]
fn another_core_has_the_same_guard_and_watchdog() {
    comes_back(M7, "overflow", STACK_OVERFLOW);
    comes_back(M7, "hang", WATCHDOG);
}

#[test]
fn three_resets_within_ten_seconds_lock() {
    let mut machine = Machine::start(M4F, "broken", "hang-always");
    let mut status = status(&mut machine);
    assert_eq!(status.cause, POWER_ON);
    let mut frames = 0;
    while status.mode != LOCKED {
        let (next, n) = next_other(&mut machine, status);
        assert_eq!(next.cause, WATCHDOG);
        (status, frames) = (next, frames + n);
    }
    // Power-up and two more starts before the third reset.
    assert!(frames <= 3 * BREAKS_AT, "locked after {frames} frames");
}
