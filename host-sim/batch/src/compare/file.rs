//! The file of a comparison, checked before anything is driven.

use std::collections::BTreeMap;

use haptic_sim::input::{InputError, parse_toml};
use serde::Deserialize;
use toml::{Table, Value};

use super::{Compare, METRICS, Tuning};
use crate::engine::Faults;
use crate::files::{Source, check_names, merge, one};
use crate::parts::{Kinds, parts, unknown};
use crate::places::{Drives, drives};
use crate::statistics::Confidence;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: String,
    #[serde(default = "one")]
    seed: u64,
    seeds: u64,
    roads: Vec<String>,
    speeds_m_per_s: Option<Vec<f64>>,
    speeds_kmh: Option<Vec<f64>>,
    #[serde(default)]
    scenario: Table,
    #[serde(default)]
    faults: Faults,
    tuning: Option<TuningFile>,
    #[serde(default)]
    world: Vec<WorldFile>,
    law: Vec<Table>,
    driver: Vec<Table>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WorldFile {
    name: String,
    #[serde(default)]
    scenario: Table,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TuningFile {
    budget: u64,
    seeds: u64,
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
/// Most drives of a comparison.
const MOST_DRIVES: f64 = 1e6;
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
    let tuning = file
        .tuning
        .as_ref()
        .map(|t| tuning(source, &file.scenario, t))
        .transpose()?;
    let faults = file.faults;
    for (field, count) in [
        ("sudden_loss", faults.sudden_loss),
        ("silent_lane", faults.silent_lane),
    ] {
        source.within(&format!("faults.{field}"), f64::from(count), 0.0, 1000.0, "")?;
    }
    source.within("faults.lasts_s", faults.lasts_s, 1.0, 600.0, "s")?;
    let compare = Compare {
        name: file.name,
        seed: file.seed,
        laws,
        drivers,
        judged,
        worlds,
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
    let speeds = source.speeds("", file.speeds_m_per_s.as_ref(), file.speeds_kmh.as_ref())?;
    let drives =
        |source: &Source, fields: &Table| drives(source, "", fields, &file.roads, &speeds, file.seeds);
    if file.world.is_empty() {
        return Ok((vec![String::new()], drives(source, &file.scenario)?));
    }
    let names: Vec<String> = file.world.iter().map(|world| world.name.clone()).collect();
    check_names(source, "world", &names)?;
    let mut all = Drives {
        places: Vec::new(),
        seeds: 0,
    };
    for world in &file.world {
        let mut fields = file.scenario.clone();
        merge(&mut fields, &world.scenario);
        let source = Source::new(format!("{}: world {}", source.name, world.name), source.folder);
        let made = drives(&source, &fields)?;
        all.places.extend(made.places);
        all.seeds = made.seeds;
    }
    Ok((names, all))
}

/// Every law and driver can be made, and there are not too many drives.
fn check_parts(source: &Source, compare: &Compare) -> Result<(), InputError> {
    let count = |drives: &Drives, sets: usize| {
        (sets * compare.drivers.len() * drives.places.len()) as f64 * f64::from(drives.seeds)
    };
    let tuned = compare
        .tuning
        .as_ref()
        .map_or(0.0, |t| count(&t.drives, compare.laws.len() * t.budget as usize));
    source.within(
        "laws x drivers x roads x speeds x seeds, with tuning",
        tuned + count(&compare.judged, compare.laws.len()),
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

fn tuning(source: &Source, scenario: &Table, file: &TuningFile) -> Result<Tuning, InputError> {
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
    let speeds = source.speeds("tuning.", file.speeds_m_per_s.as_ref(), file.speeds_kmh.as_ref())?;
    Ok(Tuning {
        budget: source.count("tuning.budget", file.budget, 1.0, 10_000.0)?,
        drives: drives(source, "tuning.", scenario, &file.roads, &speeds, file.seeds)?,
        weights,
    })
}
