//! What each varied field does to the metrics: the share of a metric's variance that lies between its levels, the metric that
//! judges by level, and which level is best.
//!
//! Drives of one sample are no independent observations: they share drawn values and seeds. So a sample counts once in an
//! interval, with the mean of its drives; where nothing is drawn, a repeat does. What a list compares meets the same samples,
//! and its values are compared sample by sample.

use haptic_metrics::Definition;
use serde::Serialize;

use super::groups::{Drives, Group, Moments, share_between};
use super::{DesignPoint, Driven, SLICES, Sweep, units};
use crate::engine::{number, text};
use crate::statistics::{Confidence, student};

/// Whether a small value of a metric is the bad one.
pub(super) fn small_is_bad(metric: &Definition) -> bool {
    metric.name.ends_with("time_to_lane_crossing_s")
}

/// A list with more rows is cut into slices.
const MOST_LEVELS: usize = 64;
/// Most repeats that are told apart; of more, those with the same remainder are one observation.
const MOST_REPEATS: u64 = 64;
/// Fewer observations of its own say nothing of a level.
const FEWEST: u64 = 5;
/// Means that differ by a smaller share of themselves are called equal, however certain the difference is.
const SMALL: f64 = 0.01;

/// What an axis does to the metrics.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effect {
    /// Its first column.
    pub field: String,
    /// Unit of its values, `-` if that is 1; none if the sweep gives the field a name or a factor of its own.
    pub unit: Option<String>,
    /// Whether the levels are slices of a distribution or of a long list, and not values.
    pub sliced: bool,
    /// Its values, or the sixteenths of its distribution.
    pub levels: Vec<Level>,
    /// Labels of the best level and of those that are not told apart from it: of the least share of drives beyond the limit,
    /// if there is one, else of the best mean among those with the fewest diverged drives. Empty if no level is told apart from it.
    pub best: Vec<String>,
    /// For each metric: the share of its variance that lies between the levels (epsilon squared, Kelley 1935: what
    /// chance alone would give is taken off); none if the metric does not vary.
    pub shares: Vec<(&'static str, Option<f64>)>,
}

/// A value of an axis, or a slice of its distribution.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Level {
    /// The value, or the mean of the slice.
    pub label: String,
    /// The label as a number, if it is one.
    pub x: Option<f64>,
    /// What came of its drives.
    #[serde(flatten)]
    pub drives: Drives,
    /// The drives by each value of the field that the sweep compares; of that field itself none.
    pub compared: Vec<Compared>,
}

/// Drives of a level with one value of the field that the sweep compares.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Compared {
    /// The value.
    pub label: String,
    /// What came of them.
    #[serde(flatten)]
    pub drives: Drives,
}

/// Effects on their way.
pub(super) struct Effects<'a> {
    sweep: &'a Sweep,
    axes: Vec<Axis>,
    judge: usize,
    confidence: Confidence,
    /// Repeats that are observations of their own.
    apart: u64,
    /// The sample under way.
    sample: u64,
}

struct Axis {
    field: String,
    unit: Option<String>,
    /// Its first column among all.
    column: usize,
    rows: usize,
    exact: bool,
    levels: Vec<Sums>,
    /// By two levels, the lower one first: how much worse the first is in the same observation.
    pairs: Vec<Moments>,
}

#[derive(Debug, Clone, Default)]
struct Sums {
    label: Option<String>,
    x: Moments,
    metrics: Vec<Moments>,
    all: Group,
    /// By the level of the axis that is compared.
    compared: Vec<Group>,
}

impl<'a> Effects<'a> {
    pub(super) fn new(sweep: &'a Sweep, judge: usize, level: Confidence) -> Self {
        let mut column = 0;
        let axis = |axis: &super::axis::Axis| {
            let of_list = axis.rows().map(<[_]>::len);
            let rows = of_list.unwrap_or(SLICES as usize);
            let first = column;
            column += axis.columns.len();
            Axis {
                field: axis.columns[0].name.clone(),
                unit: units::unit_of_column(&axis.columns[0]),
                column: first,
                rows,
                exact: of_list.is_some_and(|rows| rows <= MOST_LEVELS),
                levels: Vec::new(),
                pairs: vec![Moments::default(); MOST_LEVELS * MOST_LEVELS],
            }
        };
        Self {
            sweep,
            axes: sweep.axes().map(axis).collect(),
            judge,
            confidence: level,
            apart: if sweep.samples > 1 {
                1
            } else {
                sweep.repeats.min(MOST_REPEATS)
            },
            sample: 0,
        }
    }

    pub(super) fn confidence(&self) -> Confidence {
        self.confidence
    }

