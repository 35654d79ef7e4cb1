//! The torque envelope limits every command last, whatever the guidance law demanded. It knows nothing of the law.
//!
//! All limits start from the torque that was really applied, which the caller passes in: the envelope keeps no
//! history of its own that could differ from it. Every limit that changes the command is reported; if several do, the
//! last one is.
//!
//! | limit | bound |
//! |---|---|
//! | absolute | abs(T) <= L |
//! | window | abs(T) grows by at most 1.2 N.m in 250 ms |
//! | wind-up | abs(T) grows by at most 4 N.m/s |
//! | reduction | abs(T) falls by at most 8 N.m/s, a rounding toward zero included; by 32 while its lane is implausible |
//! | driver override | from 0.8 N.m of opposing driver torque the bound shrinks by 3 N.m per N.m; at once, or by at most 64 N.m/s ([`Yielding`]) |

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
    /// The limit on the growth within 250 ms.
    Window = 2,
    /// The limit on the rate of growth.
    WindUp = 3,
    /// The limit on the rate of reduction.
    Reduction = 4,
    /// The driver opposes the torque.
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
    /// The anchor of the window: the torque applied at its start, and when that was.
    pub struct EnvelopeState {
        anchor: Torque,
        anchor_at: Instant,
    }
}

/// The circumstances that limit a wanted torque.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Situation {
    /// The torque really applied until now.
    pub applied: Torque,
    /// Time since the last step, for the rate limits.
    pub elapsed: Micros,
    /// The driver's torque on the wheel.
    pub driver: Torque,
    /// How it is yielded to.
    pub yielding: Yielding,
}

/// How a torque yields to the driver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Yielding {
    /// In the same step: to a torque that a sensor measures.
    AtOnce,
    /// By at most 64 N.m/s: to an estimate. What it is made of shows the hand later, so that nobody can judge a faster fall.
    Gradually,
}

/// Growth per [`WINDOW`].
pub const WINDOW_GROWTH: Torque = Torque::from_nm(1.2);
/// How many times as fast a torque falls that an implausible lane demanded. A wrong torque of 5 N.m that falls at 8
/// N.m/s moves the vehicle by 0.25 m beyond where it goes without any torque, at 16 N.m/s by 0.12 m, at 32 N.m/s by
/// 0.06 m (docs/decisions/003). A drop in one step would be felt as a blow.
const DISTRUSTED: i32 = 4;
/// Opposing driver torque at which the bound begins to shrink.
pub const OVERRIDE_FROM: Torque = Torque::from_nm(0.8);
/// How much the bound shrinks for each N.m of opposing torque beyond that, N.m per N.m.
pub const OVERRIDE_SLOPE: Ratio = Ratio::from_si(3.0);

/// How fast a torque yields to an estimated hand: 5 N.m are gone after 78 ms.
const YIELD_RATE: TorqueRate = TorqueRate::from_nm_per_s(64.0);

/// Length of the window. Growth is counted from an anchor that moves up every 250 ms.
pub const WINDOW: Micros = Micros::from_ms(250);

/// Longest time for which one step uses the rate limits: two ticks. After a longer pause a larger change would be
/// felt as a jump.
const MAX_ELAPSED: Micros = Micros::from_ms(2);

/// Room for the rounding of a command toward zero in the guidance frame: one LSB. The bound on the reduction is the
/// only lower one; on upper bounds rounding toward zero is safe.
const ROUNDING: Torque = Torque::from_nm(1.0 / 4096.0);

impl EnvelopeState {
    /// No torque has been applied.
    #[must_use]
    pub const fn new(now: Instant) -> Self {
        Self {
            anchor: Torque::ZERO,
            anchor_at: now,
        }
    }
}

impl Envelope {
    /// The envelope for a torque that an implausible lane demanded: it falls faster.
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
    #[inline(always)]
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
        // The override comes last and is not held by the reduction limit: the driver's hand wins. Zero is always inside
        // these bounds, so they can only make the torque smaller.
        let (mut low, mut high) = self.override_bounds(at.driver);
        if at.yielding == Yielding::Gradually {
            let fall = fall(YIELD_RATE, at.elapsed);
            (low, high) = (low.min(at.applied.plus(fall)), high.max(at.applied.minus(fall)));
        }
        hold(&mut command, low, high, LimitReason::DriverOverride);
        command
    }

    /// Applies the rate limits: growth is limited because of lateral jerk, reduction because a sudden loss of torque
    /// disturbs the steering.
    fn hold_rates(&self, command: &mut (Torque, LimitReason), at: &Situation) {
        let growth = within(self.wind_up, at.elapsed);
        let fall = fall(self.reduction, at.elapsed);
        // Signs are mirrored so that the applied torque is positive.
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

    /// The lowest and the highest torque that the driver's torque T_d allows: `-clamp(L + 3*(0.8 - T_d), 0, L)` and
    /// `clamp(L + 3*(T_d + 0.8), 0, L)` with the default values.
    fn override_bounds(&self, driver: Torque) -> (Torque, Torque) {
        let bound = |toward: Torque| {
            let margin = toward.plus(OVERRIDE_FROM);
            // The usual case first: on this side the driver does not oppose.
            if margin >= Torque::ZERO {
                return self.absolute;
            }
            let shrunk = Torque::from_wide(product(OVERRIDE_SLOPE.fixed(), margin.fixed()));
            // The bound lies between zero, which leaves the wheel to the driver, and L. This is not `clamp`, which
            // panics where its bounds are out of order.
            self.absolute.plus(shrunk).min(self.absolute).max(Torque::ZERO)
        };
        (bound(driver.opposite()).opposite(), bound(driver))
    }
}

/// What a rate allows in a step. A longer pause than [`MAX_ELAPSED`] counts no more.
fn within(rate: TorqueRate, elapsed: Micros) -> Torque {
    Torque::from_fixed(per_second(rate.fixed(), elapsed.min(MAX_ELAPSED)))
}

/// By how much a torque may fall in a step.
fn fall(rate: TorqueRate, elapsed: Micros) -> Torque {
    within(rate, elapsed).minus(ROUNDING).max(Torque::ZERO)
}

/// Clamps a command; a limit that changes it becomes its reason.
fn hold(command: &mut (Torque, LimitReason), low: Torque, high: Torque, reason: LimitReason) {
    let held = command.0.max(low).min(high);
    if held != command.0 {
        *command = (held, reason);
    }
}
