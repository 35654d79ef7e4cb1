//! The values that a person chooses, and what the controller knows of them.

use haptic_core::controller::params::{BAR_AND_COLUMN_ANGLE, BAR_AND_WHEEL_ANGLE, Params, VehicleParams};

use super::{Condition, DEFAULT_SPEED_KMH, DriverChange, Failure, Sensors, Speed};
use crate::models::disturbances::SensorErrors;
use crate::models::driver::{ArmGains, DriverParameters};
use crate::models::nonlinear::WorldParameters;
use crate::models::road::Course;
use crate::models::tolerances::Tolerances;
use crate::models::torsion_bar::{AngleSensor, AssistParameters, ColumnParameters};
use crate::models::vehicle::VehicleParameters;

/// The controller and the camera that feeds it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GuidanceParameters {
    /// The controller's own parameters; the default is table 8.
    pub controller: Params,
    /// t'_n, look-ahead time of the camera's near point, s.
    pub t_n: f64,
    /// t'_f, look-ahead time of its far point, s.
    pub t_f: f64,
    /// Whether the host asks for the probe. Seen only by the shipping controller.
    pub probe: bool,
}

impl Default for GuidanceParameters {
    fn default() -> Self {
        Self {
            controller: Params::PAPER,
            t_n: 0.3,
            t_f: 0.7,
            probe: false,
        }
    }
}

impl GuidanceParameters {
    /// This guidance, whose controller is told of a bar: what its sensor is, and what wheel and bar are.
    #[must_use]
    pub fn told_of(mut self, column: &ColumnParameters) -> Self {
        let params = &mut self.controller;
        params.torque_sensor = match column.angle {
            AngleSensor::Wheel => BAR_AND_WHEEL_ANGLE,
            AngleSensor::Column => BAR_AND_COLUMN_ANGLE,
        };
        params.wheel_inertia_kg_m2 = column.j_w_kg_m2;
        params.wheel_damping_nm_s = column.b_w_nms_per_rad;
        params.wheel_friction_nm = column.upper_friction_nm;
        params.bar_stiffness_nm_per_rad = column.k_tb_nm_per_rad;
        self
    }
}

/// The values that a person chooses: every field of a scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct ScenarioValues {
    /// The road.
    pub course: Course,
    /// How fast the vehicle goes.
    pub speed: Speed,
    /// Whether there is no guidance.
    pub manual: bool,
    /// Vision, delay, arm and remnant.
    pub driver: DriverParameters,
    /// The arm's gains until a failure is noticed.
    pub gains: ArmGains,
    /// K_d once a failure is noticed, N.m/rad.
    pub manual_k_d: f64,
    /// The vehicle on paper, which the controller knows.
    pub vehicle: VehicleParameters,
    /// The controller and its camera.
    pub guidance: GuidanceParameters,
    /// What the controller sees.
    pub sensors: Sensors,
    /// What fails.
    pub failure: Failure,
    /// When the driver changes, if that happens.
    pub driver_change: Option<DriverChange>,
    /// What is less than ideal in the world.
    pub world: WorldParameters,
    /// What the sensors add to the truth.
    pub sensor_errors: SensorErrors,
    /// How far cars of this kind differ.
    pub tolerances: Tolerances,
    /// What the steering column is.
    pub column: ColumnParameters,
    /// What amplifies the torque of its bar, if it has one.
    pub assist: AssistParameters,
    /// Root of all random numbers.
    pub seed: u64,
}

impl Default for ScenarioValues {
    fn default() -> Self {
        Self {
            course: Course::paper(),
            speed: Speed::constant_kmh(DEFAULT_SPEED_KMH),
            manual: false,
            driver: DriverParameters::default(),
            gains: Condition::Mid.gains(),
            manual_k_d: ArmGains::MANUAL.k_d,
            vehicle: VehicleParameters::default(),
            guidance: GuidanceParameters::default(),
            sensors: Sensors::default(),
            failure: Failure::default(),
            driver_change: None,
            world: WorldParameters::default(),
            sensor_errors: SensorErrors::default(),
            tolerances: Tolerances::default(),
            column: ColumnParameters::default(),
            assist: AssistParameters::default(),
            seed: 1,
        }
    }
}

impl ScenarioValues {
    /// The controller's parameters with what it knows of the vehicle.
    pub(super) fn controller_params(&self) -> Params {
        Params {
            vehicle: self.vehicle_for_plausibility(),
            ..self.guidance.controller
        }
    }

    /// The vehicle as the controller's plausibility checks know it: the true one, from tables 8 and 9.
    fn vehicle_for_plausibility(&self) -> VehicleParams {
        let (near_time_s, far_time_s) = (self.guidance.t_n, self.guidance.t_f);
        if self.vehicle == VehicleParameters::default() {
            // The constants of the shipped image, so that host and target hold the same bits.
            return VehicleParams {
                far_time_s,
                near_time_s,
                ..Params::PAPER.vehicle
            };
        }
        let steady = self.vehicle.steady_cornering();
        VehicleParams {
            curvature_gain_per_m: steady.curvature_gain_per_m,
            // The ECU knows understeering vehicles alone: a neutral or oversteering one is told as neutral.
            stability_factor_s2_per_m2: steady.stability_factor_s2_per_m2.max(0.0),
            aligning_gain_nm_s2_per_m: steady.aligning_gain_nm_s2_per_m,
            column_damping_nm_s: self.vehicle.b_s,
            far_time_s,
            near_time_s,
        }
    }
}
