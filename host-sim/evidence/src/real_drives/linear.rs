//! The plain linear regression of T_d that a driver model is held against.

use haptic_analysis::identify::DriveLog;
use nalgebra::{DMatrix, DVector};

use super::accounted;

/// Regressors of the plain linear driver: angle, its rate and acceleration, lateral error, its rate, guidance, a constant.
const REGRESSORS: usize = 7;

/// A row of the regression, and what it is to explain; none beside a gap.
fn regressors(log: &DriveLog, k: usize) -> Option<([f64; REGRESSORS], f64)> {
    let (before, after) = (k.checked_sub(1)?, k + 1);
    (after < log.len()).then_some(())?;
    let (phi, e_y, dt) = (&log.wheel_angle_rad, &log.e_y_m, log.dt_s);
    let x = [
        phi[k],
        (phi[after] - phi[before]) / (2.0 * dt),
        (phi[after] - 2.0 * phi[k] + phi[before]) / (dt * dt),
        e_y[k],
        (e_y[after] - e_y[before]) / (2.0 * dt),
        log.guidance_torque_nm[k],
        1.0,
    ];
    let y = log.driver_torque_nm[k];
    (y + x.iter().sum::<f64>()).is_finite().then_some((x, y))
}

/// The weights of least squares; none of too few rows.
pub(super) fn weights<X: AsRef<[f64]>>(rows: &[(X, f64)]) -> Option<Vec<f64>> {
    let regressors = rows.first()?.0.as_ref().len();
    let x = DMatrix::from_fn(rows.len(), regressors, |k, i| rows[k].0.as_ref()[i]);
    let y = DVector::from_iterator(rows.len(), rows.iter().map(|row| row.1));
    Some(x.svd(true, true).solve(&y, 1e-10).ok()?.as_slice().into())
}

pub(super) fn dot(x: &[f64], weights: &[f64]) -> f64 {
    x.iter().zip(weights).map(|(x, w)| x * w).sum()
}

/// The variance that a linear regression on some rows accounts for on others.
pub(super) fn linear(log: &DriveLog, own: &[usize], other: &[usize]) -> Option<f64> {
    let rows = |rows: &[usize]| -> Vec<_> { rows.iter().filter_map(|k| regressors(log, *k)).collect() };
    let weights = weights(&rows(own))?;
    let predicted = rows(other).into_iter().map(|(x, y)| (y, dot(&x, &weights)));
    let (measured, predicted): (Vec<f64>, Vec<f64>) = predicted.unzip();
    Some(accounted(&measured, &predicted))
}
