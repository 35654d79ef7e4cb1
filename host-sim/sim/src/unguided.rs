//! When the guidance was away in a run, and why.
//!
//! Guidance is *away* while the ECU is in another mode than Active, or while its torque does not reach the column. The
//! channel [`unguided_cause`](haptic_log::trace::Sample::unguided_cause) of a trace says so in every sample, and so does a
//! file of it; [`stretches`] reads it back. A cause is *asked for* where the scenario or the host has it so: a failure,
//! a request taken back. All others are the ECU's own decision.
//!
//! Manual driving has no guidance that could be away. Not here: what the ECU decides (`haptic-core`).

use std::fmt;

use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;
use haptic_log::trace::{Sample, Trace};
use serde::{Serialize, Serializer};

use crate::action::WorldFaults;
use crate::guidance::Status;

/// Why the guidance is away.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cause {
    /// Its torque does not reach the column: the scenario's failure, or an action's.
    TorqueLost,
    /// The lane preview does not reach the ECU, again as the scenario or an action has it, and the ECU handed over.
    LaneLost,
    /// The host took its request back.
    RequestEnded,
    /// The vehicle is slower than is guided.
    TooSlow,
    /// The ECU ended it, and names no fault.
    Unnamed,
    /// The ECU ended it for these faults: their bits in the fault word.
    Faults(u32),
}

impl Cause {
    /// The causes that are no faults; the code of each is its place from -1 down.
    const PLAIN: [(Self, &str); 5] = [
        (Self::TorqueLost, "torque lost"),
        (Self::LaneLost, "lane preview lost"),
        (Self::RequestEnded, "request ended"),
        (Self::TooSlow, "too slow"),
        (Self::Unnamed, "no fault named"),
    ];

    /// Whether the scenario or the host has it so.
    #[must_use]
    pub const fn is_asked_for(self) -> bool {
        matches!(self, Self::TorqueLost | Self::LaneLost | Self::RequestEnded)
    }

    /// The value that the channel has for it: the ECU's fault word, or a number below zero.
    #[must_use]
    pub fn code(self) -> f64 {
        match self {
            Self::Faults(bits) => f64::from(bits),
            plain => {
                let place = Self::PLAIN.iter().position(|(cause, _)| *cause == plain);
                -1.0 - place.unwrap_or(0) as f64
            }
        }
    }

    /// The cause of a code; `None` for zero, with which guidance is not away, and for what is no code.
    #[must_use]
    pub fn from_code(code: f64) -> Option<Self> {
        if code > 0.0 {
            return Some(Self::Faults(code as u32));
        }
        let plain = Self::PLAIN.get((-1.0 - code) as usize);
        (code <= -1.0).then_some(plain?.0)
    }

    /// The cause for an ECU that has left Active.
    fn new(status: &Status, around: Circumstances) -> Self {
        let of_class = |class: FaultSet| match status.faults.common(class) {
            FaultSet::NONE => Self::Unnamed,
            faults => Self::Faults(faults.bits()),
        };
        match status.mode {
            Mode::Fade if around.request_ended => Self::RequestEnded,
            // A warning that no hand is felt may be there already, and is not why.
            Mode::Fade if around.are_too_slow() => Self::TooSlow,
            Mode::Fade => of_class(FaultSet::FADING),
            Mode::Handover if around.lost.lane_lost && status.faults.contains(Fault::LaneTimeout) => {
                Self::LaneLost
            }
            Mode::Handover => of_class(FaultSet::INPUT),
            _ => of_class(FaultSet::CRITICAL.union(FaultSet::LOCKING)),
        }
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Faults(bits) => f.pad(&names(FaultSet::from_bits(*bits))),
            plain => {
                let found = Self::PLAIN.iter().find(|(cause, _)| cause == plain);
                f.pad(found.map_or("", |(_, text)| *text))
            }
        }
    }
}

