//! The table of faults: what a row is, and all of them. The rows themselves are in `inputs`, `bus`, `time` and `memory`.
//!
//! | class | when | what |
//! |---|---|---|
//! | L | an extreme but valid input | limit, stay Active |
//! | R | a bad frame | reject it, go on with the last good one |
//! | A | the request ends, the vehicle is too slow | planned fade |
//! | B | an input is lost or cannot be true | handover over 2 s |
//! | C | computation, memory, time, output | zero within 20 ms, latched |
//! | D | the driver opposes | the override bound, at once |

use std::fmt;

use haptic_core::controller::params::Params;
use haptic_sim::models::nonlinear::WorldParameters;
use haptic_sim::models::torsion_bar::ColumnFault;
use serde::Serialize;

use super::bytes::{FAULT, HANDOVER};
use super::drivers::Limits;
use super::injection::{Hand, Injection, Motor, Start, first_of};
use super::residual::Detectability;

/// A run ends so long after the onset, ms.
pub(super) const AFTER_MS: u32 = 5200;
/// A run with a lie that takes its time ends so long after the onset, ms.
pub(super) const LONG_AFTER_MS: u32 = 9000;

/// Rows, one line each: name, what is injected, the injections, and what is other than in a row that goes on ([`build`]).
macro_rules! rows {
    ($($name:literal $injected:literal $injections:tt $(.$method:ident($($argument:expr),*))*;)*) => {
        &[$($crate::table::row($name, $injected, &$injections)$(.$method($($argument),*))*),*]
    };
}

mod attacks;
mod bar;
mod build;
mod bus;
mod inputs;
mod lies;
mod memory;
mod time;
mod vehicle;

/// Class of a reaction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Class {
    /// Limit and go on.
    L,
    /// Reject and go on.
    R,
    /// Planned fade.
    A,
    /// Handover.
    B,
    /// Zero at once.
    C,
    /// Leave it to the driver.
    D,
}

impl Class {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::L, Self::R, Self::A, Self::B, Self::C, Self::D];
}

impl fmt::Display for Class {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&format!("{self:?}"))
    }
}

/// Where a row is run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Place {
    /// Here only.
    Host,
    /// Here, and on the target in QEMU.
    Both,
    /// On the target only: a host has no watchdog, no stack to overflow.
    Target,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Host => "host",
            Self::Both => "host, Q",
            Self::Target => "Q",
        })
    }
}

/// What has to happen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Expect {
    /// Guidance goes on; no frame that was tampered with is accepted if `rejects`.
    GoesOn {
        /// Whether tampered frames must be rejected.
        rejects: bool,
    },
    /// Guidance goes on and no limit for the driver's sake acts.
    Uncut,
    /// Guidance goes on until the fault can be seen, and may then hand over.
    MayHandOver,
    /// Nothing but the rules of every cycle.
    OnlyRules,
    /// Hands over or stops for good.
    HandsOverOrStops,
    /// The first mode after Active, or after a fade where there is one on the way.
    Reaches {
        /// The mode.
        mode: u64,
        /// Whether a fade may come before.
        fading: bool,
    },
    /// The ECU starts anew with this cause in its status frame, and waits in Standby.
    Restarts {
        /// The cause.
        reset: u64,
    },
    /// The torque is zero in Active while the driver opposes.
    Yields,
}

/// One fault of the list.
#[derive(Debug, Clone, Copy)]
pub struct FaultCase {
    /// By which it is asked for.
    pub name: &'static str,
    /// What is injected.
    pub injected: &'static str,
    /// Class of the reaction.
    pub class: Class,
    /// What has to happen.
    pub expect: Expect,
    /// Within this time of the instant in which the fault can be seen, ms.
    pub deadline_ms: u32,
    /// What it can be seen by.
    pub seen: Detectability,
    /// Largest torque from the onset on, N.m.
    pub torque_nm: f64,
    /// Where it is run.
    pub place: Place,
    pub(super) injections: &'static [Injection],
    /// How long it lasts, ms; to the end of the run if `None`.
    pub(super) lasts_ms: Option<u32>,
    pub(super) start: Start,
    /// Whether the onset follows a lane preview, and not any instant.
    pub(super) after_sample: bool,
    /// Where on the road it begins, if not anywhere.
    pub(super) place_on_road: Option<PlaceOnRoad>,
    /// How far its lie may take the vehicle, m, if that is not the drivers' limit: nothing or little contradicts it, and who relies
    /// follows it. For those who keep the lane in a real car, and for the paper's. The share that leaves the lane is stated only.
    pub(super) lie_m: Option<[f64; 2]>,
    /// How long the run goes on behind the onset, ms.
    pub(super) after_ms: u32,
    /// What is less than ideal about the car or the road from the start.
    pub(super) plant: Option<fn(&mut WorldParameters)>,
    /// What the ECU is told wrong of its bar, from the start of the run on; the fault-free run is that of an ECU that is told right.
    pub(super) told: Option<fn(&mut Params)>,
}

impl FaultCase {
    /// This row in a curve, where what is wrong with an input has to show.
    #[must_use]
    pub fn in_a_curve(&self) -> Self {
        Self {
            place_on_road: Some(PlaceOnRoad::In),
            ..*self
        }
    }
}

/// Where on its road a run is when the fault begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PlaceOnRoad {
    /// On a straight, a curve ahead.
    Before,
    /// In a curve.
    In,
    /// On a straight behind a curve.
    After,
}

/// A list of rows under a heading.
#[derive(Debug, Clone, Copy)]
pub struct Group {
    /// Its name.
    pub name: &'static str,
    /// Its rows.
    pub rows: &'static [FaultCase],
}

