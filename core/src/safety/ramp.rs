//! Ramps that take the last trusted torque to zero.
//!
//! A sudden loss of guidance as a curve begins takes a relying driver 0.44 to 0.62 m off the centreline; the same
//! torque faded over 2 s while the driver takes over keeps the peak near what it was. Elsewhere in a curve, and for
//! drivers who take over sooner or later, a fade is worth less (docs/decisions/001). Where the driver pushes against
//! the torque, the ramp is faster. No ramp ever grows.

use fixed::types::I8F24;

use crate::quantity::{Instant, Micros, Ratio, Torque, TorqueRate, share_of, signed_quotient};
use crate::safety::redundant::words;

/// How long a handover lasts. With 1 s it costs more in an arc, with 3 s more as an arc ends.
pub const HANDOVER: Micros = Micros::from_ms(2000);
/// How long a handover lasts at least after the lane was extrapolated.
pub const GONE_ON: Micros = Micros::from_ms(1000);
/// How many times as fast a handover is without a driver torque, where the override limit cannot act: it takes 1 s.
const WITHOUT_COLUMN: u32 = 2;
/// How many times as fast a handover is with an implausible column, which may hide a driver who pushes: it takes 0.5
/// s, or longer from 5 N.m, where the reduction limit holds it.
const IMPLAUSIBLE_COLUMN: u32 = 4;
/// How many times as fast a handover is while the driver pushes against the torque. From 5 N.m that is 7.5 N.m/s: the
/// largest whole number that keeps the reduction limit.
pub const OPPOSED: u32 = 3;
/// A larger opposing driver torque counts as a push: this is the largest offset of an ordinary torque sensor.
pub const OPPOSES: Torque = Torque::from_nm(0.1);

/// How many times as fast a handover is. It depends on the driver torque, `None` if that is not known, and on whether
/// the column is plausible.
#[must_use]
pub fn pace(applied: Torque, driver: Option<Torque>, is_plausible: bool) -> u32 {
    if !is_plausible {
        return IMPLAUSIBLE_COLUMN;
    }
    let Some(driver) = driver else {
        return WITHOUT_COLUMN;
    };
    let against = if applied < Torque::ZERO {
        driver
    } else {
        driver.opposite()
    };
    if applied != Torque::ZERO && against > OPPOSES {
        OPPOSED
    } else {
        1
    }
}

/// The length of a handover that begins when the trust in the lane has already fallen. Without a picture trust falls
/// as fast as the torque of a handover, so this continues the same straight line; but it takes at least [`GONE_ON`],
/// which a driver needs to take over.
#[must_use]
pub fn handover_length(trust: Ratio) -> Micros {
    let left = share_of(trust.fixed(), I8F24::from_bits(HANDOVER.us().cast_signed()));
    Micros::from_us(left.to_bits().cast_unsigned()).max(GONE_ON)
}

words! {
    /// A straight line from a torque to zero.
    pub struct Ramp {
        from: Torque,
        length: Micros,
        done: Micros,
    }
}

impl Ramp {
    /// A ramp that has ended.
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

    /// Advances by `elapsed` and returns the torque.
    #[must_use]
    pub fn step(&mut self, elapsed: Micros) -> Torque {
        self.done = Micros::from_us(self.done.us().saturating_add(elapsed.us()));
        let left = i64::from(self.length.us().saturating_sub(self.done.us()));
        // A product of 32 and 31 bits fits in 64.
        let torque = i64::from(self.from.bits()).wrapping_mul(left);
        // The length is never zero by construction; a division that truncates never grows the torque.
        Torque::from_bits(signed_quotient(torque, self.length.us()))
    }

    /// Whether zero is reached.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.done >= self.length
    }
}

/// The outputs of the last 250 ms, one every 5 ms, and of the last 2.5 s, one every 40 ms.
///
/// Not kept twice: wherever a flipped bit puts the start of a handover, it lies between zero and the torque
/// applied. Fixed arrays, so that a flip can do nothing else.
#[derive(Debug, Clone)]
pub struct TorqueHistory {
    fine: Outputs,
    coarse: Outputs,
}

/// Spacing of the remembered outputs, of the newest 250 ms and of the rest.
pub const FINE: Micros = Micros::from_ms(5);
const COARSE: Micros = Micros::from_ms(40);
/// What the fine history reaches back to, with a place to spare.
const FINE_SPAN: Micros = Micros::from_ms(300);
/// A power of two, so that the place is a mask.
const RING: usize = 64;

/// A ring of outputs.
#[derive(Debug, Clone)]
struct Outputs {
    ring: [(Instant, Torque); RING],
    /// Where the newest is. Every number names a place, modulo the ring.
    newest: usize,
}

impl Outputs {
    const NONE: Self = Self {
        ring: [(Instant::from_us(0), Torque::ZERO); RING],
        newest: 0,
    };

    /// The output that is `back` places older than the newest.
    #[expect(clippy::indexing_slicing, reason = "a place is modulo the ring")]
    const fn output(&self, back: usize) -> (Instant, Torque) {
        self.ring[self.newest.wrapping_sub(back) % RING]
    }

    /// Takes an output if it is so long after the last; whether it did.
    #[expect(clippy::indexing_slicing, reason = "a place is modulo the ring")]
    fn push(&mut self, now: Instant, torque: Torque, every: Micros) -> bool {
        let is_due = now.since(self.output(0).0) >= every;
        if is_due {
            self.newest = self.newest.wrapping_add(1);
            self.ring[self.newest % RING] = (now, torque);
        }
        is_due
    }

    /// The last output before `suspect` time ago; zero if that is longer ago than the ring reaches.
    fn before(&self, now: Instant, suspect: Micros) -> Torque {
        let mut outputs = (0..RING).map(|back| self.output(back));
        let before = outputs.find(|(at, _)| now.since(*at) > suspect);
        before.map_or(Torque::ZERO, |(_, torque)| torque)
    }
}

impl TorqueHistory {
    /// Nothing applied yet.
    pub const NEW: Self = Self {
        fine: Outputs::NONE,
        coarse: Outputs::NONE,
    };

    /// Remembers an output. The coarse ring is asked only where the fine one took it.
    pub fn push(&mut self, now: Instant, torque: Torque) {
        if self.fine.push(now, torque, FINE) {
            self.coarse.push(now, torque, COARSE);
        }
    }

    /// The last output before `suspect` time ago; zero if there was none, or if that is longer ago than 2.5 s.
    #[must_use]
    pub fn trusted(&self, now: Instant, suspect: Micros) -> Torque {
        let outputs = if suspect < FINE_SPAN {
            &self.fine
        } else {
            &self.coarse
        };
        outputs.before(now, suspect)
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
