//! How the vehicle turned, and where its line went, in the last half second.
//!
//! A camera's sample is 0 to 150 ms old when it arrives, and the near point of a preview comes to where its far point
//! was some time before. Both need the vehicle's heading at an earlier instant, which is the sum of its rate of turn.
//!
//! Not kept twice: rings of 32 places, of which a flip spoils one. What the law takes from here is bounded in
//! [`crate::law`], so that a flip moves the torque by less than the monitor's band; what the checks take can declare
//! or hide a fault for one second.

use fixed::types::{I8F24, I22F10, I40F24};

use crate::quantity::{Instant, Micros, Radians, TurningRate, per_second, saturate, signed_quotient};

/// A power of two, so that the place is a mask.
const RING: usize = 32;
/// Two directions of the line are kept so far apart, so that the ring holds the time between near and far point.
const APART: Micros = Micros::from_ms(20);

/// The line's bend is that between its last direction and one so many before: 0.3 s at least, over which 2 mrad of noise
/// make 0.01 rad/s.
const BEND: usize = 15;

/// The time over which the rate before a sample is taken, and how often it is in a second.
const BEFORE: Micros = Micros::from_ms(50);
const BEFORE_PER_S: i32 = 20;

/// The vehicle's heading at an instant, and the rate at which it turned from there.
#[derive(Debug, Clone, Copy)]
pub struct Heading {
    at: Instant,
    /// Against where it was when the ECU started, modulo 256 rad.
    psi: I8F24,
    /// The rate of turn.
    pub rate: TurningRate,
}

impl Heading {
    const NONE: Self = Self {
        at: Instant::from_us(0),
        psi: I8F24::ZERO,
        rate: TurningRate::ZERO,
    };

    /// The same at an instant before it, if it turned as fast before: for half a second at most.
    #[cold]
    fn earlier(&self, at: Instant) -> Self {
        let turned = per_second(self.rate.fixed(), self.at.since(at));
        Self {
            at,
            psi: self.psi.wrapping_sub(turned),
            rate: self.rate,
        }
    }

    /// The heading at an instant not before this one.
    fn psi_at(&self, at: Instant) -> I8F24 {
        self.psi
            .wrapping_add(per_second(self.rate.fixed(), at.since(self.at)))
    }
}

/// The rings.
#[derive(Debug, Clone)]
pub struct MotionHistory {
    headings: [Heading; RING],
    newest: usize,
    /// Directions of the line at the far point, in the frame of the headings.
    lines: [(Instant, I8F24); RING],
    last_line: usize,
    /// How many of them count.
    known_lines: usize,
}

