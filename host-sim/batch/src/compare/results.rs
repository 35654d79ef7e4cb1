//! What a comparison found: means over places with intervals over seeds, law by law and driver by driver.

use std::io;
use std::path::Path;

use serde::Serialize;

use crate::several::holm;

use super::tune::Tuned;
use super::{
    Adapted, Compare, Driven, Faults, FrontPoint, METRICS, Mean, Metric, TunedBy, Unit, by_unit, mean_of,
};
use crate::engine::{Entry, EntryKind, Tables};
use crate::statistics::{Confidence, p_of_zero};

/// A law as it was judged.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LawResult {
    /// Its name in the file.
    pub name: String,
    /// Its kind, and what is around it.
    pub kind: String,
    /// Where it is published, with "after" where some of it was chosen here.
    pub source: String,
    /// Its parameters; of an oracle those for the first driver.
    pub values: Vec<(&'static str, f64)>,
    /// Whether it was tuned for each driver by itself.
    pub oracle: bool,
    /// How it was tuned; none if there was nothing to tune.
    pub tuning: Option<TunedBy>,
}

/// A law with a driver.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cell {
    /// Place of the law.
    pub law: usize,
    /// Place of the driver.
    pub driver: usize,
    /// In the order of the metrics.
    pub values: Vec<Option<Mean>>,
    /// Less what the first law has, unit by unit.
    pub against_first: Vec<Option<Mean>>,
    /// How probable so large a difference is where there is none, corrected by Holm's method for all cells and judged metrics; none of a
    /// metric that is not judged by.
    pub p_holm: Vec<Option<f64>>,
    /// Its drives.
    pub drives: usize,
    /// Drives without a value of a metric that others have, metric by metric: means leave them out.
    pub missing: Vec<usize>,
    /// Drives that left the road.
    pub off_road: usize,
    /// Drives in which the ECU ended guidance by its own decision.
    pub left_by_itself: usize,
    /// Failed drives that left the road.
    pub failed_off_road: u32,
}

/// A metric of a law in a world over all drivers, as a share of what the first law has there.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ratio {
    /// Place of the law.
    pub law: usize,
    /// Place of the world.
    pub world: usize,
    /// Place of the metric.
    pub metric: usize,
    /// The mean over the units, each of which has its ratio of the means over all that is not the unit.
    pub mean: Mean,
    /// How probable a ratio so far from 1 is where it is 1, corrected by Holm's method for all laws, worlds and judged metrics.
    pub p_holm: Option<f64>,
    /// The largest of a driver over draws, with an interval for as many drivers as there are, and the place of that driver.
    pub largest: (Mean, usize),
}

/// A row of the table of drives.
#[derive(Debug, Clone, PartialEq)]
pub struct DriveRow {
    /// Law, driver, world and road.
    pub names: [String; 4],
    /// Speed, km/h.
    pub speed_kmh: f64,
    /// Number of the seed.
    pub seed: u32,
    /// What came of it.
    pub driven: Driven,
}

/// What a comparison found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CompareResults {
    /// Its name.
    pub name: String,
    /// What it was judged by.
    pub metrics: Vec<Metric>,
    /// The laws, as listed.
    pub laws: Vec<LawResult>,
    /// Names and kinds, as listed.
    pub drivers: Vec<[String; 2]>,
    /// Where the gains are published with which each drives without guidance; none if nowhere, and he keeps his own.
    pub by_hand: Vec<Option<&'static str>>,
    /// K_hg at the beginning of a drive, of the drivers who have one.
    pub k_hg: Vec<Option<f64>>,
    /// Names of the worlds; one without a name if there are none.
    pub worlds: Vec<String>,
    /// Road and speed of each place in a world.
    pub places: Vec<(String, f64)>,
    /// Drives at each place.
    pub seeds: u32,
    /// What the intervals of a law with a driver are over, and of a law with all drivers.
    pub units: [Unit; 2],
    /// How many units of the first kind there are.
    pub draws: usize,
    /// How often intervals hold what they are of.
    #[serde(skip_serializing_if = "Confidence::is_usual")]
    pub level: Confidence,
    /// Most sets that were tried for a law with something to tune.
    pub budget: u32,
    /// Instants of a sudden loss and of a silent lane in each drive.
    pub instants: [u32; 2],
    /// By law, then driver.
    pub cells: Vec<Cell>,
    /// By law, then world, then metric, without the first law.
    pub ratios: Vec<Ratio>,
    /// Where drivers who adapt stand behind their days.
    pub adapted: Vec<Adapted>,
    /// What each law trades, by law, then peak.
    pub front: Vec<FrontPoint>,
    /// Every judged drive.
    #[serde(skip)]
    pub rows: Vec<DriveRow>,
}

