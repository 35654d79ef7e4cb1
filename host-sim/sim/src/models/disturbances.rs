//! What sensors add to the truth: gains and biases, and a camera that is late, noisy, blind at times, and that may
//! take another line for the lane's.
//!
//! All is off by default, and then nothing is drawn and nothing is changed. The noise has a seed of its own, so that
//! one more draw here renumbers nothing elsewhere.

use std::collections::VecDeque;

use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};

use super::{STEP_S, STEPS_PER_SECOND};
use crate::fields::fields;

fields! {
    /// What sensors add to the truth.
    #[derive(Copy)]
    SensorErrors, "sensor_errors" {
        /// bias of the driver torque
        torque_bias_nm: f64 = 0.0, "torque_bias_nm", "", "N.m", Between(-2.0, 2.0);
        /// gain of the driver torque
        torque_gain: f64 = 1.0, "torque_gain", "", "", Between(0.5, 1.5);
        /// bias of the wheel angle
        angle_bias_rad: f64 = 0.0, "angle_bias_rad", "", "rad", Between(-0.35, 0.35);
        /// gain of the speed
        speed_gain: f64 = 1.0, "speed_gain", "", "", Between(0.5, 1.5);
        /// bias of the yaw rate
        yaw_rate_bias_rad_per_s: f64 = 0.0, "yaw_rate_bias_rad_per_s", "", "rad/s", Between(-0.1, 0.1);
        /// gain of the yaw rate
        yaw_rate_gain: f64 = 1.0, "yaw_rate_gain", "", "", Between(0.5, 1.5);
        /// standard deviation of the yaw rate's noise, a draw every 10 ms
        yaw_rate_noise_rad_per_s: f64 = 0.0, "yaw_rate_noise_rad_per_s", "", "rad/s", Between(0.0, 0.1);
        /// standard deviation of e_y'
        lane_noise_m: f64 = 0.0, "lane_noise_m", "", "m", Between(0.0, 1.0);
        /// standard deviation of e_theta'
        heading_noise_rad: f64 = 0.0, "heading_noise_rad", "", "rad", Between(0.0, 0.05);
        /// bias of e_theta': the yaw of the camera's mount
        camera_yaw_rad: f64 = 0.0, "camera_yaw_rad", "", "rad", Between(-0.05, 0.05);
        /// from a picture to its lane errors, which say how old they are
        camera_latency_s: f64 = 0.0, "camera_latency_s", "", "s", Between(0.0, 0.5);
        /// standard deviation of that time
        camera_jitter_s: f64 = 0.0, "camera_jitter_s", "", "s", Between(0.0, 0.1);
        /// how often the camera begins to see nothing
        dropout_rate_per_s: f64 = 0.0, "dropout_rate_per_s", "", "1/s", Between(0.0, 1.0);
        /// for how long each time
        dropout_duration_s: f64 = 0.2, "dropout_duration_s", "", "s", Between(0.0, 10.0);
        /// how often the camera changes to the line beside its own, and back
        line_jump_rate_per_s: f64 = 0.0, "line_jump_rate_per_s", "", "1/s", Between(0.0, 1.0);
        /// how far that line lies to the left
        line_jump_m: f64 = 0.3, "line_jump_m", "", "m", Between(-5.0, 5.0);
    }
}

/// The yaw-rate sensor's errors. It measures every 10 ms, as often as it is sent.
#[derive(Debug, Clone)]
pub struct ErringGyro {
    errors: SensorErrors,
    noise_rad_per_s: f64,
    generator: Xoshiro256PlusPlus,
}

impl ErringGyro {
    /// `seed` is of the gyro's stream.
    pub fn new(errors: SensorErrors, seed: u64) -> Self {
        Self {
            errors,
            noise_rad_per_s: 0.0,
            generator: Xoshiro256PlusPlus::seed_from_u64(seed),
        }
    }

