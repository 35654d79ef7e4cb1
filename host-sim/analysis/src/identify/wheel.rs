//! The torque of the hands from that of a torsion bar below the steering wheel.
//!
//! A bar measures what passes through it: `T_hand = T_bar + J_w phi'' + B_w phi'`, with J_w and B_w inertia and damping of the wheel
//! above it. Rate and acceleration are those of a polynomial of fourth order through the angle of 0.05 s, and three rows at least, before and after each row
//! (Savitzky and Golay, 1964), so nothing is late. The wheel's own friction is left out: 0.1 N.m hide the driver.

use nalgebra::{DMatrix, DVector};

/// Half of the span that the polynomial goes through, s: in a longer one the wheel's swing on the bar, at 9 Hz, is lost, in a shorter one steps of the
/// angle are more than the remnant.
const HALF_S: f64 = 0.05;
/// Coefficients of the polynomial.
const COEFFICIENTS: usize = 5;
/// Rows of the fit are so far apart, s: those within the polynomial's span have the same error, which no remnant has.
pub(super) const FIT_ROW_S: f64 = 0.05;

/// How the wheel above a bar moves, in each row.
#[derive(Debug, Clone)]
pub(crate) struct WheelMotion {
    /// phi', rad/s.
    pub rate: Vec<f64>,
    /// phi'', rad/s2.
    pub acceleration: Vec<f64>,
}

impl WheelMotion {
    /// From the wheel's angle, rad, in rows this far apart, s.
    pub(super) fn of(angle_rad: &[f64], dt_s: f64) -> Self {
        let [rate, acceleration] = [1, 2].map(|order| derivative(angle_rad, dt_s, order));
        Self { rate, acceleration }
    }

    /// Adds to `torque_nm` what moves a wheel of this inertia, kg.m2, and damping, N.m.s/rad.
    pub(super) fn add_to(&self, torque_nm: &mut [f64], inertia: f64, damping: f64) {
        let motion = self.acceleration.iter().zip(&self.rate);
        for (torque, (a, rate)) in torque_nm.iter_mut().zip(motion) {
            *torque += inertia * a + damping * rate;
        }
    }
}

/// The first or second derivative of `u`; at the ends that of the nearest whole span.
fn derivative(u: &[f64], dt_s: f64, order: usize) -> Vec<f64> {
    let half = ((HALF_S / dt_s).round() as usize).max(COEFFICIENTS.div_ceil(2));
    let weights = weights(half, dt_s, order);
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

/// What each row of a span counts in the first or second derivative at its middle.
fn weights(half: usize, dt_s: f64, order: usize) -> DVector<f64> {
    let rows = 2 * half + 1;
    // In spans, so that the powers stay near one.
    let place = |r: usize| r as f64 / half as f64 - 1.0;
    let powers = DMatrix::from_fn(rows, COEFFICIENTS, |r, c| place(r).powi(c as i32));
    // That of the power `order`, 1 or 2, is its factorial: itself.
    let wanted = DVector::from_fn(COEFFICIENTS, |c, _| if c == order { order as f64 } else { 0.0 });
    let normal = (powers.transpose() * &powers).cholesky();
    let solved = normal.map_or_else(|| DVector::zeros(COEFFICIENTS), |n| n.solve(&wanted));
    powers * solved / (half as f64 * dt_s).powi(order as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wheel of 0.04 kg.m2 and 0.2 N.m.s/rad that swings by 0.01 rad at 2.5 Hz takes 0.04 * 0.01 * (5 pi)^2 = 0.0987 N.m in phase and
    /// 0.2 * 0.01 * 5 pi = 0.0314 N.m a quarter ahead, at 50, 120 and 200 rows a second within 2 %, without any delay.
    #[test]
    fn a_swinging_wheel_takes_what_its_inertia_needs() {
        let w = 5.0 * std::f64::consts::PI;
        for rate in [50.0, 120.0, 200.0] {
            let time = |k: usize| k as f64 / rate;
            let angle: Vec<f64> = (0..400).map(|k| 0.01 * (w * time(k)).sin()).collect();
            let mut torque = vec![0.3; 400];
            WheelMotion::of(&angle, 1.0 / rate).add_to(&mut torque, 0.04, 0.2);
            for (k, torque) in torque.iter().enumerate().take(370).skip(30) {
                let (sin, cos) = (w * time(k)).sin_cos();
                let wanted = 0.3 - 0.098_7 * sin + 0.031_4 * cos;
                assert!(
                    (torque - wanted).abs() < 0.002,
                    "{rate} {k}: {torque} for {wanted}"
                );
            }
        }
        assert_eq!(derivative(&[0.0, 0.1, 0.0, 0.1], 0.01, 2), [0.0; 4]);
    }
}
