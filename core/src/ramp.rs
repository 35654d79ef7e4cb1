//! Torques that end by themselves: the last trusted torque, and its way to zero.
//!
//! A sudden loss of guidance in a curve takes a relying driver 0.44 to 0.62 m off the centreline; the same
//! torque faded over 2 s while the driver takes over keeps the peak near what it was (docs/safety.md has the
//! table). Neither ramp ever grows.

use crate::quantity::{Instant, Micros, Torque, TorqueRate};
use crate::redundant::words;

/// A handover lasts this long. 0.12 s gains almost nothing over a sudden loss, 3 s overshoots.
pub const HANDOVER: Micros = Micros::from_ms(2000);

/// How far back an output may be trusted.
pub const HISTORY: Micros = Micros::from_ms(250);

words! {
    /// A straight line from a torque to zero.
    pub struct Ramp {
        from: Torque,
        length: Micros,
        done: Micros,
    }
}

impl Ramp {
    /// Already at zero.
    pub const NONE: Self = Self {
        from: Torque::ZERO,
        length: Micros::from_us(1),
        done: Micros::from_us(1),
    };

    /// From `torque` to zero in `length`.
    #[must_use]
    pub const fn over(torque: Torque, length: Micros) -> Self {
        Self {
            from: torque,
            length,
            done: Micros::from_us(0),
        }
    }

    /// From `torque` to zero at `rate`.
    #[must_use]
    pub fn at_rate(torque: Torque, rate: TorqueRate) -> Self {
        let us = i64::from(torque.abs().bits()).saturating_mul(1_000_000);
        let us = us.checked_div(i64::from(rate.bits())).unwrap_or(0);
        Self::over(
            torque,
            Micros::from_us(u32::try_from(us).unwrap_or(0).saturating_add(1)),
        )
    }

    /// The torque after another `elapsed`.
    #[must_use]
    pub fn step(&mut self, elapsed: Micros) -> Torque {
        self.done = Micros::from_us(self.done.us().saturating_add(elapsed.us()));
        let left = i64::from(self.length.us().saturating_sub(self.done.us()));
        let torque = i64::from(self.from.bits()).saturating_mul(left);
        // The length is never zero by construction; a division that truncates never grows the torque.
        Torque::from_wide(torque.checked_div(i64::from(self.length.us())).unwrap_or(0))
    }

    /// Whether zero is reached.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.done >= self.length
    }
}

/// The outputs of the last 250 ms, one every 5 ms.
///
/// Not kept twice: wherever a flipped bit puts the start of a handover, it lies between zero and the torque
/// applied. A fixed array, so that a flip can do nothing else.
#[derive(Debug, Clone)]
pub struct History {
    /// A ring, of which the newest [`KEPT`] count.
    outputs: [(Instant, Torque); RING],
    /// Where the newest is. Every number names a place, modulo the ring.
    newest: usize,
}

const HISTORY_STEP: Micros = Micros::from_ms(5);
/// 250 ms and both ends.
const KEPT: usize = 51;
/// A power of two, so that the place is a mask.
const RING: usize = 64;

impl History {
    /// Nothing applied yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            outputs: [(Instant::from_us(0), Torque::ZERO); RING],
            newest: 0,
        }
    }

    /// The output that is `back` places older than the newest.
    #[expect(clippy::indexing_slicing, reason = "a place is modulo the ring")]
    const fn output(&self, back: usize) -> (Instant, Torque) {
        self.outputs[self.newest.wrapping_sub(back) % RING]
    }

    /// Remembers an output.
    #[expect(clippy::indexing_slicing, reason = "a place is modulo the ring")]
    pub fn push(&mut self, now: Instant, torque: Torque) {
        if now.since(self.output(0).0) >= HISTORY_STEP {
            self.newest = self.newest.wrapping_add(1);
            self.outputs[self.newest % RING] = (now, torque);
        }
    }

    /// The last output before `suspect` time ago: the oldest one kept if that is longer ago than the
    /// history, zero if there was none.
    #[must_use]
    pub fn trusted(&self, now: Instant, suspect: Micros) -> Torque {
        let mut outputs = (0..KEPT).map(|back| self.output(back));
        let before = outputs.find(|(at, _)| now.since(*at) > suspect);
        before.unwrap_or_else(|| self.output(KEPT - 1)).1
    }

    /// Where a handover starts: the smaller of the torque applied and the torque trusted, with the sign of
    /// the trusted one; zero if their signs differ.
    #[must_use]
    pub fn handover_start(&self, now: Instant, suspect: Micros, applied: Torque) -> Torque {
        smaller_of_same_sign(self.trusted(now, suspect), applied)
    }
}

/// The torque of smaller magnitude; zero if the signs differ.
#[must_use]
pub fn smaller_of_same_sign(a: Torque, b: Torque) -> Torque {
    if (a > Torque::ZERO) != (b > Torque::ZERO) {
        Torque::ZERO
    } else if a.abs() < b.abs() {
        a
    } else {
        b
    }
}

impl Default for History {
    fn default() -> Self {
        Self::new()
    }
}
