//! `HapticController`: the shipping ECU with its sensors' frames inside, SI values outside.

use haptic_core::bus::messages::{Column, LanePreview, Message, Request, Vehicle};
use haptic_core::controller::config::Setup;
use haptic_core::controller::params::{PARAMETERS, Params};
use haptic_core::ecu::{Boot, Ecu};
use haptic_core::quantity::{Instant, Metres, Micros, Radians, Ratio, Speed, Torque, TurningRate};
use haptic_core::safety::modes::Mode;
use haptic_sim::guidance::Status;
use haptic_sim::models::sensors::camera_looks;
use haptic_sim::unguided::{Cause, Circumstances, Watch};

use crate::error::FmuError;
use crate::model::{About, Model, Texts};
use crate::variable::{Kind, Role, Variable, driver_torque, input, limits, variable, variables, wheel_angle};

/// The model.
pub static ABOUT: About = About {
    name: "HapticController",
    token: "{6a0d2f9e-6f0c-4f0b-9c53-3e0c3b2f7a06}",
    meaning: "The shipping haptic-guidance ECU: SI values in, torque out",
    variables: &VARIABLES,
    make: || Box::new(Controller::default()),
};

/// Variables that are no parameters of the controller.
const OWN: usize = 19;
use Kind::{Boolean, Integer, Real};
use Role::{Input, Output, Parameter, Tunable};

/// Every variable, the controller's own parameters last.
pub static VARIABLES: [Variable; OWN + PARAMETERS.len()] = {
    let own = variables! {
        input "e_y_m", "m", limits::LATERAL_M,
            "Lateral error at the near point, positive: the target is to the left";
        input "e_theta_rad", "rad", limits::YAW_RAD, "Yaw error at the far point";
        driver_torque;
        wheel_angle;
        input "motor_torque_nm", "N.m", limits::TORQUE_NM, "Torque that the motor delivers";
        input "speed_m_per_s", "m/s", limits::SPEED_M_PER_S, "Speed of the vehicle";
        input "yaw_rate_rad_per_s", "rad/s", limits::YAW_RATE_RAD_PER_S,
            "Measured yaw rate of the vehicle, positive to the left";
        variable "yaw_rate_valid", Boolean, Input, "", "The vehicle measures its yaw rate";
        input "authority", "", [0.0, 1.0], "Share of the guidance torque that is allowed, 0 to 1";
        variable "engage", Boolean, Input, "", "Guidance is wanted; the ECU takes a rise of it";
        variable "probe", Boolean, Input, "", "The probe is wanted";
        variable "engaged_at_start", Boolean, Parameter, "", "Guiding from the start, every sender trusted";
        variable "torque_nm", Real, Output, "N.m", "Guidance torque to apply";
        variable "mode", Integer, Output, "", "Mode, as in core/haptic.dbc";
        variable "limit", Integer, Output, "", "Limit that acted, as in core/haptic.dbc";
        variable "faults", Integer, Output, "", "Fault word, as in core/haptic.dbc";
        variable "warning", Boolean, Output, "", "The driver has to take over";
        variable "unguided_cause", Integer, Output, "",
            "Why the guidance left: 0 while it is there, or was never; as in a time series (docs/reference/formats.md)";
        variable "unguided_s", Real, Output, "s", "How long the guidance was away since it was there first";
    };
    let mut all = [own[0]; OWN + PARAMETERS.len()];
    let mut i = 0;
    while i < all.len() {
        if i < OWN {
            all[i] = own[i];
        } else {
            let parameter = PARAMETERS[i - OWN];
            all[i] = Variable {
                start: parameter.default,
                range: Some([parameter.min, parameter.max]),
                ..variable(parameter.name, Real, Tunable, parameter.unit, parameter.meaning)
            };
        }
        i += 1;
    }
    assert!(matches!(all[AUTHORITY].name.as_bytes(), b"authority"));
    assert!(matches!(all[ENGAGED].name.as_bytes(), b"engaged_at_start"));
    assert!(matches!(all[TORQUE].name.as_bytes(), b"torque_nm"));
    // Nobody holds the guidance back unless told to.
    all[AUTHORITY].start = 1.0;
    all
};
const AUTHORITY: usize = 8;
const ENGAGED: usize = 11;
const TORQUE: usize = 12;
const LEAST_SPEED: usize = {
    let mut i = 0;
    while !matches!(VARIABLES[i].name.as_bytes(), b"least_speed_m_per_s") {
        i += 1;
    }
    i
};

/// The unit under way.
#[derive(Debug, Clone)]
struct Controller {
    ecu: Ecu,
    /// Steps so far, 1 ms each: time is a whole number here, whatever a master adds up.
    steps: u64,
    /// Frames that the camera has sent; column and host send on a grid of whole steps.
    pictures: u64,
    mode: Mode,
    watch: Watch,
    /// Steps in which the guidance was away.
    unguided: u64,
}

