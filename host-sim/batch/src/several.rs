//! Several drivers beside each other: whether two differ, and what a group is like as a population.
//!
//! Of two drivers the estimates are independent, so the variance of a difference is the sum of theirs. A group is a
//! random-effects model, parameter by parameter: driver i has `theta_i ~ N(mean, spread^2)`, of which the fit of the
//! drive says `theta_i` with its standard error. The spread is that of the largest restricted likelihood, its interval
//! by the Q-profile (Viechtbauer, "Confidence intervals for the amount of heterogeneity in meta-analysis", 2007), the
//! interval of the mean by Knapp and Hartung with Student's t, modified so that it is never narrower than with equal drivers (their factor
//! is at least 1; Roever, Knapp and Friede 2015), and each driver's value is the conditional mean: drawn
//! towards the group the more, the less its own drive says.

use std::f64::consts::SQRT_2;

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use statrs::function::erf::erfc;

use haptic_analysis::identify::{Identification, Parameter};

use crate::statistics::{Confidence, Held, extent, halved};

/// One parameter of two drivers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// Key of the parameter.
    pub parameter: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// The first driver's value less the second's.
    pub difference: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// Its interval, of this parameter alone.
    #[serde(flatten)]
    pub interval: Held,
    /// How probable such a difference is between equal drivers, times what Holm's method (1979) takes for the number of
    /// parameters compared; 1 at most.
    pub p_holm: f64,
    /// Whether the drivers differ: `p_holm` is below 0.05, so that with equal drivers one pair in twenty has any such parameter.
    pub real: bool,
}

/// What tells two drivers apart: the parameters that both records tell something of, identified or not.
pub fn differences(first: &Identification, second: &Identification, level: Confidence) -> Vec<Difference> {
    let pairs = first.parameters.list().into_iter().zip(second.parameters.list());
    let mut found: Vec<Difference> = pairs
        .filter_map(|((parameter, unit, a), (_, _, b))| {
            let ((a, a_error), (b, b_error)) = (value_and_error(a)?, value_and_error(b)?);
            let (difference, standard_error) = (a - b, a_error.hypot(b_error));
            let margin = level.normal() * standard_error;
            Some(Difference {
                parameter,
                unit,
                difference,
                standard_error,
                interval: Held::new("interval", level, [difference - margin, difference + margin]),
                p_holm: erfc(difference.abs() / standard_error / SQRT_2),
                real: false,
            })
        })
        .collect();
    let corrected = holm(&found.iter().map(|d| d.p_holm).collect::<Vec<_>>());
    for (d, p_holm) in found.iter_mut().zip(corrected) {
        (d.p_holm, d.real) = (p_holm, p_holm < 0.05);
    }
    found
}

/// Probabilities of several tests, so that the least of them is wrongly below a level in no more than that share (Holm 1979).
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    let (mut corrected, mut last) = (vec![1.0; p.len()], 0.0_f64);
    for (rank, &i) in order.iter().enumerate() {
        last = last.max((p.len() - rank) as f64 * p[i]).min(1.0);
        corrected[i] = last;
    }
    corrected
}

/// What a record tells of a parameter, however little: value and standard error. Nothing of one that was given, that lies on a
/// bound of the search, or whose model is refuted.
pub fn value_and_error(p: &Parameter) -> Option<(f64, f64)> {
    let value = p.estimate.or(p.optimum.filter(|_| !p.on_bound))?;
    let error = p.standard_error.filter(|&error| error > 0.0 && !p.fixed)?;
    Some((value, error))
}

/// One parameter of a group of drivers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Population {
    /// Key of the parameter.
    pub parameter: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Drivers whose records tell something of it; those that tell little weigh little.
    pub drivers: usize,
    /// Mean of the group.
    pub mean: f64,
    /// Interval of the mean.
    #[serde(flatten)]
    pub mean_interval: Held,
    /// Standard deviation between drivers.
    pub spread: f64,
    /// Interval of the spread.
    #[serde(flatten)]
    pub spread_interval: Held,
    /// Each driver's value given the group, in the order given; none where the record tells nothing of it.
    pub each: Vec<Option<f64>>,
}

