//! Faults of time: clocks, ticks, deadlines.

use super::FaultCase;
use crate::injection::{Clock, Injection};

const fn clock(clock: Clock) -> Injection {
    Injection::Clock(clock)
}

/// Two steps in a row, or one by 10 ms, late: seen at the end of the second.
const LATE_MS: u32 = 20;

pub(super) const ROWS: &[FaultCase] = rows! {
    "clock-fast" "clock 5 % fast" [clock(Clock::Rate(1.05))] .q();
    "clock-slow" "clock 5 % slow" [clock(Clock::Rate(0.95))] .q();
    "clock-wraps" "microseconds wrap, as every 71.6 min" [clock(Clock::Wraps)] .q();
    "tick-late-2" "one tick 2 ms late" [clock(Clock::Late(2))] .bridged().q();
    "tick-late-5" "one tick 5 ms late" [clock(Clock::Late(5))] .bridged().q();
    "tick-late-15" "one tick 15 ms late" [clock(Clock::Late(15))] .stops(LATE_MS).q();
    "deadline-missed-1" "one step lost"
        [clock(Clock::Missing { steps: 1, every_ms: 100_000 })] .bridged().q();
    "deadline-missed-2" "two steps in a row lost"
        [clock(Clock::Missing { steps: 2, every_ms: 100_000 })] .bridged().q();
    "deadline-missed-always" "two of three steps lost"
        [clock(Clock::Missing { steps: 2, every_ms: 3 })] .stops(LATE_MS).q();
    "two-runs" "two runs in one tick" [clock(Clock::TwoRuns)] .bridged().q();
    "runaway-timer" "five ticks a millisecond" [clock(Clock::Runaway)] .stops(LATE_MS).q();
    "endless-loop" "step never returns: watchdog after 16 ms, and a start" [] .restarts(1, 30).only_q();
    "task-skipped" "receiver does not run, watchdog fed"
        [Injection::Inside(crate::injection::Inside::ReceiverSkipped)] .hands_over(super::STALE_MS).q();
};
