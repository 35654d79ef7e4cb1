//! The yaw error at the driver's far point, which the bus does not carry, from that at the guidance's.
//!
//! Both are the road's heading at a point ahead less the direction of movement chi. The guidance's point, 0.7 s
//! ahead, is where the driver's, 1.0 s ahead, was 0.3 s before; where the speed changes, the way says when. So the
//! driver's error now is the guidance's then, plus the change of chi until then. That change comes from the wheel angle through equations (1) and (2).
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

/// How far ahead the far points of driver and guidance lie, s.
const DRIVER_S: f64 = 1.0;
const GUIDANCE_S: f64 = 0.7;

/// The driver's yaw error, rad, at the instants of `yaw_error_rad` at which the guidance's far point comes later to where the
/// driver's is: at one speed 0.3 s later, while braking somewhat more. Samples are `dt_s` apart.
pub(super) fn driver_yaw_error(
    yaw_error_rad: &[f64],
    wheel_angle_rad: &[f64],
    vehicle: &SingleTrack,
    speed_m_per_s: &[f64],
    dt_s: f64,
) -> Vec<f64> {
    let direction = direction(wheel_angle_rad, vehicle, speed_m_per_s, dt_s);
    let road: Vec<f64> = yaw_error_rad.iter().zip(&direction).map(|(e, d)| e + d).collect();
    let mut way_m = vec![0.0];
    way_m.extend(speed_m_per_s.windows(2).scan(0.0, |way, v| {
        *way += 0.5 * (v[0] + v[1]) * dt_s;
        Some(*way)
    }));
    let ahead = |k: usize, ahead_s: f64| way_m[k] + ahead_s * speed_m_per_s[k];
    let (mut later, mut out) = (0, Vec::with_capacity(road.len()));
    for (k, now) in direction.iter().enumerate() {
        let place_m = ahead(k, DRIVER_S);
        while later > k && ahead(later, GUIDANCE_S) > place_m {
            later -= 1;
        }
        while later + 1 < road.len() && ahead(later + 1, GUIDANCE_S) <= place_m {
            later += 1;
        }
        if later + 1 >= road.len() {
            break;
        }
        let [from, to] = [later, later + 1].map(|at| ahead(at, GUIDANCE_S));
        let share = (place_m - from) / (to - from);
        out.push(road[later] + share * (road[later + 1] - road[later]) - now);
    }
    out
}

/// chi over time, rad, from zero, of a vehicle at rest in yaw at first; the wheel angle is straight between samples, and
/// stays where it is missing. The lateral velocity is a state, so that it goes on through a change of speed.
fn direction(wheel_angle_rad: &[f64], vehicle: &SingleTrack, speed_m_per_s: &[f64], dt_s: f64) -> Vec<f64> {
    let mut x = nalgebra::SVector::<f64, 5>::zeros();
    let mut out = vec![0.0];
    let mut angle = wheel_angle_rad
        .iter()
        .copied()
        .find(|a| a.is_finite())
        .unwrap_or(0.0);
    let mut known = (f64::NAN, SMatrix::<f64, 5, 5>::zeros());
    let angles = wheel_angle_rad.get(1..).unwrap_or_default();
    for (&next, v) in angles.iter().zip(speed_m_per_s.windows(2)) {
        let mean = 0.5 * (v[0] + v[1]);
        // At one speed there is one matrix.
        if mean != known.0 {
            known = (mean, (rates(vehicle, mean) * dt_s).exp());
        }
        let next = if next.is_finite() { next } else { angle };
        x[3] = angle;
        x[4] = (next - angle) / dt_s;
        angle = next;
        x = known.1 * x;
        // Where the vehicle moves to: its heading and the angle at which it slips sideways.
        out.push(x[2] + (x[0] / v[1]).atan());
    }
    out
}

/// States lateral velocity, r, psi; inputs the wheel angle and its slope, held over a step.
fn rates(vehicle: &SingleTrack, v: f64) -> SMatrix<f64, 5, 5> {
    let SingleTrack {
        m,
        i,
        l_f,
        l_r,
        k_f,
        k_r,
        k_t,
    } = *vehicle;
    let moment = l_f * k_f - l_r * k_r;
    let mut a = SMatrix::<f64, 5, 5>::zeros();
    // Stiffnesses count twice: an axle has two tyres.
    a[(0, 0)] = -2.0 * (k_f + k_r) / (m * v);
    a[(0, 1)] = -v - 2.0 * moment / (m * v);
    a[(0, 3)] = 2.0 * k_f * k_t / m;
    a[(1, 0)] = -2.0 * moment / (i * v);
    a[(1, 1)] = -2.0 * (l_f * l_f * k_f + l_r * l_r * k_r) / (v * i);
    a[(1, 3)] = 2.0 * l_f * k_f * k_t / i;
    a[(2, 1)] = 1.0;
    a[(3, 4)] = 1.0;
    a
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
        let chi = direction(&wheel, &TABLE_9, &[v; 2400], dt);
        let turned = chi[2399] - chi[2279];
        assert!((turned - rate).abs() < 1e-5, "{turned} {rate}");
        let guidance = vec![0.7 * rate; 2400];
        let driver = driver_yaw_error(&guidance, &wheel, &TABLE_9, &[v; 2400], dt);
        // The last one is computed from the last sample, or from just behind it, as the sums are rounded.
        assert!((2363..=2364).contains(&driver.len()));
        assert!((driver[2000] - 1.0 * rate).abs() < 1e-5);
    }
}
