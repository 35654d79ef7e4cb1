//! Drives that belong together: their metrics' moments, and the intervals that follow from them.

use serde::Serialize;

use super::Driven;
use crate::statistics::{Confidence, wilson};

/// What came of some drives.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Drives {
    /// How many.
    #[serde(rename = "drives")]
    pub count: u64,
    /// Drives that diverged: their metrics, if they have any, end there.
    pub diverged: u64,
    /// Mean of the metric that judges.
    pub mean: Option<f64>,
    /// Its interval (Student), if there are two observations.
    pub interval: Option<[f64; 2]>,
    /// Share of the drives beyond the limit, if there is one.
    pub beyond: Option<f64>,
    /// Its interval (Wilson).
    pub beyond_interval: Option<[f64; 2]>,
}

/// Welford's sums.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moments {
    pub(super) count: u64,
    pub(super) mean: f64,
    squares: f64,
}

/// Drives that belong together.
#[derive(Debug, Clone, Default)]
pub(super) struct Group {
    pub(super) drives: u64,
    pub(super) diverged: u64,
    pub(super) beyond: u64,
    pub(super) judged: Moments,
    /// The sample under way, by repeat: drives, and the metric that judges.
    pub(super) now: Vec<(u64, Moments)>,
    /// The means of the samples before.
    pub(super) observed: Moments,
    /// How many samples came before, with a mean or without.
    observations: u64,
}

impl Moments {
    pub(super) fn add(&mut self, value: f64) {
        self.count += 1;
        let before = value - self.mean;
        self.mean += before / self.count as f64;
        self.squares += before * (value - self.mean);
    }

    pub(super) fn mean(&self) -> Option<f64> {
        (self.count > 0).then_some(self.mean)
    }

    /// Divisor n - 1; none of fewer than two.
    pub(super) fn variance(&self) -> Option<f64> {
        (self.count > 1).then(|| self.squares / (self.count as f64 - 1.0))
    }

    /// Variance of the mean, and its degrees of freedom; none of fewer than two.
    pub(super) fn of_mean(&self) -> Option<(f64, f64)> {
        let count = self.count as f64;
        Some((self.variance()? / count, count - 1.0))
    }
}

impl Group {
    pub(super) fn add(&mut self, repeat: usize, driven: &Driven, judged: Option<f64>, is_beyond: bool) {
        self.drives += 1;
        self.diverged += u64::from(driven.diverged);
        self.beyond += u64::from(is_beyond);
        if self.now.len() <= repeat {
            self.now.resize(repeat + 1, Default::default());
        }
        let (drives, metric) = &mut self.now[repeat];
        *drives += 1;
        if let Some(value) = judged {
            metric.add(value);
            self.judged.add(value);
        }
    }

    pub(super) fn end_sample(&mut self) {
        for (drives, metric) in self.now.drain(..) {
            self.observations += u64::from(drives > 0);
            metric.mean().into_iter().for_each(|mean| self.observed.add(mean));
        }
    }

    pub(super) fn finish(&self, has_limit: bool, level: Confidence) -> Drives {
        let mean = self.judged.mean();
        let around = |mean: f64| {
            let (variance, free) = self.observed.of_mean()?;
            let half = level.student(free) * variance.sqrt();
            Some([mean - half, mean + half])
        };
        let beyond = (has_limit && self.drives > 0).then(|| self.beyond as f64 / self.drives as f64);
        Drives {
            count: self.drives,
            diverged: self.diverged,
            mean,
            interval: mean.and_then(around),
            beyond,
            beyond_interval: beyond.map(|share| wilson(share, self.observations as f64, level)),
        }
    }
}

/// Epsilon squared of groups: (SSB - (k - 1) MSW) / SST, not below zero.
pub(super) fn share_between(groups: impl Iterator<Item = Moments> + Clone) -> Option<f64> {
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
    use crate::statistics::student;

    fn group(values: &[f64]) -> Moments {
        let mut moments = Moments::default();
        values.iter().for_each(|value| moments.add(*value));
        moments
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

    /// Student's 97.5 % quantile of 9 degrees is 2.262157.
    #[test]
    fn a_quantile_is_that_of_the_tables() {
        assert!((student(0.975, 9.0) - 2.262_157).abs() < 1e-5);
    }
}
