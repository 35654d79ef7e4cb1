//! Least squares on what a model simulates, behind a filter that makes the noise white.
//!
//! The model is simulated from the measured input alone, so that noise of the measured output (the steps of a quantised angle) enters
//! no regressor. What is left over is described by an autoregressive filter, and model and record pass it before they are compared
//! (the structure of Box and Jenkins): slow disturbances, such as the camber of the road, then count for what they tell.
//! What is known beforehand stands beside the record as a normal distribution of the parameters.
//!
//! Not here: what is simulated (`model`), and what is made of the parameters (`quantities`).

use nalgebra::{DMatrix, DVector};

/// Values a second that are compared: the means of the rows between them.
pub(super) const BLOCK_RATE_HZ: f64 = 25.0;
/// Order of the filter: 0.8 s.
const ORDER: usize = 20;
/// Values of a group whose sum makes one part of the sandwich: 4 s.
const GROUP: usize = 100;
/// Rounds of filter and parameters.
const ROUNDS: usize = 3;
/// Steps of the search in a round.
const STEPS: usize = 12;
/// A step that gains less than this of twice the log likelihood, a tenth of a standard error, ends the search.
const SETTLED: f64 = 0.01;
/// Damping from which on no step is found any more.
const MOST_DAMPING: f64 = 1e8;
/// Least variance of the noise: a record without any, such as a simulated drive on a straight, would be infinitely sure. No file
/// has its values so exactly.
const LEAST_VARIANCE: f64 = 1e-16;

/// One list of values for each stretch of the record.
pub(super) type Stretches = Vec<Vec<f64>>;

/// What is known of the parameters beside the record: their mean, and the inverse of their covariance.
#[derive(Debug, Clone)]
pub(super) struct Prior {
    pub(super) mean: DVector<f64>,
    pub(super) information: DMatrix<f64>,
}

/// Why a fit says nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NoFit {
    /// There is less than some seconds of rows.
    TooShort,
    /// No parameters were found that explain anything.
    Diverged,
}

/// Noise as white noise of a variance behind an autoregressive filter.
#[derive(Debug, Clone)]
pub(super) struct Noise {
    filter: Vec<f64>,
    pub(super) variance: f64,
}

/// What was found.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    pub(super) parameters: DVector<f64>,
    /// Covariance with the prior.
    pub(super) covariance: DMatrix<f64>,
    /// What the record alone tells.
    pub(super) information: DMatrix<f64>,
    pub(super) noise: Noise,
    /// Share of the output's standard deviation that the simulation explains, %.
    pub(super) fit_percent: f64,
    /// Inverse of all information, if the filter made the noise white.
    white: DMatrix<f64>,
    sensitivity: Vec<Vec<f64>>,
    left: Vec<f64>,
}

