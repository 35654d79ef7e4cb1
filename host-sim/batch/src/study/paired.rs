//! Differences between two conditions within participants.
//!
//! Each participant has one value under each condition: the mean over the repetitions. The differences of the
//! participants who have both values are assumed to be normally distributed. Their mean gets Student's interval; the
//! *effect size* d_z is the mean divided by the standard deviation of the differences (Lakens 2013, Front. Psychol.
//! 4:863).

use haptic_metrics::{DEFINITIONS, Definition};
use serde::Serialize;

use super::SessionResult;
use crate::statistics::{Confidence, Mean, deviation, mean};

/// One metric under two conditions.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// Name of the metric.
    pub metric: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// The condition whose value is subtracted.
    pub from: String,
    /// The other one.
    pub to: String,
    /// Participants with a value under both.
    pub participants: usize,
    /// Mean of the differences; its interval is not corrected for the number of metrics and pairs.
    #[serde(flatten)]
    pub mean: Mean,
    /// d_z; none of a single participant, or where all differences are the same.
    pub effect_size: Option<f64>,
}

/// The value of each participant under a condition, in the order of the sessions: the mean over the repetitions that
/// stayed on the road, `None` without one.
#[must_use]
pub fn of_participants(sessions: &[SessionResult], condition: &str, metric: &Definition) -> Vec<Option<f64>> {
    let of_one = |own: &[SessionResult]| {
        let own = own.iter().filter(|s| s.condition == condition);
        let records = own.filter_map(|s| Some(s.recorded.as_ref()?.record));
        let values = records
            .filter(|r| !r.diverged)
            .filter_map(|r| (metric.value)(&r.metrics));
        mean(values)
    };
    let each = sessions.chunk_by(|a, b| a.participant == b.participant);
    each.map(of_one).collect()
}

/// The differences of every pair of conditions, later minus earlier, in every metric that has values.
pub(super) fn differences(
    conditions: &[String],
    sessions: &[SessionResult],
    level: Confidence,
) -> Vec<Difference> {
    let mut all = Vec::new();
    for (place, from) in conditions.iter().enumerate() {
        for to in &conditions[place + 1..] {
            all.extend(DEFINITIONS.iter().filter_map(|metric| {
                let [before, after] = [from, to].map(|name| of_participants(sessions, name, metric));
                let pairs = before.into_iter().zip(after);
                let found: Vec<f64> = pairs
                    .filter_map(|(before, after)| Some(after? - before?))
                    .collect();
                let mean = Mean::new(&found, level)?;
                Some(Difference {
                    metric: metric.name,
                    unit: metric.unit,
                    from: from.clone(),
                    to: to.clone(),
                    participants: found.len(),
                    mean,
                    effect_size: effect_size(&found, mean.mean),
                })
            }));
        }
    }
    all
}

/// d_z of differences with this mean.
fn effect_size(differences: &[f64], mean: f64) -> Option<f64> {
    let deviation = deviation(differences, mean)?;
    (deviation > 0.0).then(|| mean / deviation)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// SciPy 1.17.1: `r = stats.ttest_rel(a, b); r.confidence_interval(0.95)` of a = 1.2, 0.8, 1.5, 0.9, 1.1 and
    /// b = 1.0, 0.9, 1.1, 0.7, 1.0.
    #[test]
    fn agrees_with_scipy() {
        let differences = [0.2, -0.1, 0.4, 0.2, 0.1];
        let mean = Mean::new(&differences, Confidence::USUAL).unwrap();
        let [low, high] = mean.interval.unwrap();
        for (value, expected) in [
            (mean.mean, 0.16),
            (low, -0.065_559_466_629_904),
            (high, 0.385_559_466_629_904),
            (
                effect_size(&differences, mean.mean).unwrap(),
                0.880_771_012_101_088,
            ),
        ] {
            assert!((value - expected).abs() < 1e-9, "{value} instead of {expected}");
        }
    }

    #[test]
    fn one_participant_has_no_effect_size_and_nor_have_equal_differences() {
        assert_eq!(effect_size(&[0.5], 0.5), None);
        assert_eq!(effect_size(&[0.5, 0.5], 0.5), None);
    }
}
