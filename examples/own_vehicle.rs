//! A vehicle of one's own under the paper's driver, with the shipping ECU:
//! `cargo run --release -p haptic-guidance --example own_vehicle`.
//!
//! It is a kinematic single track, which goes where its front wheel points, behind a steering column with inertia,
//! damping and a torque that centres it.

use haptic_sim::guidance::OverBus;
use haptic_sim::models::{STEP_S, vehicle::VehicleParameters};
use haptic_sim::parts::{Acting, Motion, PaperDriver, Vehicle};
use haptic_sim::scenario::ScenarioError;
use haptic_sim::simulation::Run;
use haptic_sim::{Scenario, Simulation};

/// Wheelbase, m, and front wheel angle per steering wheel angle.
pub(crate) const WHEELBASE_M: f64 = 2.6;
pub(crate) const RATIO: f64 = 1.0 / 17.0;
/// Inertia and damping of the column, kg.m^2 and N.m.s/rad; its aligning torque per lateral acceleration, N.m.s^2/m.
const INERTIA: f64 = 0.11;
const DAMPING: f64 = 0.57;
pub(crate) const ALIGNING: f64 = 1.0;

/// The vehicle is all in how it moves.
#[derive(Debug, Clone, Default)]
pub(crate) struct Kinematic(Motion);

impl Vehicle for Kinematic {
    fn step(&mut self, acting: &Acting) -> f64 {
        let (v, now) = (acting.speed_m_per_s[0], &mut self.0);
        now.yaw_rate_rad_per_s = v * (RATIO * now.wheel_angle_rad).tan() / WHEELBASE_M;
        let aligning_nm = -ALIGNING * v * now.yaw_rate_rad_per_s;
        let torque_nm = acting.driver_torque_nm + acting.guidance_torque_nm + aligning_nm;
        // The wheel's new rate moves the wheel, which keeps a swinging column from gaining energy.
        now.wheel_rate_rad_per_s += STEP_S * (torque_nm - DAMPING * now.wheel_rate_rad_per_s) / INERTIA;
        now.wheel_angle_rad += STEP_S * now.wheel_rate_rad_per_s;
        let halfway_rad = now.direction_rad + 0.5 * STEP_S * now.yaw_rate_rad_per_s;
        now.position_m[0] += STEP_S * v * halfway_rad.cos();
        now.position_m[1] += STEP_S * v * halfway_rad.sin();
        now.direction_rad += STEP_S * now.yaw_rate_rad_per_s;
        acting.guidance_torque_nm
    }

    fn motion(&self) -> Motion {
        self.0
    }
}

/// A drive on the paper's course. The ECU is told of a neutral vehicle with this wheelbase.
pub(crate) fn drive() -> Result<Run, ScenarioError> {
    let mut told = VehicleParameters::default();
    (told.l_f, told.l_r, told.k_r) = (0.5 * WHEELBASE_M, 0.5 * WHEELBASE_M, told.k_f);
    let scenario = Scenario::builder().vehicle(told).build()?;
    let (driver, ecu) = (PaperDriver::new(&scenario), OverBus::new(scenario.setup()));
    Ok(Simulation::of_parts(&scenario, driver, Kinematic::default(), ecu).run())
}

pub(crate) fn main() -> Result<(), ScenarioError> {
    let run = drive()?;
    println!("{:?} after {} s", run.ending, 1e-3 * f64::from(run.steps));
    Ok(())
}