impl Noise {
    /// The filter after Levinson and Durbin.
    fn of(left: &Stretches) -> Self {
        let count: usize = left.iter().map(Vec::len).sum();
        let order = ORDER.min(count / 20);
        let product = |lag: usize| -> f64 {
            let one = |x: &Vec<f64>| x.iter().zip(x.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>();
            left.iter().map(one).sum::<f64>() / count as f64
        };
        let products: Vec<f64> = (0..=order).map(product).collect();
        let (mut filter, mut variance) = (Vec::new(), products[0].max(LEAST_VARIANCE));
        for lag in 1..=order {
            let ahead: f64 = filter
                .iter()
                .enumerate()
                .map(|(i, a): (usize, &f64)| a * products[lag - 1 - i])
                .sum();
            let reflection = (products[lag] - ahead) / variance;
            let mirrored: Vec<f64> = filter.iter().rev().copied().collect();
            for (a, other) in filter.iter_mut().zip(mirrored) {
                *a -= reflection * other;
            }
            filter.push(reflection);
            variance = (variance * (1.0 - reflection * reflection)).max(LEAST_VARIANCE);
        }
        Self { filter, variance }
    }

    const fn white() -> Self {
        Self {
            filter: Vec::new(),
            variance: 1.0,
        }
    }

    fn whitened(&self, stretches: &Stretches) -> Vec<f64> {
        let order = self.filter.len();
        let mut out = Vec::new();
        for x in stretches {
            for k in order..x.len() {
                let past: f64 = self
                    .filter
                    .iter()
                    .enumerate()
                    .map(|(i, a)| a * x[k - 1 - i])
                    .sum();
                out.push(x[k] - past);
            }
        }
        out
    }

    /// What a drive with these sensitivities would tell.
    pub(super) fn information(&self, sensitivity: &[Stretches]) -> DMatrix<f64> {
        let columns: Vec<Vec<f64>> = sensitivity.iter().map(|s| self.whitened(s)).collect();
        gram(&columns) / self.variance
    }
}

/// Derivatives of what is simulated by each parameter.
pub(super) fn sensitivity(
    simulate: &impl Fn(&DVector<f64>) -> Stretches,
    at: &DVector<f64>,
    steps: &[f64],
) -> Vec<Stretches> {
    let one = |(i, step): (usize, &f64)| {
        let [mut up, mut down] = [at.clone(), at.clone()];
        up[i] += step;
        down[i] -= step;
        let (up, down) = (simulate(&up), simulate(&down));
        difference(&up, &down, 0.5 / step)
    };
    steps.iter().enumerate().map(one).collect()
}

/// Derivatives by differences to one side: half the work, and exact enough for the way to the optimum.
fn slopes(
    simulate: &impl Fn(&DVector<f64>) -> Stretches,
    at: &DVector<f64>,
    steps: &[f64],
) -> Vec<Stretches> {
    let now = simulate(at);
    let one = |(i, step): (usize, &f64)| {
        let mut up = at.clone();
        up[i] += step;
        difference(&simulate(&up), &now, 1.0 / step)
    };
    steps.iter().enumerate().map(one).collect()
}

fn difference(a: &Stretches, b: &Stretches, scale: f64) -> Stretches {
    let one = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| scale * (a - b)).collect();
    a.iter().zip(b).map(one).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn gram(columns: &[Vec<f64>]) -> DMatrix<f64> {
    DMatrix::from_fn(columns.len(), columns.len(), |i, j| dot(&columns[i], &columns[j]))
}

/// Fits what `simulate` says to `measured`; `steps` are the distances of the derivatives.
pub(super) fn fit(
    simulate: &impl Fn(&DVector<f64>) -> Stretches,
    measured: &Stretches,
    start: &DVector<f64>,
    steps: &[f64],
    prior: &Prior,
) -> Result<Fit, NoFit> {
    if measured
        .iter()
        .map(|x| x.len().saturating_sub(ORDER))
        .sum::<usize>()
        < 5 * ORDER
    {
        return Err(NoFit::TooShort);
    }
    let mut at = start.clone();
    let mut noise = Noise::white();
    for round in 0..ROUNDS {
        if round > 0 {
            noise = Noise::of(&difference(measured, &simulate(&at), 1.0));
        } else {
            let left = noise.whitened(&difference(measured, &simulate(&at), 1.0));
            noise.variance = (dot(&left, &left) / left.len() as f64).max(LEAST_VARIANCE);
        }
        at = search(simulate, measured, at, steps, prior, &noise)?;
    }
    let left = difference(measured, &simulate(&at), 1.0);
    let noise = Noise {
        variance: Noise::of(&left).variance,
        ..noise
    };
    let sensitivity = sensitivity(simulate, &at, steps);
    let sensitivity: Vec<Vec<f64>> = sensitivity.iter().map(|s| noise.whitened(s)).collect();
    let whitened = noise.whitened(&left);
    let information = gram(&sensitivity) / noise.variance;
    let white = (&information + &prior.information)
        .cholesky()
        .ok_or(NoFit::Diverged)?
        .inverse();
    let covariance = covariance(&sensitivity, &whitened, &noise, &white, prior);
    Ok(Fit {
        parameters: at,
        covariance,
        information,
        fit_percent: fit_percent(measured, &left),
        noise,
        white,
        sensitivity,
        left: whitened,
    })
}

/// Where sum of squares and prior together are least, after Levenberg and Marquardt.
fn search(
    simulate: &impl Fn(&DVector<f64>) -> Stretches,
    measured: &Stretches,
    mut at: DVector<f64>,
    steps: &[f64],
    prior: &Prior,
    noise: &Noise,
) -> Result<DVector<f64>, NoFit> {
    let left_at = |at: &DVector<f64>| noise.whitened(&difference(measured, &simulate(at), 1.0));
    let cost = |left: &[f64], at: &DVector<f64>| {
        let away = at - &prior.mean;
        dot(left, left) / noise.variance + away.dot(&(&prior.information * &away))
    };
    let mut left = left_at(&at);
    let mut now = cost(&left, &at);
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let columns = slopes(simulate, &at, steps);
        let columns: Vec<Vec<f64>> = columns.iter().map(|s| noise.whitened(s)).collect();
        let information = gram(&columns) / noise.variance + &prior.information;
        let score = DVector::from_fn(columns.len(), |i, _| dot(&columns[i], &left) / noise.variance)
            + &prior.information * (&prior.mean - &at);
        let gained = loop {
            let mut damped = information.clone();
            for i in 0..damped.nrows() {
                damped[(i, i)] *= 1.0 + damping;
            }
            let step = damped.cholesky().ok_or(NoFit::Diverged)?.solve(&score);
            let next = &at + &step;
            let next_left = left_at(&next);
            let then = cost(&next_left, &next);
            if then.is_finite() && then <= now {
                let gained = now - then;
                (at, left, now) = (next, next_left, then);
                damping = (damping * 0.1).max(1e-9);
                break gained;
            }
            damping *= 10.0;
            if damping > MOST_DAMPING {
                return if now.is_finite() {
                    Ok(at)
                } else {
                    Err(NoFit::Diverged)
                };
            }
        };
        if gained < SETTLED {
            break;
        }
    }
    Ok(at)
}

