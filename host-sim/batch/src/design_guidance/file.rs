//! The file of a design, checked before anything is driven.

use std::collections::BTreeMap;

use haptic_sim::input::{InputError, parse_toml};
use haptic_sim::participants::participants;
use haptic_sim::scenario::Scenario;
use haptic_sim::seeds::named;
use serde::Deserialize;
use toml::Table;

use super::search::BARS;
use super::{DesignGuidance, Gains, Member, Stage, published};
use crate::files::{Source, check_names};
use crate::parts::unknown;
use crate::places::drives;
use crate::statistics::Confidence;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: String,
    #[serde(default)]
    seed: u64,
    law: String,
    #[serde(default)]
    scenario: Table,
    population: Population,
    search: Search,
    #[serde(default)]
    bars: BTreeMap<String, f64>,
    training: StageFile,
    held_out: StageFile,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Population {
    participants: Option<Vec<u32>>,
    own_line_share: f64,
    own_line_m: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Search {
    budget: u64,
    stretch: Vec<[f64; 2]>,
    scales: [[f64; 2]; 4],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StageFile {
    seeds: u64,
    roads: Vec<String>,
    speeds_m_per_s: Option<Vec<f64>>,
    speeds_kmh: Option<Vec<f64>>,
    losses: u64,
}

pub(super) fn from_text(
    source: &Source,
    text: &str,
    own_line_share: Option<f64>,
) -> Result<DesignGuidance, InputError> {
    let file: File = parse_toml(&source.name, text)?;
    check_names(source, "design", [&file.name])?;
    if file.law != "paper" {
        return Err(source.bad(unknown("law", &file.law, ["paper"].into_iter())));
    }
    let share = own_line_share.unwrap_or(file.population.own_line_share);
    let stage = |stream, table: &str, file_of: &StageFile, share, turn| {
        let (m_per_s, kmh) = (&file_of.speeds_m_per_s, &file_of.speeds_kmh);
        let speeds = source.speeds(table, m_per_s.as_ref(), kmh.as_ref())?;
        let drives = drives(
            source,
            table,
            &file.scenario,
            &file_of.roads,
            &speeds,
            file_of.seeds,
        )?;
        let places = drives.places.into_iter();
        let (places, scenarios) = places
            .map(|(road, kmh, scenario)| ((road, kmh), scenario))
            .unzip();
        Ok(Stage {
            stream,
            places,
            scenarios,
            seeds: drives.seeds,
            losses: source.count(&format!("{table}losses"), file_of.losses, 1.0, 1000.0)?,
            drivers: population(source, &file.population, share, turn)?,
        })
    };
    let stages = [
        stage("training", "training.", &file.training, share, 0)?,
        // Other drivers have lines of their own.
        stage(
            "held out",
            "held_out.",
            &file.held_out,
            file.population.own_line_share,
            1,
        )?,
    ];
    for stretch in file.search.stretch.as_flattened() {
        source.within("search.stretch", *stretch, 0.0, f64::INFINITY, "")?;
    }
    if file.search.stretch.is_empty() {
        return Err(source.bad("search.stretch = []: one at least is wanted"));
    }
    let places = stages.iter().flat_map(|stage| &stage.scenarios);
    let courses: String = places.map(Scenario::to_toml).collect();
    let design = DesignGuidance {
        name: file.name,
        seed: file.seed,
        budget: source.count("search.budget", file.search.budget, 8.0, 100_000.0)?,
        stretches: file.search.stretch,
        range: range(source, file.search.scales)?,
        bars: bars(source, &file.bars)?,
        level: Confidence::USUAL,
        identity: named(0, &format!("{text}{share}{courses}")),
        stages,
    };
    for gains in design.range {
        for stage in &design.stages {
            let made = design.scenario(&stage.scenarios[0], stage.drivers[0], gains, 1);
            made.map_err(|e| source.bad(e))?;
        }
    }
    Ok(design)
}

/// So many of the drivers have a line of their own, spread evenly over them, left and right in turn; `turn` says with whom it begins.
fn population(
    source: &Source,
    file: &Population,
    share: f64,
    turn: usize,
) -> Result<Vec<Member>, InputError> {
    source.within("population.own_line_share", share, 0.0, 1.0, "")?;
    source.within("population.own_line_m", file.own_line_m, 0.0, 2.0, "m")?;
    let all = participants();
    let numbers = file
        .participants
        .clone()
        .unwrap_or_else(|| all.iter().map(|p| p.number).collect());
    if numbers.len() < 2 {
        return Err(source.bad(format!(
            "population.participants = {numbers:?}: two at least are wanted"
        )));
    }
    for (place, number) in numbers.iter().enumerate() {
        source.within(
            "population.participants",
            f64::from(*number),
            1.0,
            all.len() as f64,
            "",
        )?;
        if numbers[..place].contains(number) {
            return Err(source.bad(format!("population.participants: {number} is there twice")));
        }
    }
    let with_line = (share * numbers.len() as f64).round() as usize;
    let before = |place: usize| place * with_line / numbers.len();
    let member = |(place, number): (usize, &u32)| {
        let turned = (place + turn) % numbers.len();
        let side = if before(turned).is_multiple_of(2) {
            1.0
        } else {
            -1.0
        };
        let has_line = before(turned + 1) > before(turned);
        Member {
            participant: *number,
            line_m: if has_line { side * file.own_line_m } else { 0.0 },
        }
    };
    Ok(numbers.iter().enumerate().map(member).collect())
}

fn range(source: &Source, scales: [[f64; 2]; 4]) -> Result<[Gains; 2], InputError> {
    let mut range = [published(); 2];
    for (place, [low, high]) in scales.into_iter().enumerate() {
        source.within("search.scales", low, 0.01, 1.0, "")?;
        source.within("search.scales", high, 1.0, 50.0, "")?;
        range[0][place] *= low;
        range[1][place] *= high;
    }
    Ok(range)
}

fn bars(source: &Source, given: &BTreeMap<String, f64>) -> Result<[f64; BARS.len()], InputError> {
    let mut bars = BARS.map(|bar| bar.limit);
    for (name, limit) in given {
        let known = || BARS.iter().map(|bar| bar.name);
        let place = known().position(|known| known == name);
        let place = place.ok_or_else(|| source.bad(unknown("bars", name, known())))?;
        let [low, high] = if BARS[place].is_goal {
            [0.1, 1.0]
        } else {
            [1.0, 100.0]
        };
        source.within(&format!("bars.{name}"), *limit, low, high, "")?;
        bars[place] = *limit;
    }
    Ok(bars)
}
