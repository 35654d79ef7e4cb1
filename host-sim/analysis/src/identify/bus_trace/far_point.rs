//! The yaw error at the driver's far point, which the bus does not carry, from that at the guidance's.
//!
//! Both are the road's heading at a point ahead less the direction of movement chi. The guidance's point, 0.7 s
//! ahead, is where the driver's, 1.0 s ahead, was 0.3 s before. So the driver's error now is the guidance's 0.3 s
//! later, plus the change of chi until then. That change comes from the wheel angle through equations (1) and (2).
//! On a bend the two points differ by the little that the vehicle drifts across the road in 0.3 s.

use nalgebra::SMatrix;

/// What of a vehicle decides how it turns under a wheel angle: equations (1) and (2). Stiffnesses are per tyre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SingleTrack {
    /// Mass, kg.
    pub m: f64,
    /// Yaw inertia, kg.m^2.
    pub i: f64,
    /// Front axle to centre of gravity, m.
    pub l_f: f64,
    /// Rear axle to centre of gravity, m.
    pub l_r: f64,
    /// Cornering stiffness of a front tyre, N/rad.
    pub k_f: f64,
    /// Cornering stiffness of a rear tyre, N/rad.
    pub k_r: f64,
    /// Front wheel angle per steering wheel angle.
    pub k_t: f64,
}

/// Table 9.
pub(super) const TABLE_9: SingleTrack = SingleTrack {
    m: 1100.0,
    i: 2940.0,
    l_f: 1.0,
    l_r: 1.635,
    k_f: 53_300.0,
    k_r: 117_000.0,
    k_t: 1.0 / 17.0,
};

/// By how much the driver's far point lies ahead of the guidance's, s: 1.0 and 0.7 s.
pub(super) const AHEAD_S: f64 = 0.3;

/// The driver's yaw error, rad, at the instants of `yaw_error_rad` that have one [`AHEAD_S`] later, from samples
/// every `dt_s`.
pub(super) fn driver_yaw_error(
    yaw_error_rad: &[f64],
    wheel_angle_rad: &[f64],
    vehicle: &SingleTrack,
    speed_m_per_s: f64,
    dt_s: f64,
) -> Vec<f64> {
    let direction = direction(wheel_angle_rad, vehicle, speed_m_per_s, dt_s);
    let road: Vec<f64> = yaw_error_rad.iter().zip(&direction).map(|(e, d)| e + d).collect();
    let (whole, share) = ((AHEAD_S / dt_s).floor(), (AHEAD_S / dt_s).fract());
    let whole = whole as usize;
    let later = road.get(whole..).unwrap_or_default();
    later
        .windows(2)
        .zip(&direction)
        .map(|(road, now)| road[0] + share * (road[1] - road[0]) - now)
        .collect()
}

/// chi over time, rad, from zero, of a vehicle at rest in yaw at first; the wheel angle is straight between samples, and
/// stays where it is missing.
fn direction(wheel_angle_rad: &[f64], vehicle: &SingleTrack, speed_m_per_s: f64, dt_s: f64) -> Vec<f64> {
    let SingleTrack {
        m,
        i,
        l_f,
        l_r,
        k_f,
        k_r,
        k_t,
    } = *vehicle;
    let v = speed_m_per_s;
    let moment = l_f * k_f - l_r * k_r;
    // States beta, r, psi; inputs the wheel angle and its slope, held over a step.
    let mut a = SMatrix::<f64, 5, 5>::zeros();
    a[(0, 0)] = -2.0 * (k_f + k_r) / (m * v);
    a[(0, 1)] = -1.0 - 2.0 * moment / (m * v * v);
    a[(0, 3)] = 2.0 * k_f * k_t / (m * v);
    a[(1, 0)] = -2.0 * moment / i;
    a[(1, 1)] = -2.0 * (l_f * l_f * k_f + l_r * l_r * k_r) / (v * i);
    a[(1, 3)] = 2.0 * l_f * k_f * k_t / i;
    a[(2, 1)] = 1.0;
    a[(3, 4)] = 1.0;
    let step = (a * dt_s).exp();
    let mut x = nalgebra::SVector::<f64, 5>::zeros();
    let mut out = vec![0.0];
    let mut angle = wheel_angle_rad
        .iter()
        .copied()
        .find(|a| a.is_finite())
        .unwrap_or(0.0);
    for &next in wheel_angle_rad.get(1..).unwrap_or_default() {
        let next = if next.is_finite() { next } else { angle };
        x[3] = angle;
        x[4] = (next - angle) / dt_s;
        angle = next;
        x = step * x;
        out.push(x[2] + x[0]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A constant wheel angle: in the steady state chi turns at r = v delta/(L (1 + A v^2)), 4.25386 1/s of the front
    /// wheel angle at 60 km/h by the textbook's formula and table 9. On a circle that it follows, every point
    /// ahead sees the same curvature: the error at 1.0 s is that at 0.7 s times 1.0/0.7.
    #[test]
    fn on_a_steady_circle_the_error_grows_with_the_distance_ahead() {
        let (v, dt) = (60.0 / 3.6, 1.0 / 120.0);
        let wheel = vec![0.17; 2400];
        let rate = 4.25386 * 0.17 / 17.0;
        let chi = direction(&wheel, &TABLE_9, v, dt);
        let turned = chi[2399] - chi[2279];
        assert!((turned - rate).abs() < 1e-5, "{turned} {rate}");
        let guidance = vec![0.7 * rate; 2400];
        let driver = driver_yaw_error(&guidance, &wheel, &TABLE_9, v, dt);
        assert_eq!(driver.len(), 2400 - 36 - 1);
        assert!((driver[2000] - 1.0 * rate).abs() < 1e-5);
    }
}
