//! How much each varied field matters by itself: the share of a metric's variance that lies between its levels.

use serde::Serialize;

use super::{Driven, Point, SLICES, Sweep, value};

/// A list with more rows is cut into slices.
const MOST_LEVELS: usize = 64;

/// What an axis does to the metrics.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effect {
    /// Its first column.
    pub field: String,
    /// Its values, or the sixteenths of its distribution.
    pub levels: Vec<Level>,
    /// For each metric: the share of its variance that lies between the levels (epsilon squared, Kelley 1935: what
    /// chance alone would give is taken off); none if the metric does not vary.
    pub shares: Vec<(&'static str, Option<f64>)>,
}

/// A value of an axis, or a slice of its distribution.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Level {
    /// The value, or the mean of the slice.
    pub label: String,
    /// The same as a number, if it is one.
    pub x: Option<f64>,
    /// Drives with it.
    pub drives: u64,
    /// Mean of the metric that judges.
    pub mean: Option<f64>,
    /// Share of the drives beyond the limit, if there is one.
    pub beyond: Option<f64>,
    /// The same for each value of the field that the sweep compares; of that field itself none.
    pub compared: Vec<Compared>,
}

/// Drives of a level with one value of the field that the sweep compares.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Compared {
    /// The value.
    pub label: String,
    /// Drives with it.
    pub drives: u64,
    /// Mean of the metric that judges.
    pub mean: Option<f64>,
    /// Share of the drives beyond the limit, if there is one.
    pub beyond: Option<f64>,
}

/// Effects on their way.
pub(super) struct Effects {
    axes: Vec<Axis>,
    metrics: Vec<&'static str>,
    has_limit: bool,
    compare: Option<usize>,
    judge: usize,
}

struct Axis {
    field: String,
    /// Its first column among all.
    column: usize,
    rows: usize,
    exact: bool,
    levels: Vec<Sums>,
}

/// Welford's sums.
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    count: u64,
    mean: f64,
    squares: f64,
}

#[derive(Debug, Clone, Default)]
struct Sums {
    label: Option<String>,
    x: Moments,
    drives: u64,
    beyond: u64,
    metrics: Vec<Moments>,
    /// By the level of the axis that is compared.
    compared: Vec<Part>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Part {
    drives: u64,
    beyond: u64,
    judged: Moments,
}

impl Moments {
    fn add(&mut self, value: f64) {
        self.count += 1;
        let before = value - self.mean;
        self.mean += before / self.count as f64;
        self.squares += before * (value - self.mean);
    }

    fn mean(&self) -> Option<f64> {
        (self.count > 0).then_some(self.mean)
    }
}

impl Effects {
    pub(super) fn new(sweep: &Sweep, judge: usize) -> Self {
        let mut column = 0;
        let axis = |axis: &super::file::Axis| {
            let of_list = axis.rows();
            let rows = of_list.unwrap_or(SLICES as usize);
            let first = column;
            column += axis.columns.len();
            Axis {
                field: axis.columns[0].name.clone(),
                column: first,
                rows,
                exact: of_list.is_some_and(|rows| rows <= MOST_LEVELS),
                levels: Vec::new(),
            }
        };
        Self {
            axes: sweep.axes().map(axis).collect(),
            metrics: sweep.metrics().iter().map(|d| d.name).collect(),
            has_limit: sweep.limit.is_some(),
            compare: sweep.compare,
            judge,
        }
    }

    pub(super) fn add(&mut self, point: &Point, driven: &Driven, is_beyond: bool) {
        let metrics = self.metrics.len();
        let part = self.compare.map(|axis| point.levels[axis] as usize);
        for (axis, level) in self.axes.iter_mut().zip(&point.levels) {
            let level = *level as usize;
            let level = if axis.rows > MOST_LEVELS {
                level * SLICES as usize / axis.rows
            } else {
                level
            };
            if axis.levels.len() <= level {
                let empty = Sums {
                    metrics: vec![Moments::default(); metrics],
                    ..Sums::default()
                };
                axis.levels.resize(level + 1, empty);
            }
            let sums = &mut axis.levels[level];
            let own = &point.values[axis.column];
            if axis.exact && sums.label.is_none() {
                sums.label = Some(value::text(own));
            }
            if let Some(x) = value::number(own) {
                sums.x.add(x);
            }
            sums.drives += 1;
            sums.beyond += u64::from(is_beyond);
            for (moments, value) in sums.metrics.iter_mut().zip(&driven.metrics) {
                if let Some(value) = value {
                    moments.add(*value);
                }
            }
            if let Some(part) = part {
                sums.add_to(part, is_beyond, driven.metrics[self.judge]);
            }
        }
    }

