//! Where the drives of a file are: its roads, each at its speeds, and the seeds of the drives there.

use haptic_sim::input::InputError;
use haptic_sim::scenario::{Condition, FailureKind, Scenario, Speed};
use haptic_sim::seeds::named;
use toml::{Table, Value};

use crate::files::Source;

/// The drives of a law with a driver: each road at each speed with each seed.
#[derive(Debug, Clone)]
pub struct Drives {
    /// A scenario for each road and speed, with what to call them.
    pub places: Vec<(String, f64, Scenario)>,
    /// Drives at each place.
    pub seeds: u32,
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
    let mut places = Vec::new();
    for road in roads {
        let here = format!("{}: {table}roads {road}", source.name);
        let mut fields = fields.clone();
        fields.insert("course".into(), Value::String(road.clone()));
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
        for speed in speeds_m_per_s {
            let built = scenario.to_builder().speed(Speed::Constant(*speed)).build();
            let built = built.map_err(|e| InputError::new(&here, e))?;
            places.push((road.clone(), built.speed_kmh(), built));
        }
    }
    Ok(Drives { places, seeds })
}