/// Every row.
pub const GROUPS: [Group; 8] = [
    Group {
        name: "Inputs",
        rows: inputs::ROWS,
    },
    Group {
        name: "Bus",
        rows: bus::ROWS,
    },
    Group {
        name: "Time",
        rows: time::ROWS,
    },
    Group {
        name: "Memory and power",
        rows: memory::ROWS,
    },
    Group {
        name: "Camera, motor and road",
        rows: vehicle::ROWS,
    },
    Group {
        name: "Lies that fit together",
        rows: lies::ROWS,
    },
    Group {
        name: "Attacks by legal frames",
        rows: attacks::ROWS,
    },
    Group {
        name: "Torsion bar",
        rows: bar::ROWS,
    },
];

/// Every row, in order.
pub fn rows() -> impl Iterator<Item = &'static FaultCase> {
    GROUPS.iter().flat_map(|group| group.rows)
}

/// Reaction to an input that is stale: 30 ms of age, seen in the next cycle. The last good sample may be older
/// than the onset, never younger.
const STALE_MS: u32 = 31;
/// Reaction to a lane that is lost: guidance goes on for a second without a picture.
const BLIND_MS: u32 = STALE_MS + 1001;
/// Reaction to pictures of a line elsewhere that comes no nearer: four seconds.
const ELSEWHERE_MS: u32 = STALE_MS + 4001;
/// Reaction to speeds that step or are apart: 0.3 s are ridden out, with a message or two of 10 ms.
const SLIP_MS: u32 = STALE_MS + 320;
/// Reaction to a contradiction, from the instant in which it can be seen.
const CONTRADICTION_MS: u32 = 200;
/// From the instant in which the motor delivers what no honest one would, if it goes on: 10 ms of patience, two
/// periods of the column, and the cycle in which it is seen.
const MOTOR_MS: u32 = 15;
/// From the instant in which torque is missing: 50 ms of patience, two periods of the column, and the cycle in which it
/// is seen.
pub(super) const WEAK_MS: u32 = 55;
/// Torque in ordinary curves and through a jerk of the wheel. Measured peaks are below it; the point is that
/// no fault may draw more.
const ORDINARY_NM: f64 = 2.0;

/// A row that goes on unless it says otherwise.
const fn row(name: &'static str, injected: &'static str, injections: &'static [Injection]) -> FaultCase {
    FaultCase {
        name,
        injected,
        class: Class::L,
        expect: Expect::GoesOn { rejects: false },
        deadline_ms: 0,
        seen: Detectability::AtOnce,
        torque_nm: ORDINARY_NM,
        place: Place::Host,
        injections,
        lasts_ms: None,
        start: Start::Engaged,
        after_sample: false,
        place_on_road: None,
        lie_m: None,
        after_ms: AFTER_MS,
        plant: None,
        told: None,
    }
}

impl FaultCase {
    /// Whether guidance has to end: by a handover, or for good.
    pub fn asks_to_leave(&self) -> bool {
        match self.expect {
            Expect::HandsOverOrStops => true,
            Expect::Reaches { mode, .. } => matches!(mode, HANDOVER | FAULT) && self.start == Start::Engaged,
            _ => false,
        }
    }

    /// Whether guidance may end, because something is wrong that the ECU may notice.
    pub fn may_leave(&self) -> bool {
        self.asks_to_leave() || matches!(self.expect, Expect::MayHandOver | Expect::OnlyRules)
    }

    /// Whether the motor does what the ECU says, so that the ECU decides where the vehicle goes.
    pub(super) fn obeys(&self) -> bool {
        !self.injections.contains(&Injection::Motor(Motor::Stuck))
    }

    /// Whether the absolute limits judge where the vehicle goes: the ECU decides it, and no hand pulls that the fault-free run
    /// does not have.
    pub(super) fn is_limited(&self) -> bool {
        let opposes = |one: &Injection| matches!(one, Injection::Hand(Hand::Opposes { .. }));
        self.obeys() && !self.injections.iter().any(opposes)
    }

    /// What of a column with a bar fails at the onset, if anything does.
    pub(super) fn column_fault(&self) -> Option<ColumnFault> {
        first_of!(self.injections, Injection::Column(fault) => *fault)
    }

    /// Why a world whose column has a bar, or has none, cannot have this row; `None` if it can.
    pub fn left_out(&self, has_bar: bool) -> Option<&'static str> {
        if !has_bar {
            let is_of_a_bar = self.told.is_some() || self.column_fault().is_some();
            return is_of_a_bar.then_some("its column has no torsion bar");
        }
        let mut plant = WorldParameters::default();
        self.plant?(&mut plant);
        match plant {
            WorldParameters { friction_nm, .. } if friction_nm != 0.0 => {
                Some("its wheel and column have their own friction")
            }
            WorldParameters { assist_nm, .. } if assist_nm != 0.0 => Some("its column has its own assist"),
            WorldParameters { motor_lag_s, .. } if motor_lag_s != 0.0 => {
                Some("the lag of its motor is that of its assist")
            }
            _ => None,
        }
    }

    /// The limits of these drivers for this row.
    pub(super) fn limits(&self, drivers: Limits) -> Limits {
        self.lie_m.map_or(drivers, |[keepers_m, papers_m]| Limits {
            deviation_m: if drivers.left_lane.is_some() {
                keepers_m
            } else {
                papers_m
            },
            left_lane: None,
            ..drivers
        })
    }

    /// The latest a reaction may come after the fault can be seen, ms; `None` where none is asked for.
    pub fn deadline_ms(&self) -> Option<u32> {
        let asked = !matches!(
            self.expect,
            Expect::GoesOn { .. } | Expect::Uncut | Expect::MayHandOver | Expect::OnlyRules
        );
        asked.then_some(self.deadline_ms)
    }
}