impl CompareResults {
    /// Writes the table of drives, with a row each, into a directory: `drives.csv`, and with the feature `parquet` `drives.parquet`.
    ///
    /// # Errors
    /// What the file system says.
    pub fn write_tables(&self, directory: &Path) -> io::Result<()> {
        let metadata = [
            ("haptic.version", crate::VERSION),
            ("haptic.comparison", &self.name),
        ];
        let places = ["drives.csv", "drives.parquet"].map(|name| directory.join(name));
        let columns = columns().map(|(name, kind)| (name.to_owned(), kind));
        let mut tables = Tables::create(columns.collect(), &metadata, &places)?;
        for row in &self.rows {
            tables.row(row.entries().collect())?;
        }
        tables.finish()
    }
}

/// The columns of the table of drives.
fn columns() -> impl Iterator<Item = (&'static str, EntryKind)> {
    use EntryKind::{Flag, Number, Text, Whole};
    let names = ["law", "driver", "world", "road"].map(|name| (name, Text));
    let metrics = METRICS.map(|metric| (metric.name, Number));
    let flags = ["off_road", "guidance_left_by_itself"].map(|name| (name, Flag));
    names
        .into_iter()
        .chain([("speed_kmh", Number), ("seed", Whole)])
        .chain(metrics)
        .chain(flags)
        .chain([("failed_off_road", Whole)])
}

impl DriveRow {
    /// In the order of the columns.
    fn entries(&self) -> impl Iterator<Item = Entry<'_>> {
        let driven = &self.driven;
        let names = self.names.iter().map(|name| Entry::Text(name.clone()));
        names
            .chain([
                Entry::Number(Some(self.speed_kmh)),
                Entry::Whole(self.seed.into()),
            ])
            .chain(driven.values.map(Entry::Number))
            .chain([driven.off_road, driven.left_by_itself].map(Entry::Flag))
            .chain([Entry::Whole(driven.failed_off_road.into())])
    }
}

pub(super) fn sum_up(
    compare: &Compare,
    tuned: Vec<Tuned>,
    driven: &[Driven],
    front: Vec<FrontPoint>,
    adapted: Vec<Option<Adapted>>,
) -> CompareResults {
    let places = compare.judged.places.len() / compare.worlds.len();
    let Faults {
        sudden_loss,
        silent_lane,
        ..
    } = compare.faults;
    let draws = compare.judged.unit;
    CompareResults {
        name: compare.name.clone(),
        metrics: METRICS.into(),
        laws: (compare.laws.iter().zip(&compare.oracles).zip(tuned))
            .map(law_result)
            .collect(),
        drivers: (compare.drivers.iter().map(|d| [d.name.clone(), d.kinds()])).collect(),
        by_hand: (compare.by_hand.iter())
            .map(|by_hand| by_hand.as_ref().map(|(_, table)| *table))
            .collect(),
        k_hg: (compare.drivers.iter())
            .map(|driver| driver.untuned_part(&compare.judged.places[0].2).ok()?.k_hg())
            .collect(),
        places: compare
            .judged
            .places
            .iter()
            .take(places)
            .map(|(road, kmh, _)| (road.clone(), *kmh))
            .collect(),
        worlds: compare.worlds.clone(),
        seeds: compare.judged.seeds,
        units: [
            draws,
            if compare.drivers_are_a_sample {
                Unit::Driver
            } else {
                draws
            },
        ],
        draws: compare.units(),
        level: compare.level,
        budget: compare.tuning.as_ref().map_or(0, |t| t.budget),
        instants: [sudden_loss, silent_lane],
        cells: cells(compare, driven),
        ratios: ratios(compare, driven),
        adapted: adapted.into_iter().flatten().collect(),
        front,
        rows: (driven.iter().enumerate())
            .map(|(number, driven)| drive_row(compare, number, driven))
            .collect(),
    }
}

pub(super) fn cells(compare: &Compare, driven: &[Driven]) -> Vec<Cell> {
    let (drivers, level) = (compare.drivers.len(), compare.level);
    let each = driven.len() / (compare.laws.len() * drivers);
    let of_cell = |law: usize, driver: usize| &driven[(law * drivers + driver) * each..][..each];
    let units = |values: &mut dyn Iterator<Item = Option<f64>>| by_unit(compare.units(), values);
    let cell = |number: usize| {
        let (law, driver) = (number / drivers, number % drivers);
        let (own, first) = (of_cell(law, driver), of_cell(0, driver));
        let value = |metric: usize| units(&mut own.iter().map(|d| d.values[metric]));
        let apart = |metric: usize| {
            let pairs = own.iter().zip(first);
            units(&mut pairs.map(|(own, first)| Some(own.values[metric]? - first.values[metric]?)))
        };
        let p = |metric: usize| p_of_zero(&apart(metric)).filter(|_| METRICS[metric].is_judged && law > 0);
        let metrics = 0..METRICS.len();
        Cell {
            law,
            driver,
            values: (metrics.clone())
                .map(|metric| mean_of(&value(metric), level))
                .collect(),
            against_first: (metrics.clone())
                .map(|metric| mean_of(&apart(metric), level))
                .collect(),
            p_holm: metrics.map(p).collect(),
            drives: own.len(),
            missing: (0..METRICS.len()).map(|metric| missing(own, metric)).collect(),
            off_road: own.iter().filter(|d| d.off_road).count(),
            left_by_itself: own.iter().filter(|d| d.left_by_itself).count(),
            failed_off_road: own.iter().map(|d| d.failed_off_road).sum(),
        }
    };
    let mut cells: Vec<Cell> = (0..compare.laws.len() * drivers).map(cell).collect();
    correct(cells.iter_mut().flat_map(|cell| &mut cell.p_holm).collect());
    cells
}

