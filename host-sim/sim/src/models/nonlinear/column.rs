//! A steering column: inertia, damping, and dry friction after Dahl.

use super::WorldParameters;
use crate::models::vehicle::VehicleParameters;

/// Equation (5) with friction: a spring that gives way at the friction torque (Dahl 1968), so that a small motion
/// is held and a large one is opposed by all of it.
#[derive(Debug, Clone)]
pub struct SteeringColumn {
    /// kg.m^2.
    pub inertia: f64,
    /// N.m.s/rad.
    pub damping: f64,
    /// Friction torque at which the spring gives way, N.m.
    pub friction_nm: f64,
    /// Deflection at which the friction gives way, rad.
    pub give_rad: f64,
}

impl SteeringColumn {
    /// A column with table 9's inertia and damping.
    pub fn new(vehicle: &VehicleParameters, world: &WorldParameters) -> Self {
        Self {
            inertia: vehicle.j_s,
            damping: vehicle.b_s,
            friction_nm: world.friction_nm,
            give_rad: world.friction_give_rad,
        }
    }
}

impl SteeringColumn {
    /// Acceleration of the wheel (rad/s^2) and rate of the friction's deflection (rad/s), for the wheel's rate, the
    /// deflection and the sum of all torques on the column.
    pub fn respond(&self, wheel_rate: f64, deflection_rad: f64, torque_nm: f64) -> [f64; 2] {
        let share = deflection_rad / self.give_rad;
        let against = self.damping * wheel_rate + self.friction_nm * share;
        [
            (torque_nm - against) / self.inertia,
            wheel_rate - wheel_rate.abs() * share,
        ]
    }
}
