//! `HapticDriver`: equations (7) and (8), the delay exact.

use haptic_sim::fields::{Field, Fields, from_numbers};
use haptic_sim::models::arm::Arm;
use haptic_sim::models::driver::{ArmGains, ArmInFile, DriverParameters, Vision};

use crate::error::FmuError;
use crate::model::{About, Model, Texts};
use crate::variable::{
    Kind, Role, Variable, guidance_torque, input, limits, of_field, variable, variables, wheel_angle,
};
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
/// The fields of a scenario's driver that act here: whoever couples the unit looks at the road, and adds a remnant.
const FIELDS: [&Field; 9] = [
    Field::named(DriverParameters::FIELDS, "a_1_rad_per_m"),
    Field::named(DriverParameters::FIELDS, "a_2_rad_per_m_s"),
    Field::named(DriverParameters::FIELDS, "a_3"),
    Field::named(DriverParameters::FIELDS, "t_p_s"),
    Field::named(DriverParameters::FIELDS, "t_nms_s"),
    Field::named(DriverParameters::FIELDS, "k_nms_nm_per_rad"),
    Field::named(DriverParameters::FIELDS, "line_m"),
    Field::named(ArmInFile::FIELDS, "k_d_nm_per_rad"),
    Field::named(ArmInFile::FIELDS, "k_hg"),
];
/// Places of the arm's gains.
const K_D: usize = FIRST + 7;
const K_HG: usize = K_D + 1;

/// The driver of a scenario that says nothing.
static VARIABLES: [Variable; FIRST + FIELDS.len()] = {
    let mut all = [OWN[0]; FIRST + FIELDS.len()];
    let mut i = 0;
    while i < all.len() {
        all[i] = if i < FIRST {
            OWN[i]
        } else {
            of_field(FIELDS[i - FIRST])
        };
        i += 1;
    }
    // Without them a scenario takes those of its condition.
    (all[K_D].start, all[K_HG].start) = (3.0, 0.5);
    all
};

const OWN: [Variable; FIRST] = variables! {
    input "e_y_m", "m", limits::LATERAL_M,
        "Lateral error at the driver's near point, positive: the target is to the left";
    input "e_theta_rad", "rad", limits::YAW_RAD, "Yaw error at the driver's far point";
    wheel_angle;
    guidance_torque;
    variable "driver_torque_nm", Real, Output, "N.m", "Torque of the driver on the column";
};

#[derive(Clone)]
struct Driver {
    vision: Vision,
    arm: Option<Arm>,
}

impl Model for Driver {
    fn begin(&mut self, values: &mut [f64], _texts: &Texts) -> Result<(), FmuError> {
        let names = FIELDS.iter().map(|field| field.name);
        let (parameters, arm): (DriverParameters, ArmInFile) =
            from_numbers(names.zip(values[FIRST..].iter().copied()))?;
        parameters.check().and_then(|()| arm.check())?;
        let (k_d, k_hg) = (values[K_D], values[K_HG]);
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