    /// What it makes of the truth at a step, rad/s.
    pub fn see(&mut self, step: u32, truth_rad_per_s: f64) -> f64 {
        let errors = &self.errors;
        if errors.yaw_rate_noise_rad_per_s > 0.0 && step.is_multiple_of(10) {
            let white: f64 = StandardNormal.sample(&mut self.generator);
            self.noise_rad_per_s = errors.yaw_rate_noise_rad_per_s * white;
        }
        errors.yaw_rate_gain * truth_rad_per_s + errors.yaw_rate_bias_rad_per_s + self.noise_rad_per_s
    }
}

/// A picture's lane errors (m, rad) on their way.
#[derive(Debug, Clone, Copy)]
struct Picture {
    taken_step: u32,
    due_step: u32,
    errors: [f64; 2],
}

/// The camera's errors, with what they remember.
#[derive(Debug, Clone)]
pub struct ErringCamera {
    errors: SensorErrors,
    on_their_way: VecDeque<Picture>,
    blind_until: u32,
    is_on_other_line: bool,
    last_step: Option<u32>,
    generator: Xoshiro256PlusPlus,
}

impl ErringCamera {
    /// `seed` is of the sensors' stream.
    pub fn new(errors: SensorErrors, seed: u64) -> Self {
        Self {
            errors,
            on_their_way: VecDeque::new(),
            blind_until: 0,
            is_on_other_line: false,
            last_step: None,
            generator: Xoshiro256PlusPlus::seed_from_u64(seed),
        }
    }

    /// Takes a picture's true errors (e_y' in m, e_theta' in rad) at a step; returns those that arrive then, and how long
    /// ago they were true, steps.
    pub fn see(&mut self, step: u32, [e_y_m, e_theta_rad]: [f64; 2]) -> Option<([f64; 2], u32)> {
        let errors = self.errors;
        let since_s = f64::from(step - self.last_step.unwrap_or(step)) * STEP_S;
        let is_first = self.last_step.replace(step).is_none();
        if self.happens(errors.dropout_rate_per_s, since_s) {
            self.blind_until = step + (errors.dropout_duration_s * f64::from(STEPS_PER_SECOND)) as u32;
        }
        if self.happens(errors.line_jump_rate_per_s, since_s) {
            self.is_on_other_line = !self.is_on_other_line;
        }
        let beside_m = if self.is_on_other_line {
            errors.line_jump_m
        } else {
            0.0
        };
        let seen = [
            e_y_m + beside_m + errors.lane_noise_m * self.normal(errors.lane_noise_m),
            e_theta_rad
                + (errors.camera_yaw_rad + errors.heading_noise_rad * self.normal(errors.heading_noise_rad)),
        ];
        // A camera was there before the run began: its first picture is not waited for.
        let late_s = if is_first {
            0.0
        } else {
            errors.camera_latency_s + errors.camera_jitter_s * self.normal(errors.camera_jitter_s)
        };
        let late = (late_s.max(0.0) / STEP_S).round() as u32;
        if step >= self.blind_until {
            // A picture does not overtake the one before it.
            let after = self.on_their_way.back().map_or(0, |last| last.due_step);
            self.on_their_way.push_back(Picture {
                taken_step: step,
                due_step: (step + late).max(after),
                errors: seen,
            });
        }
        let mut arrived = None;
        while let Some(picture) = self.on_their_way.front().filter(|p| p.due_step <= step) {
            arrived = Some((picture.errors, step - picture.taken_step));
            self.on_their_way.pop_front();
        }
        arrived
    }

    /// Whether something that happens at a rate happens in a time.
    fn happens(&mut self, per_s: f64, time_s: f64) -> bool {
        per_s > 0.0 && self.generator.random::<f64>() < per_s * time_s
    }