/// What the group is like, for each parameter that the records of at least three drivers tell something of.
pub fn population(found: &[&Identification], level: Confidence) -> Vec<Population> {
    let Some(first) = found.first() else {
        return Vec::new();
    };
    first
        .parameters
        .list()
        .into_iter()
        .enumerate()
        .filter_map(|(i, (parameter, unit, _))| {
            let all: Vec<Option<(f64, f64)>> = found
                .iter()
                .map(|f| value_and_error(f.parameters.list()[i].2))
                .collect();
            let known: Vec<(f64, f64)> = all.iter().copied().flatten().collect();
            let effects = RandomEffects::from_values(&known, level)?;
            Some(Population {
                parameter,
                unit,
                drivers: known.len(),
                mean: effects.mean,
                mean_interval: Held::new("mean_interval", level, effects.mean_interval),
                spread: effects.variance.sqrt(),
                spread_interval: Held::new(
                    "spread_interval",
                    level,
                    effects.variance_interval.map(f64::sqrt),
                ),
                each: all.iter().map(|x| x.map(|(y, s)| effects.shrunk(y, s))).collect(),
            })
        })
        .collect()
}

/// A random-effects model of values with standard errors.
#[derive(Debug, Clone, Copy)]
struct RandomEffects {
    mean: f64,
    mean_interval: [f64; 2],
    variance: f64,
    variance_interval: [f64; 2],
}

/// Fewest drivers that have a spread.
const FEWEST: usize = 3;
/// Halvings of an interval until it is done.
const HALVINGS: usize = 200;

impl RandomEffects {
    fn from_values(values: &[(f64, f64)], level: Confidence) -> Option<Self> {
        if values.len() < FEWEST {
            return None;
        }
        let freedom = (values.len() - 1) as f64;
        let variance = restricted_variance(values);
        let (mean, weight, q) = weighed(values, variance);
        let error = ((q / freedom).max(1.0) / weight).sqrt();
        let t = level.student(freedom);
        let chi = ChiSquared::new(freedom).ok()?;
        // Q falls as the variance grows.
        let at = |share: f64| root(values, chi.inverse_cdf(share));
        Some(Self {
            mean,
            mean_interval: [mean - t * error, mean + t * error],
            variance,
            variance_interval: [at(level.upper()), at(level.lower())],
        })
    }

    fn shrunk(&self, value: f64, error: f64) -> f64 {
        let own = self.variance / (self.variance + error * error);
        self.mean + own * (value - self.mean)
    }
}

/// Mean, sum of the weights and weighed sum of squares at a variance between drivers.
fn weighed(values: &[(f64, f64)], variance: f64) -> (f64, f64, f64) {
    let weight = |s: f64| 1.0 / (s * s + variance);
    let sum: f64 = values.iter().map(|v| weight(v.1)).sum();
    let mean = values.iter().map(|v| weight(v.1) * v.0).sum::<f64>() / sum;
    let q = values.iter().map(|v| weight(v.1) * (v.0 - mean).powi(2)).sum();
    (mean, sum, q)
}

/// A variance that is surely too large.
fn largest(values: &[(f64, f64)]) -> f64 {
    let [low, high] = extent(values.iter().map(|v| v.0));
    1e4 * (high - low).powi(2) + 1e-12
}

fn root(values: &[(f64, f64)], level: f64) -> f64 {
    let exceeds = |variance: f64| weighed(values, variance).2 > level;
    if !exceeds(0.0) {
        return 0.0;
    }
    halved([0.0, largest(values)], HALVINGS, exceeds)
}

