//! The heading of the vehicle and the direction of the line in the last half second.
//!
//! A camera's sample is 0 to 150 ms old when it arrives, and the near point of a preview reaches a place some time
//! after the far point was there. Both need the vehicle's heading at an earlier instant, which is the integral of its
//! yaw rate.
//!
//! The state is not kept twice: it is made of rings of 32 entries, of which a flipped bit spoils one. What the law
//! uses of it is bounded in [`crate::law`], so that a flip changes the torque by less than the monitor's band; in the
//! checks a flip can raise or hide a fault for one second.

use fixed::types::{I8F24, I22F10, I40F24};

use crate::quantity::{Instant, Micros, Radians, TurningRate, per_second, saturate, signed_quotient};

/// Entries of a ring. A power of two, so that the index is a mask.
const RING: usize = 32;
/// Least time between two stored directions of the line. With it the ring covers the time between near and far point.
const APART: Micros = Micros::from_ms(20);

/// How many entries back the direction lies with which the last one is compared for the rate of the bend. That is at
/// least 0.3 s, over which 2 mrad of noise make 0.01 rad/s.
const BEND: usize = 15;

/// The time over which the yaw rate before a sample is averaged, and how many such times a second has.
const BEFORE: Micros = Micros::from_ms(50);
const BEFORE_PER_S: i32 = 20;

/// The vehicle's heading at an instant, and its yaw rate from then on.
#[derive(Debug, Clone, Copy, Default)]
pub struct Heading {
    at: Instant,
    /// Heading relative to that at the start of the ECU, modulo 256 rad.
    psi: I8F24,
    /// The yaw rate.
    pub rate: TurningRate,
}

impl Heading {
    /// The heading at an earlier instant, if the yaw rate was the same before; for half a second at most.
    #[cold]
    fn earlier(&self, at: Instant) -> Self {
        let turned = per_second(self.rate.fixed(), self.at.since(at));
        Self {
            at,
            psi: self.psi.wrapping_sub(turned),
            rate: self.rate,
        }
    }

    /// The heading at this instant or a later one.
    fn psi_at(&self, at: Instant) -> I8F24 {
        self.psi
            .wrapping_add(per_second(self.rate.fixed(), at.since(self.at)))
    }
}

/// Directions of a line at the far point, relative to the same direction as the headings.
#[derive(Debug, Clone, Default)]
struct Line {
    directions: [(Instant, I8F24); RING],
    last: usize,
    /// How many entries are valid.
    known: usize,
}

impl Line {
    #[expect(clippy::indexing_slicing, reason = "a place is modulo the ring")]
    fn place(&self, back: usize) -> (Instant, I8F24) {
        self.directions[self.last.wrapping_sub(back) % RING]
    }
}

/// The rings of headings and of directions: of the line that is followed, and of another one that pictures show.
#[derive(Debug, Clone, Default)]
pub struct MotionHistory {
    headings: [Heading; RING],
    newest: usize,
    lines: [Line; 2],
    /// Which of the two is followed, modulo 2.
    followed: usize,
}

impl MotionHistory {
    /// Nothing is known yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Stores the yaw rate from now on.
    #[expect(clippy::indexing_slicing, reason = "a place is modulo the ring")]
    pub fn record_turning_rate(&mut self, now: Instant, rate: TurningRate) {
        let psi = self.headings[self.newest % RING].psi_at(now);
        self.newest = self.newest.wrapping_add(1);
        self.headings[self.newest % RING] = Heading { at: now, psi, rate };
    }

    /// The last heading stored before an instant. For an instant before the oldest entry, the heading that follows if
    /// the yaw rate was the same before.
    #[expect(clippy::indexing_slicing, reason = "a place is modulo the ring")]
    #[must_use]
    pub fn heading(&self, now: Instant, at: Instant) -> Heading {
        let age = now.since(at);
        let place = |back: usize| &self.headings[self.newest.wrapping_sub(back) % RING];
        let found = (0..RING).map(place).find(|heading| now.since(heading.at) >= age);
        found.map_or_else(|| place(RING.wrapping_sub(1)).earlier(at), |heading| *heading)
    }

