//! Who drives in the campaign: the paper's drivers, those who keep the lane in a real car, or those of them who rely on the
//! guidance. And how far a fault may move the vehicle of each.

use haptic_sim::models::driver::{ArmGains, DriverParameters};
use haptic_sim::participants::participants;
use haptic_sim::population::LaneKeeper;
use haptic_sim::scenario::Condition;
use haptic_sim::seeds::{Stream, named};
use rand::SeedableRng;
use rand::rngs::Xoshiro256PlusPlus;
use serde::Serialize;

/// Who goes further aside than a lane is wide without any torque is thrown off the road whatever the ECU does: metres
/// beyond that say nothing of a handover, and are not judged.
pub const OFF_ROAD_M: f64 = 3.6;
/// From the middle of a lane of 3.6 m to where a vehicle of 1.7 m begins to leave it, m.
pub(crate) const LANE_EDGE_M: f64 = 0.95;

/// Most that a torque that nobody asked for may push a vehicle whose driver keeps the lane, m: a quarter of the way to the lane's edge.
const PUSHED_M: f64 = 0.25;

/// Remnant of those who keep the lane in a real car, N.m: that of `cargo xtask availability` on a motorway.
const REMNANT_SD_NM: f64 = 0.4;

/// Who drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Drivers {
    /// The participants of tables 5 and 6 and the nine drivers of tables 7 and 8, for the paper's car.
    Paper,
    /// The drivers of `cargo xtask availability`, for a real car.
    Population,
    /// The population with a reliance of 0.8 to 1 and without a remnant: nothing they do shows that the guidance is
    /// wrong.
    Relying,
}

/// How far a fault may move the vehicle, whatever dropping the torque would do.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Limits {
    /// Largest deviation of a run, m.
    pub deviation_m: f64,
    /// Largest share of a row's runs that leave the lane where the fault-free vehicle does not; `None` if it is stated only.
    pub left_lane: Option<f64>,
    /// Most that a false torque may push the vehicle before it is cut, m; `None` if it is stated only.
    pub pushed_m: Option<f64>,
}

impl Drivers {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Paper, Self::Population, Self::Relying];

    /// By which a person asks for them.
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Population => "population",
            Self::Relying => "relying",
        }
    }

    /// The absolute limits. Who keeps the lane in a real car stays in it if the middle of the lane is where the fault finds the
    /// vehicle. The paper's drivers hold the wheel so loosely that a plain loss takes them out of the lane: for them the limit
    /// is the width of a lane, and the share that leaves it is stated only.
    pub fn limits(self) -> Limits {
        match self {
            Self::Paper => Limits {
                deviation_m: OFF_ROAD_M,
                left_lane: None,
                pushed_m: None,
            },
            Self::Population | Self::Relying => Limits {
                deviation_m: LANE_EDGE_M,
                left_lane: Some(0.04),
                pushed_m: Some(PUSHED_M),
            },
        }
    }
}

/// A driver, by origin.
#[derive(Debug, Clone, PartialEq)]
pub struct Driver {
    /// Table and participant, or delay and condition.
    pub name: String,
    /// Vision and delay.
    pub parameters: DriverParameters,
    /// Arm.
    pub gains: ArmGains,
}

/// Everyone of the paper: 28 participants, then t_p 0.1, 0.3, 0.5 with high, mid, low reliance.
pub fn everyone() -> Vec<Driver> {
    let all = participants();
    let manual = all.iter().map(|p| (5, p.number, p.manual));
    let guided = all.iter().map(|p| (6, p.number, p.guided));
    let published = manual.chain(guided).map(|(table, number, driver)| Driver {
        name: format!("table {table}, participant {number}"),
        parameters: driver.parameters(),
        gains: driver.gains(),
    });
    let drivers = [0.1, 0.3, 0.5].into_iter().flat_map(|t_p| {
        [Condition::High, Condition::Mid, Condition::Low].map(|condition| Driver {
            name: format!("t_p {t_p} s, {condition} reliance"),
            parameters: DriverParameters {
                t_p,
                ..Default::default()
            },
            gains: condition.gains(),
        })
    });
    published.chain(drivers).collect()
}

/// A driver of the population, by a stream of its own: all else is drawn as for the paper's.
pub fn lane_keeper(seed: u64) -> LaneKeeper {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(named(Stream::Faults.seed(seed), "driver"));
    LaneKeeper::draw(&mut rng, REMNANT_SD_NM)
}

/// The driver of a seed, relying on the guidance.
pub fn relying(seed: u64) -> LaneKeeper {
    let driver = lane_keeper(seed);
    LaneKeeper {
        reliance: 0.8 + 0.2 * driver.reliance,
        remnant_sd_nm: 0.0,
        ..driver
    }
}