/// The variance between drivers of the largest restricted likelihood, by bisection of its derivative.
fn restricted_variance(values: &[(f64, f64)]) -> f64 {
    // 2 dl/dv = -sum w + sum w^2/sum w + sum w^2 (y - mean)^2.
    let rises = |variance: f64| {
        let (mean, sum, _) = weighed(values, variance);
        let weight = |s: f64| 1.0 / (s * s + variance);
        let squares: f64 = values.iter().map(|v| weight(v.1).powi(2)).sum();
        let far: f64 = values.iter().map(|v| (weight(v.1) * (v.0 - mean)).powi(2)).sum();
        far + squares / sum - sum > 0.0
    };
    if !rises(0.0) {
        return 0.0;
    }
    halved([0.0, largest(values)], HALVINGS, rises)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// R: `p.adjust(c(0.01, 0.04, 0.03, 0.005), "holm")`.
    #[test]
    fn several_tests_are_corrected_as_r_does() {
        let corrected = holm(&[0.01, 0.04, 0.03, 0.005]);
        for (found, expected) in corrected.iter().zip([0.03, 0.06, 0.06, 0.02]) {
            assert!((found - expected).abs() < 1e-12, "{corrected:?}");
        }
    }

    /// A driver who is not identified counts with what the drive tells; one on a bound, or refuted, does not.
    #[test]
    fn an_imprecise_drive_counts() {
        let p = Parameter {
            estimate: None,
            standard_error: Some(0.2),
            interval_95: Some([0.1, 0.9]),
            identified: false,
            on_bound: false,
            fixed: false,
            optimum: Some(0.5),
            errors: None,
        };
        assert_eq!(value_and_error(&p), Some((0.5, 0.2)));
        assert_eq!(value_and_error(&Parameter { on_bound: true, ..p }), None);
        assert_eq!(
            value_and_error(&Parameter {
                standard_error: None,
                ..p
            }),
            None
        );
    }

    /// The trials of the BCG vaccine (log relative risks and variances as printed by R's metafor for `dat.bcg`), whose
    /// documented results are tau^2 0.3132 with the Q-profile's interval 0.1197 to 1.1115, and the mean -0.7145.
    #[test]
    fn the_published_results_of_the_bcg_trials_are_found() {
        let y = [
            -0.8893, -1.5854, -1.3481, -1.4416, -0.2175, -0.7861, -1.6209, 0.0120, -0.4694, -1.3713, -0.3394,
            0.4459, -0.0173,
        ];
        let v = [
            0.3256_f64, 0.1946, 0.4154, 0.0200, 0.0512, 0.0069, 0.2230, 0.0040, 0.0564, 0.0730, 0.0124,
            0.5325, 0.0714,
        ];
        let values: Vec<(f64, f64)> = y.into_iter().zip(v.map(f64::sqrt)).collect();
        let found = RandomEffects::from_values(&values, Confidence::USUAL).unwrap();
        assert!((found.variance - 0.3132).abs() < 1e-3, "{found:?}");
        assert!((found.mean + 0.7145).abs() < 1e-3, "{found:?}");
        let [low, high] = found.variance_interval;
        assert!(
            (low - 0.1197).abs() < 2e-3 && (high - 1.1115).abs() < 5e-3,
            "{found:?}"
        );
    }

    /// The eight schools (Rubin 1981): no spread beyond the errors, and the mean 7.69 of equal schools.
    #[test]
    fn drivers_who_do_not_differ_have_no_spread() {
        let y = [28.0, 8.0, -3.0, 7.0, -1.0, 1.0, 18.0, 12.0];
        let s = [15.0, 10.0, 16.0, 11.0, 9.0, 11.0, 10.0, 18.0];
        let values: Vec<(f64, f64)> = y.into_iter().zip(s).collect();
        let found = RandomEffects::from_values(&values, Confidence::USUAL).unwrap();
        assert_eq!(found.variance, 0.0);
        assert!((found.mean - 7.69).abs() < 0.01, "{found:?}");
        // numpy and SciPy: Q is 0.672 times its freedom, which would narrow the interval; with a factor of 1 it is 7.686 -+ 2.3646 * 4.072.
        let [low, high] = found.mean_interval;
        assert!(
            (low + 1.9429).abs() < 1e-3 && (high - 17.3142).abs() < 1e-3,
            "{found:?}"
        );
        // At 99 % Student's quantile of 7 degrees of freedom is 3.4995 in tables.
        let level = Confidence::new(0.99).unwrap();
        let [low, high] = RandomEffects::from_values(&values, level).unwrap().mean_interval;
        assert!(((high - low) / (17.3142 + 1.9429) - 3.4995 / 2.3646).abs() < 1e-3);
        assert!((found.shrunk(28.0, 15.0) - found.mean).abs() < 1e-12);
    }
}
