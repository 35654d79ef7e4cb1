//! A driver at a wheel on a torsion bar: what the guidance reads is the bar, not the hands.

use haptic_sim::parts::{Acting, Driver, DriverVehicle, DriverView, Motion, Vehicle};

use crate::Plant;

/// Any driver in a car with a torsion bar.
///
/// The driver feels the guidance through the bar ([`Plant::felt_nm`]); the torque that a simulation hands to its guidance and
/// records is that of the bar's sensor. That of the hands is kept beside it.
#[derive(Debug, Clone)]
pub struct ThroughBar<D> {
    /// The driver.
    pub driver: D,
    /// The car.
    pub plant: Plant,
    hands_nm: f64,
    motor_torque_nm: f64,
}

impl<D: Driver> ThroughBar<D> {
    /// A driver in a car at the start of the course.
    pub fn new(driver: D, plant: Plant) -> Self {
        Self {
            driver,
            plant,
            hands_nm: 0.0,
            motor_torque_nm: 0.0,
        }
    }

    /// The torque of driver and hand in the last step, N.m.
    pub fn hands_torque_nm(&self) -> f64 {
        self.hands_nm
    }
}

impl<D: Driver> DriverVehicle for ThroughBar<D> {
    fn look_ahead_s(&self) -> [f64; 2] {
        self.driver.look_ahead_s()
    }

    fn drive(&mut self, view: &DriverView, hand_torque_nm: f64) -> f64 {
        let felt = DriverView {
            guidance_torque_nm: self.plant.felt_nm(view.speed_m_per_s),
            ..*view
        };
        self.hands_nm = self.driver.step(&felt) + hand_torque_nm;
        self.plant.sensor_torque_nm()
    }

    fn advance(&mut self, acting: &Acting) {
        let hands = Acting {
            driver_torque_nm: self.hands_nm,
            ..*acting
        };
        self.motor_torque_nm = self.plant.step(&hands);
    }

    fn motion(&self) -> Motion {
        self.plant.motion()
    }

    fn ahead_m(&self, distance_m: f64) -> [f64; 2] {
        self.plant.ahead_m(distance_m)
    }

    fn motor_torque_nm(&self) -> f64 {
        self.motor_torque_nm
    }
}