    pub(super) fn finish(self) -> Vec<Effect> {
        // What the compared values are called; each axis met the same ones.
        let labels: Vec<String> = self.compare.map_or_else(Vec::new, |compared| {
            let levels = self.axes[compared].levels.iter();
            levels
                .map(|level| level.label.clone().unwrap_or_default())
                .collect()
        });
        let share = |part: u64, of: u64| (self.has_limit && of > 0).then(|| part as f64 / of as f64);
        let compared = |(part, label): (&Part, &String)| Compared {
            label: label.clone(),
            drives: part.drives,
            mean: part.judged.mean(),
            beyond: share(part.beyond, part.drives),
        };
        let effect = |(place, axis): (usize, &Axis)| {
            let labels = if self.compare == Some(place) {
                &[]
            } else {
                &labels[..]
            };
            let of_variance =
                |metric: usize| share_between(axis.levels.iter().map(|level| level.metrics[metric]));
            let level = |level: &Sums| Level {
                label: level
                    .label
                    .clone()
                    .unwrap_or_else(|| format!("{:.4}", level.x.mean)),
                x: level.x.mean(),
                drives: level.drives,
                mean: level.metrics[self.judge].mean(),
                beyond: share(level.beyond, level.drives),
                compared: level.compared.iter().zip(labels).map(compared).collect(),
            };
            Effect {
                field: axis.field.clone(),
                levels: axis
                    .levels
                    .iter()
                    .filter(|level| level.drives > 0)
                    .map(level)
                    .collect(),
                shares: self
                    .metrics
                    .iter()
                    .enumerate()
                    .map(|(i, name)| (*name, of_variance(i)))
                    .collect(),
            }
        };
        self.axes.iter().enumerate().map(effect).collect()
    }
}

impl Sums {
    fn add_to(&mut self, part: usize, is_beyond: bool, judged: Option<f64>) {
        if self.compared.len() <= part {
            self.compared.resize(part + 1, Part::default());
        }
        let part = &mut self.compared[part];
        part.drives += 1;
        part.beyond += u64::from(is_beyond);
        if let Some(value) = judged {
            part.judged.add(value);
        }
    }
}

/// Epsilon squared of groups: (SSB - (k - 1) MSW) / SST, not below zero.
fn share_between(groups: impl Iterator<Item = Moments> + Clone) -> Option<f64> {
    let groups = || groups.clone().filter(|group| group.count > 0);
    let count: u64 = groups().map(|group| group.count).sum();
    let k = groups().count() as u64;
    if k < 2 || count <= k {
        return None;
    }
    let mean = groups().map(|group| group.count as f64 * group.mean).sum::<f64>() / count as f64;
    let between: f64 = groups()
        .map(|group| group.count as f64 * (group.mean - mean).powi(2))
        .sum();
    let within: f64 = groups().map(|group| group.squares).sum();
    let total = between + within;
    let by_chance = (k - 1) as f64 * within / (count - k) as f64;
    (total > 0.0).then(|| ((between - by_chance) / total).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn group(values: &[f64]) -> Moments {
        let mut moments = Moments::default();
        values.iter().for_each(|value| moments.add(*value));
        moments
    }

    /// Counted again from the rows of the table.
    #[test]
    fn what_is_compared_is_what_the_rows_say() {
        let failing = "[scenario.failure]\ntime = 8\n[vary]\n\"failure.kind\" = [\"torque\", \"input\"]\n";
        let sweep = crate::sweep::tests::with_road(
            "samples = 20\nmetrics = [\"peak_lateral_error_m\"]\nlimit = 0.3\ncompare = \"failure.kind\"\n",
            &format!("{failing}speed = [50, 80]\n\"driver.t_p\" = {{ uniform = [0.1, 0.4] }}\n"),
        );
        let folder = tempfile::tempdir().unwrap();
        let store = crate::sweep::Store::open(&sweep, "test 1", folder.path()).unwrap();
        crate::sweep::drive_all(&store, &sweep, crate::sweep::Shard::WHOLE, 1, |_| ()).unwrap();
        let summary = store.finish().unwrap();
        assert_eq!(summary.compare.as_deref(), Some("failure.kind"));
        let csv = std::fs::read_to_string(folder.path().join("drives.csv")).unwrap();
        let heads: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
        let column = |name: &str| heads.iter().position(|head| *head == name).unwrap();
        let [kind, speed, peak] = ["failure.kind", "speed", "peak_lateral_error_m"].map(column);
        let rows: Vec<Vec<&str>> = csv.lines().skip(1).map(|row| row.split(',').collect()).collect();
        let effect = |field: &str| summary.effects.iter().find(|of| of.field == field).unwrap();
        let mut beyond = 0;
        for level in &effect("speed").levels {
            for own in &level.compared {
                let with = |row: &&Vec<&str>| row[kind] == own.label && row[speed] == level.label;
                let peaks: Vec<f64> = rows
                    .iter()
                    .filter(with)
                    .map(|row| row[peak].parse().unwrap())
                    .collect();
                let bad = peaks.iter().filter(|peak| **peak > 0.3).count();
                beyond += bad;
                assert_eq!((own.drives, peaks.len()), (20, 20));
                assert_eq!(own.beyond, Some(bad as f64 / 20.0));
                assert!((own.mean.unwrap() - peaks.iter().sum::<f64>() / 20.0).abs() < 1e-12);
            }
        }
        assert!((1..80).contains(&beyond), "{beyond}");
        assert!(
            effect("failure.kind")
                .levels
                .iter()
                .all(|level| level.compared.is_empty())
        );
        let slices = &effect("driver.t_p").levels;
        let drives = slices
            .iter()
            .flat_map(|level| &level.compared)
            .map(|own| own.drives);
        assert_eq!(drives.sum::<u64>(), 80);
    }

    /// By hand: groups 1,2,3 and 4,5,6. SSB 13.5, SSW 4, MSW 1, SST 17.5: (13.5 - 1) / 17.5.
    #[test]
    fn the_share_is_that_of_a_table_by_hand() {
        let groups = [group(&[1.0, 2.0, 3.0]), group(&[4.0, 5.0, 6.0])];
        let share = share_between(groups.into_iter()).unwrap();
        assert!((share - 12.5 / 17.5).abs() < 1e-12, "{share}");
        // Levels without a difference explain nothing, and a metric that does not vary has no share.
        assert_eq!(
            share_between([group(&[1.0, 3.0]), group(&[3.0, 1.0])].into_iter()),
            Some(0.0)
        );
        assert_eq!(
            share_between([group(&[1.0, 1.0]), group(&[1.0, 1.0])].into_iter()),
            None
        );
    }
}
