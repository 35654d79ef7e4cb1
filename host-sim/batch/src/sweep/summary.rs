//! What a sweep found, gathered drive by drive in memory that does not grow with their number.

use std::collections::BTreeMap;

use haptic_metrics::Definition;
use haptic_sim::unguided::Cause;
use serde::Serialize;

use super::effects::{Effects, small_is_bad};
use super::groups::Moments;
use super::saltelli::{Blocks, SobolIndex};
use super::{Design, DesignPoint, Driven, Effect, Sweep};
use crate::Away;
use crate::engine::text;
use crate::statistics::Confidence;

/// Drives that are shown as the worst.
const WORST: usize = 10;

/// What a sweep found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// The program that drove.
    pub version: String,
    /// How samples were drawn.
    pub design: Design,
    /// Drives in the table.
    pub drives: u64,
    /// Drives that were planned: more, if the sweep was stopped early.
    pub planned: u64,
    /// Drives that were stopped because they diverged.
    pub diverged: u64,
    /// Drives in which the ECU ended guidance by itself.
    pub left_by_itself: u64,
    /// How many of them, by why.
    pub left_why: BTreeMap<String, u64>,
    /// The metric by which drives are called bad.
    pub judge: &'static str,
    /// Beyond it a drive is bad, if there is a limit.
    pub limit: Option<f64>,
    /// How often intervals hold what they are of.
    #[serde(skip_serializing_if = "Confidence::is_usual")]
    pub level: Confidence,
    /// Drives beyond the limit, and those that diverged.
    pub beyond: Option<u64>,
    /// The field whose values are told apart, if the sweep compares.
    pub compare: Option<String>,
    /// The distribution of each metric.
    pub distributions: Vec<Distribution>,
    /// The effect of each axis.
    pub effects: Vec<Effect>,
    /// The indices of each sampled field and metric, if the design allows.
    pub sobol: Vec<SobolIndex>,
    /// The worst drives, the worst first.
    pub worst: Vec<Worst>,
}

/// How the values of a metric are spread. Quantiles are right to 0.2 % of their value.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Distribution {
    /// Name of the metric.
    pub metric: &'static str,
    /// Drives with a value.
    pub count: u64,
    /// Mean.
    pub mean: Option<f64>,
    /// Standard deviation, divisor n - 1.
    pub sd: Option<f64>,
    /// Smallest value.
    pub min: Option<f64>,
    /// The values below which 5, 25, 50, 75, 95 and 99 % of the drives lie.
    pub quantiles: Vec<(f64, f64)>,
    /// Largest value.
    pub max: Option<f64>,
    /// Value and share of the drives at or below it, for a picture.
    pub cumulative: Vec<(f64, f64)>,
}

/// One of the worst drives.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Worst {
    /// Its number.
    pub drive: u64,
    /// Its scenario's seed.
    pub seed: u64,
    /// What is varied, in order of the columns.
    pub values: Vec<String>,
    /// Whether it diverged.
    pub diverged: bool,
    /// When the guidance was away.
    #[serde(flatten)]
    pub away: Away,
    /// The metric by which it is judged.
    pub value: Option<f64>,
}

const QUANTILES: [f64; 6] = [0.05, 0.25, 0.5, 0.75, 0.95, 0.99];
/// Points of a picture.
const POINTS: usize = 200;

/// A summary on its way.
pub(super) struct Summarised<'a> {
    sweep: &'a Sweep,
    judge: usize,
    drives: u64,
    diverged: u64,
    left: BTreeMap<Cause, u64>,
    beyond: u64,
    spreads: Vec<Spread>,
    effects: Effects<'a>,
    blocks: Option<Blocks>,
    worst: Vec<Worst>,
}

