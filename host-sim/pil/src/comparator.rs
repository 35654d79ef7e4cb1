//! Reads the frames that the target answers and compares them with those of the host's controller.

use std::fmt;
use std::sync::mpsc::{Receiver, SyncSender};

use haptic_core::bus::Frame;
use haptic_core::bus::messages::{Guidance, Message};
use haptic_core::quantity::Instant;
use haptic_lockstep::{StackUse, StepCost};
use serde::Serialize;

use super::qemu::instructions;
use super::responses::ResponseStream;
use super::{Channel, PilError, Report};

/// Most frames of one answer: guidance, a warning, a line of the fault history, telemetry.
const ANSWER_MAX: usize = 4;

/// What the host's controller answered at a tick. No allocation: there is one each step.
pub(super) struct Expected {
    now: Instant,
    answer: [Option<Frame>; ANSWER_MAX],
}

impl Expected {
    pub(super) fn new(now: Instant, answer: &[Frame]) -> Self {
        assert!(
            answer.len() <= ANSWER_MAX,
            "a step answers with {ANSWER_MAX} frames at most"
        );
        Self {
            now,
            answer: std::array::from_fn(|i| answer.get(i).copied()),
        }
    }
}

/// A tick at which the two controllers differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mismatch {
    /// Number of the step, from 0.
    pub step: u64,
    /// Time of the tick.
    pub now: Instant,
    /// The host's frame, if it sent one.
    pub host: Option<Frame>,
    /// The target's.
    pub target: Option<Frame>,
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "first difference at step {}, {} us:", self.step, self.now.us())?;
        writeln!(f, "  host   {}", Decoded(self.host))?;
        write!(f, "  target {}", Decoded(self.target))
    }
}

/// A frame's bytes and, if it is a guidance frame, its signals.
struct Decoded(Option<Frame>);

impl fmt::Display for Decoded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(frame) = self.0 else {
            return write!(f, "no frame");
        };
        write!(f, "{:03X} {:02X?}", frame.id(), frame.data())?;
        let data = match <[u8; 8]>::try_from(frame.data()) {
            Ok(data) if frame.id() == Guidance::ID => data,
            _ => return Ok(()),
        };
        let counter = data[1] & 0x0F;
        let crc = if Guidance::PROTECTION.is_intact(&data) {
            "good"
        } else {
            "bad"
        };
        match Guidance::unpack(&data) {
            Some(guidance) => write!(
                f,
                ": torque {:.6} N.m, limit {:?}, mode {:?}, faults {:?}, counter {counter}, CRC {crc}",
                guidance.torque.nm(),
                guidance.limit,
                guidance.mode,
                guidance.faults
            ),
            None => write!(f, ": a signal is out of range, counter {counter}, CRC {crc}"),
        }
    }
}

/// What the ticks of a run cost the target: all frames received, the step and the background. The unit is
/// instructions in QEMU, and cycles of the core on a board.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Spent {
    /// The largest cost of a tick.
    pub worst: u32,
    /// Number of that tick, from 0.
    pub worst_step: u64,
    /// The mean cost of a tick.
    pub mean: f64,
    /// The largest cost of a background alone, which is the work after the frames have left.
    pub worst_background: u32,
    /// The mean cost of a background.
    pub mean_background: f64,
}

/// What the target's counter of cycles counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Counter {
    /// Nothing usable: QEMU runs by this computer's clock.
    Nothing,
    /// QEMU's instructions.
    Instructions,
    /// A board's cycles.
    Cycles,
}

pub(super) struct Comparator {
    responses: ResponseStream,
    counter: Counter,
    report: Report,
}

impl Comparator {
    pub(super) fn new(responses: ResponseStream, channel: Channel, counter: Counter) -> Self {
        Self {
            responses,
            counter,
            report: Report {
                channel,
                steps: 0,
                frames_compared: 0,
                mismatches: 0,
                steps_per_second: 0.0,
                stack_bytes: 0,
                instructions: None,
                cycles: None,
                first_mismatch: None,
            },
        }
    }

    /// Compares until no more answers are expected, drops `answering`, which ends the sender, and waits for the
    /// machine to end.
    pub(super) fn run(
        mut self,
        expected: &Receiver<Expected>,
        answering: SyncSender<()>,
    ) -> Result<Report, PilError> {
        let mut start = None;
        let mut total = [0_u64; 2];
        for expected in expected {
            let start = *start.get_or_insert_with(std::time::Instant::now);
            for (total, spent) in total.iter_mut().zip(self.step(&expected)?) {
                *total += u64::from(spent);
            }
            self.report.steps += 1;
            self.responses.steps = self.report.steps;
            self.report.steps_per_second = self.report.steps as f64 / start.elapsed().as_secs_f64();
        }
        drop(answering);
        let spent = self.report.instructions.as_mut().or(self.report.cycles.as_mut());
        if let Some(spent) = spent {
            [spent.mean, spent.mean_background] = total.map(|total| total as f64 / self.report.steps as f64);
        }
        self.responses.end()?;
        if self.report.mismatches == 0 {
            self.responses.discard_log();
        }
        Ok(self.report)
    }

    /// Compares one answer. Returns the cost of the step with its background, and of the background alone.
    fn step(&mut self, expected: &Expected) -> Result<[u32; 2], PilError> {
        let mut host = expected.answer.iter().flatten().copied();
        let cost = loop {
            let frame = self.responses.frame()?;
            if let Some(StackUse { bytes }) = StackUse::decode(&frame) {
                self.report.stack_bytes = bytes;
                continue;
            }
            if let Some(cost) = StepCost::decode(&frame) {
                break cost;
            }
            self.compare(expected.now, host.next(), Some(frame));
        };
        for missing in host {
            self.compare(expected.now, Some(missing), None);
        }
        Ok(self.account(cost))
    }

    fn compare(&mut self, now: Instant, host: Option<Frame>, target: Option<Frame>) {
        let report = &mut self.report;
        report.frames_compared += 1;
        if target != host {
            report.mismatches += 1;
            report.first_mismatch.get_or_insert(Mismatch {
                step: report.steps,
                now,
                host,
                target,
            });
        }
    }

    /// Adds a cost to the report. Returns the cost of the step with its background, and of the background alone.
    fn account(&mut self, cost: StepCost) -> [u32; 2] {
        let cycles = [cost.cycles, cost.background_cycles];
        let (spent, most) = match self.counter {
            Counter::Nothing => return [0; 2],
            Counter::Instructions => (cycles.map(instructions), &mut self.report.instructions),
            Counter::Cycles => (cycles, &mut self.report.cycles),
        };
        let most = most.get_or_insert_default();
        let [step, background] = spent;
        if step + background > most.worst {
            most.worst = step + background;
            most.worst_step = self.report.steps;
        }
        most.worst_background = most.worst_background.max(background);
        [step + background, background]
    }
}
