//! The file of a comparison, checked before anything is driven.

use std::collections::BTreeMap;

use haptic_sim::input::{InputError, parse_toml};
use haptic_sim::seeds::named;
use serde::Deserialize;
use toml::{Table, Value};

use super::{Compare, METRICS, Tuning};
use crate::engine::Faults;
use crate::files::{Source, check_names, merge, one};
use crate::parts::{Kinds, parts, unknown};
use crate::places::{Drawn, Drives, drives};
use crate::statistics::Confidence;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: String,
    #[serde(default = "one")]
    seed: u64,
    seeds: u64,
    #[serde(default)]
    roads: Vec<String>,
    speeds_m_per_s: Option<Vec<f64>>,
    speeds_kmh: Option<Vec<f64>>,
    drawn: Option<Drawn>,
    #[serde(default)]
    drivers_are_a_sample: bool,
    #[serde(default)]
    scenario: Table,
    #[serde(default)]
    faults: Faults,
    tuning: Option<TuningFile>,
    #[serde(default)]
    days: u64,
    #[serde(default)]
    world: Vec<WorldFile>,
    law: Vec<Table>,
    driver: Vec<Table>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WorldFile {
    name: String,
    days: Option<u64>,
    #[serde(default)]
    scenario: Table,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TuningFile {
    budget: u64,
    #[serde(default = "settles")]
    settles: f64,
    #[serde(default = "front")]
    front: u64,
    seeds: u64,
    #[serde(default)]
    roads: Vec<String>,
    speeds_m_per_s: Option<Vec<f64>>,
    speeds_kmh: Option<Vec<f64>>,
    weights: Option<BTreeMap<String, f64>>,
}

/// What is weighed where a file says nothing: 1 m of peak, 1 N.m of effort and 1 N.m of conflict count alike (chosen here).
const WEIGHTS: [&str; 3] = [
    "peak_lateral_error_m",
    "mean_abs_driver_torque_nm",
    "conflict_torque_nm",
];
/// A share of the objective that nobody would change a law for (chosen here).
fn settles() -> f64 {
    0.01
}

/// Enough sets to see how a law's front bends (chosen here).
fn front() -> u64 {
    5
}

/// Most drives of a comparison.
const MOST_DRIVES: f64 = 1e6;
/// Most days that drivers adapt for.
const MOST_DAYS: f64 = 1000.0;

pub(super) fn from_text<'k>(
    source: &Source,
    text: &str,
    kinds: &'k Kinds,
) -> Result<Compare<'k>, InputError> {
    let file: File = parse_toml(&source.name, text)?;
    check_names(source, "comparison", [&file.name])?;
    let (tables, oracles) = oracles(source, &file.law)?;
    let laws = parts(source, "law", &tables, &kinds.laws)?;
    let drivers = parts(source, "driver", &file.driver, &kinds.drivers)?;
    let (worlds, judged) = worlds(source, &file)?;
    let tuning = (file.tuning.as_ref())
        .map(|t| tuning(source, &file, t))
        .transpose()?;
    let faults = file.faults;
    for (field, count) in [
        ("sudden_loss", faults.sudden_loss),
        ("silent_lane", faults.silent_lane),
    ] {
        source.within(&format!("faults.{field}"), f64::from(count), 0.0, 1000.0, "")?;
    }
    source.within("faults.lasts_s", faults.lasts_s, 1.0, 600.0, "s")?;
    let days = match &file.world[..] {
        [] => vec![file.days],
        worlds => worlds
            .iter()
            .map(|world| world.days.unwrap_or(file.days))
            .collect(),
    };
    let days = days
        .into_iter()
        .map(|days| source.count("days", days, 0.0, MOST_DAYS));
    let days = days.collect::<Result<_, _>>()?;
    let compare = Compare {
        name: file.name,
        seed: file.seed,
        laws,
        by_hand: drivers
            .iter()
            .map(|driver| driver.by_hand(&kinds.drivers))
            .collect(),
        drivers,
        drivers_are_a_sample: file.drivers_are_a_sample,
        judged,
        worlds,
        days,
        oracles,
        tuning,
        faults,
        level: Confidence::USUAL,
    };
    check_parts(source, &compare)?;
    Ok(compare)
}

/// The tables of the laws without `oracle`, and whether each is one.
fn oracles(source: &Source, laws: &[Table]) -> Result<(Vec<Table>, Vec<bool>), InputError> {
    let mut tables = laws.to_vec();
    let is_oracle = |table: &mut Table| match table.remove("oracle") {
        None => Ok(false),
        Some(Value::Boolean(is)) => Ok(is),
        Some(other) => Err(source.bad(format!("law.oracle = {other}: true or false is wanted"))),
    };
    let oracles = tables.iter_mut().map(is_oracle).collect::<Result<_, _>>()?;
    Ok((tables, oracles))
}