/// Inverse of the information, each error as large as the scores of groups of neighbours make it, where those make it larger: what
/// the filter left unwhite.
fn covariance(
    sensitivity: &[Vec<f64>],
    left: &[f64],
    noise: &Noise,
    white: &DMatrix<f64>,
    prior: &Prior,
) -> DMatrix<f64> {
    let count = sensitivity.len();
    let mut meat = prior.information.clone();
    for from in (0..left.len()).step_by(GROUP) {
        let to = (from + GROUP).min(left.len());
        let score = DVector::from_fn(count, |i, _| {
            dot(&sensitivity[i][from..to], &left[from..to]) / noise.variance
        });
        meat += &score * score.transpose();
    }
    let robust = white * meat * white;
    let wider = DVector::from_fn(count, |i, _| (robust[(i, i)] / white[(i, i)]).sqrt().max(1.0));
    DMatrix::from_fn(count, count, |i, j| white[(i, j)] * wider[i] * wider[j])
}

fn fit_percent(measured: &Stretches, left: &Stretches) -> f64 {
    let all = || measured.iter().flatten();
    let mean = all().sum::<f64>() / all().count() as f64;
    let spread: f64 = all().map(|y| (y - mean).powi(2)).sum();
    let missed: f64 = left.iter().flatten().map(|e| e * e).sum();
    100.0 * (1.0 - (missed / spread.max(f64::MIN_POSITIVE)).sqrt())
}

impl Fit {
    /// Score test of the first half of the record against all of it, for some parameters: the statistic, chi squared with as many
    /// degrees of freedom if they were the same in both halves.
    pub(super) fn change(&self, which: &[usize]) -> f64 {
        let half = self.left.len() / 2;
        let first = |i: usize| &self.sensitivity[i][..half];
        let variance = self.noise.variance;
        let all = &self.white;
        let count = self.sensitivity.len();
        let early = DMatrix::from_fn(count, count, |i, j| dot(first(i), first(j)) / variance);
        let spread = &early - &early * all * &early;
        let score = DVector::from_fn(which.len(), |i, _| {
            dot(first(which[i]), &self.left[..half]) / variance
        });
        let spread = DMatrix::from_fn(which.len(), which.len(), |i, j| spread[(which[i], which[j])]);
        spread
            .cholesky()
            .map_or(0.0, |spread| score.dot(&spread.solve(&score)))
    }

    /// Score test of something that the model leaves out, by what it would add to the simulation: the statistic, chi squared with one
    /// degree of freedom if there is no such thing.
    pub(super) fn omitted(&self, column: &Stretches) -> f64 {
        let column = self.noise.whitened(column);
        let variance = self.noise.variance;
        let shared = DVector::from_fn(self.sensitivity.len(), |i, _| {
            dot(&self.sensitivity[i], &column) / variance
        });
        let own = dot(&column, &column) / variance;
        let free = own - shared.dot(&(&self.white * &shared));
        if free < 1e-6 * own {
            0.0
        } else {
            (dot(&column, &self.left) / variance).powi(2) / free
        }
    }
}
