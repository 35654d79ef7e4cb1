//! The parts of a closed loop beside its [guidance](crate::guidance): a driver, and a vehicle with its column.
//!
//! - [`Driver`] looks at the road, feels the wheel and answers with a torque on the column.
//! - [`Vehicle`] takes the torques on its column and moves.
//! - [`DriverVehicle`] is what a simulation moves: both as one system. [`Parts`] couples any driver with any vehicle;
//!   each torque is held for the 1 ms of a step. [`PaperPair`] is the paper's pair, whose arm is a state of the plant's
//!   matrix, so that its step is exact.
//! - [`PaperDriver`] and [`PaperVehicle`] are its two halves, for a vehicle or a driver of one's own.
//!
//! Not here: the equations (`models`).

mod driver;
mod paper_pair;
mod vehicle;

pub use driver::{Driver, DriverView, NoDriver, PaperDriver};
pub(crate) use paper_pair::Notices;
pub use paper_pair::{ByReliance, Mover, PaperPair};
pub use vehicle::{Acting, BarState, Motion, PaperVehicle, Vehicle};

/// A driver and a vehicle as one system: what a simulation moves.
pub trait DriverVehicle {
    /// How far ahead the driver's near and far point are, s.
    fn look_ahead_s(&self) -> [f64; 2];

    /// The torque of the driver and of a hand beside the driver on the column in this step, N.m.
    fn drive(&mut self, view: &DriverView, hand_torque_nm: f64) -> f64;

    /// Moves for 1 ms.
    fn advance(&mut self, acting: &Acting);

    /// Where the vehicle is, and how it and its wheel move.
    fn motion(&self) -> Motion;

    /// The point that lies `distance_m` ahead along the direction of movement, m.
    fn ahead_m(&self, distance_m: f64) -> [f64; 2];

    /// The guidance torque of the last step as the motor measures it, N.m.
    fn motor_torque_nm(&self) -> f64;

    /// The torsion bar of its column, if it has one.
    fn bar(&self) -> Option<BarState> {
        None
    }
}

/// Any driver in any vehicle.
#[derive(Debug, Clone)]
pub struct Parts<D, V> {
    /// The driver.
    pub driver: D,
    /// The vehicle.
    pub vehicle: V,
    motor_torque_nm: f64,
}

impl<D: Driver, V: Vehicle> Parts<D, V> {
    /// A driver in a vehicle at the start of the course.
    pub fn new(driver: D, vehicle: V) -> Self {
        Self {
            driver,
            vehicle,
            motor_torque_nm: 0.0,
        }
    }
}

impl<D: Driver, V: Vehicle> DriverVehicle for Parts<D, V> {
    fn look_ahead_s(&self) -> [f64; 2] {
        self.driver.look_ahead_s()
    }

    fn drive(&mut self, view: &DriverView, hand_torque_nm: f64) -> f64 {
        self.driver.step(view) + hand_torque_nm
    }

    fn advance(&mut self, acting: &Acting) {
        self.motor_torque_nm = self.vehicle.step(acting);
    }

    fn motion(&self) -> Motion {
        self.vehicle.motion()
    }

    fn ahead_m(&self, distance_m: f64) -> [f64; 2] {
        self.vehicle.ahead_m(distance_m)
    }

    fn motor_torque_nm(&self) -> f64 {
        self.motor_torque_nm
    }

    fn bar(&self) -> Option<BarState> {
        self.vehicle.bar()
    }
}