impl MotionHistory {
    /// Nothing known.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            headings: [Heading::NONE; RING],
            newest: 0,
            lines: [(Instant::from_us(0), I8F24::ZERO); RING],
            last_line: 0,
            known_lines: 0,
        }
    }

    /// The rate of turn from now on.
    #[expect(clippy::indexing_slicing, reason = "a place is modulo the ring")]
    pub fn record_turning_rate(&mut self, now: Instant, rate: TurningRate) {
        let psi = self.headings[self.newest % RING].psi_at(now);
        self.newest = self.newest.wrapping_add(1);
        self.headings[self.newest % RING] = Heading { at: now, psi, rate };
    }

    /// The heading known last before an instant, or that of then if the vehicle turned as it did at the oldest.
    #[expect(clippy::indexing_slicing, reason = "a place is modulo the ring")]
    #[must_use]
    pub fn heading(&self, now: Instant, at: Instant) -> Heading {
        let age = now.since(at);
        let place = |back: usize| &self.headings[self.newest.wrapping_sub(back) % RING];
        let found = (0..RING).map(place).find(|heading| now.since(heading.at) >= age);
        found.map_or_else(|| place(RING.wrapping_sub(1)).earlier(at), |heading| *heading)
    }

    /// How far the vehicle turned from an instant until now, and the rate at which it turned before then: over 50 ms, the
    /// middle of which is as old as the law's filtered rates are.
    #[must_use]
    pub fn turned(&self, now: Instant, from: Instant) -> (Radians, TurningRate) {
        let then = self.heading(now, from);
        let turned = self.heading(now, now).psi_at(now).wrapping_sub(then.psi_at(from));
        let earlier = from.before(BEFORE);
        let before = self.heading(now, earlier).psi_at(earlier);
        let rate = TurningRate::from_fixed(then.psi_at(from).wrapping_sub(before)).times(BEFORE_PER_S);
        (Radians::from_fixed(turned), rate)
    }

    /// The direction of the line at the far point, `e_theta` from the vehicle's heading at `at`.
    #[expect(clippy::indexing_slicing, reason = "a place is modulo the ring")]
    pub fn record_line(&mut self, now: Instant, at: Instant, e_theta: Radians) {
        let direction = self.heading(now, at).psi_at(at).wrapping_add(e_theta.fixed());
        if self.known_lines == 0 || at.since(self.lines[self.last_line % RING].0) >= APART {
            self.last_line = self.last_line.wrapping_add(1);
            self.lines[self.last_line % RING] = (at, direction);
            self.known_lines = self.known_lines.saturating_add(1).min(RING);
        }
    }

    /// The direction of the line `before` an instant, against the vehicle's heading at that instant: where the far point
    /// was then. `None` where that is longer ago than the line is known.
    #[expect(clippy::indexing_slicing, reason = "a place is modulo the ring")]
    #[must_use]
    pub fn line_direction(&self, now: Instant, at: Instant, before: Micros) -> Option<Radians> {
        let place = |back: usize| self.lines[self.last_line.wrapping_sub(back) % RING];
        let wanted = at.before(before);
        let age = now.since(wanted);
        // The first that is as old, by halving: the further back, the older.
        let (mut back, mut end) = (0, self.known_lines);
        while back < end {
            let middle = back.wrapping_add(end) / 2;
            if now.since(place(middle).0) >= age {
                end = middle;
            } else {
                back = middle.saturating_add(1);
            }
        }
        if back >= self.known_lines {
            return None;
        }
        let (from, direction) = place(back);
        // Straight from there to the one after.
        let (to, next) = place(back.saturating_sub(1));
        let (span, done) = (to.since(from).us(), wanted.since(from).us());
        let share = done
            .min(100_000)
            .wrapping_shl(10)
            .checked_div(span)
            .unwrap_or(0)
            .min(1 << 10);
        let share = I22F10::from_bits(share.cast_signed());
        let way = I40F24::wrapping_from_num(next.wrapping_sub(direction).wide_mul(share));
        let direction = direction.wrapping_add(saturate(way));
        let psi = self.heading(now, at).psi_at(at);
        Some(Radians::from_fixed(direction.wrapping_sub(psi)))
    }

    /// By how much the direction of the line at the far point changes, against the vehicle's heading, from one instant to a
    /// later one if the line goes on to bend as it did.
    #[expect(clippy::indexing_slicing, reason = "a place is modulo the ring")]
    #[must_use]
    pub fn direction_change(&self, now: Instant, from: Instant, to: Instant) -> Radians {
        let place = |back: usize| self.lines[self.last_line.wrapping_sub(back) % RING];
        let (newest, direction) = place(0);
        let (oldest, before) = place(self.known_lines.saturating_sub(1).min(BEND));
        let bent = i64::from(direction.wrapping_sub(before).to_bits()).saturating_mul(1_000_000);
        let rate = I8F24::from_bits(signed_quotient(bent, newest.since(oldest).us()));
        let psi = |at: Instant| self.heading(now, at).psi_at(at);
        let turned = psi(to).wrapping_sub(psi(from));
        Radians::from_fixed(per_second(rate, to.since(from)).saturating_sub(turned))
    }

    /// The line was lost.
    pub fn forget_line(&mut self) {
        self.known_lines = 0;
    }
}

impl Default for MotionHistory {
    fn default() -> Self {
        Self::new()
    }
}
