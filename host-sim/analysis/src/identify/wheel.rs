//! The torque of the hands from that of a torsion bar below the steering wheel.
//!
//! A bar measures what passes through it: `T_hand = T_bar + J_w phi''`, with J_w the inertia of the wheel above it. The
//! acceleration is that of a polynomial of fourth order through the angle of a tenth of a second before and after each row
//! (Savitzky and Golay, 1964), so nothing is late. The wheel's own damping and friction, and the twist of the bar, are left out:
//! at a probe of 2.5 Hz they are small beside J_w.

use nalgebra::{DMatrix, DVector};

/// Half of the span that the polynomial goes through, s.
const HALF_S: f64 = 0.1;
/// Coefficients of the polynomial.
const COEFFICIENTS: usize = 5;

/// Adds to `torque_nm` what accelerates a wheel of this inertia, kg.m2.
pub(super) fn add_wheel(torque_nm: &mut [f64], wheel_angle_rad: &[f64], dt_s: f64, inertia: f64) {
    for (torque, acceleration) in torque_nm.iter_mut().zip(acceleration(wheel_angle_rad, dt_s)) {
        *torque += inertia * acceleration;
    }
}

/// The second derivative of `u`; at the ends that of the nearest whole span.
pub(super) fn acceleration(u: &[f64], dt_s: f64) -> Vec<f64> {
    let half = ((HALF_S / dt_s).round() as usize).max(COEFFICIENTS / 2);
    let weights = weights(half, dt_s);
    let last = u.len().saturating_sub(half + 1);
    if last < half {
        return vec![0.0; u.len()];
    }
    (0..u.len())
        .map(|k| {
            let middle = k.clamp(half, last);
            let span = &u[middle - half..=middle + half];
            span.iter().zip(weights.iter()).map(|(u, w)| u * w).sum()
        })
        .collect()
}

/// What each row of a span counts in the second derivative at its middle.
fn weights(half: usize, dt_s: f64) -> DVector<f64> {
    let rows = 2 * half + 1;
    // In spans, so that the powers stay near one.
    let place = |r: usize| r as f64 / half as f64 - 1.0;
    let powers = DMatrix::from_fn(rows, COEFFICIENTS, |r, c| place(r).powi(c as i32));
    let curvature = DVector::from_fn(COEFFICIENTS, |c, _| f64::from(2 * u8::from(c == 2)));
    let normal = (powers.transpose() * &powers).cholesky();
    let solved = normal.map_or_else(|| DVector::zeros(COEFFICIENTS), |n| n.solve(&curvature));
    powers * solved / (half as f64 * dt_s).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wheel of 0.04 kg.m2 that swings by 0.01 rad at 2.5 Hz takes 0.04 * 0.01 * (5 pi)^2 = 0.0987 N.m, at 50, 120 and 200
    /// rows a second within 2 %, without any delay.
    #[test]
    fn a_swinging_wheel_takes_what_its_inertia_needs() {
        let w = 5.0 * std::f64::consts::PI;
        for rate in [50.0, 120.0, 200.0] {
            let time = |k: usize| k as f64 / rate;
            let angle: Vec<f64> = (0..400).map(|k| 0.01 * (w * time(k)).sin()).collect();
            let mut torque = vec![0.3; 400];
            add_wheel(&mut torque, &angle, 1.0 / rate, 0.04);
            for (k, torque) in torque.iter().enumerate().take(370).skip(30) {
                let wanted = 0.3 - 0.098_7 * (w * time(k)).sin();
                assert!(
                    (torque - wanted).abs() < 0.002,
                    "{rate} {k}: {torque} for {wanted}"
                );
            }
        }
        let mut short = vec![1.0; 4];
        add_wheel(&mut short, &[0.0, 0.1, 0.0, 0.1], 0.01, 0.04);
        assert_eq!(short, [1.0; 4]);
    }
}
