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

/// The variance that a linear regression on some rows accounts for on others.
pub(super) fn linear(log: &DriveLog, own: &[usize], other: &[usize]) -> Option<f64> {
    let rows = |rows: &[usize]| -> Vec<_> { rows.iter().filter_map(|k| regressors(log, *k)).collect() };
    let (own, other) = (rows(own), rows(other));
    let x = DMatrix::from_fn(own.len(), REGRESSORS, |k, i| own[k].0[i]);
    let y = DVector::from_iterator(own.len(), own.iter().map(|row| row.1));
    let weights = x.svd(true, true).solve(&y, 1e-10).ok()?;
    let (measured, predicted): (Vec<f64>, Vec<f64>) = other
        .iter()
        .map(|(x, y)| (*y, x.iter().zip(weights.iter()).map(|(x, w)| x * w).sum::<f64>()))
        .unzip();
    Some(accounted(&measured, &predicted))
}
