//! `HapticVehicle`: vehicle, column and the road before them, under two torques. It is the simulator's closed loop whose driver
//! has no gain and whose guidance is an input.

use haptic_sim::fields::from_numbers;
use haptic_sim::guidance::{Actuation, Guidance, Observation};
use haptic_sim::input::InputError;
use haptic_sim::models::road::{Course, LaneChoice, PAPER_COURSE};
use haptic_sim::models::vehicle::VehicleParameters;
use haptic_sim::parts::{DriverVehicle, PaperPair};
use haptic_sim::scenario::{Condition, SPEED_M_PER_S, ScenarioBuilder, Speed};
use haptic_sim::simulation::Ending;
use haptic_sim::{Action, Scenario, Simulation};

use crate::error::FmuError;
use crate::model::{About, Model, Texts};
use crate::variable::{
    Kind, Role, Variable, driver_torque, guidance_torque, of_field, parameter, variable, variables,
};
use Kind::{Real, Text};
use Role::{Output, Parameter};

/// The model.
pub static ABOUT: About = About {
    name: "HapticVehicle",
    token: "{6a0d2f9e-6f0c-4f0b-9c53-3e0c3b2f7a07}",
    meaning: "A vehicle with its steering column on a road, and what a driver and a camera see of it",
    variables: &VARIABLES,
    make: || {
        Box::new(Vehicle {
            simulation: None,
            lateral_error_m: 0.0,
            s_m: 0.0,
        })
    },
};

const OUTPUTS: usize = 2;
const SPEED: usize = 14;
const FIRST: usize = 15;
const COURSE: usize = FIRST + VehicleParameters::FIELDS.len();
const COLUMN: usize = COURSE + 1;

/// Road and column are the last of them, the fields of a scenario's vehicle before them.
static VARIABLES: [Variable; COLUMN + 1] = {
    let mut all = [ROAD; COLUMN + 1];
    let mut i = 0;
    while i < COURSE {
        all[i] = if i < FIRST {
            OWN[i]
        } else {
            of_field(&VehicleParameters::FIELDS[i - FIRST])
        };
        i += 1;
    }
    all[COLUMN] = text(
        "column",
        RIGID,
        "The steering column: rigid, or a scenario file whose [column] has a torsion bar, of which [column] and [assist] count; a \
         relative path is one in resources",
    );
    all
};

const ROAD: Variable = text(
    "course",
    PAPER_COURSE,
    "The road: paper-course, or a file (TOML, or OpenDRIVE if it ends with .xodr); a relative path is one in resources",
);
/// The paper's column, in the place of a file.
const RIGID: &str = "rigid";

const fn text(name: &'static str, text: &'static str, meaning: &'static str) -> Variable {
    Variable {
        text,
        ..variable(name, Text, Parameter, "", meaning)
    }
}

const OWN: [Variable; FIRST] = variables! {
    driver_torque;
    guidance_torque;
    variable "e_y_m", Real, Output, "m", "Lateral error at the driver's near point";
    variable "e_theta_rad", Real, Output, "rad", "Yaw error at the driver's far point";
    variable "guidance_e_y_m", Real, Output, "m", "Lateral error at the guidance's near point";
    variable "guidance_e_theta_rad", Real, Output, "rad", "Yaw error at the guidance's far point";
    variable "wheel_angle_rad", Real, Output, "rad", "Angle of the steering wheel";
    variable "column_torque_nm", Real, Output, "N.m", "Torque as the column's sensor reads it: of the driver, or of the torsion bar";
    variable "motor_torque_nm", Real, Output, "N.m", "Guidance torque that acted in the last step";
    variable "lateral_error_m", Real, Output, "m",
        "Offset from the centreline, left positive; 200 values a second";
    variable "s_m", Real, Output, "m", "Arc length along the centreline; 200 values a second";
    variable "speed_m_per_s", Real, Output, "m/s", "Speed";
    variable "told_angle_rad", Real, Output, "rad", "Angle as the column's sensor reads it: of the wheel, or of a column below its bar";
    variable "felt_torque_nm", Real, Output, "N.m", "Guidance torque of the last step as hands feel it: what comes up through a bar";
    parameter "v_m_per_s", "m/s", 60.0 / 3.6, [*SPEED_M_PER_S.start(), *SPEED_M_PER_S.end()], "Speed";
};

