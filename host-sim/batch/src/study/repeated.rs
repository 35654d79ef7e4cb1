//! Whether three and more conditions differ in a metric: repeated measures.
//!
//! Each participant has one value under each condition. The test is the analysis of variance within participants; where the
//! differences between conditions do not scatter alike, its degrees of freedom are too many, and Greenhouse and Geisser's epsilon
//! (1959, Psychometrika 24:95-112) takes of them what is too much. Over the metrics the probabilities are corrected by Holm's method
//! (1979), so that among conditions that are equal one study in twenty has any metric below 5 %.

use crate::several::holm;
use haptic_metrics::DEFINITIONS;
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::{SessionResult, of_participants};
use crate::statistics::mean;

/// One metric under all conditions.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Repeated {
    /// Name of the metric.
    pub metric: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Participants with a value under each condition.
    pub participants: usize,
    /// The test.
    #[serde(flatten)]
    pub test: Test,
    /// Its probability, corrected for the number of metrics.
    pub p_holm: f64,
}

/// An analysis of variance within participants.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Test {
    /// F.
    pub f: f64,
    /// Its degrees of freedom, times epsilon.
    pub freedom: [f64; 2],
    /// Greenhouse and Geisser's epsilon: 1 where all differences scatter alike.
    pub epsilon: f64,
    /// How probable such an F is, or a larger one, where the conditions are equal.
    pub p: f64,
}

/// The test of each metric that at least three participants have a value of under each of three or more conditions; empty of fewer.
pub(super) fn repeated(conditions: &[String], sessions: &[SessionResult]) -> Vec<Repeated> {
    if conditions.len() < 3 {
        return Vec::new();
    }
    let of_metric = |metric: &'static haptic_metrics::Definition| {
        let columns = conditions
            .iter()
            .map(|name| of_participants(sessions, name, metric));
        let columns: Vec<Vec<Option<f64>>> = columns.collect();
        let row = |i: usize| {
            columns
                .iter()
                .map(|column| column[i])
                .collect::<Option<Vec<f64>>>()
        };
        let rows: Vec<Vec<f64>> = (0..columns[0].len()).filter_map(row).collect();
        Some(Repeated {
            metric: metric.name,
            unit: metric.unit,
            participants: rows.len(),
            test: Test::new(&rows)?,
            p_holm: 1.0,
        })
    };
    let mut found: Vec<Repeated> = DEFINITIONS.iter().filter_map(of_metric).collect();
    let corrected = holm(&found.iter().map(|r| r.test.p).collect::<Vec<_>>());
    for (r, p_holm) in found.iter_mut().zip(corrected) {
        r.p_holm = p_holm;
    }
    found
}

impl Test {
    /// A row is a participant, a column a condition; none of fewer than three rows, or where nothing scatters.
    fn new(rows: &[Vec<f64>]) -> Option<Self> {
        let (n, k) = (rows.len(), rows.first()?.len());
        if n < 3 || k < 2 {
            return None;
        }
        let of_row: Vec<f64> = rows.iter().filter_map(|row| mean(row.iter().copied())).collect();
        let of_column: Vec<f64> = (0..k)
            .filter_map(|j| mean(rows.iter().map(|row| row[j])))
            .collect();
        let whole = mean(of_row.iter().copied())?;
        let left = |i: usize, j: usize| rows[i][j] - of_row[i] - of_column[j] + whole;
        // Without the means of rows and columns: their products are those of the contrasts.
        let products = |a: usize, b: usize| (0..n).map(|i| left(i, a) * left(i, b)).sum::<f64>();
        let trace: f64 = (0..k).map(|j| products(j, j)).sum();
        let pairs = (0..k).flat_map(|a| (0..k).map(move |b| (a, b)));
        let squares: f64 = pairs.map(|(a, b)| products(a, b).powi(2)).sum();
        let between = n as f64 * of_column.iter().map(|mean| (mean - whole).powi(2)).sum::<f64>();
        // Not a number is no scatter either.
        let scatters = trace > 1e-20 * (between + whole * whole);
        if !scatters {
            return None;
        }
        let [conditions, participants] = [k, n].map(|count| (count - 1) as f64);
        let epsilon = (trace * trace / (conditions * squares)).min(1.0);
        let f = (between / conditions) / (trace / (conditions * participants));
        let freedom = [epsilon * conditions, epsilon * conditions * participants];
        let law = FisherSnedecor::new(freedom[0], freedom[1]).ok()?;
        Some(Self {
            f,
            freedom,
            epsilon,
            p: law.sf(f),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// statsmodels 0.14: `AnovaRM(d, 'y', 's', within=['c']).fit()` has F = 4.678304 over 2 and 8 degrees of freedom; epsilon is numpy's
    /// `trace(M)**2 / (2 trace(M @ M))` with M the covariance without its means, and p is `scipy.stats.f.sf(F, 2 * epsilon, 8 * epsilon)`.
    #[test]
    fn agrees_with_statsmodels() {
        let rows = [
            vec![1.2, 0.9, 1.1],
            vec![0.8, 0.7, 0.95],
            vec![1.5, 1.0, 1.2],
            vec![0.9, 0.85, 0.8],
            vec![1.1, 0.9, 1.3],
        ];
        let found = Test::new(&rows).unwrap();
        for (value, expected) in [
            (found.f, 4.678_304_239_401_5),
            (found.epsilon, 0.929_501_667_658_976_7),
            (found.freedom[1] / found.epsilon, 8.0),
            (found.p, 0.050_120_337_177_423_9),
        ] {
            assert!((value - expected).abs() < 1e-9, "{value} instead of {expected}");
        }
        assert_eq!(Test::new(&rows[..2]), None);
        assert_eq!(Test::new(&vec![vec![1.0, 2.0, 3.0]; 4]), None);
    }
}