impl<'a> Summarised<'a> {
    pub(super) fn new(sweep: &'a Sweep, level: Confidence) -> Self {
        let metrics = sweep.metrics().len();
        let fields = sweep.sampled.len();
        let is_judge = |d: &&Definition| d.name == sweep.judge().name;
        let judge = sweep.metrics().iter().position(is_judge).unwrap_or(0);
        Self {
            sweep,
            judge,
            drives: 0,
            diverged: 0,
            left: BTreeMap::new(),
            beyond: 0,
            spreads: vec![Spread::default(); metrics],
            effects: Effects::new(sweep, judge, level),
            blocks: (sweep.design() == Design::Saltelli).then(|| Blocks::new(fields, metrics)),
            worst: Vec::new(),
        }
    }

    pub(super) fn add(&mut self, point: &DesignPoint, driven: &Driven) {
        self.drives += 1;
        self.diverged += u64::from(driven.diverged);
        if let Some(why) = driven.away.guidance_left_why.filter(|why| !why.is_asked_for()) {
            *self.left.entry(why).or_default() += 1;
        }
        let judged = driven.metrics[self.judge];
        let small = small_is_bad(self.sweep.judge());
        let is_beyond = self.sweep.limit.is_some_and(|limit| {
            driven.diverged || judged.is_some_and(|value| if small { value < limit } else { value > limit })
        });
        self.beyond += u64::from(is_beyond);
        for (spread, value) in self.spreads.iter_mut().zip(&driven.metrics) {
            if let Some(value) = value {
                spread.add(*value);
            }
        }
        self.effects.add(point, driven, is_beyond);
        if let Some(blocks) = &mut self.blocks {
            blocks.add(point.sample, point.role, &driven.metrics);
        }
        self.keep_if_bad(point, driven, judged);
    }

    fn keep_if_bad(&mut self, point: &DesignPoint, driven: &Driven, value: Option<f64>) {
        let sign = if small_is_bad(self.sweep.judge()) {
            -1.0
        } else {
            1.0
        };
        let badness =
            |diverged: bool, value: Option<f64>| (diverged, value.map_or(f64::NEG_INFINITY, |v| sign * v));
        let own = badness(driven.diverged, value);
        // Behind its equals: the first of them stay.
        let behind = |worst: &Worst| {
            let other = badness(worst.diverged, worst.value);
            other.0.cmp(&own.0).then(other.1.total_cmp(&own.1)).is_ge()
        };
        let place = self.worst.partition_point(behind);
        if place < WORST {
            let values = point.values.iter().map(text).collect();
            let worst = Worst {
                drive: point.drive,
                seed: point.seed,
                values,
                diverged: driven.diverged,
                away: driven.away,
                value,
            };
            self.worst.insert(place, worst);
            self.worst.truncate(WORST);
        }
    }

    pub(super) fn finish(self, drives: u64, version: &str) -> Summary {
        debug_assert_eq!(drives, self.drives);
        let names: Vec<&'static str> = self.sweep.metrics().iter().map(|d| d.name).collect();
        let fields: Vec<String> = self
            .sweep
            .sampled
            .iter()
            .map(|axis| axis.columns[0].name.clone())
            .collect();
        Summary {
            version: version.into(),
            design: self.sweep.design(),
            drives: self.drives,
            planned: self.sweep.drives(),
            diverged: self.diverged,
            left_by_itself: self.left.values().sum(),
            left_why: self
                .left
                .iter()
                .map(|(why, count)| (why.to_string(), *count))
                .collect(),
            judge: self.sweep.judge().name,
            limit: self.sweep.limit,
            level: self.effects.confidence(),
            beyond: self.sweep.limit.map(|_| self.beyond),
            compare: self.sweep.compare.and_then(|axis| {
                let axis = self.sweep.axes().nth(axis)?;
                Some(axis.columns[0].name.clone())
            }),
            distributions: names
                .iter()
                .zip(&self.spreads)
                .map(|(name, spread)| spread.finish(name))
                .collect(),
            effects: self.effects.finish(),
            sobol: self
                .blocks
                .map(|blocks| blocks.finish(&fields, &names))
                .unwrap_or_default(),
            worst: self.worst,
        }
    }
}

