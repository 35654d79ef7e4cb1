//! A vehicle with its steering column: what acts on it, and how it moves.

use super::{DriverVehicle, PaperPair};
use crate::scenario::Scenario;

/// What acts on a vehicle during a step of 1 ms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Acting {
    /// Torque of the driver on the column, N.m, positive turns left.
    pub driver_torque_nm: f64,
    /// T_h, the torque that the guidance applies, N.m.
    pub guidance_torque_nm: f64,
    /// Speed at the start and at the end of the step, m/s.
    pub speed_m_per_s: [f64; 2],
    /// Bank of the road, rad, positive where the left edge is the higher one.
    pub bank_rad: f64,
}

/// Where a vehicle is, and how it and its wheel move.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Motion {
    /// Position of the centre of gravity, m.
    pub position_m: [f64; 2],
    /// Direction of movement, rad, left positive, not wrapped.
    pub direction_rad: f64,
    /// Side-slip angle: the direction of movement less the yaw angle, rad.
    pub sideslip_rad: f64,
    /// Yaw rate, rad/s.
    pub yaw_rate_rad_per_s: f64,
    /// Angle of the steering wheel, rad.
    pub wheel_angle_rad: f64,
    /// Its rate, rad/s.
    pub wheel_rate_rad_per_s: f64,
}

/// What passes through a steering column with a torsion bar, and what is told of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BarState {
    /// T_tb as its sensor reads it, N.m: what the ECU is told in the place of the hands' torque.
    pub sensor_nm: f64,
    /// T_tb, N.m.
    pub torque_nm: f64,
    /// The motor's torque without the guidance's part, N.m.
    pub assist_nm: f64,
    /// T_h as hands that hold the wheel feel it, N.m.
    pub felt_nm: f64,
    /// The angle that the ECU is told, rad.
    pub told_angle_rad: f64,
}

/// Something that is steered by torques on its column. It starts at the origin, moving along x.
pub trait Vehicle {
    /// Moves for 1 ms; returns the guidance torque as the motor measures it, N.m: the one that acts, if the motor is ideal.
    fn step(&mut self, acting: &Acting) -> f64;

    /// Where it is, and how it moves.
    fn motion(&self) -> Motion;

    /// Its torsion bar, if it has one: otherwise the column's sensors measure hands and wheel.
    fn bar(&self) -> Option<BarState> {
        None
    }

    /// The point that lies `distance_m` ahead along the direction of movement, m.
    fn ahead_m(&self, distance_m: f64) -> [f64; 2] {
        let motion = self.motion();
        let ([x, y], (sin, cos)) = (motion.position_m, motion.direction_rad.sin_cos());
        [x + distance_m * cos, y + distance_m * sin]
    }
}

/// A scenario's vehicle and column, for a driver of one's own: the paper's, or those of a less than ideal world.
#[derive(Debug, Clone)]
pub struct PaperVehicle(PaperPair);

impl PaperVehicle {
    /// The car that a scenario's tolerances draw.
    pub fn new(scenario: &Scenario) -> Self {
        Self(PaperPair::without_driver(scenario))
    }
}

impl Vehicle for PaperVehicle {
    fn step(&mut self, acting: &Acting) -> f64 {
        self.0.hold(acting.driver_torque_nm);
        self.0.advance(acting);
        self.0.motor_torque_nm()
    }

    fn motion(&self) -> Motion {
        self.0.motion()
    }

    fn bar(&self) -> Option<BarState> {
        self.0.bar()
    }

    fn ahead_m(&self, distance_m: f64) -> [f64; 2] {
        self.0.ahead_m(distance_m)
    }
}
