//! What a comparison found: means over places with intervals over seeds, law by law and driver by driver.

use std::io;
use std::path::Path;

use serde::Serialize;

use super::tune::Tuned;
use super::{Compare, Driven, Faults, Job, METRICS, Mean, Metric};
use crate::engine::{Entry, EntryKind, Tables};
use crate::statistics::Confidence;

/// A law as it was judged.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LawResult {
    /// Its name in the file.
    pub name: String,
    /// Its kind, and what is around it.
    pub kind: String,
    /// Where it is published.
    pub source: &'static str,
    /// Its parameters; of an oracle those for the first driver.
    pub values: Vec<(&'static str, f64)>,
    /// Whether it was tuned for each driver by itself.
    pub oracle: bool,
    /// The objective before and after tuning.
    pub objective: Option<[f64; 2]>,
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
    /// Less what the first law has, drive by drive.
    pub against_first: Vec<Option<Mean>>,
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
    /// The ratio of the means over drivers and places, with its interval over the seeds.
    pub mean: Mean,
    /// The largest of a driver, and the place of that driver.
    pub largest: (f64, usize),
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
    /// Names of the worlds; one without a name if there are none.
    pub worlds: Vec<String>,
    /// Road and speed of each place in a world.
    pub places: Vec<(String, f64)>,
    /// Drives at each place.
    pub seeds: u32,
    /// How often intervals hold what they are of.
    #[serde(skip_serializing_if = "Confidence::is_usual")]
    pub level: Confidence,
    /// Sets that were tried for each law with something to tune.
    pub budget: u32,
    /// Instants of a sudden loss and of a silent lane in each drive.
    pub instants: [u32; 2],
    /// By law, then driver.
    pub cells: Vec<Cell>,
    /// By law, then world, then metric, without the first law.
    pub ratios: Vec<Ratio>,
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
    jobs: &[Job],
    driven: &[Driven],
) -> CompareResults {
    let drivers = compare.drivers.len();
    let each = driven.len() / (compare.laws.len() * drivers);
    let of_cell = |law: usize, driver: usize| &driven[(law * drivers + driver) * each..][..each];
    let seeds = compare.judged.seeds;
    let cell = |number: usize| {
        let (law, driver) = (number / drivers, number % drivers);
        let (own, first) = (of_cell(law, driver), of_cell(0, driver));
        let metric = |metric: usize| mean(seeds, compare.level, own.iter().map(|d| d.values[metric]));
        let difference = |metric: usize| {
            let pairs = own.iter().zip(first);
            mean(
                seeds,
                compare.level,
                pairs.map(|(own, first)| Some(own.values[metric]? - first.values[metric]?)),
            )
        };
        Cell {
            law,
            driver,
            values: (0..METRICS.len()).map(metric).collect(),
            against_first: (0..METRICS.len()).map(difference).collect(),
            off_road: own.iter().filter(|d| d.off_road).count(),
            left_by_itself: own.iter().filter(|d| d.left_by_itself).count(),
            failed_off_road: own.iter().map(|d| d.failed_off_road).sum(),
        }
    };
    let places = compare.judged.places.len() / compare.worlds.len();
    let Faults {
        sudden_loss,
        silent_lane,
        ..
    } = compare.faults;
    CompareResults {
        name: compare.name.clone(),
        metrics: METRICS.into(),
        laws: (compare.laws.iter().zip(&compare.oracles).zip(tuned))
            .map(law_result)
            .collect(),
        drivers: (compare.drivers.iter().map(|d| [d.name.clone(), d.kinds()])).collect(),
        places: compare
            .judged
            .places
            .iter()
            .take(places)
            .map(|(road, kmh, _)| (road.clone(), *kmh))
            .collect(),
        worlds: compare.worlds.clone(),
        seeds,
        level: compare.level,
        budget: compare.tuning.as_ref().map_or(0, |t| t.budget),
        instants: [sudden_loss, silent_lane],
        cells: (0..compare.laws.len() * drivers).map(cell).collect(),
        ratios: ratios(compare, driven),
        rows: (jobs.iter().zip(driven))
            .map(|(job, driven)| drive_row(compare, job, driven))
            .collect(),
    }
}

