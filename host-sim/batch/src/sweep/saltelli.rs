//! Sobol indices from Saltelli's design: how much of a metric's variance a field explains alone (first order; Saltelli
//! et al. 2010, Comput. Phys. Commun. 181:259-270, table 2b) and with all others (total; Jansen 1999, table 2f).

use serde::Serialize;

/// The samples are dealt to so many groups; leaving out one after the other gives the standard errors (jackknife).
const GROUPS: usize = 20;

/// Indices of one field for one metric.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SobolIndex {
    /// The field.
    pub field: String,
    /// The metric.
    pub metric: &'static str,
    /// First order, and its standard error.
    pub first: [f64; 2],
    /// Total, and its standard error.
    pub total: [f64; 2],
}

/// The drives of one sample, and the sums of all.
pub(super) struct Blocks {
    fields: usize,
    /// Drives of the sample that is under way, by role.
    rows: Vec<Vec<Option<f64>>>,
    /// By metric and group.
    sums: Vec<[Sums; GROUPS]>,
}

#[derive(Debug, Clone, Default)]
struct Sums {
    count: f64,
    /// Sums of the first and the second sample: the values and their squares.
    own: [f64; 2],
    squares: f64,
    /// By field: mixture less first sample, that times the second, and its square.
    fields: Vec<[f64; 3]>,
}

impl Blocks {
    pub(super) fn new(fields: usize, metrics: usize) -> Self {
        Self {
            fields,
            rows: Vec::new(),
            sums: (0..metrics)
                .map(|_| std::array::from_fn(|_| Sums::new(fields)))
                .collect(),
        }
    }

    /// The drives come in order of sample and role.
    pub(super) fn add(&mut self, sample: u64, role: u64, metrics: &[Option<f64>]) {
        if role == 0 {
            self.rows.clear();
        }
        self.rows.push(metrics.to_vec());
        if self.rows.len() != self.fields + 2 {
            return;
        }
        for (metric, groups) in self.sums.iter_mut().enumerate() {
            let values: Option<Vec<f64>> = self.rows.iter().map(|row| row[metric]).collect();
            if let Some(values) = values {
                groups[sample as usize % GROUPS].add(&values);
            }
        }
    }

    pub(super) fn finish(&self, fields: &[String], metrics: &[&'static str]) -> Vec<SobolIndex> {
        let mut found = Vec::new();
        for (groups, metric) in self.sums.iter().zip(metrics) {
            for (k, field) in fields.iter().enumerate() {
                let Some(whole) = indices(groups.iter(), k) else {
                    continue;
                };
                let without = |left_out: usize| {
                    let kept = groups.iter().enumerate().filter(move |(i, _)| *i != left_out);
                    indices(kept.map(|(_, sums)| sums), k)
                };
                let parts: Vec<[f64; 2]> = (0..GROUPS).filter_map(without).collect();
                let [first, total] =
                    [0, 1].map(|which| [whole[which], jackknife(parts.iter().map(|part| part[which]))]);
                found.push(SobolIndex {
                    field: field.clone(),
                    metric,
                    first,
                    total,
                });
            }
        }
        found
    }
}

impl Sums {
    fn new(fields: usize) -> Self {
        Self {
            fields: vec![[0.0; 3]; fields],
            ..Self::default()
        }
    }

    fn add(&mut self, values: &[f64]) {
        let (a, b) = (values[0], values[1]);
        self.count += 1.0;
        self.own = [self.own[0] + a, self.own[1] + b];
        self.squares += a * a + b * b;
        for (sums, mixed) in self.fields.iter_mut().zip(&values[2..]) {
            let change = mixed - a;
            *sums = [sums[0] + change, sums[1] + b * change, sums[2] + change * change];
        }
    }
}

fn indices<'a>(groups: impl Iterator<Item = &'a Sums>, field: usize) -> Option<[f64; 2]> {
    let mut all = Sums::new(1);
    for sums in groups {
        all.count += sums.count;
        all.own = [all.own[0] + sums.own[0], all.own[1] + sums.own[1]];
        all.squares += sums.squares;
        for (sum, own) in all.fields[0].iter_mut().zip(sums.fields[field]) {
            *sum += own;
        }
    }
    let n = all.count;
    let mean = (all.own[0] + all.own[1]) / (2.0 * n);
    let variance = all.squares / (2.0 * n) - mean * mean;
    let [change, product, square] = all.fields[0];
    // About the mean: the estimate is the same on average, and scatters less.
    let first = (product - mean * change) / n / variance;
    let total = square / (2.0 * n) / variance;
    (n > 1.0 && variance > 1e-12 * mean * mean && variance > 0.0).then_some([first, total])
}

fn jackknife(parts: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = parts.clone().count() as f64;
    let mean = parts.clone().sum::<f64>() / n;
    (parts.map(|part| (part - mean).powi(2)).sum::<f64>() * (n - 1.0) / n).sqrt()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::sweep::design::Places;
    use crate::sweep::file::Design;

    /// The function of Ishigami and Homma (1990) with a = 7, b = 0.1 has indices in closed form: first order 0.3139, 0.4424,
    /// 0; total 0.5576, 0.4424, 0.2437.
    #[test]
    fn a_function_with_known_indices_has_them() {
        let names = ["x_1", "x_2", "x_3"].map(String::from);
        let places = Places::new(Design::Saltelli, 4096, 1, &names).unwrap();
        let mut blocks = Blocks::new(3, 1);
        for sample in 0..4096 {
            for role in 0..5 {
                let x: Vec<f64> = places
                    .at(sample, role)
                    .iter()
                    .map(|u| PI * (2.0 * u - 1.0))
                    .collect();
                let y = x[0].sin() + 7.0 * x[1].sin().powi(2) + 0.1 * x[2].powi(4) * x[0].sin();
                blocks.add(sample, role, &[Some(y)]);
            }
        }
        let found = blocks.finish(&names, &["y"]);
        let known = [[0.3139, 0.5576], [0.4424, 0.4424], [0.0, 0.2437]];
        for (index, known) in found.iter().zip(known) {
            for ([value, error], known) in [index.first, index.total].into_iter().zip(known) {
                assert!((value - known).abs() < 0.02 && error < 0.05, "{index:?}");
            }
        }
        assert_eq!(found.len(), 3);
    }
}
