//! The file of a study of two adaptations, checked before anything is driven.

use haptic_sim::input::{InputError, parse_toml};
use haptic_sim::laws::Law as _;
use haptic_sim::models::road::Course;
use haptic_sim::scenario::Scenario;
use serde::Deserialize;
use toml::Table;

use super::{Adaptation, Times};
use crate::files::{Source, check_names, one};
use crate::parts::{Kinds, parts};
use crate::places::drives;
use crate::statistics::Confidence;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: String,
    road: String,
    speed_m_per_s: f64,
    seeds: u64,
    #[serde(default = "one")]
    seed: u64,
    #[serde(default)]
    scenario: Table,
    map: MapFile,
    loss: LossFile,
    law: Vec<Table>,
    driver: Vec<Table>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MapFile {
    k_1: Vec<f64>,
    k_hg: Vec<f64>,
    settles_s: f64,
    averages_s: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LossFile {
    at_s: f64,
    lasts_s: f64,
}

pub(super) fn from_text<'k>(
    source: &Source,
    text: &str,
    kinds: &'k Kinds,
) -> Result<Adaptation<'k>, InputError> {
    let file: File = parse_toml(&source.name, text)?;
    check_names(source, "study", [&file.name])?;
    rising(source, "map.k_1", &file.map.k_1, [0.0, 4.0])?;
    rising(source, "map.k_hg", &file.map.k_hg, [0.0, 1.0])?;
    let laws = parts(source, "law", &file.law, &kinds.laws)?;
    let drivers = parts(source, "driver", &file.driver, &kinds.drivers)?;
    let times = Times {
        lost_at_s: file.loss.at_s,
        lost_for_s: file.loss.lasts_s,
        settles_s: file.map.settles_s,
        averages_s: file.map.averages_s,
    };
    let limits = [
        ("map.settles_s", times.settles_s, 10.0),
        ("map.averages_s", times.averages_s, 10.0),
        ("loss.at_s", times.lost_at_s, times.settles_s + times.averages_s),
        ("loss.lasts_s", times.lost_for_s, 0.1),
    ];
    for (field, value, least) in limits {
        source.within(field, value, least, 3000.0, "s")?;
    }
    let (roads, speeds) = ([file.road], [file.speed_m_per_s]);
    let mut made = drives(source, "", &file.scenario, &roads, &speeds, file.seeds)?;
    let (road, speed_kmh, scenario) = made.places.remove(0);
    let scenario = laid_end_to_end(source, &scenario, times.loop_s())?;
    for law in &laws {
        if law.check("law", source, &scenario)?.k_1().is_none() {
            return Err(source.bad(format!("law {}: it is not (9) with a gain K_1", law.name)));
        }
    }
    for driver in &drivers {
        if driver.around.last().is_none_or(|(kind, _)| kind.name != "trust") {
            let what = "around ends with no habit \"trust\", which moves K_hg";
            return Err(source.bad(format!("driver {}: {what}", driver.name)));
        }
        driver.check("driver", source, &scenario)?;
    }
    let paper = [Table::from_iter([("kind".into(), "paper".into())])];
    let fixed = parts(source, "law", &paper, &kinds.laws)?.remove(0);
    Ok(Adaptation {
        name: file.name,
        seed: file.seed,
        seeds: made.seeds,
        place: (road, speed_kmh, scenario),
        k_1: file.map.k_1,
        k_hg: file.map.k_hg,
        times,
        laws,
        drivers,
        fixed,
        level: Confidence::USUAL,
    })
}

/// Two values at least, each above the one before it.
fn rising(source: &Source, field: &str, values: &[f64], [low, high]: [f64; 2]) -> Result<(), InputError> {
    for value in values {
        source.within(field, *value, low, high, "")?;
    }
    if values.len() < 2 || !values.is_sorted_by(|a, b| a < b) {
        return Err(source.bad(format!(
            "{field} = {values:?}: two or more rising values are wanted"
        )));
    }
    Ok(())
}

/// The road as often as a drive needs it.
fn laid_end_to_end(source: &Source, scenario: &Scenario, lasts_s: f64) -> Result<Scenario, InputError> {
    let road = scenario.course();
    if !road.is_of_segments() {
        return Err(source.bad(format!("road {}: a course of segments is wanted", road.name())));
    }
    // What the driver looks ahead is more than the road behind the last metre that is driven.
    let wanted_m = (lasts_s + 10.0) * scenario.speed_m_per_s();
    let times = (wanted_m / road.length_m()).ceil() as usize;
    let segments = road.segments().repeat(times);
    let course = Course::new(road.name(), road.lane_width_m(), segments);
    let course = course.map_err(|e| source.bad(format!("road {}, {times} times: {e}", road.name())))?;
    let built = scenario.to_builder().course(course).build();
    built.map_err(|e| source.bad(e))
}
