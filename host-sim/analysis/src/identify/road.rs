//! The road under the driver's near point, from what the driver sees at the far point and from the wheel angle.
//!
//! e_theta is the heading of the road at the far point, 1 s ahead, less the vehicle's. A vehicle turns in proportion to the
//! wheel angle, after a lag, so `e_theta + G Int phi` is the road's heading there, up to a constant. G is what makes e_theta
//! the turn of one second in bends. The near point, 0.3 s ahead, is 0.7 s behind: a lag of [`SMOOTH_S`] is a part of that, and
//! takes the noise out. The car's own weaving cancels, so this is the road's and nobody's answer.

use super::wide::{integral, lagged};
use haptic_recording::DriveLog;

/// How far ahead the far and the near point are, s.
const FAR_S: f64 = 1.0;
const NEAR_S: f64 = 0.3;
/// Lag of the vehicle's turn behind the wheel angle, s.
const VEHICLE_S: f64 = 0.12;
/// Lag that the road's heading is smoothed with, s.
const SMOOTH_S: f64 = 0.3;
/// Lag behind which bends are seen and weaving is not, s.
const BENDS_S: f64 = 1.5;

/// Turn of the road, rad/s, and heading of the road, rad, at the near point of each row.
pub(super) fn road(log: &DriveLog) -> [Vec<f64>; 2] {
    let dt_s = log.dt_s;
    let turning = lagged(&log.wheel_angle_rad, dt_s, VEHICLE_S);
    let slow = [&log.e_theta_rad, &turning].map(|u| lagged(u, dt_s, BENDS_S));
    let gain = slope(&slow[0], &slow[1]) / FAR_S;
    let far: Vec<f64> = integral(&turning, dt_s)
        .iter()
        .zip(&log.e_theta_rad)
        .map(|(turned, e)| e + gain * turned)
        .collect();
    let smooth = lagged(&far, dt_s, SMOOTH_S);
    let behind = ((FAR_S - NEAR_S - SMOOTH_S) / dt_s).round() as usize;
    let at = |k: usize| k.saturating_sub(behind);
    let rows = 0..log.len();
    [
        rows.clone()
            .map(|k| (far[at(k)] - smooth[at(k)]) / SMOOTH_S)
            .collect(),
        rows.map(|k| smooth[at(k)] - smooth[0]).collect(),
    ]
}

/// Slope of `y` over `x`; zero where `x` does not move.
fn slope(y: &[f64], x: &[f64]) -> f64 {
    let n = x.len().max(1) as f64;
    let [mean_y, mean_x] = [y, x].map(|u| u.iter().sum::<f64>() / n);
    let both = || y.iter().zip(x).map(|(y, x)| (y - mean_y, x - mean_x));
    let spread: f64 = both().map(|(_, x)| x * x).sum();
    if spread > 0.0 {
        both().map(|(y, x)| y * x).sum::<f64>() / spread
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A road that turns by 0.05 rad/s from 20 s on, driven on exactly by a vehicle that turns at 0.4 times the wheel angle of
    /// 0.12 s before: at the near point of 30 s it turns at 0.05 rad/s, and has turned by 0.05 times 10.3 s.
    #[test]
    fn the_road_is_that_of_the_near_point() {
        let dt_s = 0.01;
        let turn = |t: f64| if t > 20.0 { 0.05 } else { 0.0 };
        let heading = |t: f64| 0.05 * (t - 20.0).max(0.0);
        let time = |k: usize| k as f64 * dt_s;
        let log = DriveLog {
            dt_s,
            e_theta_rad: (0..4000)
                .map(|k| heading(time(k) + 1.0) - heading(time(k)))
                .collect(),
            wheel_angle_rad: (0..4000).map(|k| turn(time(k)) / 0.4).collect(),
            driver_torque_nm: vec![0.0; 4000],
            ..DriveLog::default()
        };
        let [turns, turned] = road(&log);
        assert!((turns[3000] - 0.05).abs() < 0.003, "{}", turns[3000]);
        assert!((turned[3000] - 0.515).abs() < 0.03, "{}", turned[3000]);
        assert!(turns[1000].abs() < 1e-9 && turned[1000].abs() < 1e-9);
    }
}