    /// The angle that the vehicle turned from an instant until now, and its yaw rate before that instant. The rate is
    /// averaged over 50 ms, whose middle is as old as the law's filtered rates.
    #[must_use]
    pub fn turned(&self, now: Instant, from: Instant) -> (Radians, TurningRate) {
        let then = self.heading(now, from);
        let turned = self.heading(now, now).psi_at(now).wrapping_sub(then.psi_at(from));
        let earlier = from.before(BEFORE);
        let before = self.heading(now, earlier).psi_at(earlier);
        let rate = TurningRate::from_fixed(then.psi_at(from).wrapping_sub(before)).times(BEFORE_PER_S);
        (Radians::from_fixed(turned), rate)
    }

    /// Stores the direction of the line at the far point, which is `e_theta` relative to the vehicle's heading at
    /// `at`.
    #[expect(clippy::indexing_slicing, reason = "a place is modulo the ring")]
    pub fn record_line(&mut self, now: Instant, at: Instant, e_theta: Radians) {
        let direction = self.heading(now, at).psi_at(at).wrapping_add(e_theta.fixed());
        let line = &mut self.lines[self.followed % 2];
        if line.known == 0 || at.since(line.place(0).0) >= APART {
            line.last = line.last.wrapping_add(1);
            line.directions[line.last % RING] = (at, direction);
            line.known = line.known.saturating_add(1).min(RING);
        }
    }

    /// The direction that the line had at the far point at the time `before` an instant, relative to the vehicle's
    /// heading at that instant. `None` where the line was not yet known.
    #[must_use]
    pub fn line_direction(&self, now: Instant, at: Instant, before: Micros) -> Option<Radians> {
        let line = self.followed();
        let wanted = at.before(before);
        let age = now.since(wanted);
        // Bisection for the newest entry that is at least as old; entries further back are older.
        let (mut back, mut end) = (0, line.known);
        while back < end {
            let middle = back.wrapping_add(end) / 2;
            if now.since(line.place(middle).0) >= age {
                end = middle;
            } else {
                back = middle.saturating_add(1);
            }
        }
        if back >= line.known {
            return None;
        }
        let (from, direction) = line.place(back);
        // Linear interpolation to the next entry.
        let (to, next) = line.place(back.saturating_sub(1));
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

    /// The change of the line's direction at the far point relative to the vehicle's heading, from one instant to a
    /// later one, if the line keeps its present bend.
    #[must_use]
    pub fn direction_change(&self, now: Instant, from: Instant, to: Instant) -> Radians {
        let line = self.followed();
        let (newest, direction) = line.place(0);
        let (oldest, before) = line.place(line.known.saturating_sub(1).min(BEND));
        let bent = i64::from(direction.wrapping_sub(before).to_bits()).saturating_mul(1_000_000);
        let rate = I8F24::from_bits(signed_quotient(bent, newest.since(oldest).us()));
        let psi = |at: Instant| self.heading(now, at).psi_at(at);
        let turned = psi(to).wrapping_sub(psi(from));
        Radians::from_fixed(per_second(rate, to.since(from)).saturating_sub(turned))
    }

    #[expect(clippy::indexing_slicing, reason = "a place is modulo two")]
    fn followed(&self) -> &Line {
        &self.lines[self.followed % 2]
    }

    /// Follows the other line from now on.
    pub(crate) fn swap_lines(&mut self) {
        self.followed ^= 1;
    }

    /// Forgets the line, which was lost.
    #[expect(clippy::indexing_slicing, reason = "a place is modulo two")]
    pub fn forget_line(&mut self) {
        self.lines[self.followed % 2].known = 0;
    }
}
