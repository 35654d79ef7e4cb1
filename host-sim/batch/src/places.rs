//! Where the drives of a file are: its roads, each at its speeds, and the seeds of the drives there.

use haptic_sim::input::InputError;
use haptic_sim::models::road::{Course, DEFAULT_LANE_WIDTH_M, PAPER_COURSE, Segment};
use haptic_sim::scenario::{Condition, FailureKind, Scenario, Speed};
use haptic_sim::seeds::named;
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use crate::files::Source;

/// The drives of a law with a driver: each road at each speed with each seed.
#[derive(Debug, Clone)]
pub struct Drives {
    /// A scenario for each road and speed, with what to call them.
    pub places: Vec<(String, f64, Scenario)>,
    /// Drives at each place.
    pub seeds: u32,
    /// What its figures scatter over.
    pub unit: Unit,
}

/// The unit of inference: what was drawn by chance, so that a mean over it has an interval.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Unit {
    /// The noise of a drive. Roads and speeds are those of the file, and nothing is said of others.
    Noise,
    /// A road, a speed and the noise of the drive there.
    Road,
    /// A driver.
    Driver,
}

impl std::fmt::Display for Unit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Noise => "draws of the noise",
            Self::Road => "draws of a road, a speed and the noise",
            Self::Driver => "drivers",
        })
    }
}

impl Drives {
    /// How many units there are in one world.
    pub(crate) fn units(&self, worlds: usize) -> usize {
        match self.unit {
            Unit::Road => self.places.len() / worlds,
            Unit::Noise | Unit::Driver => self.seeds as usize,
        }
    }
}

/// Roads and speeds by chance: level, bends to either side at random, each as sharp as its lateral acceleration has it.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Drawn {
    bends: u64,
    speeds_m_per_s: Option<Vec<f64>>,
    speeds_kmh: Option<Vec<f64>>,
    lateral_m_per_s2: Vec<f64>,
}

impl Drawn {
    /// A place for each draw, with a road and a speed of its own.
    pub(crate) fn drives(
        &self,
        source: &Source,
        table: &str,
        fields: &Table,
        draws: u64,
        root: u64,
    ) -> Result<Drives, InputError> {
        let draws = source.count(&format!("{table}seeds"), draws, 1.0, 1000.0)?;
        let bends = source.count("drawn.bends", self.bends, 1.0, 8.0)?;
        let speeds = source.speeds("drawn.", self.speeds_m_per_s.as_ref(), self.speeds_kmh.as_ref())?;
        for lateral in &self.lateral_m_per_s2 {
            source.within("drawn.lateral_m_per_s2", *lateral, 0.1, 3.0, "m/s2")?;
        }
        let ends = |field: &str, ends: &[f64]| match *ends {
            [low, high] if low < high => Ok(low..high),
            _ => Err(source.bad(format!(
                "drawn.{field}: the least and the largest are wanted, rising"
            ))),
        };
        let (speeds, laterals) = (
            ends("speeds", &speeds)?,
            ends("lateral_m_per_s2", &self.lateral_m_per_s2)?,
        );
        let base = base(source, table, fields, PAPER_COURSE)?;
        let draw = |number: u32| {
            let name = format!("drawn-{}", number + 1);
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(named(root, &name));
            let v = rng.random_range(speeds.clone());
            let mut segments = Vec::new();
            for _ in 0..bends {
                let [straight_s, arc_s] = [rng.random_range(4.0..8.0), rng.random_range(3.0..7.0)];
                let into_s = rng.random_range(2.0..3.5);
                let side = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
                let curvature_1pm = side * rng.random_range(laterals.clone()) / (v * v);
                segments.extend([
                    Segment::straight(v * straight_s),
                    Segment::clothoid(v * into_s, 0.0, curvature_1pm),
                    Segment::arc(v * arc_s, curvature_1pm),
                    Segment::clothoid(v * into_s, curvature_1pm, 0.0),
                ]);
            }
            segments.push(Segment::straight(v * 4.0));
            let bad = |e: &dyn std::fmt::Display| source.bad(format!("{table}{name}: {e}"));
            let course = Course::new(&name, DEFAULT_LANE_WIDTH_M, segments).map_err(|e| bad(&e))?;
            let scenario = base.to_builder().course(course).speed(Speed::Constant(v)).build();
            let scenario = scenario.map_err(|e| bad(&e))?;
            Ok((name, scenario.speed_kmh(), scenario))
        };
        Ok(Drives {
            places: (0..draws).map(draw).collect::<Result<_, InputError>>()?,
            seeds: 1,
            unit: Unit::Road,
        })
    }
}

/// The seed of a drive: drives of another stream share none.
pub(crate) fn seed_of(root: u64, stream: &str, road: &str, speed_kmh: f64, number: u32) -> u64 {
    // 53 bits, which every reader of a number takes whole.
    named(named(root, stream), &format!("{road} {speed_kmh} {number}")) >> 11
}

/// The places of drives: a scenario for each road and speed.
pub(crate) fn drives(
    source: &Source,
    table: &str,
    fields: &Table,
    roads: &[String],
    speeds_m_per_s: &[f64],
    seeds: u64,
) -> Result<Drives, InputError> {
    let seeds = source.count(&format!("{table}seeds"), seeds, 1.0, 1000.0)?;
    for (field, is_empty) in [
        ("roads", roads.is_empty()),
        ("speeds_m_per_s", speeds_m_per_s.is_empty()),
    ] {
        if is_empty {
            return Err(source.bad(format!("{table}{field} = []: one at least is wanted")));
        }
    }
    let mut places = Vec::new();
    for road in roads {
        let here = format!("{}: {table}roads {road}", source.name);
        let scenario = base(source, table, fields, road)?;
        for speed in speeds_m_per_s {
            let built = scenario.to_builder().speed(Speed::Constant(*speed)).build();
            let built = built.map_err(|e| InputError::new(&here, e))?;
            places.push((road.clone(), built.speed_kmh(), built));
        }
    }
    let unit = Unit::Noise;
    Ok(Drives { places, seeds, unit })
}

/// The scenario of a file on a road, which has nothing that the file says elsewhere.
fn base(source: &Source, table: &str, fields: &Table, road: &str) -> Result<Scenario, InputError> {
    for field in [
        "seed",
        "course",
        "speed",
        "speed_m_per_s",
        "speed_kmh",
        "failure",
        "driver_change",
    ] {
        if fields.contains_key(field) {
            return Err(source.bad(format!(
                "scenario.{field}: this file has its own seeds, roads, speeds, faults and drivers"
            )));
        }
    }
    let here = format!("{}: {table}roads {road}", source.name);
    let mut fields = fields.clone();
    fields.insert("course".into(), Value::String(road.into()));
    let scenario = Scenario::from_toml(&here, &fields.to_string(), |course, lane| {
        source.course(course, lane)
    })?;
    if scenario.condition() == Condition::Manual || scenario.failure().kind != FailureKind::None {
        return Err(source.bad("scenario.condition = \"manual\": a law of kind \"none\" is no guidance"));
    }
    let law = scenario.guidance().controller.law;
    if law != 0.0 {
        return Err(source.bad(format!(
            "scenario.guidance.law = {law}: this file has its own laws, which take the place of the ECU's"
        )));
    }
    Ok(scenario)
}