    /// A draw, but none for what is off.
    fn normal(&mut self, scale: f64) -> f64 {
        if scale == 0.0 {
            return 0.0;
        }
        StandardNormal.sample(&mut self.generator)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pictures(errors: SensorErrors, count: u32) -> Vec<Option<([f64; 2], u32)>> {
        let mut camera = ErringCamera::new(errors, 5);
        (0..count)
            .map(|n| camera.see(8 * n, [f64::from(n), 0.1]))
            .collect()
    }

    #[test]
    fn a_camera_without_errors_shows_the_truth() {
        for (n, seen) in (0_u32..).zip(pictures(SensorErrors::default(), 100)) {
            assert_eq!(seen, Some(([f64::from(n), 0.1], 0)));
        }
    }

    #[test]
    fn a_yaw_rate_has_its_gain_its_bias_and_its_noise() {
        let mut exact = ErringGyro::new(SensorErrors::default(), 1);
        assert_eq!(exact.see(0, 0.123), 0.123);
        let errors = SensorErrors {
            yaw_rate_bias_rad_per_s: 0.003,
            yaw_rate_gain: 1.02,
            yaw_rate_noise_rad_per_s: 0.002,
            ..SensorErrors::default()
        };
        let mut gyro = ErringGyro::new(errors, 1);
        let seen: Vec<f64> = (0..100_000).map(|n| gyro.see(10 * n, 0.1)).collect();
        let mean = seen.iter().sum::<f64>() / seen.len() as f64;
        let sd = (seen.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / seen.len() as f64).sqrt();
        // 0.1*1.02 + 0.003, known to four standard errors of 2e-3/sqrt(1e5); the deviation to 1 %.
        assert!(
            (mean - 0.105).abs() < 2.6e-5 && (sd / 2e-3 - 1.0).abs() < 0.01,
            "{mean} {sd}"
        );
        // Between two measurements the last one stays.
        assert_eq!(gyro.see(1_000_001, 0.1), gyro.see(1_000_002, 0.1));
    }

    #[test]
    fn a_late_camera_shows_the_truth_of_before() {
        let errors = SensorErrors {
            camera_latency_s: 0.08,
            ..SensorErrors::default()
        };
        let seen = pictures(errors, 100);
        // The first is there when the run begins, the others come 80 ms late.
        assert_eq!(seen[0], Some(([0.0, 0.1], 0)));
        assert_eq!(seen[1..11], [None; 10]);
        for (n, seen) in (11_u32..).zip(&seen[11..]) {
            assert_eq!(*seen, Some(([f64::from(n - 10), 0.1], 80)));
        }
    }

    #[test]
    fn noise_has_its_spread_and_dropouts_their_number_and_length() {
        let errors = SensorErrors {
            lane_noise_m: 0.03,
            heading_noise_rad: 0.002,
            camera_yaw_rad: 0.0015,
            ..SensorErrors::default()
        };
        let mut camera = ErringCamera::new(errors, 5);
        let seen: Vec<_> = (0..40_000)
            .filter_map(|n| Some(camera.see(8 * n, [0.5, 0.0])?.0))
            .collect();
        let moments = |of: fn(&[f64; 2]) -> f64| {
            let mean = seen.iter().map(of).sum::<f64>() / seen.len() as f64;
            let square = seen.iter().map(|s| (of(s) - mean).powi(2)).sum::<f64>() / seen.len() as f64;
            (mean, square.sqrt())
        };
        // 40000 draws: means within 4 standard errors, deviations within 2 %.
        let (lane, heading) = (moments(|s| s[0]), moments(|s| s[1]));
        assert!(
            (lane.0 - 0.5).abs() < 6e-4 && (lane.1 / 0.03 - 1.0).abs() < 0.02,
            "{lane:?}"
        );
        assert!(
            (heading.0 - 1.5e-3).abs() < 4e-5 && (heading.1 / 2e-3 - 1.0).abs() < 0.02,
            "{heading:?}"
        );

        let errors = SensorErrors {
            dropout_rate_per_s: 0.1,
            dropout_duration_s: 0.5,
            ..SensorErrors::default()
        };
        // An hour and a bit, with a dropout of 0.5 s every 10 s: 5 % of the pictures are missing.
        let seen = pictures(errors, 450_000);
        let missing = seen.iter().filter(|s| s.is_none()).count() as f64 / seen.len() as f64;
        assert!((missing - 0.048).abs() < 0.01, "{missing}");
    }
}
