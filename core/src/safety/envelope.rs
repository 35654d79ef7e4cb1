//! The torque envelope: the last word on every command. It knows nothing of the guidance law.
//!
//! All limits are judged on the torque that was really applied, which the caller hands in: the envelope
//! keeps no history of its own that could drift from the truth. Every clamp returns its reason; the reason
//! that won is the last one that acted.
//!
//! | limit | bound |
//! |---|---|
//! | absolute | abs(T) <= L |
//! | window | abs(T) grows by at most 1.2 N.m in 250 ms |
//! | wind-up | abs(T) grows by at most 4 N.m/s |
//! | reduction | abs(T) falls by at most 8 N.m/s, a rounding toward zero included; by 32 while its lane is implausible |
//! | driver override | from 0.8 N.m of opposing driver torque the bound shrinks by 3 N.m per N.m |

use crate::quantity::{Instant, Micros, Ratio, Torque, TorqueRate, per_second, product};
use crate::safety::redundant::words;

/// Which limit held the torque back.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[repr(u8)]
#[non_exhaustive]
pub enum LimitReason {
    /// No limit acted.
    #[default]
    None = 0,
    /// The absolute limit L.
    Absolute = 1,
    /// The growth within 250 ms.
    Window = 2,
    /// The rate of growth.
    WindUp = 3,
    /// The rate of reduction.
    Reduction = 4,
    /// The driver opposes.
    DriverOverride = 5,
    /// The mode allows no torque, or less than the law asks for.
    Mode = 6,
    /// The monitor withdrew its permission.
    Monitor = 7,
}

impl LimitReason {
    /// The reason of a code on the bus.
    #[must_use]
    pub const fn from_code(code: i64) -> Option<Self> {
        Some(match code {
            0 => Self::None,
            1 => Self::Absolute,
            2 => Self::Window,
            3 => Self::WindUp,
            4 => Self::Reduction,
            5 => Self::DriverOverride,
            6 => Self::Mode,
            7 => Self::Monitor,
            _ => return None,
        })
    }
}

words! {
    /// Limits of the torque; immutable once validated by [`crate::controller::params`].
    pub struct Envelope {
        /// L.
        pub(crate) absolute: Torque,
        /// Growth per second.
        pub(crate) wind_up: TorqueRate,
        /// Fall per second.
        pub(crate) reduction: TorqueRate,
    }
}

words! {
    /// The anchor of the window; everything else is handed in.
    pub struct EnvelopeState {
        anchor: Torque,
        anchor_at: Instant,
    }
}

/// What the envelope holds a wanted torque against.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Situation {
    /// The torque really applied until now.
    pub applied: Torque,
    /// Since when: the time that the rate limits may use.
    pub elapsed: Micros,
    /// The driver's torque on the wheel.
    pub driver: Torque,
}

/// Growth per [`WINDOW`].
pub const WINDOW_GROWTH: Torque = Torque::from_nm(1.2);
/// How many times as fast a distrusted torque falls. At 8 N.m/s a lie of 5 N.m moves the vehicle by 0.25 m beyond where it
/// goes without any torque, at 16 by 0.12 m, at 32 by 0.06 m (docs/decisions). At once it would be a blow.
const DISTRUSTED: i32 = 4;
/// Opposing driver torque at which the bound begins to shrink.
pub const OVERRIDE_FROM: Torque = Torque::from_nm(0.8);
/// How fast it shrinks, N.m per N.m.
pub const OVERRIDE_SLOPE: Ratio = Ratio::from_si(3.0);

/// Length of the window. Growth is counted from an anchor that moves up every 250 ms.
pub const WINDOW: Micros = Micros::from_ms(250);

/// A late step earns no more than this much of a rate limit: two ticks. A larger jump after a pause would
/// be felt as one.
const MAX_ELAPSED: Micros = Micros::from_ms(2);

/// What rounding a command toward zero may take away after this file has judged it: an LSB of the guidance
/// frame. Every other bound is an upper one, on which rounding toward zero is safe.
const ROUNDING: Torque = Torque::from_nm(1.0 / 4096.0);