fn drive_row(compare: &Compare, job: &Job, driven: &Driven) -> DriveRow {
    let places = compare.judged.places.len() / compare.worlds.len();
    let (road, speed_kmh, _) = &compare.judged.places[job.place];
    DriveRow {
        names: [
            compare.laws[job.law].name.clone(),
            compare.drivers[job.driver].name.clone(),
            compare.worlds[job.place / places].clone(),
            road.clone(),
        ],
        speed_kmh: *speed_kmh,
        seed: job.seed,
        driven: driven.clone(),
    }
}

/// Every law over the first one, where all drives of both have a value.
fn ratios(compare: &Compare, driven: &[Driven]) -> Vec<Ratio> {
    let (drivers, worlds, seeds) = (
        compare.drivers.len(),
        compare.worlds.len(),
        compare.judged.seeds as usize,
    );
    let places = compare.judged.places.len() / worlds;
    // Sums over the places of a world, by driver, then seed.
    let sums = |law: usize, world: usize, metric: usize| -> Option<Vec<Vec<f64>>> {
        let of_driver = |driver: usize| {
            let mut sums = vec![0.0; seeds];
            for place in 0..places {
                let first = ((law * drivers + driver) * worlds + world) * places + place;
                for (sum, drive) in sums.iter_mut().zip(&driven[first * seeds..]) {
                    *sum += drive.values[metric]?;
                }
            }
            Some(sums)
        };
        (0..drivers).map(of_driver).collect()
    };
    let ratio = |law: usize, world: usize, metric: usize| {
        let (own, first) = (sums(law, world, metric)?, sums(0, world, metric)?);
        let of_seed = |sums: &[Vec<f64>], seed: usize| sums.iter().map(|of| of[seed]).sum::<f64>();
        let by_seed: Vec<f64> = (0..seeds)
            .map(|seed| of_seed(&own, seed) / of_seed(&first, seed))
            .collect();
        let over_seeds = Mean::new(&by_seed, compare.level)?;
        let total = |sums: &[f64]| sums.iter().sum::<f64>();
        let all = |sums: &[Vec<f64>]| sums.iter().map(|of| total(of)).sum::<f64>();
        let each = own
            .iter()
            .zip(&first)
            .map(|(own, first)| total(own) / total(first));
        let largest = (each.zip(0..)).max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(Ratio {
            law,
            world,
            metric,
            mean: Mean {
                mean: all(&own) / all(&first),
                ..over_seeds
            },
            largest,
        })
    };
    let mut found = Vec::new();
    for law in 1..compare.laws.len() {
        for world in 0..worlds {
            found.extend((0..METRICS.len()).filter_map(|metric| ratio(law, world, metric)));
        }
    }
    found
}

fn law_result(((law, oracle), tuned): ((&super::Chosen<'_, dyn super::Law>, &bool), Tuned)) -> LawResult {
    LawResult {
        name: law.name.clone(),
        kind: law.kinds(),
        source: law.kind.source,
        values: law
            .kind
            .parameters
            .iter()
            .map(|p| p.name)
            .zip(tuned.values.into_iter().next().unwrap_or_default())
            .collect(),
        oracle: *oracle,
        objective: tuned.objective,
    }
}

/// The mean of values by place, then seed: each seed's mean over the places that have a value, then over the seeds.
fn mean(seeds: u32, level: Confidence, values: impl Iterator<Item = Option<f64>>) -> Option<Mean> {
    let mut sums = vec![(0.0, 0_u32); seeds as usize];
    for (number, value) in values.enumerate() {
        if let Some(value) = value {
            let (sum, count) = &mut sums[number % seeds as usize];
            *sum += value;
            *count += 1;
        }
    }
    let of_seeds: Vec<f64> = sums
        .into_iter()
        .filter(|(_, count)| *count > 0)
        .map(|(sum, count)| sum / f64::from(count))
        .collect();
    Mean::new(&of_seeds, level)
}
