//! `HapticDriver`: equations (7) and (8), the delay exact.

use haptic_sim::models::arm::Arm;
use haptic_sim::models::driver::{ArmGains, DriverParameters, Vision};

use crate::error::FmuError;
use crate::model::{About, Model, Texts};
use crate::variable::{Kind, Role, Variable, input, limits, parameter, variable};
use Kind::Real;
use Role::Output;

/// The model.
pub static ABOUT: About = About {
    name: "HapticDriver",
    token: "{6a0d2f9e-6f0c-4f0b-9c53-3e0c3b2f7a05}",
    meaning: "A driver: two-point vision with an exact delay, and an arm that weighs vision against the guidance",
    variables: &VARIABLES,
    make: || {
        Box::new(Driver {
            vision: Vision::new(&DriverParameters::default()),
            arm: None,
        })
    },
};

const TORQUE: usize = 4;
const FIRST: usize = 5;

/// The driver of a scenario that says nothing.
static VARIABLES: [Variable; 13] = [
    input(
        "e_y_m",
        "m",
        limits::LATERAL_M,
        "Lateral error at the driver's near point, positive: the target is to the left",
    ),
    input(
        "e_theta_rad",
        "rad",
        limits::YAW_RAD,
        "Yaw error at the driver's far point",
    ),
    input(
        "wheel_angle_rad",
        "rad",
        limits::WHEEL_RAD,
        "Angle of the steering wheel",
    ),
    input(
        "guidance_torque_nm",
        "N.m",
        limits::TORQUE_NM,
        "Guidance torque on the column",
    ),
    variable(
        "driver_torque_nm",
        Real,
        Output,
        "N.m",
        "Torque of the driver on the column",
    ),
    parameter("a_1", "rad/m", 0.1, [0.0, 10.0], "Target angle per lateral error"),
    parameter(
        "a_2",
        "rad/(m.s)",
        0.05,
        [0.0, 10.0],
        "Target angle per integral of the lateral error",
    ),
    parameter("a_3", "", 3.7, [0.0, 100.0], "Target angle per yaw error"),
    parameter("t_p_s", "s", 0.1, [0.001, 2.0], "Delay from seeing to acting"),
    parameter("t_nms_s", "s", 0.1, [0.01, 2.0], "Time constant of the arm"),
    parameter("k_nms_nm_per_rad", "N.m/rad", 1.0, [0.0, 100.0], "Reflex gain"),
    parameter(
        "k_d_nm_per_rad",
        "N.m/rad",
        3.0,
        [0.0, 50.0],
        "Torque per target angle",
    ),
    parameter(
        "k_hg",
        "",
        0.5,
        [0.0, 10.0],
        "Share of the guidance torque that the arm works against",
    ),
];

#[derive(Clone)]
struct Driver {
    vision: Vision,
    arm: Option<Arm>,
}

impl Model for Driver {
    fn begin(&mut self, values: &mut [f64], _texts: &Texts) -> Result<(), FmuError> {
        let [a_1, a_2, a_3, t_p, t_nms, k_nms, k_d, k_hg, ..] = values[FIRST..] else {
            return Err(FmuError::Other("variables are missing"));
        };
        let parameters = DriverParameters {
            a_1,
            a_2,
            a_3,
            t_p,
            t_nms,
            k_nms,
            ..DriverParameters::default()
        };
        parameters.check()?;
        self.vision = Vision::new(&parameters);
        self.arm = Some(Arm::new(&parameters, ArmGains { k_d, k_hg }));
        values[TORQUE] = 0.0;
        Ok(())
    }

    fn step(&mut self, values: &mut [f64]) -> Result<(), FmuError> {
        let target_rad = self.vision.step(values[0], values[1]);
        if let Some(arm) = &mut self.arm {
            values[TORQUE] = arm.step(target_rad, values[2], values[3]);
        }
        Ok(())
    }

    fn copy(&self) -> Box<dyn Model> {
        Box::new(self.clone())
    }
}
