//! The bus between the senders and the ECU, and what is wrong with it.
//!
//! Without a fault a frame arrives in the step in which it is sent, in order. A frame that a fault has touched is
//! marked, so that a run can tell whether the ECU accepted what it had to reject.

use std::collections::VecDeque;

use haptic_core::bus::Frame;
use rand::RngExt;
use rand::rngs::Xoshiro256PlusPlus;

use super::bytes::{self, LANE, MESSAGES};
use super::injection::{Injection, Wire, first_of};

/// A frame at the ECU's door.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arrival {
    pub(super) frame: Frame,
    /// Whether a receiver has to reject it.
    pub(super) bad: bool,
}

/// What the bus remembers.
#[derive(Debug, Clone, Default)]
pub(super) struct Bus {
    /// Everything sent, by step, as long as a replay may need it.
    log: VecDeque<Vec<Frame>>,
    log_length: usize,
    /// By message: frames since the onset.
    since_onset: [u32; MESSAGES.len()],
    /// By message: counter at the onset.
    counters: [Option<u8>; MESSAGES.len()],
    /// By message: a frame that waits for its successor.
    waiting: [Option<Frame>; MESSAGES.len()],
    /// Frames on their way, with the step in which they arrive.
    late: VecDeque<(u32, Frame)>,
    /// By message: when the last one arrives.
    last_due: [u32; MESSAGES.len()],
}

impl Bus {
    pub(super) fn new(injections: &[Injection]) -> Self {
        let log_length = first_of!(injections, Injection::Wire(Wire::Replayed(_, ms)) => *ms);
        Self {
            log_length: log_length.unwrap_or(0),
            ..Self::default()
        }
    }

    /// How often the senders have to send in this step, where it is not once.
    pub(super) fn burst(acting: &[Injection]) -> Option<u8> {
        first_of!(acting, Injection::Wire(Wire::Burst(times)) => *times)
    }

    /// Takes what is sent in a step, appends what arrives.
    pub(super) fn carry(
        &mut self,
        step: u32,
        sent: &[Frame],
        acting: &[Injection],
        rng: &mut Xoshiro256PlusPlus,
        arrivals: &mut Vec<Arrival>,
    ) {
        if self.log_length > 0 {
            self.log.push_back(sent.to_vec());
        }
        let replayed = (self.log.len() > self.log_length)
            .then(|| self.log.pop_front())
            .flatten();
        let wire = first_of!(acting, Injection::Wire(wire) => *wire);
        if let Some(Wire::Replayed(ids, _)) = wire {
            let of_these = |frame: &&Frame| ids.contains(&frame.id());
            let frames = replayed.unwrap_or_default();
            arrivals.extend(frames.iter().filter(of_these).map(|frame| bad(*frame)));
            arrivals.extend(
                sent.iter()
                    .filter(|frame| !of_these(frame))
                    .map(|frame| good(*frame)),
            );
            return;
        }
        for frame in sent {
            let sender = MESSAGES.iter().position(|id| *id == frame.id()).unwrap_or(0);
            match wire {
                Some(wire) => {
                    self.disturb(wire, step, sender, frame, rng, arrivals);
                    self.since_onset[sender] += 1;
                }
                None => arrivals.push(good(*frame)),
            }
        }
        while self.late.front().is_some_and(|(due, _)| *due <= step) {
            arrivals.extend(self.late.pop_front().map(|(_, frame)| good(frame)));
        }
    }

    fn disturb(
        &mut self,
        wire: Wire,
        step: u32,
        sender: usize,
        frame: &Frame,
        rng: &mut Xoshiro256PlusPlus,
        arrivals: &mut Vec<Arrival>,
    ) {
        let within = |frames: Option<u32>| frames.is_none_or(|n| self.since_onset[sender] < n);
        let counter = bytes::unsigned(frame, 8, 4) as u8;
        match wire {
            Wire::Lost(ids, frames) => {
                if !(ids.contains(&frame.id()) && within(frames)) {
                    arrivals.push(good(*frame));
                }
            }
            Wire::Twice => arrivals.extend([good(*frame), bad(*frame)]),
            Wire::Swapped => match self.waiting[sender].take() {
                None => self.waiting[sender] = Some(*frame),
                Some(earlier) => arrivals.extend([good(*frame), bad(earlier)]),
            },
            Wire::CounterFrozen => {
                let frozen = *self.counters[sender].get_or_insert(counter);
                let first = self.since_onset[sender] == 0;
                let frame = bytes::with_counter(frame, frozen);
                arrivals.push(Arrival { frame, bad: !first });
            }
            Wire::Flipped(frames) => {
                if within(frames) {
                    let bit = rng.random_range(0..64);
                    arrivals.push(bad(bytes::with_bit_flipped(frame, bit)));
                } else {
                    arrivals.push(good(*frame));
                }
            }
            Wire::Field {
                id,
                start,
                bits,
                value,
                frames,
            } => {
                if frame.id() == id && within(frames) {
                    arrivals.push(bad(bytes::with_field(frame, start, bits, value)));
                } else {
                    arrivals.push(good(*frame));
                }
            }
            Wire::Masquerade => {
                let other = MESSAGES[(sender + 1) % MESSAGES.len()];
                arrivals.extend([good(*frame), bad(bytes::renamed(other, frame.data()))]);
            }
            Wire::Outrun(lsb) => {
                if frame.id() == LANE {
                    let e_y = (bytes::signed(frame, 12, 17) + lsb).clamp(-32_768, 32_768);
                    arrivals.push(good(bytes::with_field(frame, 12, 17, e_y)));
                }
                arrivals.push(good(*frame));
            }
            Wire::Between {
                id,
                start,
                bits,
                more,
            } => {
                arrivals.push(good(*frame));
                if frame.id() == id {
                    let value = bytes::signed(frame, start, bits) + more;
                    let lie = bytes::with_field(frame, start, bits, value);
                    let ahead = [3, 6, 9, 12, 15, 16];
                    let between = |by| good(bytes::with_counter(&lie, counter.wrapping_add(by)));
                    arrivals.extend(ahead.map(between));
                }
            }
            Wire::Short => arrivals.push(bad(bytes::renamed(frame.id(), &frame.data()[..7]))),
            Wire::Renamed => arrivals.push(good(bytes::renamed(frame.id() ^ 0x400, frame.data()))),
            Wire::Burst(times) => {
                let again = |ahead| good(bytes::with_counter(frame, counter.wrapping_add(ahead)));
                arrivals.extend((0..times).map(again));
            }
            Wire::Jittered(ms) => {
                // In order: none arrives before the one that was sent before it.
                let due = (step + rng.random_range(0..=ms)).max(self.last_due[sender]);
                self.last_due[sender] = due;
                let place = self.late.partition_point(|(other, _)| *other <= due);
                self.late.insert(place, (due, *frame));
            }
            // Handled with the whole step.
            Wire::Replayed(..) => {}
        }
    }
}

fn good(frame: Frame) -> Arrival {
    Arrival { frame, bad: false }
}

fn bad(frame: Frame) -> Arrival {
    Arrival { frame, bad: true }
}
