//! The driver's two points from what other recordings have in their place, and the slopes between columns.

use std::collections::BTreeMap;

use haptic_log::notes::Notes;

use super::SPEED_COLUMN;

/// Columns by their names.
pub type Table = BTreeMap<String, Vec<f64>>;

/// What a layout takes from a table, every row.
#[derive(Debug)]
pub struct Signals {
    /// Time, s.
    pub time_s: Vec<f64>,
    /// The layout's signals by name, with their units in it.
    pub columns: Table,
    /// What the file holds that these do not.
    pub notes: Notes,
}

/// The driver's near and far point ahead, s (table 4).
const POINTS_S: [f64; 2] = [0.3, 1.0];
/// The lane's direction is the slope of its offset over so much time to either side, s; what lies across a joint of two drives is
/// left out for as long.
pub(super) const SLOPE_S: f64 = 0.35;

/// Slope and correlation of y on x.
pub(super) fn line(pairs: &[(f64, f64)]) -> (f64, f64) {
    let n = pairs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for p in pairs {
        xx += (p.0 - x).powi(2);
        xy += (p.0 - x) * (p.1 - y);
        yy += (p.1 - y).powi(2);
    }
    (xy / xx, xy / (xx * yy).sqrt())
}

/// The slope of a signal at each row, per second: of the line through its neighbours, as many on either side.
pub(super) fn slopes(signal: &[f64], dt_s: f64) -> Vec<f64> {
    let reach = ((SLOPE_S / dt_s) as usize).max(1);
    (0..signal.len())
        .map(|k| {
            let reach = reach.min(k).min(signal.len() - 1 - k);
            let far = (1..=reach).map(|j| j as f64 * (signal[k + j] - signal[k - j]));
            let square: f64 = (1..=reach).map(|j| 2.0 * (j * j) as f64).sum();
            if reach == 0 {
                0.0
            } else {
                far.sum::<f64>() / (square * dt_s)
            }
        })
        .collect()
}

/// e_y at the driver's near and e_theta at the far point, of a lane of this offset, direction and curvature: the lane is an arc.
/// Where its direction is not told, the car moves towards its centre as the offset shrinks.
pub(super) fn two_points(table: &mut Table, dt_s: f64) {
    let column = |name: &str| table.get(name).map(Vec::as_slice);
    let (Some(offset), Some(curvature), Some(speed)) =
        (column("offset_m"), column("curvature_1pm"), column(SPEED_COLUMN))
    else {
        return;
    };
    let points = |k: usize, direction: f64| {
        let [near, far] = POINTS_S.map(|s| s * speed[k]);
        let e_y = offset[k] + near * direction + 0.5 * curvature[k] * near * near;
        (e_y, direction + curvature[k] * far)
    };
    let direction: Vec<f64> = match column("lane_direction_rad") {
        Some(told) => told.to_vec(),
        None => {
            let slopes = slopes(offset, dt_s).into_iter().zip(speed);
            slopes.map(|(slope, speed)| slope / speed.max(1.0)).collect()
        }
    };
    let (e_y, e_theta) = direction
        .into_iter()
        .enumerate()
        .map(|(k, direction)| points(k, direction))
        .unzip();
    table.insert("e_y_m".into(), e_y);
    table.insert("e_theta_rad".into(), e_theta);
}
