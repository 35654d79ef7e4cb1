//! Drives of arms that obey equation (8).

use std::f64::consts::TAU;

use haptic_core::controller::params::Params;
use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};

use super::{Phasor, Point, over};

pub(crate) const LSB: f64 = 1.0 / 16_777_216.0;

pub(crate) fn rounded(si: f64) -> f64 {
    (si / LSB).round() * LSB
}

/// A drive: what the arm and the limits do at a time, s.
pub(crate) struct Drive<'a> {
    pub(crate) params: Params,
    /// The arm's own t_nms, s.
    pub(crate) t_nms_s: f64,
    pub(crate) k_hg: &'a dyn Fn(f64) -> f64,
    /// So much of the probe is applied.
    pub(crate) applied: &'a dyn Fn(f64) -> f64,
    /// Hands are on the wheel.
    pub(crate) hands: &'a dyn Fn(f64) -> bool,
    /// Standard deviation of T_d, white, and amplitudes of slow movements at 0.25 Hz: T_d, T_h.
    pub(crate) noise_nm: f64,
    pub(crate) slow_nm: [f64; 2],
    /// What the wheel does at the probe's frequency.
    pub(crate) wheel: Phasor,
    pub(crate) start_us: u64,
    pub(crate) sample_us: u64,
    /// Samples come up to so much late, and one in so many not at all.
    pub(crate) late_us: u64,
    pub(crate) lost: u32,
    pub(crate) seconds: f64,
    pub(crate) seed: u64,
}

impl Drive<'_> {
    /// Hands that are never quite still, and a probe that nothing limits.
    pub(crate) fn new(params: Params) -> Self {
        Self {
            params,
            t_nms_s: params.t_nms_s,
            k_hg: &|_| 0.5,
            applied: &|_| 1.0,
            hands: &|_| true,
            noise_nm: 0.0,
            slow_nm: [0.03, 0.0],
            wheel: [0.0; 2],
            start_us: 1_000_000,
            sample_us: 2_000,
            late_us: 0,
            lost: u32::MAX,
            seconds: 20.0,
            seed: 1,
        }
    }

    /// Equation (8) at the probe's frequency: (1 + j*w*t_nms)*T_d = -(K_hg*T_h + K_nms*phi).
    pub(crate) fn points(&self) -> Vec<Point> {
        let mut rng = SmallRng::seed_from_u64(self.seed);
        let mut points = Vec::new();
        let w = TAU * self.params.probe_frequency_hz;
        for k in 0..(self.seconds * 1e6) as u64 / self.sample_us {
            let at_us = self.start_us + k * self.sample_us + rng.random_range(0..=self.late_us);
            // Twelve uniform numbers are near enough to a normal one.
            let normal = (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>();
            if rng.random_range(0..self.lost) == 0 && k > 0 {
                continue;
            }
            let t = 1e-6 * (at_us - self.start_us) as f64;
            // The probe's own phase has nothing to do with the estimator's.
            let (sin, cos) = (w * t + 0.4).sin_cos();
            let wave = |[re, im]: Phasor| re * sin + im * cos;
            let slow = (TAU * 0.25 * t).sin();
            let applied = [self.params.probe_amplitude_nm * (self.applied)(t), 0.0];
            let k_hg = (self.k_hg)(t);
            let right = [0, 1].map(|i| -k_hg * applied[i] - self.params.k_nms * self.wheel[i]);
            let driver = over(right, [1.0, w * self.t_nms_s]);
            let hands = f64::from(u8::from((self.hands)(t)));
            points.push(Point {
                at_us,
                applied_nm: rounded(wave(applied) + self.slow_nm[1] * slow),
                driver_nm: rounded(hands * (wave(driver) + self.slow_nm[0] * slow + self.noise_nm * normal)),
                wheel_rad: rounded(wave(self.wheel)),
            });
        }
        points
    }
}