/// The text of a file that a parameter names.
fn read(texts: &Texts, name: &str) -> Result<String, InputError> {
    let path = texts.resources.join(name);
    let bytes = std::fs::read(&path).map_err(|why| InputError::new(path.display(), why))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// The road that was asked for.
fn course(texts: &Texts) -> Result<Course, InputError> {
    let name = texts.texts[COURSE].as_str();
    if name == PAPER_COURSE {
        return Ok(Course::paper());
    }
    Course::from_text(name, &read(texts, name)?, &LaneChoice::default())
}

/// A scenario with the column that was asked for.
fn columned(texts: &Texts, builder: ScenarioBuilder) -> Result<ScenarioBuilder, InputError> {
    let name = texts.texts[COLUMN].as_str();
    if name == RIGID {
        return Ok(builder);
    }
    // The road of the file is not driven on.
    let file = Scenario::from_toml(name, &read(texts, name)?, |_, _| Ok(Course::paper()))?;
    if !file.column().has_bar() {
        return Err(InputError::new(
            name,
            "column.kind = \"torsion-bar\" is wanted in it; without a bar, column = rigid",
        ));
    }
    Ok(builder.column(*file.column()).assist(file.assist().clone()))
}

/// A guidance that applies what it is told.
#[derive(Clone, Default)]
struct GivenTorque {
    torque_nm: f64,
}

impl Guidance for GivenTorque {
    fn looks_at_road(&self, _step: u32) -> bool {
        true
    }

    fn step(&mut self, _observation: &Observation) -> Actuation {
        Actuation {
            torque_nm: self.torque_nm,
            limited: false,
        }
    }
}

#[derive(Clone)]
struct Vehicle {
    simulation: Option<Simulation<GivenTorque>>,
    lateral_error_m: f64,
    s_m: f64,
}

impl Vehicle {
    /// What there is to be seen now: a copy looks, and is thrown away.
    fn observe(&mut self, values: &mut [f64]) -> Result<(), FmuError> {
        let Some(simulation) = &self.simulation else {
            return Err(FmuError::NotStarted);
        };
        let action = Action {
            hand_torque_nm: values[0],
            ..Action::default()
        };
        let driven = simulation.driver_vehicle();
        let (wheel_rad, bar) = (driven.motion().wheel_angle_rad, driven.bar());
        let mut copy = simulation.clone();
        let Some(outcome) = copy.step(&action) else {
            return Err(ended(&copy));
        };
        let (preview, now, sample) = (outcome.preview, outcome.observation, outcome.sample);
        if let Some(sample) = sample {
            (self.lateral_error_m, self.s_m) = (sample.lateral_error_m, sample.s_m);
        }
        let camera = now.lane.unwrap_or_default();
        values[OUTPUTS..SPEED].copy_from_slice(&[
            preview.e_y_m,
            preview.e_theta_rad,
            camera.e_y_m,
            camera.e_theta_rad,
            wheel_rad,
            now.driver_torque_nm,
            now.motor_torque_nm,
            self.lateral_error_m,
            self.s_m,
            now.speed_m_per_s,
            now.wheel_angle_rad,
            bar.map_or(now.motor_torque_nm, |bar| bar.felt_nm),
        ]);
        Ok(())
    }
}

/// Why there is no next step.
fn ended(simulation: &Simulation<GivenTorque>) -> FmuError {
    match simulation.ending() {
        Some(Ending::Diverged { s_m }) => FmuError::LeftRoad(s_m),
        _ => FmuError::Ended,
    }
}

impl Model for Vehicle {
    fn begin(&mut self, values: &mut [f64], texts: &Texts) -> Result<(), FmuError> {
        let names = VehicleParameters::FIELDS.iter().map(|field| field.name);
        let vehicle = from_numbers(names.zip(values[FIRST..COURSE].iter().copied()))?;
        let scenario = columned(texts, Scenario::builder())
            .map_err(|why| FmuError::Text("column", why))?
            .course(course(texts).map_err(|why| FmuError::Text("course", why))?)
            .condition(Condition::High)
            .speed(Speed::Constant(values[SPEED]))
            .vehicle(vehicle)
            .build()?;
        self.simulation = Some(Simulation::with_driver_vehicle(
            &scenario,
            PaperPair::without_driver(&scenario),
            GivenTorque::default(),
        ));
        (self.lateral_error_m, self.s_m) = (0.0, 0.0);
        self.observe(values)
    }

    fn step(&mut self, values: &mut [f64]) -> Result<(), FmuError> {
        let Some(simulation) = &mut self.simulation else {
            return Err(FmuError::NotStarted);
        };
        simulation.guidance_mut().torque_nm = values[1];
        let action = Action {
            hand_torque_nm: values[0],
            ..Action::default()
        };
        if simulation.step(&action).is_none() {
            return Err(ended(simulation));
        }
        self.observe(values)
    }

    fn copy(&self) -> Box<dyn Model> {
        Box::new(self.clone())
    }
}
