//! Worlds by name: from the one on paper to what roads, winds, cars and cameras are, and beyond.
//!
//! A world is a kind: each drive in it meets another car, another wind and another road.

use crate::models::disturbances::SensorErrors;
use crate::models::nonlinear::{Tyres, WorldParameters};
use crate::models::tolerances::Tolerances;
use crate::models::torsion_bar::{
    AngleSensor, AssistParameters, ColumnKind, ColumnParameters, CurveChoice, Usual,
};
use crate::scenario::{GuidanceParameters, ScenarioBuilder};

/// How a road lies across.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Fall to the right on a straight.
    pub crossfall: f64,
    /// Most superelevation of a curve.
    pub superelevation: f64,
}

impl Surface {
    /// No bank anywhere.
    pub const FLAT: Self = Self {
        crossfall: 0.0,
        superelevation: 0.0,
    };

    /// Bank of a straight, rad: a fall to the right leaves the left edge higher.
    pub fn straight_rad(&self) -> f64 {
        self.crossfall.atan()
    }

    /// Bank of a curve, rad, whose lateral acceleration (left positive) is that share of the sharpest curve's: as design
    /// rules have it, from the crossfall up, the outer edge higher.
    pub fn curve_rad(&self, share: f64) -> f64 {
        let steep = self
            .crossfall
            .max(self.superelevation * share.abs())
            .min(self.superelevation);
        -steep.atan().copysign(share)
    }
}

/// A world to drive in.
#[derive(Debug, PartialEq)]
pub struct WorldKind {
    /// By which it is asked for.
    pub name: &'static str,
    /// What it has beyond the paper's world, in words.
    pub what: &'static str,
    /// Whether roads and cars are like that, so that every declaration is one too many.
    pub judged: bool,
    /// Whether it has all of [`EVERYTHING`] beside its parts.
    everything: bool,
    parts: &'static [Part],
}

/// One thing that is real.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    /// Dry friction of the column, 0.2 to 0.4 N.m.
    Friction,
    /// Tyres that saturate, a trail that falls.
    Tyres,
    /// Each car another.
    Tolerances,
    /// Crossfall 2.5 %, superelevation to 6 %.
    Bank,
    /// Gusts to 600 N and 300 N.m.
    Wind,
    /// A motor with lag, error and ripple, each car another.
    Motor,
    /// A boost curve.
    Assist,
    /// A torsion bar, its assist, and an ECU that is told of it.
    Bar,
    /// Delay, jitter and noise of a production camera.
    Camera,
    /// A road of mu 0.3, and curves to 3 m/s2.
    Slippery,
    /// Superelevation to 10 %.
    Steep,
    /// A camera that sees nothing for half a second, 30 times an hour.
    Blind,
    /// A speed that falls and rises by up to 3 m/s2.
    Braking,
    /// Gusts at bridges: 1 kN within 0.3 s.
    Gusts,
    /// What happens now and then, see [`Happens`].
    Blinks,
    Slips,
    Works,
    LaneChanges,
    Fades,
    NoYawRate,
}

/// What happens to honest inputs now and then.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Happens {
    /// The camera sees nothing for a while.
    pub blinks: bool,
    /// The wheels slip or lock.
    pub slips: bool,
    /// The line moves aside, and back.
    pub works: bool,
    /// A lane change by hand of which nobody is told.
    pub lane_changes: bool,
    /// A yaw rate dies slowly, and a speed drifts.
    pub fades: bool,
    /// No yaw rate is measured.
    pub no_yaw_rate: bool,
}

use Part::{Assist, Bank, Blind, Braking, Camera, Friction, Gusts, Motor, Slippery, Steep, Wind};

