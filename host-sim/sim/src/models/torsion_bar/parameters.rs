//! What a scenario says of its steering column and of the power assist; where the defaults come from stands in
//! docs/explanation/torsion-bar.md.

use serde::{Deserialize, Serialize};

use super::assist::CurveChoice;
use crate::fields::{FieldValue, Fields, fields};
use crate::models::nonlinear::WorldParameters;
use crate::models::tolerances::Tolerances;
use crate::models::vehicle::VehicleParameters;
use crate::scenario::ScenarioError;

/// What a steering column is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ColumnKind {
    /// The paper's: one rigid body, whose sensor measures the hands.
    #[default]
    Rigid,
    /// A wheel on a torsion bar, whose sensor measures what passes through it.
    TorsionBar,
}

/// What fails in a column with a bar, from an instant on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ColumnFault {
    /// Nothing.
    #[default]
    None,
    /// The sensor reads 1 N.m more.
    SensorOffset,
    /// The sensor reads more by 0.05 N.m in a second.
    SensorDrift,
    /// The sensor reads what it read last.
    SensorStuck,
    /// The sensor reads twice the torque.
    SensorDoubled,
    /// The bar has a tenth of its stiffness left, and its sensor reads the twist as that of the whole one.
    BrokenBar,
    /// The motor assists no longer; it still guides.
    AssistLost,
    /// The assist turns left with all that the motor may.
    AssistRunaway,
}

/// Which angle the ECU is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AngleSensor {
    /// That of the wheel, above the bar.
    #[default]
    Wheel,
    /// That of column and motor, below it.
    Column,
}

/// Where the guidance is brought in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Inject {
    /// Added to the motor's torque behind the assist.
    #[default]
    Overlay,
    /// Added to the bar's torque in front of the assist, which then turns the wheel.
    Offset,
}

impl FieldValue for ColumnKind {}
impl FieldValue for ColumnFault {}
impl FieldValue for AngleSensor {}
impl FieldValue for Inject {}
impl FieldValue for CurveChoice {}

fields! {
    /// Wheel, bar and sensor. Inertia and damping of the column are the vehicle's without the wheel's.
    #[derive(Copy)]
    ColumnParameters, "column" {
        /// one rigid body, whose sensor measures the hands, or a wheel on a torsion bar, which every other field is for
        kind: ColumnKind = ColumnKind::Rigid, "kind", "", "", OneOf(&["rigid", "torsion-bar"]);
        /// inertia of the wheel
        j_w_kg_m2: f64 = 0.044, "j_w_kg_m2", "J_w", "kg.m2", Between(0.005, 0.5);
        /// damping of the wheel
        b_w_nms_per_rad: f64 = 0.05, "b_w_nms_per_rad", "B_w", "N.m.s/rad", Between(0.0, 5.0);
        /// stiffness of the bar
        k_tb_nm_per_rad: f64 = 143.24, "k_tb_nm_per_rad", "K_tb", "N.m/rad", Between(5.0, 1e9);
        /// damping of the bar
        b_tb_nms_per_rad: f64 = 0.0, "b_tb_nms_per_rad", "B_tb", "N.m.s/rad", Between(0.0, 5.0);
        /// dry friction of the wheel
        upper_friction_nm: f64 = 0.2, "upper_friction_nm", "", "N.m", Between(0.0, 5.0);
        /// dry friction of the column
        lower_friction_nm: f64 = 0.5, "lower_friction_nm", "", "N.m", Between(0.0, 20.0);
        /// how far a body gives before it slides: 0.2 degrees
        friction_give_rad: f64 = 0.2_f64.to_radians(), "friction_give_rad", "", "rad", Between(0.0005, 0.1);
        /// most that the bar's sensor reads
        sensor_range_nm: f64 = 10.0, "sensor_range_nm", "", "N.m", Between(0.5, 100.0);
        /// step of its readings
        sensor_resolution_nm: f64 = 0.005, "sensor_resolution_nm", "", "N.m", Between(1e-6, 1.0);
        /// standard deviation of its noise, a draw every millisecond
        sensor_noise_nm: f64 = 0.01, "sensor_noise_nm", "", "N.m", Between(0.0, 1.0);
        /// what it adds always
        sensor_offset_nm: f64 = 0.0, "sensor_offset_nm", "", "N.m", Between(-2.0, 2.0);
        /// its lag
        sensor_lag_s: f64 = 0.001, "sensor_lag_s", "", "s", Between(0.0002, 0.05);
        /// which angle the ECU is told: above or below the bar
        angle: AngleSensor = AngleSensor::Wheel, "angle", "", "", OneOf(&["wheel", "column"]);
        /// what fails: nothing, the sensor (1 N.m more, 0.05 N.m/s more, its last reading, twice), the bar (a tenth of K_tb), the assist
        fault: ColumnFault = ColumnFault::None, "fault", "", "", OneOf(&[
            "none", "sensor-offset", "sensor-drift", "sensor-stuck", "sensor-doubled", "broken-bar", "assist-lost", "assist-runaway",
        ]);
        /// when it fails, before the run ends
        fault_time_s: f64 = 70.0, "fault_time_s", "", "s", Between(0.0, 1e6);
    }
}

