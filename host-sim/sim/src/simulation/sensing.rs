//! What the sensors make of the truth.

use crate::guidance::{LaneErrors, Observation};
use crate::models::disturbances::{ErringCamera, ErringGyro, SensorErrors};
use crate::scenario::Scenario;
use crate::seeds::Stream;

/// The sensors of a car, with their noise.
#[derive(Debug, Clone)]
pub struct Sensing {
    /// Gains and biases.
    pub errors: SensorErrors,
    /// The camera.
    pub camera: ErringCamera,
    /// The yaw-rate sensor.
    pub gyro: ErringGyro,
}

impl Sensing {
    /// The sensors of a scenario's car; `None` where they add nothing.
    pub fn new(scenario: &Scenario) -> Option<Box<Self>> {
        let errors = scenario.car().sensor_errors;
        if errors == SensorErrors::default() {
            return None;
        }
        let camera = ErringCamera::new(errors, Stream::Sensors.seed(scenario.seed()));
        let gyro = ErringGyro::new(errors, Stream::Gyro.seed(scenario.seed()));
        Some(Box::new(Self { errors, camera, gyro }))
    }

    /// What the sensors make of the truth.
    pub(super) fn of_truth(&mut self, truth: &Observation) -> Observation {
        let seen = truth
            .lane
            .and_then(|lane| self.camera.see(truth.step, [lane.e_y_m, lane.e_theta_rad]));
        Observation {
            lane: seen.map(|([e_y_m, e_theta_rad], _)| LaneErrors { e_y_m, e_theta_rad }),
            lane_age_ms: seen.map_or(0, |(_, age_steps)| age_steps),
            driver_torque_nm: self.errors.torque_gain * truth.driver_torque_nm + self.errors.torque_bias_nm,
            wheel_angle_rad: truth.wheel_angle_rad + self.errors.angle_bias_rad,
            speed_m_per_s: self.errors.speed_gain * truth.speed_m_per_s,
            yaw_rate_rad_per_s: truth
                .yaw_rate_rad_per_s
                .map(|rate| self.gyro.see(truth.step, rate)),
            ..*truth
        }
    }
}