impl Default for Controller {
    fn default() -> Self {
        Self {
            ecu: Ecu::new(Some(&Setup::PAPER), Boot::default(), Instant::from_us(0)),
            steps: 0,
            pictures: 0,
            mode: Mode::Boot,
            watch: Watch::default(),
            unguided: 0,
        }
    }
}

/// The parameters among the values, checked alone and together.
fn setup_of(values: &[f64]) -> Result<Setup, FmuError> {
    let parameters = std::array::from_fn(|i| values[OWN + i]);
    Setup::new(&Params::from_values(&parameters)).map_err(FmuError::Setup)
}

impl Model for Controller {
    fn begin(&mut self, values: &mut [f64], _texts: &Texts) -> Result<(), FmuError> {
        let setup = setup_of(values)?;
        let start = Instant::from_us(0);
        self.ecu = if values[ENGAGED] != 0.0 {
            Ecu::engaged(&setup, start)
        } else {
            Ecu::new(Some(&setup), Boot::default(), start)
        };
        (self.steps, self.pictures) = (0, 0);
        (self.watch, self.unguided) = (Watch::default(), 0);
        self.mode = if values[ENGAGED] != 0.0 {
            Mode::Active
        } else {
            Mode::Boot
        };
        Ok(())
    }

    /// Takes a new set while nobody is guided: the ECU starts again with it, like one on a vehicle.
    fn tune(&mut self, values: &[f64]) -> Result<(), FmuError> {
        let setup = setup_of(values)?;
        if !matches!(self.mode, Mode::Boot | Mode::Standby) {
            return Err(FmuError::Mode(self.mode));
        }
        let now = Instant::from_us(self.steps.wrapping_mul(1000) as u32);
        self.ecu = Ecu::new(Some(&setup), Boot::default(), now);
        self.mode = Mode::Boot;
        Ok(())
    }

    /// The sensors send what is due, the ECU decides.
    fn step(&mut self, values: &mut [f64]) -> Result<(), FmuError> {
        let [
            e_y,
            e_theta,
            driver,
            wheel,
            motor,
            speed,
            yaw_rate,
            yaw_rate_valid,
            authority,
            engage,
            probe,
            ..,
        ] = *values
        else {
            return Err(FmuError::MissingValues(values.len()));
        };
        let step = self.steps;
        // The ECU's clock wraps.
        let now = Instant::from_us(step.wrapping_mul(1000) as u32);
        let mut hear = |frame| {
            // The ECU judges by itself, and reports what it misses.
            let _ = self.ecu.receive(&frame, now);
        };
        // 25 steps hold three pictures, so the grid of the rest is that of all.
        if camera_looks((step % 25) as u32) {
            let preview = LanePreview {
                e_y: Metres::from_m(e_y),
                e_theta: Radians::from_rad(e_theta),
                age: Micros::from_us(0),
                valid: true,
            };
            hear(preview.encode(self.pictures as u8));
            self.pictures += 1;
        }
        if step.is_multiple_of(2) {
            let column = Column {
                driver_torque: Torque::from_nm(driver),
                wheel_angle: Radians::from_rad(wheel),
                motor_torque: Torque::from_nm(motor),
            };
            hear(column.encode((step / 2) as u8));
        }
        if step.is_multiple_of(10) {
            let counter = (step / 10) as u8;
            let speeds = [Speed::from_m_per_s(speed); 2];
            let yaw_rate = (yaw_rate_valid != 0.0).then(|| TurningRate::from_rad_per_s(yaw_rate));
            hear(Vehicle { speeds, yaw_rate }.encode(counter));
            let request = Request {
                engage: engage != 0.0,
                authority: Ratio::from_si(authority),
                probe: probe != 0.0,
            };
            hear(request.encode(counter));
        }
        let command = self.ecu.step(now).command;
        let _ = self.ecu.background_step();
        self.mode = command.mode;
        let around = Circumstances {
            request_ended: engage == 0.0,
            speed_m_per_s: speed,
            least_speed_m_per_s: values[LEAST_SPEED],
            ..Circumstances::default()
        };
        self.watch.step(&status_of(&command), around);
        let cause = self.watch.cause();
        self.unguided += u64::from(cause.is_some());
        values[TORQUE..OWN].copy_from_slice(&[
            command.torque.nm(),
            f64::from(command.mode as u8),
            f64::from(command.limit as u8),
            f64::from(command.faults.bits()),
            f64::from(u8::from(command.warning)),
            cause.map_or(0.0, Cause::code),
            self.unguided as f64 * 1e-3,
        ]);
        self.steps += 1;
        Ok(())
    }

    fn copy(&self) -> Box<dyn Model> {
        Box::new(self.clone())
    }
}

/// A command as the watch over guidance reads it.
fn status_of(command: &haptic_core::controller::Command) -> Status {
    Status {
        mode: command.mode,
        faults: command.faults,
        warning: command.warning,
        k_hg: None,
    }
}