/// How many drives have no value of a metric; 0 where none has.
fn missing(drives: &[Driven], metric: usize) -> usize {
    let without = drives
        .iter()
        .filter(|drive| drive.values[metric].is_none())
        .count();
    if without == drives.len() { 0 } else { without }
}

/// Holm's correction of a family, in place.
fn correct(family: Vec<&mut Option<f64>>) {
    let mut family: Vec<&mut f64> = family.into_iter().filter_map(Option::as_mut).collect();
    let corrected = holm(&family.iter().map(|p| **p).collect::<Vec<_>>());
    for (p, corrected) in family.iter_mut().zip(corrected) {
        **p = corrected;
    }
}

/// A judged drive by its number: by law, driver, place and seed.
fn drive_row(compare: &Compare, number: usize, driven: &Driven) -> DriveRow {
    let (drivers, all, seeds) = (
        compare.drivers.len(),
        compare.judged.places.len(),
        compare.judged.seeds as usize,
    );
    let place = number / seeds % all;
    let pair = number / seeds / all;
    let (road, speed_kmh, _) = &compare.judged.places[place];
    DriveRow {
        names: [
            compare.laws[pair / drivers].name.clone(),
            compare.drivers[pair % drivers].name.clone(),
            compare.worlds[place / (all / compare.worlds.len())].clone(),
            road.clone(),
        ],
        speed_kmh: *speed_kmh,
        seed: (number % seeds) as u32,
        driven: driven.clone(),
    }
}

/// Every law over the first one, where all drives of both have a value.
fn ratios(compare: &Compare, driven: &[Driven]) -> Vec<Ratio> {
    let (drivers, worlds, level) = (compare.drivers.len(), compare.worlds.len(), compare.level);
    let in_world = driven.len() / (compare.laws.len() * drivers * worlds);
    // Means over the places of a world, by driver, then unit.
    let means = |law: usize, world: usize, metric: usize| -> Option<Vec<Vec<f64>>> {
        let of_driver = |driver: usize| {
            let first = ((law * drivers + driver) * worlds + world) * in_world;
            let values: Option<Vec<f64>> = driven[first..][..in_world]
                .iter()
                .map(|d| d.values[metric])
                .collect();
            Some(by_unit(compare.units(), values?.into_iter().map(Some)))
        };
        (0..drivers).map(of_driver).collect()
    };
    let ratio = |law: usize, world: usize, metric: usize| {
        let (own, first) = (means(law, world, metric)?, means(0, world, metric)?);
        let over = |(own, first): (&Vec<f64>, &Vec<f64>)| -> Vec<f64> {
            own.iter().zip(first).map(|(own, first)| own / first).collect()
        };
        let total = |of: &[Vec<f64>], unit: usize| of.iter().map(|of| of[unit]).sum::<f64>();
        let sum = |of: &Vec<f64>| of.iter().sum::<f64>();
        let of_drivers: Vec<f64> = own
            .iter()
            .zip(&first)
            .map(|(own, first)| sum(own) / sum(first))
            .collect();
        let by_unit = match compare.drivers_are_a_sample {
            true => of_drivers.clone(),
            false => (0..compare.units())
                .map(|unit| total(&own, unit) / total(&first, unit))
                .collect(),
        };
        let largest = (0..drivers).max_by(|a, b| of_drivers[*a].total_cmp(&of_drivers[*b]))?;
        let of_largest = over((&own[largest], &first[largest]));
        let away: Vec<f64> = by_unit.iter().map(|ratio| ratio - 1.0).collect();
        Some(Ratio {
            law,
            world,
            metric,
            mean: mean_of(&by_unit, level).filter(|mean| mean.mean.is_finite())?,
            p_holm: p_of_zero(&away).filter(|_| METRICS[metric].is_judged),
            largest: (mean_of(&of_largest, level.of_several(drivers))?, largest),
        })
    };
    let mut found = Vec::new();
    for law in 1..compare.laws.len() {
        for world in 0..worlds {
            found.extend((0..METRICS.len()).filter_map(|metric| ratio(law, world, metric)));
        }
    }
    correct(found.iter_mut().map(|ratio| &mut ratio.p_holm).collect());
    found
}

fn law_result(((law, oracle), tuned): ((&super::Chosen<'_, dyn super::Law>, &bool), Tuned)) -> LawResult {
    LawResult {
        name: law.name.clone(),
        kind: law.kinds(),
        source: law.kind.said_source(),
        values: law
            .kind
            .parameters
            .iter()
            .map(|p| p.name)
            .zip(tuned.values.into_iter().next().unwrap_or_default())
            .collect(),
        oracle: *oracle,
        tuning: tuned.by,
    }
}
