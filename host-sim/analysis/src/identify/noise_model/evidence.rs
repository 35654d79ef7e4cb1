//! What else the record says of the model that was fitted: its likelihood over the delay, the scatter of its scores, and
//! how much better it would be if what was taken as known were free.

use nalgebra::{DMatrix, DVector};

use super::delays::Delays;
use super::sums::Rows;
use super::{
    COUNT, D_LATE, DAMPING, H_LATE, K_HG, K_NMS, LONGEST_DELAY_S, Line, OWN_BEND, OWN_OFFSET, Problem,
    SOUGHT_KG_M2, T_NMS, T_NMS_RANGE_S, T_NMS_SD_S, T_P, VARIATION_WIDTHS, WHEEL,
};
use crate::identify::result::{Parameter, STANDARD_NORMAL_95};
use crate::identify::search::{Bounds, Optimum, Quadratic, covariance, step};

/// Steps of the delay's profile over the whole range.
const PROFILE_STEPS: usize = 20;
/// Length of the blocks over which scores are taken as independent, s.
const BLOCK_S: f64 = 2.0;

/// K_hg that the derivative by T_h's delay is taken at, at least: it is in proportion to it.
const LEAST_K_HG: f64 = 0.05;

/// Less than this of a guidance torque, N.m, is no probe or a weak one: the remnant may have made it through the car and the law.
pub(super) const LEAST_PROBE_NM: f64 = 0.03;

/// What freeing one assumption would do, to first order.
#[derive(Debug, Clone)]
pub(super) struct Alternative {
    /// Place of what was assumed.
    pub place: usize,
    /// How far from the assumed value the record draws it.
    pub step: f64,
    /// That in its standard errors.
    pub z: f64,
    /// What the other parameters move by for each unit of it.
    pub slopes: DVector<f64>,
    /// What the record knows of it, as a standard error.
    pub error: f64,
}

impl Alternative {
    /// What it would move parameter `i` by.
    pub(super) fn moves(&self, i: usize) -> f64 {
        self.slopes[i] * self.step
    }
}

impl Problem<'_> {
    /// Minus twice the log likelihood over t_p above the optimum, with what is linear solved for at each.
    pub(super) fn profile(&self, p: &[f64], loss: f64, variance: f64, error: f64) -> Vec<[f64; 2]> {
        if !self.is_free(T_P) {
            return Vec::new();
        }
        let mut delays: Vec<f64> = (0..=PROFILE_STEPS)
            .map(|i| LONGEST_DELAY_S * i as f64 / PROFILE_STEPS as f64)
            .collect();
        // Finer where the interval ends.
        let error = if error.is_finite() { error } else { 0.0 };
        delays.extend((-4..=4).map(|i| (p[T_P] + 0.5 * f64::from(i) * error).clamp(0.0, LONGEST_DELAY_S)));
        delays.sort_by(f64::total_cmp);
        delays.dedup();
        let along = Delays::new(self, p, Line::Size).at(&delays);
        delays
            .into_iter()
            .zip(along)
            .map(|(t_p, linear)| {
                let d = step(p, &self.bounds, &linear, 0.0);
                let gain = -linear.gradient.dot(&d) - 0.5 * d.dot(&(&linear.hessian * &d));
                [t_p, 2.0 * (linear.loss - gain - loss) / variance]
            })
            .collect()
    }

    /// Covariance of the estimate from the scatter of the scores over blocks of neighbouring rows, which holds
    /// where the prediction errors are not quite white or even; by `free` parameters.
    pub(super) fn scattered(&self, rows: &Rows, hessian: &DMatrix<f64>, free: &[usize]) -> DMatrix<f64> {
        let size = self.size();
        let block = (BLOCK_S / self.signals.dt_s) as usize;
        let bread = covariance(hessian, free);
        let mut meat = DMatrix::zeros(size, size);
        let mut from = 0;
        for (number, stretch) in self.stretches.iter().enumerate() {
            let of = from..from + stretch.len();
            from = of.end;
            let blocks = rows.columns[of.clone()].chunks(block);
            for (columns, errors) in blocks.zip(rows.errors[of].chunks(block)) {
                let mut sum: DVector<f64> = DVector::zeros(size);
                for (columns, error) in columns.iter().zip(errors) {
                    for (i, x) in columns.iter().enumerate() {
                        sum[i] += error * x;
                    }
                    sum[COUNT + number] += error * rows.by_constant;
                }
                meat += &sum * sum.transpose();
            }
        }
        &bread * meat * &bread
    }

    /// What freeing each assumption would do: a score test of each, with the `free` parameters following.
    pub(super) fn alternatives(&self, p: &[f64], free: &[usize], variance: f64) -> Vec<Alternative> {
        let full = self.all_sums(p);
        [K_NMS, T_NMS, H_LATE, D_LATE, WHEEL, DAMPING, OWN_OFFSET, OWN_BEND]
            .into_iter()
            .filter(|&x| !(self.is_free(x) || x == H_LATE && p[K_HG] == 0.0))
            .filter_map(|place| freed(&full, free, place, variance))
            .collect()
    }
}

