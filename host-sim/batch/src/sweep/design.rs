//! Where in the space of the sampled fields each sample lies. Any sample is computed by itself, so that threads,
//! shards and restarts change nothing.

use haptic_sim::seeds::{self, Stream};

use super::file::Design;
use crate::engine::{StudyError, refuse};
use crate::sobol::{DIMENSIONS, Dimension};

/// Most slices of a Latin hypercube: they are kept in memory.
const MOST_SLICES: u64 = 20_000_000;

/// The places of all samples.
#[derive(Debug, Clone)]
pub(super) struct Places {
    design: Design,
    samples: u64,
    fields: Vec<Field>,
}

/// One sampled field.
#[derive(Debug, Clone)]
struct Field {
    /// Seed of the field's own stream.
    seed: u64,
    /// Which slice of a Latin hypercube each sample has.
    slices: Vec<u32>,
    /// The field's own dimension of Sobol's sequence, and that of the second sample; each with its shift.
    sobol: Vec<(Dimension, u32)>,
}

impl Places {
    pub(super) fn new(design: Design, samples: u64, root: u64, names: &[String]) -> Result<Self, StudyError> {
        let stream = Stream::Design.seed(root);
        let each = if design == Design::Saltelli { 2 } else { 1 };
        let is_sobol = matches!(design, Design::Sobol | Design::Saltelli);
        if is_sobol && each * names.len() > DIMENSIONS {
            return refuse(format!(
                "design = \"{design}\" takes at most {} sampled fields",
                DIMENSIONS / each
            ));
        }
        if design == Design::LatinHypercube && samples.saturating_mul(names.len() as u64) > MOST_SLICES {
            return refuse(format!(
                "samples: {samples} of {} fields are more slices than a latin-hypercube keeps, {MOST_SLICES}; sobol and \
                 random keep none",
                names.len()
            ));
        }
        let field = |(i, name): (usize, &String)| {
            let seed = seeds::named(stream, name);
            let numbers = if is_sobol { each } else { 0 };
            let dimension = |k: usize| {
                let shift = (seeds::nth(seed, k as u64) >> 32) as u32;
                (Dimension::new(i + k * names.len()), shift)
            };
            Field {
                seed,
                slices: if design == Design::LatinHypercube {
                    shuffled(samples as u32, seed)
                } else {
                    Vec::new()
                },
                sobol: (0..numbers).map(dimension).collect(),
            }
        };
        Ok(Self {
            design,
            samples,
            fields: names.iter().enumerate().map(field).collect(),
        })
    }

    /// Drives that one sample takes: more than one where mixtures are driven too.
    pub(super) fn roles(&self) -> u64 {
        match self.design {
            Design::Saltelli => self.fields.len() as u64 + 2,
            _ => 1,
        }
    }

    /// Where a sample lies in each field, between 0 and 1. Of Saltelli's design role 0 is the first sample, role 1 the
    /// second, role 2 + k the first with field k of the second.
    pub(super) fn at(&self, sample: u64, role: u64) -> Vec<f64> {
        let place = |(k, field): (usize, &Field)| match self.design {
            Design::Random => middle(seeds::nth(field.seed, sample)),
            Design::LatinHypercube => {
                let slice = field.slices.get(sample as usize).copied().unwrap_or(0);
                (f64::from(slice) + middle(seeds::nth(field.seed, sample))) / self.samples as f64
            }
            Design::Sobol => field.sobol(0, sample),
            Design::Saltelli => field.sobol(usize::from(role == 1 || role == 2 + k as u64), sample),
        };
        self.fields.iter().enumerate().map(place).collect()
    }
}

impl Field {
    fn sobol(&self, which: usize, sample: u64) -> f64 {
        let (dimension, shift) = &self.sobol[which];
        (f64::from(dimension.at(sample as u32) ^ shift) + 0.5) / 4_294_967_296.0
    }
}

/// 53 bits as a number between 0 and 1, neither of them.
fn middle(bits: u64) -> f64 {
    ((bits >> 11) as f64 + 0.5) / 9_007_199_254_740_992.0
}

/// The numbers from 0 in an order of chance (Fisher and Yates).
fn shuffled(count: u32, seed: u64) -> Vec<u32> {
    let mut order: Vec<u32> = (0..count).collect();
    let stream = seeds::named(seed, "order");
    for last in (1..order.len()).rev() {
        // The remainder favours no place by more than 2^-32.
        let other = seeds::nth(stream, last as u64) % (last as u64 + 1);
        order.swap(last, other as usize);
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(design: Design, samples: u64) -> Places {
        let names = ["driver.t_p_s".to_string(), "speed_m_per_s".to_string()];
        Places::new(design, samples, 1, &names).unwrap()
    }

    #[test]
    fn a_latin_hypercube_has_one_sample_in_each_slice_of_each_field() {
        let places = places(Design::LatinHypercube, 1000);
        for field in 0..2 {
            let mut slices: Vec<u32> = (0..1000)
                .map(|n| (places.at(n, 0)[field] * 1000.0) as u32)
                .collect();
            assert!(slices.windows(2).any(|pair| pair[0] > pair[1]));
            slices.sort_unstable();
            assert_eq!(slices, (0..1000).collect::<Vec<_>>());
        }
    }

    /// The first 2^k numbers of a sequence in base 2 lie one in each of so many slices, in both fields, whatever the
    /// shift.
    #[test]
    fn a_sobol_set_is_even() {
        let places = places(Design::Sobol, 256);
        for field in 0..2 {
            let mut slices: Vec<u32> = (0..256)
                .map(|n| (places.at(n, 0)[field] * 256.0) as u32)
                .collect();
            slices.sort_unstable();
            assert_eq!(slices, (0..256).collect::<Vec<_>>());
        }
    }

    #[test]
    fn mixtures_take_one_field_of_the_second_sample() {
        let places = places(Design::Saltelli, 8);
        assert_eq!(places.roles(), 4);
        let [a, b, first, second] = [0, 1, 2, 3].map(|role| places.at(5, role));
        assert_eq!((first, second), (vec![b[0], a[1]], vec![a[0], b[1]]));
    }

    /// Mean 1/2 and variance 1/12, within four standard errors of 40,000 draws; and one more field changes no other.
    #[test]
    fn draws_are_uniform_and_keep_to_their_field() {
        let places = places(Design::Random, 40_000);
        let draws: Vec<f64> = (0..40_000).map(|n| places.at(n, 0)[1]).collect();
        let mean = draws.iter().sum::<f64>() / 40_000.0;
        let variance = draws.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 40_000.0;
        assert!((mean - 0.5).abs() < 4.0 * 0.2887 / 200.0, "{mean}");
        assert!((variance - 1.0 / 12.0).abs() < 4.0 * 0.0745 / 200.0, "{variance}");
        let more = [
            "a".to_string(),
            "driver.t_p_s".to_string(),
            "speed_m_per_s".to_string(),
        ];
        let more = Places::new(Design::Random, 40_000, 1, &more).unwrap();
        assert_eq!(more.at(17, 0)[2], draws[17]);
    }
}