/// Every world, from paper to beyond.
pub const WORLDS: [WorldKind; 23] = [
    world("calibrated", "a calibrated car, flat road, no friction", &[]),
    world(
        "friction",
        "friction 0.2 to 0.4 N.m, saturating tyres",
        &[Friction, Part::Tyres],
    ),
    world(
        "tolerances",
        "tyres and trail +-15 %, load to 300 kg, wheel angle 1 deg sd, torque sensor 0.08 N.m sd, camera yaw 1.5 mrad sd",
        &[Part::Tolerances],
    ),
    world(
        "bank",
        "crossfall 2.5 %, superelevation to 6 %, friction, gusts to 600 N and 300 N.m",
        &[Bank, Friction, Wind],
    ),
    world(
        "everything",
        "friction, tyres, tolerances, bank and wind together",
        EVERYTHING,
    ),
    more(
        "motor",
        "everything, and a motor with 2 to 20 ms of lag, 10 % of error, 0.02 N.m of ripple",
        &[Motor],
    ),
    more(
        "assist",
        "everything, and a power assist of 8 N.m at 3 N.m of driver torque, half of it at 60 km/h",
        &[Assist],
    ),
    world(
        "bar",
        "a torsion bar with friction of 0.1 and 0.3 N.m, and the medium assist, as in examples/torsion-bar.toml",
        &[Part::Bar],
    ),
    more(
        "bar-everything",
        "everything, with the column of bar, its friction and its assist",
        &[Part::Bar],
    ),
    more(
        "bar-braking",
        "bar-everything, and the speed of braking",
        &[Part::Bar, Braking],
    ),
    more(
        "camera",
        "everything, and a camera 40 ms late, 10 ms of jitter, 0.03 m and 2 mrad of noise",
        &[Camera],
    ),
    more(
        "braking",
        "everything, and a speed that falls to 60 % and rises again, by up to 3 m/s2",
        &[Braking],
    ),
    more(
        "blinks",
        "everything, and a camera that sees nothing for 0.04 to 0.8 s, 12 times an hour",
        &[Part::Blinks],
    ),
    more(
        "slips",
        "everything, and wheels that slip or spin by up to 5 m/s, in and out by ramps to 1 s, 6 times an hour",
        &[Part::Slips],
    ),
    more(
        "works",
        "everything, and a line that jumps by 0.2 to 3.5 m and back, 3 times an hour",
        &[Part::Works],
    ),
    more(
        "lane-changes",
        "everything, and lane changes by hand of which nobody is told, 22 an hour",
        &[Part::LaneChanges],
    ),
    more("gusts", "everything, and gusts to 1 kN within 0.3 s", &[Gusts]),
    more(
        "events",
        "everything, blinks, slips, works, lane changes and gusts together",
        &[Gusts, Part::Blinks, Part::Slips, Part::Works, Part::LaneChanges],
    ),
    beyond(
        "fades",
        "everything, and a yaw rate that dies within 1 to 10 s beside a speed that drifts, 6 times an hour",
        &[Part::Fades],
    ),
    beyond(
        "no-yaw-rate",
        "everything, and no yaw rate on the bus",
        &[Part::NoYawRate],
    ),
    beyond("slippery", "everything, mu 0.3 and curves to 3 m/s2", &[Slippery]),
    beyond("steep", "everything, superelevation to 10 %", &[Steep]),
    WorldKind {
        judged: false,
        ..world(
            "blind",
            "the paper's world, and a camera that sees nothing for 0.5 s, 30 times an hour",
            &[Blind],
        )
    },
];

const EVERYTHING: &[Part] = &[Friction, Part::Tyres, Part::Tolerances, Bank, Wind];

const fn world(name: &'static str, what: &'static str, parts: &'static [Part]) -> WorldKind {
    WorldKind {
        name,
        what,
        judged: true,
        everything: false,
        parts,
    }
}

/// Everything, and more.
const fn more(name: &'static str, what: &'static str, parts: &'static [Part]) -> WorldKind {
    WorldKind {
        everything: true,
        ..world(name, what, parts)
    }
}

const fn beyond(name: &'static str, what: &'static str, parts: &'static [Part]) -> WorldKind {
    WorldKind {
        judged: false,
        ..more(name, what, parts)
    }
}

impl WorldKind {
    fn has(&self, part: Part) -> bool {
        self.parts.contains(&part) || (self.everything && EVERYTHING.contains(&part))
    }

    /// Whether cars brake and accelerate in it.
    pub fn changes_speed(&self) -> bool {
        self.has(Braking)
    }