fields! {
    /// What amplifies the torque of the bar.
    AssistParameters, "assist" {
        /// where the guidance is added: to the motor's torque, or to the bar's in front of the curve
        inject: Inject = Inject::Overlay, "inject", "", "", OneOf(&["overlay", "offset"]);
        /// time constant of the compensator's lead
        lead_s: f64 = 0.012, "lead_s", "", "s", Between(0.0, 0.5);
        /// time constant of the compensator's lag
        lag_s: f64 = 0.001, "lag_s", "", "s", Between(0.0002, 0.5);
        /// lag of the motor
        motor_lag_s: f64 = 0.001, "motor_lag_s", "", "s", Between(0.0002, 0.1);
        /// most torque of the motor, seen at the wheel
        limit_nm: f64 = 60.0, "limit_nm", "", "N.m", Between(1.0, 200.0);
        /// assist over torque and speed: of usual practice by name, or a table [assist.curve] of points
        curve: CurveChoice = CurveChoice::default(), "curve", "", "", OneOf(&["none", "light", "medium", "strong"]);
    }
}

/// The name of the first of some numbers that is not its default.
fn first_changed<T: Fields>(table: &T) -> Option<(&'static str, f64)> {
    let (own, default) = (table.numbers(), T::default().numbers());
    let mut pairs = T::fields().into_iter().zip(own.into_iter().zip(default));
    pairs.find_map(|(field, (own, default))| own.filter(|_| own != default).map(|own| (field.name, own)))
}

impl ColumnParameters {
    /// No friction, no noise and no offset: what the linear form knows.
    #[must_use]
    pub fn linear(self) -> Self {
        Self {
            upper_friction_nm: 0.0,
            lower_friction_nm: 0.0,
            sensor_noise_nm: 0.0,
            sensor_offset_nm: 0.0,
            ..self
        }
    }

    /// When something fails, if it does, s.
    pub fn fault_at_s(&self) -> Option<f64> {
        (self.fault != ColumnFault::None).then_some(self.fault_time_s)
    }

    /// Whether there is a bar.
    pub fn has_bar(&self) -> bool {
        self.kind == ColumnKind::TorsionBar
    }

    /// Whether the wheel leaves something of inertia and damping to the column of a vehicle.
    ///
    /// # Errors
    /// The field, its value and the vehicle's.
    pub fn check_share(&self, vehicle: &VehicleParameters) -> Result<(), ScenarioError> {
        let shares = [
            ("j_w_kg_m2", self.j_w_kg_m2, "kg.m2", vehicle.j_s),
            ("b_w_nms_per_rad", self.b_w_nms_per_rad, "N.m.s/rad", vehicle.b_s),
        ];
        match shares.into_iter().find(|(_, value, _, all)| value >= all) {
            Some((field, value, unit, all)) => Err(ScenarioError::WheelHasAll {
                field,
                value,
                unit,
                all,
            }),
            None => Ok(()),
        }
    }

    /// Whether column and assist go together with each other and with the world.
    ///
    /// # Errors
    /// The first field that says something of a bar or an assist that there is not, or of a column that a bar replaces.
    pub(crate) fn check_with(
        &self,
        assist: &AssistParameters,
        world: &WorldParameters,
        tolerances: &Tolerances,
    ) -> Result<(), ScenarioError> {
        if !self.has_bar() {
            let number = |table: &str, (name, value)| format!("{table}.{name} = {value}");
            let what = match (first_changed(self), first_changed(assist)) {
                (Some(changed), _) => number("column", changed),
                (None, Some(changed)) => number("assist", changed),
                (None, None) if *self != Self::default() => "column.angle or column.fault".into(),
                (None, None) if *assist != AssistParameters::default() => {
                    "assist.inject or assist.curve".into()
                }
                (None, None) => return Ok(()),
            };
            return Err(ScenarioError::WithoutBar(what));
        }
        if assist.inject == Inject::Offset && assist.curve == CurveChoice::default() {
            return Err(ScenarioError::OffsetOfNothing);
        }
        let replaced = [
            (
                "world.friction_nm",
                world.friction_nm,
                "column.upper_friction_nm and column.lower_friction_nm",
            ),
            ("world.assist_nm", world.assist_nm, "assist.curve"),
            ("world.motor_lag_s", world.motor_lag_s, "assist.motor_lag_s"),
            (
                "tolerances.friction_most_nm",
                tolerances.friction_most_nm,
                "column.lower_friction_nm",
            ),
            (
                "tolerances.motor_lag_s",
                tolerances.motor_lag_s,
                "assist.motor_lag_s",
            ),
        ];
        match replaced.into_iter().find(|(_, value, _)| *value != 0.0) {
            Some((field, value, instead)) => Err(ScenarioError::OfTheRigidColumn {
                field,
                value,
                instead,
            }),
            None => Ok(()),
        }
    }
}
