//! What a drive can say of its driver before anybody estimates: Fisher's information of the noise model at the truth.
//!
//! With the remnant known, the torque is Gaussian about the model, and the information of a record is the Gauss-Newton
//! matrix of the prediction errors at the truth over their variance. Its inverse bounds the covariance of every unbiased
//! estimator (Cramer and Rao). The constants of the stretches and the driver's
//! own line are unknowns of no interest and are taken out. Information
//! of drives adds up, so that of a longer drive like this one is in proportion to its length.

use nalgebra::DMatrix;
use serde::Serialize;

use super::{COUNT, K_HG, OWN_BEND, OWN_OFFSET, Problem, RHO, T_NMS, T_NMS_SD_S, T_P, THETA};
use crate::identify::options::Options;
use crate::identify::prepare::prepare;
use crate::identify::search::covariance;
use haptic_recording::DriveLog;

/// A driver and the disturbance, as they are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Truth {
    /// (K_d + K_nms)*a_i.
    pub gain: [f64; 3],
    /// K_hg.
    pub k_hg: f64,
    /// t_p, s.
    pub t_p_s: f64,
    /// Standard deviation of the remnant, N.m.
    pub remnant_sd_nm: f64,
    /// Its corner, Hz.
    pub remnant_corner_hz: f64,
    /// Standard deviation of the torque sensor's white noise, N.m.
    pub sensor_sd_nm: f64,
}

/// Parameters that there is information on, in order.
pub const INFORMED: [&str; 6] = ["gain_1", "gain_2", "gain_3", "k_hg", "t_p", "t_nms"];
const PLACES: [usize; 6] = [0, 1, 2, K_HG, T_P, T_NMS];

/// The information of a record.
#[derive(Debug, Clone, PartialEq)]
pub struct Information {
    matrix: DMatrix<f64>,
    /// Length of the record, s.
    pub span_s: f64,
}

/// The information that `log` has on its driver, whose `truth` is known.
pub fn information(log: &DriveLog, options: &Options, truth: &Truth) -> Information {
    let options = Options {
        lane_noise: false,
        leave_out: false,
        ..options.clone()
    };
    let prepared = prepare(log, &options);
    let mut problem = Problem::new(&prepared, &options);
    let (rho, theta, variance) = truth.disturbance(log.dt_s);
    let mut p = vec![0.0; problem.size()];
    p[..3].copy_from_slice(&truth.gain);
    (p[K_HG], p[T_P], p[RHO], p[THETA]) = (truth.k_hg, truth.t_p_s, rho, theta);
    (p[super::K_NMS], p[T_NMS]) = (options.muscle.k_nms, options.muscle.t_nms_s);
    problem.assume_muscle(&p);
    let whole = problem.all_sums(&p).hessian;
    let others: Vec<usize> = (COUNT..problem.size()).chain([OWN_OFFSET, OWN_BEND]).collect();
    let inverse = covariance(&whole, &others).map(|x| if x.is_finite() { x } else { 0.0 });
    let taken = &whole * inverse * &whole;
    let of = |i: usize, j: usize| {
        let place = (PLACES[i], PLACES[j]);
        (whole[place] - taken[place]) / variance
    };
    Information {
        matrix: DMatrix::from_fn(PLACES.len(), PLACES.len(), of),
        span_s: problem.row_count() as f64 * log.dt_s,
    }
}

impl Truth {
    /// rho, theta and the innovation's variance of the ARMA(1,1) that the disturbance is when it is sampled.
    fn disturbance(&self, dt_s: f64) -> (f64, f64, f64) {
        let rho = (-std::f64::consts::TAU * self.remnant_corner_hz * dt_s).exp();
        let white = self.sensor_sd_nm.powi(2).max(1e-12);
        let driving = self.remnant_sd_nm.powi(2) * (1.0 - rho * rho);
        // (1 + theta^2) s^2 = driving + (1 + rho^2) white and theta s^2 = rho white.
        let q = rho * white / (driving + (1.0 + rho * rho) * white);
        let theta = (1.0 - (1.0 - 4.0 * q * q).max(0.0).sqrt()) / (2.0 * q);
        (rho, theta, rho * white / theta)
    }
}

impl Information {
    /// What both records tell together.
    #[must_use]
    pub fn and(&self, other: &Self) -> Self {
        Self {
            matrix: &self.matrix + &other.matrix,
            span_s: self.span_s + other.span_s,
        }
    }

    /// What a record like this would tell if it were so long.
    #[must_use]
    pub fn lasting(&self, span_s: f64) -> Self {
        let share = span_s / self.span_s;
        Self {
            matrix: &self.matrix * share,
            span_s,
        }
    }

    /// The least standard errors, in the order of [`INFORMED`]; with t_nms as assumed it has none.
    pub fn standard_errors(&self, t_nms_known: bool) -> [f64; 6] {
        let mut matrix = self.matrix.clone();
        let last = PLACES.len() - 1;
        let free: Vec<usize> = (0..if t_nms_known { last } else { last + 1 }).collect();
        matrix[(last, last)] += 1.0 / (T_NMS_SD_S * T_NMS_SD_S);
        let errors = covariance(&matrix, &free);
        std::array::from_fn(|i| errors[(i, i)].sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An AR(1) of variance 1 and corner f under white noise of variance 0.25, sampled: its spectrum at frequency zero is
    /// (1 - rho^2)/(1 - rho)^2 + 0.25, and so is that of the ARMA(1,1), s^2 (1 - theta)^2/(1 - rho)^2; at the highest
    /// frequency (1 - rho^2)/(1 + rho)^2 + 0.25 = s^2 (1 + theta)^2/(1 + rho)^2.
    #[test]
    fn the_disturbance_has_the_spectrum_of_its_parts() {
        let truth = Truth {
            gain: [0.0; 3],
            k_hg: 0.0,
            t_p_s: 0.1,
            remnant_sd_nm: 1.0,
            remnant_corner_hz: 0.5,
            sensor_sd_nm: 0.5,
        };
        let (rho, theta, s2) = truth.disturbance(1.0 / 120.0);
        for sign in [-1.0, 1.0] {
            let parts = (1.0 - rho * rho) / (1.0 + sign * rho).powi(2) + 0.25;
            let whole = s2 * ((1.0 + sign * theta) / (1.0 + sign * rho)).powi(2);
            assert!((parts / whole - 1.0).abs() < 1e-9, "{parts} {whole}");
        }
    }
}