impl EnvelopeState {
    /// No torque so far.
    #[must_use]
    pub const fn new(now: Instant) -> Self {
        Self {
            anchor: Torque::ZERO,
            anchor_at: now,
        }
    }
}

impl Envelope {
    /// The same for a torque that an implausible lane asked for: it falls faster.
    #[must_use]
    #[cold]
    pub fn distrusted(&self) -> Self {
        Self {
            reduction: self.reduction.times(DISTRUSTED),
            ..*self
        }
    }

    /// The nearest torque within the envelope, and which limit held it back.
    #[must_use]
    pub fn step(
        &self,
        state: &mut EnvelopeState,
        now: Instant,
        wanted: Torque,
        at: &Situation,
    ) -> (Torque, LimitReason) {
        if now.since(state.anchor_at) >= WINDOW {
            *state = EnvelopeState {
                anchor: at.applied,
                anchor_at: now,
            };
        }
        let mut command = (wanted, LimitReason::None);
        let window = state.anchor.abs().plus(WINDOW_GROWTH);
        // The usual case first: within both.
        if wanted.abs() > self.absolute.min(window) {
            // +-L: the driver must be able to override the guidance by hand (paper, section 3.2).
            hold(
                &mut command,
                self.absolute.opposite(),
                self.absolute,
                LimitReason::Absolute,
            );
            hold(&mut command, window.opposite(), window, LimitReason::Window);
        }
        self.hold_rates(&mut command, at);
        // Last, and exempt from the reduction limit: whatever else holds, the driver's hand wins at once.
        // Zero is always inside these bounds, so they can only make the torque smaller.
        let (low, high) = self.override_bounds(at.driver);
        hold(&mut command, low, high, LimitReason::DriverOverride);
        command
    }

    /// Growth against lateral jerk, reduction against the hole that a sudden loss tears into the steering.
    fn hold_rates(&self, command: &mut (Torque, LimitReason), at: &Situation) {
        let elapsed = at.elapsed.min(MAX_ELAPSED);
        let step = |rate: TorqueRate| Torque::from_fixed(per_second(rate.fixed(), elapsed));
        let growth = step(self.wind_up);
        let fall = step(self.reduction).minus(ROUNDING).max(Torque::ZERO);
        // Judged in the frame where the applied torque is positive.
        let mirror = at.applied < Torque::ZERO;
        let turn = |t: Torque| if mirror { t.opposite() } else { t };
        let applied = at.applied.abs();
        let mut turned = (turn(command.0), command.1);
        let high = applied.plus(growth);
        hold(&mut turned, Torque::MIN, high, LimitReason::WindUp);
        if applied > fall {
            let low = applied.minus(fall);
            hold(&mut turned, low, Torque::MAX, LimitReason::Reduction);
        } else {
            // Across zero: the old torque can fall to zero in this step, and the new one grows from there.
            let low = growth.opposite();
            hold(&mut turned, low, Torque::MAX, LimitReason::WindUp);
        }
        *command = (turn(turned.0), turned.1);
    }

    /// `clamp(L + 3*(T_d + 0.8), 0, L)` above, `-clamp(L + 3*(0.8 - T_d), 0, L)` below (defaults).
    fn override_bounds(&self, driver: Torque) -> (Torque, Torque) {
        let bound = |toward: Torque| {
            let margin = toward.plus(OVERRIDE_FROM);
            // The usual case first: on this side the driver does not oppose.
            if margin >= Torque::ZERO {
                return self.absolute;
            }
            let shrunk = Torque::from_wide(product(OVERRIDE_SLOPE.fixed(), margin.fixed()));
            // Between nothing, which leaves the wheel to the driver, and L, which is the limit anyway. Not
            // `clamp`, which panics where its bounds are out of order.
            self.absolute.plus(shrunk).min(self.absolute).max(Torque::ZERO)
        };
        (bound(driver.opposite()).opposite(), bound(driver))
    }
}

/// Clamps a command; a limit that changes it becomes its reason.
fn hold(command: &mut (Torque, LimitReason), low: Torque, high: Torque, reason: LimitReason) {
    let held = command.0.max(low).min(high);
    if held != command.0 {
        *command = (held, reason);
    }
}