/// What the guidance torque tells of a wheel's inertia.
pub(super) struct Told {
    /// How far all parameters are from where they were, the inertia at its place.
    pub moves: DVector<f64>,
    /// Variance of the inertia that the disturbance makes.
    pub variance: f64,
    /// Root mean square of what the guidance torque has beside the arm's answer to it, behind the filter of the disturbance.
    pub probe_nm: f64,
    /// What the inertia moves by for each unit of another parameter.
    pub slopes: DVector<f64>,
}

impl Problem<'_> {
    /// What the guidance torque tells of the wheel's inertia; none where it turns no wheel. The remnant turns the wheel in the instant in
    /// which it is in the torque too, which draws least squares to a smaller inertia. Here it is the one with which the prediction errors
    /// hold nothing of the guidance torque beside what the arm makes of it: of the remnant there is nothing in that (an instrumental
    /// variable).
    pub(super) fn inertia_told(&self, optimum: &Optimum) -> Option<Told> {
        let mut p = optimum.point.clone();
        p[T_NMS] = self.signals.t_nms_s;
        // The derivative by T_h's delay is K_hg times T_h less what the arm has of it.
        p[K_HG] = p[K_HG].max(LEAST_K_HG);
        let full = self.all_sums(&p);
        let free: Vec<usize> = (0..self.size())
            .filter(|&i| self.is_free(i) && (i >= COUNT || i == K_HG || !self.bounds[i].touches(p[i])))
            .collect();
        let inverse = covariance(&full.hessian, &free);
        let instrument = full.hessian.column(H_LATE);
        let follow = &inverse * instrument;
        let with = instrument - &full.hessian * &follow;
        let by = with[WHEEL];
        let mean_square = with[H_LATE] / self.row_count().max(1) as f64;
        let step = (follow.dot(&full.gradient) - full.gradient[H_LATE]) / by;
        let mut moves = -inverse * (full.gradient + full.hessian.column(WHEEL) * step);
        moves[WHEEL] = step;
        let told = Told {
            moves,
            variance: with[H_LATE] * self.error_variance(optimum) * self.log.slow_noise() / (by * by),
            probe_nm: mean_square.sqrt() * p[T_NMS] / p[K_HG],
            slopes: with / -by,
        };
        (step.is_finite() && told.variance.is_finite()).then_some(told)
    }

    /// What all parameters move by for each second of t_nms, the inertia with them: the more of what the slowest and the quickest arm
    /// make, for that is no straight line.
    pub(super) fn moves_by_arm(&self, optimum: &Optimum, told: &Told) -> Option<DVector<f64>> {
        let [quick, slow] = T_NMS_RANGE_S.map(|t_nms| {
            let (mut other, mut p) = (self.clone(), optimum.point.clone());
            let by = t_nms - p[T_NMS];
            p[T_NMS] = t_nms;
            other.assume_muscle(&p);
            Some((other.inertia_told(optimum)?.moves - &told.moves) / by)
        });
        let mut moves = slow?.zip_map(&quick?, |a, b| if a.abs() > b.abs() { a } else { b });
        // The probe tells the product of K_hg and the arm's answer: what an unknown arm makes of K_hg reaches farther above than below.
        let k_hg = optimum.point[K_HG].max(LEAST_K_HG);
        let share = STANDARD_NORMAL_95 * T_NMS_SD_S * moves[K_HG].abs() / k_hg;
        moves[K_HG] *= (share.exp_m1() / share).max(1.0);
        Some(moves)
    }

    /// The inertia of a wheel that is sought: none that the disturbance hides, or that rests on a bound.
    pub(super) fn inertia(&self, p: &[f64], told: Option<&Told>) -> Parameter {
        let [low, high] = SOUGHT_KG_M2;
        let bounds = Bounds::new(low, high);
        let of = |told: &Told, variance| {
            Parameter::estimated(
                p[WHEEL],
                0.0,
                variance,
                told.moves[WHEEL],
                bounds,
                VARIATION_WIDTHS[WHEEL],
            )
        };
        let told = told.filter(|told| {
            let shakes = told.probe_nm > LEAST_PROBE_NM && of(told, told.variance).identified;
            shakes && !bounds.touches(p[WHEEL])
        });
        told.map_or(Parameter::not_identified(p[WHEEL], bounds), |told| {
            let known = self.assumed.iter().filter(|a| !self.is_free(a.place));
            let of_assumed: f64 = known.map(|a| (told.slopes[a.place] * a.sd).powi(2)).sum();
            of(told, told.variance + of_assumed)
        })
    }
}

fn freed(full: &Quadratic, free: &[usize], place: usize, variance: f64) -> Option<Alternative> {
    let inverse = covariance(&full.hessian, free);
    let mixed = DVector::from_fn(full.hessian.nrows(), |i, _| {
        if free.contains(&i) {
            full.hessian[(i, place)]
        } else {
            0.0
        }
    });
    let follow = &inverse * &mixed;
    let curvature = full.hessian[(place, place)] - mixed.dot(&follow);
    let least = 1e-9 * full.hessian[(place, place)];
    if curvature.is_nan() || curvature <= least || !follow.iter().all(|x| x.is_finite()) {
        return None;
    }
    let score = full.gradient[place] - follow.dot(&full.gradient);
    let step = -score / curvature;
    Some(Alternative {
        place,
        step,
        z: step * (curvature / variance).sqrt(),
        error: (variance / curvature).sqrt(),
        slopes: -follow,
    })
}
