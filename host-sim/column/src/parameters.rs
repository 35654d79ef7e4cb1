//! What a column with a torsion bar is made of; defaults and where they come from stand in docs/explanation/torsion-bar.md.

use haptic_sim::fields::{Field, Range};
use haptic_sim::input::RangeError;
use haptic_sim::models::vehicle::VehicleParameters;
use serde::{Deserialize, Serialize};

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

/// Why there is no such column.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ColumnError {
    /// A number out of its range.
    #[error(transparent)]
    Range(#[from] RangeError),
    /// A curve that cannot be read.
    #[error("{field} has to be: {is}")]
    Curve {
        /// The field.
        field: &'static str,
        /// What it has to be.
        is: &'static str,
    },
    /// The wheel has more of something than wheel and column together.
    #[error("column.{field} = {value} {unit} leaves the column none of the vehicle's {all} {unit}")]
    Share {
        /// The field.
        field: &'static str,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// That of wheel and column together.
        all: f64,
    },
}

/// Makes the struct of the parameters and the list of their fields from one list.
macro_rules! parameters {
    ($($field:ident: $default:expr, $unit:literal, [$low:expr, $high:expr], $meaning:literal;)*) => {
        /// Wheel, bar, sensor, compensator and motor. Inertia and damping of the column are the vehicle's without the wheel's.
        #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct BarParameters {
            $(#[doc = concat!($meaning, ", `", $unit, "`.")] pub $field: f64,)*
            /// Where the guidance is brought in.
            pub inject: Inject,
        }

        impl Default for BarParameters {
            fn default() -> Self {
                Self { $($field: $default,)* inject: Inject::Overlay }
            }
        }

        impl BarParameters {
            /// Its numbers.
            pub const FIELDS: &'static [Field] = &[$(Field {
                name: stringify!($field),
                symbol: "",
                unit: $unit,
                range: Range::Between($low, $high),
                default: Some($default),
                meaning: $meaning,
            },)*];

            fn numbers(&self) -> impl Iterator<Item = f64> {
                [$(self.$field,)*].into_iter()
            }
        }
    };
}

parameters! {
    j_w_kg_m2: 0.044, "kg.m2", [0.005, 0.5], "J_w, inertia of the wheel";
    b_w_nms_per_rad: 0.05, "N.m.s/rad", [0.0, 5.0], "B_w, damping of the wheel";
    k_tb_nm_per_rad: 143.24, "N.m/rad", [5.0, 1e9], "K_tb, stiffness of the bar";
    b_tb_nms_per_rad: 0.0, "N.m.s/rad", [0.0, 5.0], "B_tb, damping of the bar";
    upper_friction_nm: 0.2, "N.m", [0.0, 5.0], "Dry friction of the wheel";
    lower_friction_nm: 0.5, "N.m", [0.0, 20.0], "Dry friction of the column";
    friction_give_rad: 0.2_f64.to_radians(), "rad", [0.0005, 0.1], "How far a body gives before it slides";
    sensor_range_nm: 10.0, "N.m", [0.5, 100.0], "Most that the bar's sensor reads";
    sensor_resolution_nm: 0.005, "N.m", [1e-6, 1.0], "Step of its readings";
    sensor_noise_nm: 0.01, "N.m", [0.0, 1.0], "Standard deviation of its noise";
    sensor_offset_nm: 0.0, "N.m", [-2.0, 2.0], "What it adds always";
    sensor_lag_s: 0.001, "s", [0.0002, 0.05], "Its lag";
    lead_s: 0.012, "s", [0.0, 0.5], "Time constant of the compensator's lead";
    lag_s: 0.001, "s", [0.0002, 0.5], "Time constant of the compensator's lag";
    motor_lag_s: 0.001, "s", [0.0002, 0.1], "Lag of the motor";
    motor_limit_nm: 60.0, "N.m", [1.0, 200.0], "Most torque of the motor, seen at the wheel";
}

impl BarParameters {
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

    /// Whether there is such a column in a vehicle.
    ///
    /// # Errors
    /// The field, its value and its range.
    pub fn check(&self, vehicle: &VehicleParameters) -> Result<(), ColumnError> {
        for (field, value) in Self::FIELDS.iter().zip(self.numbers()) {
            field.check(value).map_err(|e| e.within("column"))?;
        }
        let shares = [
            ("j_w_kg_m2", self.j_w_kg_m2, "kg.m2", vehicle.j_s),
            ("b_w_nms_per_rad", self.b_w_nms_per_rad, "N.m.s/rad", vehicle.b_s),
        ];
        match shares.into_iter().find(|(_, value, _, all)| value >= all) {
            Some((field, value, unit, all)) => Err(ColumnError::Share {
                field,
                value,
                unit,
                all,
            }),
            None => Ok(()),
        }
    }
}