    /// Drives come in the order of their numbers.
    pub(super) fn add(&mut self, point: &DesignPoint, driven: &Driven, is_beyond: bool) {
        if point.sample != self.sample {
            self.end_sample();
            self.sample = point.sample;
        }
        let metrics = self.sweep.metrics.len();
        let repeat = (point.drive % self.sweep.repeats % self.apart) as usize;
        let judged = driven.metrics[self.judge];
        let part = self.sweep.compare.map(|axis| point.levels[axis] as usize);
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
                sums.label = Some(text(own));
            }
            if let Some(x) = number(own) {
                sums.x.add(x);
            }
            for (moments, value) in sums.metrics.iter_mut().zip(&driven.metrics) {
                if let Some(value) = value {
                    moments.add(*value);
                }
            }
            sums.all.add(repeat, driven, judged, is_beyond);
            if let Some(part) = part {
                if sums.compared.len() <= part {
                    sums.compared.resize(part + 1, Group::default());
                }
                sums.compared[part].add(repeat, driven, judged, is_beyond);
            }
        }
    }

    fn end_sample(&mut self) {
        for axis in &mut self.axes {
            for (i, first) in axis.levels.iter().enumerate() {
                for (j, second) in axis.levels.iter().enumerate().skip(i + 1) {
                    for ((_, a), (_, b)) in first.all.now.iter().zip(&second.all.now) {
                        if let (Some(a), Some(b)) = (a.mean(), b.mean()) {
                            axis.pairs[i * MOST_LEVELS + j].add(a - b);
                        }
                    }
                }
            }
            for level in &mut axis.levels {
                level.all.end_sample();
                level.compared.iter_mut().for_each(Group::end_sample);
            }
        }
    }

    pub(super) fn finish(mut self) -> Vec<Effect> {
        self.end_sample();
        let has_limit = self.sweep.limit.is_some();
        // What the compared values are called; each axis met the same ones.
        let labels: Vec<String> = self.sweep.compare.map_or_else(Vec::new, |compared| {
            self.axes[compared].levels.iter().map(Sums::label).collect()
        });
        let compared = |(part, label): (&Group, &String)| Compared {
            label: label.clone(),
            drives: part.finish(has_limit, self.confidence),
        };
        let effect = |(place, axis): (usize, &Axis)| {
            let labels = if self.sweep.compare == Some(place) {
                &[]
            } else {
                &labels[..]
            };
            let of_variance =
                |metric: usize| share_between(axis.levels.iter().map(|level| level.metrics[metric]));
            let level = |level: &Sums| Level {
                label: level.label(),
                x: level.x.mean(),
                drives: level.all.finish(has_limit, self.confidence),
                compared: level.compared.iter().zip(labels).map(compared).collect(),
            };
            Effect {
                field: axis.field.clone(),
                unit: axis.unit.clone(),
                sliced: !axis.exact,
                levels: axis
                    .levels
                    .iter()
                    .filter(|level| level.all.drives > 0)
                    .map(level)
                    .collect(),
                best: axis.best(has_limit, self.confidence, small_is_bad(self.sweep.judge)),
                shares: (self.sweep.metrics.iter().enumerate())
                    .map(|(i, metric)| (metric.name, of_variance(i)))
                    .collect(),
            }
        };
        self.axes.iter().enumerate().map(effect).collect()
    }
}

impl Sums {
    fn label(&self) -> String {
        self.label
            .clone()
            .unwrap_or_else(|| format!("{:.4}", self.x.mean))
    }
}