impl Serialize for Cause {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// The names of faults, joined by a plus.
#[must_use]
pub fn names(faults: FaultSet) -> String {
    let present = Fault::ALL.into_iter().filter(|fault| faults.contains(*fault));
    present
        .map(|fault| format!("{fault:?}"))
        .collect::<Vec<_>>()
        .join("+")
}

/// What an ECU does not say of why it leaves.
#[derive(Debug, Clone, Copy, Default)]
pub struct Circumstances {
    /// What is lost on the way to the ECU and from it.
    pub lost: WorldFaults,
    /// The host does not ask for guidance.
    pub request_ended: bool,
    /// The speed as the ECU's sensor has it, m/s.
    pub speed_m_per_s: f64,
    /// The least that is guided, m/s.
    pub least_speed_m_per_s: f64,
}

impl Circumstances {
    /// Whether the vehicle is slower than is guided, to a count of the bus.
    fn are_too_slow(&self) -> bool {
        self.speed_m_per_s < self.least_speed_m_per_s + SPEED_LSB_M_PER_S
    }
}

/// A count of speed on the bus, m/s.
const SPEED_LSB_M_PER_S: f64 = 1.0 / 256.0;

/// Follows a run step by step.
#[derive(Debug, Clone, Copy, Default)]
pub struct Watch {
    was_guided: bool,
    cause: Option<Cause>,
}

impl Watch {
    /// Takes what an ECU says in a step. Before it was Active for the first time nothing is away.
    #[inline]
    pub fn step(&mut self, status: &Status, around: Circumstances) {
        let is_active = status.mode == Mode::Active;
        self.was_guided |= is_active;
        if is_active && !around.lost.torque_lost {
            self.cause = None;
        } else if self.cause.is_none() && self.was_guided {
            self.cause = Some(if is_active {
                Cause::TorqueLost
            } else {
                Cause::new(status, around)
            });
        }
    }

    /// Why the guidance is away, if it is.
    #[must_use]
    pub const fn cause(&self) -> Option<Cause> {
        self.cause
    }
}

/// A stretch of a run without guidance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Unguided {
    /// When the guidance left, s.
    pub from_s: f64,
    /// When it was back, s; `None` if it was not in this run.
    pub until_s: Option<f64>,
    /// How long it was away, s: until it was back, or until the run ended.
    pub lasts_s: f64,
    /// Where it left, arc length, m.
    pub from_m: f64,
    /// Where it was back, or the run ended, m.
    pub to_m: f64,
    /// Why it left.
    pub why: Cause,
    /// Whether the scenario or the host has it so.
    pub asked_for: bool,
}

/// Without the last bits of a multiple of the sample time: 30.025, not 30.025000000000002.
fn to_us(time_s: f64) -> f64 {
    (time_s * 1e6).round() / 1e6
}

/// The stretches of a run without guidance, in order, to the time between two samples. `None` for a record that does not
/// say: a file of an earlier version.
#[must_use]
pub fn stretches(trace: &Trace) -> Option<Vec<Unguided>> {
    let same = |a: &Sample, b: &Sample| a.unguided_cause == b.unguided_cause;
    let mut parts = trace.samples.chunk_by(same).peekable();
    let mut found = Vec::new();
    while let Some(part) = parts.next() {
        let (Some(first), Some(last)) = (part.first(), part.last()) else {
            continue;
        };
        if first.unguided_cause.is_nan() {
            return None;
        }
        let back = parts.peek().and_then(|next| next.first());
        let to = back.unwrap_or(last);
        found.extend(Cause::from_code(first.unguided_cause).map(|why| Unguided {
            from_s: to_us(first.time_s),
            until_s: back.map(|sample| to_us(sample.time_s)),
            lasts_s: to_us(to.time_s - first.time_s),
            from_m: first.s_m,
            to_m: to.s_m,
            why,
            asked_for: why.is_asked_for(),
        }));
    }
    Some(found)
}
