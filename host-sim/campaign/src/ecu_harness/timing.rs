//! When the faults of a case act, and at which instants of its clock the ECU runs.

use crate::injection::{Clock, Injection, first_of};
use crate::table::FaultCase;

/// A case that begins at a step.
#[derive(Debug, Clone)]
pub(super) struct FaultTiming<'a> {
    row: &'a FaultCase,
    pub(super) onset: u32,
    /// Nothing of the row goes wrong here; what the driver's hand does stays.
    pub(super) healthy: bool,
    pub(super) clock_base_us: u32,
}

impl<'a> FaultTiming<'a> {
    pub(super) fn new(row: &'a FaultCase, onset: u32) -> Self {
        let wraps = row.injections.contains(&Injection::Clock(Clock::Wraps));
        Self {
            row,
            onset,
            healthy: false,
            clock_base_us: if wraps {
                0_u32.wrapping_sub(onset * 1000)
            } else {
                0
            },
        }
    }

    /// Steps since the onset.
    pub(super) fn since(&self, step: u32) -> i64 {
        i64::from(step) - i64::from(self.onset)
    }

    /// What acts in a step.
    pub(super) fn acting(&self, step: u32) -> &'static [Injection] {
        let since = self.since(step);
        let acts = !self.healthy && since >= 0 && self.row.lasts_ms.is_none_or(|ms| since < i64::from(ms));
        if acts { self.row.injections } else { &[] }
    }

    /// Instants of the ECU's clock at which it runs in this step, and how many they are.
    pub(super) fn ticks(&self, step: u32) -> ([u32; 5], usize) {
        let clock = first_of!(self.row.injections, Injection::Clock(clock) => *clock);
        let rate = if let Some(Clock::Rate(rate)) = clock {
            rate
        } else {
            1.0
        };
        let us = (f64::from(step) * 1000.0 * rate) as u32;
        let now = self.clock_base_us.wrapping_add(us);
        let once = ([now, now, 0, 0, 0], 1);
        let since = self.since(step);
        if since < 0 || self.healthy {
            return once;
        }
        match clock {
            Some(Clock::Late(ms)) if since < i64::from(ms) => (once.0, 0),
            Some(Clock::Missing { steps, every_ms }) if since % i64::from(every_ms) < i64::from(steps) => {
                (once.0, 0)
            }
            Some(Clock::TwoRuns) if since == 0 => (once.0, 2),
            Some(Clock::Runaway) => ([0, 200, 400, 600, 800].map(|us| now.wrapping_add(us)), 5),
            _ => once,
        }
    }
}
