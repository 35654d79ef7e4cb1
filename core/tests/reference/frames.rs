//! The frames of a step, packed here by hand from docs/reference/bus.md and core/haptic.dbc.

use super::receivers::protected;
use haptic_core::controller::Command;
use haptic_core::safety::faults::FaultSet;
use haptic_core::safety::modes::Mode;

/// Bits of the fault word by class.
const CLASS_B: u32 = 0x0007_80FF;
const CLASS_C: u32 = 0x1F00;
const LOCKED: u32 = 0x6000;

/// What is counted from step to step.
#[derive(Debug, Clone)]
pub(crate) struct Frames {
    reset: u64,
    steps: u32,
    /// The step and the mode in which the warning began.
    warned: Option<(u32, Mode)>,
    is_line_due: bool,
    counts: [u64; 21],
    seen_s: [u64; 21],
    present: u32,
    ever: u32,
    second: i64,
    seconds: u64,
}

impl Frames {
    pub(crate) fn new(reset: u64, now: i64) -> Self {
        Self {
            reset,
            steps: 0,
            warned: None,
            is_line_due: false,
            counts: [0; 21],
            seen_s: [0; 21],
            present: 0,
            ever: 0,
            second: now,
            seconds: 0,
        }
    }

    /// Identifiers and bytes, guidance first; `is_busy`: the step has a new sample of the column.
    pub(crate) fn expected(&mut self, now: i64, command: &Command, is_busy: bool) -> Vec<(u16, [u8; 8])> {
        let (steps, faults) = (self.steps, command.faults.bits());
        self.steps += 1;
        let bit = |is: bool, place: u32| u64::from(is) << place;
        let counts = (command.torque.nm() * 4096.0) as i64 as u64 & 0xFFFF;
        let word = counts << 12
            | (command.limit as u64) << 28
            | (command.mode as u64) << 32
            | bit(command.warning, 36)
            | u64::from(faults) << 37
            | bit(faults & CLASS_B != 0, 58)
            | bit(faults & CLASS_C != 0, 59)
            | bit(faults & LOCKED != 0, 60)
            | self.reset << 61;
        let mut frames = vec![(0x0C0, protected(word, 0x5A, steps))];
        self.count(now, command.faults);
        self.warned = self
            .warned
            .filter(|(_, mode)| command.warning && *mode == command.mode);
        if command.warning {
            let (since, _) = *self.warned.get_or_insert((steps, command.mode));
            if (steps - since).is_multiple_of(100) {
                let word = (command.mode as u64) << 12 | u64::from(faults) << 16;
                frames.push((0x0D0, protected(word, 0x66, (steps - since) / 100)));
            }
        }
        // The fiftieth step of a hundred, or the first of the next three without such a sample, or the third.
        let place = steps % 100;
        self.is_line_due |= place == 50;
        let is_line_now = self.is_line_due && (place == 53 || !is_busy);
        self.is_line_due &= !is_line_now;
        if is_line_now && self.ever != 0 {
            let (turn, total) = (steps / 100, self.ever.count_ones());
            let index = turn % total;
            let line = (0..21)
                .filter(|fault| self.ever >> fault & 1 == 1)
                .nth(index as usize)
                .unwrap();
            let word = u64::from(index) << 12
                | u64::from(total) << 17
                | (line as u64) << 23
                | bit(self.present >> line & 1 == 1, 28)
                | self.counts[line].min(255) << 32
                | (self.seconds - self.seen_s[line]) << 40;
            frames.push((0x300, protected(word, 0x77, turn)));
        }
        frames
    }

    fn count(&mut self, now: i64, faults: FaultSet) {
        if now - self.second >= 1_000_000 {
            (self.second, self.seconds) = (now, self.seconds + 1);
        }
        for fault in 0..21 {
            if faults.bits() & !self.present & 1 << fault != 0 {
                (self.counts[fault], self.seen_s[fault]) = (self.counts[fault] + 1, self.seconds);
            }
        }
        (self.present, self.ever) = (faults.bits(), self.ever | faults.bits());
    }
}