    /// What happens in it now and then.
    pub fn happens(&self) -> Happens {
        Happens {
            blinks: self.has(Part::Blinks),
            slips: self.has(Part::Slips),
            works: self.has(Part::Works),
            lane_changes: self.has(Part::LaneChanges),
            fades: self.has(Part::Fades),
            no_yaw_rate: self.has(Part::NoYawRate),
        }
    }

    /// How the road lies across.
    pub fn surface(&self) -> Surface {
        if !self.has(Bank) {
            return Surface::FLAT;
        }
        Surface {
            crossfall: 0.025,
            superelevation: if self.has(Steep) { 0.10 } else { 0.06 },
        }
    }

    /// Most lateral acceleration of a curve, where it is not the road's, m/s2.
    pub fn lateral_m_per_s2(&self) -> Option<f64> {
        self.has(Slippery).then_some(3.0)
    }

    /// Tyres, wind, motor and assist.
    pub fn parameters(&self) -> WorldParameters {
        let off = WorldParameters::default();
        WorldParameters {
            tyres: if self.has(Part::Tyres) {
                Tyres::Saturating
            } else {
                off.tyres
            },
            mu: if self.has(Slippery) { 0.3 } else { off.mu },
            // Three standard deviations are 600 N, and with the lever 300 N.m.
            gust_sd_n: match self {
                _ if self.has(Gusts) => 330.0,
                _ if self.has(Wind) => 200.0,
                _ => off.gust_sd_n,
            },
            gust_corner_hz: if self.has(Gusts) { 1.0 } else { off.gust_corner_hz },
            wind_lever_m: 0.5,
            motor_ripple_nm: if self.has(Motor) {
                0.02
            } else {
                off.motor_ripple_nm
            },
            motor_lag_s: if self.has(Motor) { 0.002 } else { off.motor_lag_s },
            assist_nm: if self.has(Assist) { 8.0 } else { off.assist_nm },
            ..off
        }
    }

    /// Whether its column has a torsion bar.
    pub fn has_bar(&self) -> bool {
        self.has(Part::Bar)
    }

    /// A scenario with its column and assist, if those are not the paper's, and with guidance whose ECU is told of them.
    pub fn on_its_column(&self, scenario: ScenarioBuilder, guidance: GuidanceParameters) -> ScenarioBuilder {
        if !self.has_bar() {
            return scenario.guidance(guidance);
        }
        let column = ColumnParameters {
            kind: ColumnKind::TorsionBar,
            upper_friction_nm: 0.1,
            lower_friction_nm: 0.3,
            angle: AngleSensor::Column,
            ..ColumnParameters::default()
        };
        let assist = AssistParameters {
            curve: CurveChoice::Usual(Usual::Medium),
            ..AssistParameters::default()
        };
        let guidance = guidance.told_of(&column);
        scenario.column(column).assist(assist).guidance(guidance)
    }

    /// How far cars differ.
    pub fn tolerances(&self, car: u64) -> Tolerances {
        let mut tolerances = Tolerances {
            car: Some(car),
            ..Tolerances::default()
        };
        // A column with a bar has its own.
        if self.has(Friction) && !self.has_bar() {
            (tolerances.friction_least_nm, tolerances.friction_most_nm) = (0.2, 0.4);
        }
        if self.has(Motor) {
            (tolerances.motor_lag_s, tolerances.motor_error) = (0.018, 0.1);
        }
        if !self.has(Part::Tolerances) {
            return tolerances;
        }
        Tolerances {
            tyres: 0.15,
            trail: 0.15,
            load_kg: 300.0,
            torque_bias_nm: 0.08,
            angle_bias_rad: 1.0_f64.to_radians(),
            camera_yaw_rad: 0.0015,
            ..tolerances
        }
    }

    /// What the camera adds.
    pub fn sensor_errors(&self) -> SensorErrors {
        if self.has(Blind) {
            return SensorErrors {
                dropout_rate_per_s: 30.0 / 3600.0,
                dropout_duration_s: 0.5,
                ..SensorErrors::default()
            };
        }
        if !self.has(Camera) {
            return SensorErrors::default();
        }
        SensorErrors {
            camera_latency_s: 0.04,
            camera_jitter_s: 0.01,
            lane_noise_m: 0.03,
            heading_noise_rad: 0.002,
            ..SensorErrors::default()
        }
    }
}