impl Axis {
    /// The levels that [`Effect::best`] names.
    fn best(&self, has_limit: bool, level: Confidence, small_is_bad: bool) -> Vec<String> {
        let driven: Vec<usize> = (0..self.levels.len())
            .filter(|i| self.levels[*i].all.drives > 0)
            .collect();
        let lost = |i: usize| self.levels[i].all.diverged as f64 / self.levels[i].all.drives as f64;
        let fewest = driven.iter().map(|i| lost(*i)).fold(f64::INFINITY, f64::min);
        let badness = |i: &usize| {
            let all = &self.levels[*i].all;
            match (has_limit, small_is_bad) {
                (true, _) => Some(all.beyond as f64 / all.drives as f64),
                // The metrics of a drive that diverged end there: a level looks better by them than it is.
                _ if lost(*i) > fewest => None,
                (false, true) => Some(-all.judged.mean()?),
                (false, false) => all.judged.mean(),
            }
        };
        let judged: Vec<(usize, f64)> = driven.iter().filter_map(|i| Some((*i, badness(i)?))).collect();
        let Some((least, _)) = judged.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)) else {
            return Vec::new();
        };
        // Each of the others might seem different by chance.
        let certainty = 1.0 - (1.0 - level.share()) / (2.0 * (driven.len() as f64 - 1.0).max(1.0));
        let apart = |i: usize| {
            if has_limit {
                self.shares_differ(i, least, level)
            } else {
                self.means_differ(i, least, certainty)
            }
        };
        let alike: Vec<usize> = judged
            .into_iter()
            .map(|(i, _)| i)
            .filter(|i| *i == least || !apart(*i))
            .collect();
        if alike.len() == driven.len() {
            return Vec::new();
        }
        alike.into_iter().map(|i| self.levels[i].label()).collect()
    }

    /// Whether the intervals of two shares lie apart.
    fn shares_differ(&self, i: usize, j: usize, level: Confidence) -> bool {
        let [i, j] = [i, j].map(|place| self.levels[place].all.finish(true, level).beyond_interval);
        i.zip(j)
            .is_some_and(|([low, high], [other_low, other_high])| low > other_high || other_low > high)
    }

    /// Whether two means are told apart: in the observations that both levels have, or, if each has its own, by these (Welch).
    /// A single observation is all there is where nothing is drawn.
    fn means_differ(&self, i: usize, j: usize, certainty: f64) -> bool {
        let own = [i, j].map(|level| self.levels[level].all.observed);
        let fewer = own[0].count.min(own[1].count);
        let pair = &self.pairs[i.min(j) * MOST_LEVELS + i.max(j)];
        let half = |variance: f64, free: f64| student(certainty, free) * variance.sqrt();
        let (difference, half) = match own.map(|own| own.of_mean()) {
            [None, None] => (pair.mean, 0.0),
            _ if pair.count == fewer => match pair.of_mean() {
                Some((variance, free)) => (pair.mean, half(variance, free)),
                None => return false,
            },
            [Some((a, free_a)), Some((b, free_b))] if fewer >= FEWEST => {
                let free = (a + b).powi(2) / (a * a / free_a + b * b / free_b);
                let half = if a + b > 0.0 { half(a + b, free) } else { 0.0 };
                (own[0].mean - own[1].mean, half)
            }
            _ => return false,
        };
        difference.abs() > half.max(SMALL * own[0].mean.abs().max(own[1].mean.abs()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::Watch;

    /// Counted again from the rows of the table.
    #[test]
    fn what_is_compared_is_what_the_rows_say() {
        let failing = "[scenario.failure]\ntime_s = 8\n[vary]\n\"failure.kind\" = [\"torque\", \"input\"]\n";
        let sweep = crate::sweep::tests::with_road(
            "samples = 20\nmetrics = [\"peak_lateral_error_m\"]\nlimit = 0.3\ncompare = \"failure.kind\"\n",
            &format!("{failing}speed_m_per_s = [14, 22]\n\"driver.t_p_s\" = {{ uniform = [0.1, 0.4] }}\n"),
        );
        let folder = tempfile::tempdir().unwrap();
        let store = crate::sweep::Store::open(&sweep, "test 1", folder.path()).unwrap();
        crate::sweep::run_all(&store, &sweep, crate::sweep::Shard::WHOLE, &Watch::nobody()).unwrap();
        let summary = store.finish(Confidence::USUAL).unwrap();
        assert_eq!(summary.compare.as_deref(), Some("failure.kind"));
        let csv = std::fs::read_to_string(folder.path().join("drives.csv")).unwrap();
        let heads: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
        let column = |name: &str| heads.iter().position(|head| *head == name).unwrap();
        let [kind, speed, peak] = ["failure.kind", "speed_m_per_s", "peak_lateral_error_m"].map(column);
        let rows: Vec<Vec<&str>> = csv.lines().skip(1).map(|row| row.split(',').collect()).collect();
        let effect = |field: &str| summary.effects.iter().find(|of| of.field == field).unwrap();
        let mut beyond = 0;
        for level in &effect("speed_m_per_s").levels {
            for own in &level.compared {
                let with = |row: &&Vec<&str>| row[kind] == own.label && row[speed] == level.label;
                let peaks: Vec<f64> = rows
                    .iter()
                    .filter(with)
                    .map(|row| row[peak].parse().unwrap())
                    .collect();
                let bad = peaks.iter().filter(|peak| **peak > 0.3).count();
                beyond += bad;
                assert_eq!((own.drives.count, peaks.len()), (20, 20));
                assert_eq!(own.drives.beyond, Some(bad as f64 / 20.0));
                assert!((own.drives.mean.unwrap() - peaks.iter().sum::<f64>() / 20.0).abs() < 1e-12);
            }
        }
        assert!((1..80).contains(&beyond), "{beyond}");
        assert!(
            effect("failure.kind")
                .levels
                .iter()
                .all(|level| level.compared.is_empty())
        );
        let slices = &effect("driver.t_p_s").levels;
        let drives = slices
            .iter()
            .flat_map(|level| &level.compared)
            .map(|own| own.drives.count);
        assert_eq!(drives.sum::<u64>(), 80);
    }

    /// Effects of a sweep whose drives have these peaks; none: it diverged.
    fn effects_of(text: &str, vary: &str, peak: impl Fn(&DesignPoint) -> Option<f64>) -> Vec<Effect> {
        let text = format!("metrics = [\"peak_lateral_error_m\"]\n{text}");
        let sweep = crate::sweep::tests::with_road(&text, vary);
        let mut effects = Effects::new(&sweep, 0, Confidence::USUAL);
        for drive in 0..sweep.drives() {
            let point = sweep.point(drive);
            let peak = peak(&point);
            let driven = Driven {
                diverged: peak.is_none(),
                end_m: 0.0,
                away: Default::default(),
                metrics: vec![peak],
            };
            let is_beyond = sweep
                .limit
                .is_some_and(|limit| peak.is_none_or(|peak| peak > limit));
            effects.add(&point, &driven, is_beyond);
        }
        effects.finish()
    }

    const TWO_FIELDS: &str =
        "[vary]\nspeed_m_per_s = [14, 17, 22]\n\"driver.t_p_s\" = { uniform = [0.1, 0.4] }\n";

    /// What every sample shares is no doubt about a list's values: means of 1.0, 0.9 and 1.1 with a spread of 1 between samples
    /// are told apart as soon as the difference is the same in each sample. Of 20 samples with peaks 0, 2, 0, 2 ... the interval
    /// is 2.093 times sqrt(1.0526 / 20), Student's quantile of 19 degrees.
    #[test]
    fn values_are_compared_sample_by_sample() {
        let base = |point: &DesignPoint| 2.0 * (point.sample % 2) as f64;
        let better = [0.1, 0.0, 0.2];
        let found = effects_of("samples = 20\n", TWO_FIELDS, |point| {
            Some(base(point) + better[point.levels[0] as usize])
        });
        let speed = &found[0];
        assert_eq!(
            (speed.best.as_slice(), speed.unit.as_deref()),
            (&["17".to_string()][..], Some("m/s"))
        );
        let drives = &speed.levels[1].drives;
        let [low, high] = drives.interval.unwrap();
        let half = 2.093_02 * (1.052_63_f64 / 20.0).sqrt();
        assert!(
            (low - (1.0 - half)).abs() < 1e-4 && (high - (1.0 + half)).abs() < 1e-4,
            "{low} {high}"
        );
        assert!(
            found[1].sliced && found[1].best.is_empty(),
            "the delay does nothing here"
        );
        // Nothing differs: nothing is best. Nor is a difference of half a percent, however sure.
        for small in [0.0, 0.005] {
            let alike = effects_of("samples = 20\n", TWO_FIELDS, |point| {
                Some(base(point) + small * f64::from(point.levels[0]) / 2.0)
            });
            assert!(alike[0].best.is_empty(), "{:?}", alike[0].best);
        }
        // A difference that comes and goes with the samples is chance.
        let noisy = effects_of("samples = 20\n", TWO_FIELDS, |point| {
            let sign = if (point.sample / 2 + u64::from(point.levels[0])).is_multiple_of(2) {
                1.0
            } else {
                -1.0
            };
            Some(1.0 + 0.5 * sign)
        });
        assert!(noisy[0].best.is_empty(), "{:?}", noisy[0].best);
    }

    #[test]
    fn a_level_whose_drives_diverge_is_not_the_best() {
        let found = effects_of("samples = 20\n", TWO_FIELDS, |point| match point.levels[0] {
            0 => (point.sample > 0).then_some(0.1),
            1 => Some(0.5),
            _ => Some(0.7),
        });
        assert_eq!(
            (found[0].best.as_slice(), found[0].levels[0].drives.diverged),
            (&["17".to_string()][..], 1)
        );
    }

    /// Where nothing is drawn each mean is all there is; where there is a limit, its share counts: 1 of 20 against 12 and 20.
    #[test]
    fn lists_alone_and_limits_are_judged_too() {
        let lists = effects_of(
            "",
            "[vary]\nspeed_m_per_s = [14, 17]\n\"driver.t_p_s\" = [0.1, 0.2]\n",
            |point| Some(1.0 + 0.1 * f64::from(point.levels[1])),
        );
        assert_eq!(lists[0].field, "driver.t_p_s");
        let best: Vec<_> = lists.iter().map(|effect| effect.best.clone()).collect();
        assert_eq!(best, [Vec::<String>::new(), vec!["14".into()]]);
        assert_eq!(lists[1].levels[0].drives.interval, None);
        let limited = effects_of("samples = 20\nlimit = 0.3\n", TWO_FIELDS, |point| {
            let bad = point.sample < [1, 12, 20][point.levels[0] as usize];
            Some(if bad {
                0.4
            } else {
                0.2 - 0.01 * f64::from(point.levels[0])
            })
        });
        assert_eq!(limited[0].best, ["14"]);
        assert_eq!(limited[0].levels[1].drives.beyond, Some(0.6));
    }
}