/// Counts of values in classes of 0.4 % of their size.
#[derive(Debug, Clone, Default)]
pub(super) struct Spread {
    classes: BTreeMap<i64, u64>,
    all: Moments,
    min: Option<f64>,
    max: Option<f64>,
}

/// Bits of a number that a class does not tell apart: it keeps sign, exponent and eight bits behind the point.
const CLASS_BITS: u32 = 44;

fn class(value: f64) -> i64 {
    let size = (value.abs().to_bits() >> CLASS_BITS) as i64;
    if value < 0.0 { -size } else { size }
}

/// The middle of a class.
fn middle(class: i64) -> f64 {
    if class == 0 {
        return 0.0;
    }
    let size = f64::from_bits((class.unsigned_abs() << CLASS_BITS) | (1 << (CLASS_BITS - 1)));
    if class < 0 { -size } else { size }
}

impl Spread {
    pub(super) fn add(&mut self, value: f64) {
        *self.classes.entry(class(value)).or_default() += 1;
        self.all.add(value);
        self.min = Some(self.min.map_or(value, |min| min.min(value)));
        self.max = Some(self.max.map_or(value, |max| max.max(value)));
    }

    pub(super) fn finish(&self, metric: &'static str) -> Distribution {
        let within = |value: f64| value.clamp(self.min.unwrap_or(value), self.max.unwrap_or(value));
        let mut sums = Vec::with_capacity(self.classes.len());
        let mut sum = 0;
        for (class, count) in &self.classes {
            sum += count;
            sums.push((within(middle(*class)), sum));
        }
        let quantile = |share: f64| {
            let rank = (share * self.all.count as f64).ceil().max(1.0) as u64;
            let at = sums.partition_point(|(_, sum)| *sum < rank);
            sums.get(at).map(|(value, _)| (share, *value))
        };
        let every = sums.len().div_ceil(POINTS).max(1);
        let shown = sums
            .iter()
            .enumerate()
            .filter(|(i, _)| i % every == 0 || i + 1 == sums.len());
        Distribution {
            metric,
            count: self.all.count,
            mean: self.all.mean(),
            sd: self.all.variance().map(f64::sqrt),
            min: self.min,
            quantiles: QUANTILES.iter().filter_map(|share| quantile(*share)).collect(),
            max: self.max,
            cumulative: shown
                .map(|(_, (value, sum))| (*value, *sum as f64 / self.all.count as f64))
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every figure of the numbers 1 to 1000 is known by hand.
    #[test]
    fn a_spread_of_known_numbers_has_their_figures() {
        let mut spread = Spread::default();
        (1..=1000).rev().for_each(|i| spread.add(f64::from(i)));
        let found = spread.finish("peak");
        assert_eq!(
            (found.count, found.min, found.max),
            (1000, Some(1.0), Some(1000.0))
        );
        assert!((found.mean.unwrap() - 500.5).abs() < 1e-9);
        // (n^2 - 1) / 12 with divisor n - 1.
        assert!((found.sd.unwrap() - (1000.0_f64 * 1001.0 / 12.0).sqrt()).abs() < 1e-9);
        for (share, value) in &found.quantiles {
            assert!((value / (share * 1000.0) - 1.0).abs() < 0.003, "{share}: {value}");
        }
        let last = found.cumulative.last().unwrap();
        assert!(last.1 == 1.0 && (last.0 / 1000.0 - 1.0).abs() < 0.003);
    }

    #[test]
    fn classes_keep_order_and_size() {
        let values = [-300.0, -0.001, 0.0, 1e-9, 0.5, 0.502, 7.0];
        assert!(values.windows(2).all(|pair| class(pair[0]) <= class(pair[1])));
        for value in values {
            assert!(
                (middle(class(value)) - value).abs() <= 0.002 * value.abs(),
                "{value}"
            );
        }
    }
}