/// Names of the worlds, and the drives in each, one world behind the other; one world without a name if the file has none.
fn worlds(source: &Source, file: &File) -> Result<(Vec<String>, Drives), InputError> {
    let given = Given {
        table: "",
        roads: &file.roads,
        speeds: [&file.speeds_m_per_s, &file.speeds_kmh],
        seeds: file.seeds,
    };
    if file.world.is_empty() {
        return Ok((vec![String::new()], given.drives(source, &file.scenario, file)?));
    }
    let names: Vec<String> = file.world.iter().map(|world| world.name.clone()).collect();
    check_names(source, "world", &names)?;
    let of_world = |world: &WorldFile| {
        let mut fields = file.scenario.clone();
        merge(&mut fields, &world.scenario);
        let source = Source::new(format!("{}: world {}", source.name, world.name), source.folder);
        given.drives(&source, &fields, file)
    };
    let mut all = of_world(&file.world[0])?;
    for world in &file.world[1..] {
        all.places.extend(of_world(world)?.places);
    }
    Ok((names, all))
}

/// Where a file wants drives: on roads that it names at its speeds, or on drawn ones.
struct Given<'a> {
    table: &'static str,
    roads: &'a [String],
    speeds: [&'a Option<Vec<f64>>; 2],
    seeds: u64,
}

impl Given<'_> {
    fn drives(&self, source: &Source, fields: &Table, file: &File) -> Result<Drives, InputError> {
        let (table, [m_per_s, kmh]) = (self.table, self.speeds);
        let is_drawn = self.roads.is_empty() && m_per_s.is_none() && kmh.is_none();
        match &file.drawn {
            Some(drawn) if is_drawn => {
                // Tuning has roads of its own.
                let root = named(
                    file.seed,
                    if table.is_empty() {
                        "judged roads"
                    } else {
                        "tuning roads"
                    },
                );
                drawn.drives(source, table, fields, self.seeds, root)
            }
            Some(_) if table.is_empty() => {
                Err(source.bad("drawn: roads and speeds are drawn, or named in roads and speeds, not both"))
            }
            _ => {
                let speeds = source.speeds(table, m_per_s.as_ref(), kmh.as_ref())?;
                drives(source, table, fields, self.roads, &speeds, self.seeds)
            }
        }
    }
}

/// Every law and driver can be made, and there are not too many drives.
fn check_parts(source: &Source, compare: &Compare) -> Result<(), InputError> {
    let count = |drives: &Drives, sets: usize| -> f64 {
        (sets * compare.drivers.len() * drives.places.len()) as f64 * f64::from(drives.seeds)
    };
    let laws = compare.laws.len();
    let tuned = compare.tuning.as_ref().map_or(0.0, |t| {
        count(&t.drives, laws * t.budget as usize) + count(&compare.judged, laws * t.front as usize)
    });
    let adapting = compare.drivers.iter().filter(|driver| driver.adapts().is_some());
    let sets = laws + compare.tuning.as_ref().map_or(0, |t| laws * t.front as usize);
    let lived = (adapting.count() * (sets + 1)) as f64 * f64::from(compare.days.iter().sum::<u32>());
    source.within(
        "laws x drivers x roads x speeds x seeds, with tuning and days",
        tuned + count(&compare.judged, laws) + lived,
        1.0,
        MOST_DRIVES,
        "",
    )?;
    let (_, _, scenario) = &compare.judged.places[0];
    for law in &compare.laws {
        law.check("law", source, scenario)?;
    }
    for driver in &compare.drivers {
        driver.check("driver", source, scenario)?;
    }
    Ok(())
}

fn tuning(source: &Source, whole: &File, file: &TuningFile) -> Result<Tuning, InputError> {
    let mut weights = vec![0.0; METRICS.len()];
    let given = file.weights.clone();
    for (name, weight) in given.unwrap_or_else(|| WEIGHTS.map(|name| (name.into(), 1.0)).into()) {
        // Training drives have no failures.
        let place = METRICS[..7].iter().position(|metric| metric.name == name);
        let place = place.ok_or_else(|| {
            source.bad(unknown(
                "tuning.weights",
                &name,
                METRICS[..7].iter().map(|m| m.name),
            ))
        })?;
        source.within(&format!("tuning.weights.{name}"), weight, 0.0, 1e6, "")?;
        weights[place] = weight;
    }
    source.within("tuning.settles", file.settles, 1e-4, 1.0, "")?;
    let given = Given {
        table: "tuning.",
        roads: &file.roads,
        speeds: [&file.speeds_m_per_s, &file.speeds_kmh],
        seeds: file.seeds,
    };
    Ok(Tuning {
        budget: source.count("tuning.budget", file.budget, 1.0, 10_000.0)?,
        settles: file.settles,
        front: source.count("tuning.front", file.front, 0.0, 100.0)?,
        drives: given.drives(source, &whole.scenario, whole)?,
        weights,
    })
}
