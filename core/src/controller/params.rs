//! The one list of the controller's parameters, in SI: names, units, ranges, defaults, and their order.
//!
//! One more parameter is one more line of [`parameters!`](self) below. From it follow the struct, the defaults, the
//! checks, the names and numbers on the bus ([`crate::service::download`]), the copy in memory ([`crate::service::stored`]) and the
//! parameters of a lock-step run. What else wants a decision says so itself: `core/tests/params.rs` asks for its row
//! in `docs/parameters.md`, `core/tests/dbc.rs` for its name in `core/haptic.dbc`, `core/tests/stored.rs` for a new
//! version of the stored layout, and the compiler warns in [`crate::controller::config`] while nothing uses it.
//!
//! A rejected parameter is named with its value, unit and range. Not here: what the parameters decide, and ranges of
//! their products ([`crate::controller::config`]).

#![expect(
    clippy::as_conversions,
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    reason = "a list of constants, gone through in const functions; outside the torque path"
)]

use core::fmt;

/// One parameter of the list.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Parameter {
    /// The path of its field in [`Params`], on the bus and in messages: `k_1`, `vehicle.far_time_s`.
    pub name: &'static str,
    /// What it is.
    pub meaning: &'static str,
    /// SI unit; `1` if it has none.
    pub unit: &'static str,
    /// Least allowed value.
    pub min: f64,
    /// Largest allowed value.
    pub max: f64,
    /// The paper's, or the one that goes with it.
    pub default: f64,
}

/// The guidance laws that ship, in the order of the parameter `law`.
pub const LAWS: [&str; 2] = ["paper", "driver_activity"];
/// [`Params::law`] of driver activity.
pub const DRIVER_ACTIVITY: f64 = 1.0;

/// The sensors of the column, in the order of the parameter `torque_sensor`: the hands' torque, or that of a bar beside the angle of its
/// column or of its wheel.
pub const SENSORS: [&str; 3] = ["hands", "bar_and_column_angle", "bar_and_wheel_angle"];
/// [`Params::torque_sensor`] of a bar beside the angle of its column.
pub const BAR_AND_COLUMN_ANGLE: f64 = 1.0;
/// [`Params::torque_sensor`] of a bar beside the angle of its wheel.
pub const BAR_AND_WHEEL_ANGLE: f64 = 2.0;

/// [`ParamError::unit`] of a parameter that has to be a whole number.
pub const WHOLE: &str = "in whole numbers";

/// Declares the parameters: `field: unit, least to largest, default;`, a group of those that belong together, and more. New
/// ones come last, so that none changes its number.
macro_rules! parameters {
    (
        $(#[$doc:meta])* $Set:ident {
            $($(#[doc = $meaning:literal])+ $field:ident: $unit:literal, $min:literal to $max:literal, $default:literal;)*
            group $group:ident: $Group:ident, $group_doc:literal {
                $($(#[doc = $g_meaning:literal])+ $g_field:ident: $g_unit:literal, $g_min:literal to $g_max:literal, $g_default:literal;)*
            }
            $($(#[doc = $l_meaning:literal])+ $l_field:ident: $l_unit:literal, $l_min:literal to $l_max:literal, $l_default:literal;)*
        }
    ) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct $Set {
            $($(#[doc = $meaning])+ #[doc = concat!("\n\nUnit ", $unit, ", ", stringify!($min), " to ", stringify!($max), ".")] pub $field: f64,)*
            #[doc = $group_doc]
            pub $group: $Group,
            $($(#[doc = $l_meaning])+ #[doc = concat!("\n\nUnit ", $l_unit, ", ", stringify!($l_min), " to ", stringify!($l_max), ".")] pub $l_field: f64,)*
        }

        #[doc = $group_doc]
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct $Group {
            $($(#[doc = $g_meaning])+ #[doc = concat!("\n\nUnit ", $g_unit, ", ", stringify!($g_min), " to ", stringify!($g_max), ".")] pub $g_field: f64,)*
        }

        /// Every parameter, in the order of the bus and of the memory.
        pub const PARAMETERS: [Parameter; [$(stringify!($field),)* $(stringify!($g_field),)* $(stringify!($l_field),)*].len()] = [
            $(Parameter {
                name: stringify!($field),
                meaning: concat!($($meaning),+),
                unit: $unit,
                min: $min,
                max: $max,
                default: $default,
            },)*
            $(Parameter {
                name: concat!(stringify!($group), ".", stringify!($g_field)),
                meaning: concat!($($g_meaning),+),
                unit: $g_unit,
                min: $g_min,
                max: $g_max,
                default: $g_default,
            },)*
            $(Parameter {
                name: stringify!($l_field),
                meaning: concat!($($l_meaning),+),
                unit: $l_unit,
                min: $l_min,
                max: $l_max,
                default: $l_default,
            },)*
        ];

        impl $Set {
            /// The defaults: table 8 of the paper, its 5 N.m limit, and a 10 Hz corner for the rates
            /// (`docs/explanation/simulation-numerics.md` says why).
            pub const PAPER: Self = Self {
                $($field: $default,)*
                $group: $Group { $($g_field: $g_default,)* },
                $($l_field: $l_default,)*
            };

            /// The values in the order of [`PARAMETERS`].
            #[must_use]
            pub const fn to_values(&self) -> [f64; PARAMETERS.len()] {
                [$(self.$field,)* $(self.$group.$g_field,)* $(self.$l_field,)*]
            }

            /// The set with these values, in the order of [`PARAMETERS`].
            #[must_use]
            pub const fn from_values(values: &[f64; PARAMETERS.len()]) -> Self {
                let [$($field,)* $($g_field,)* $($l_field,)*] = *values;
                Self {
                    $($field,)*
                    $group: $Group { $($g_field,)* },
                    $($l_field,)*
                }
            }
        }
    };
}

parameters! {
    /// Parameters of the guidance controller, SI units.
    Params {
        /// K_1, overall gain.
        k_1: "N.m", 0.0 to 4.0, 0.25;
        /// a1' on e_y'.
        a_1: "1/m", 0.0 to 100.0, 2.0;
        /// a2' on de_y'/dt.
        a_2: "s/m", 0.0 to 100.0, 0.05;
        /// a3' on e_theta'.
        a_3: "1/rad", 0.0 to 100.0, 40.0;
        /// a4' on de_theta'/dt.
        a_4: "s/rad", 0.0 to 100.0, 1.0;
        /// Corner of the low-pass on both rates; at most half the camera's sample rate.
        rate_corner_hz: "Hz", 0.5 to 60.0, 10.0;
        /// L, absolute limit of the guidance torque. Profiles in use: 5 (paper, section 3.2) and 3 (production units
        /// that fault above 3).
        torque_limit_nm: "N.m", 0.1 to 5.0, 5.0;
        /// Largest growth of the torque (lateral jerk and acceleration limits of ISO 11270).
        wind_up_nm_per_s: "N.m/s", 0.5 to 4.0, 4.0;
        /// Largest fall of the torque; 4 is a planned fade.
        reduction_nm_per_s: "N.m/s", 4.0 to 8.0, 8.0;
        /// Slowest speed that is guided.
        least_speed_m_per_s: "m/s", 0.5 to 30.0, 5.0;
        /// Amplitude of the probe.
        probe_amplitude_nm: "N.m", 0.0 to 0.3, 0.2;
        /// Frequency of the probe. Its steepest slope, 2*pi*amplitude*frequency, is at most 3.5 N.m/s, so that the
        /// wind-up limit leaves room for it and nominal guidance together.
        probe_frequency_hz: "Hz", 1.0 to 5.0, 2.5;
        /// t_nms of the driver's arm, as the estimator of K_hg assumes it.
        t_nms_s: "s", 0.01 to 1.0, 0.1;
        /// K_nms of the driver's arm, likewise.
        k_nms: "N.m/rad", 0.0 to 10.0, 1.0;
        /// Share of the guidance torque at 20 km/h and below; it grows linearly to all of it at 60 km/h.
        low_speed_share: "1", 0.0 to 1.0, 1.0;
        /// Share of the guidance torque at 130 km/h and above; it falls linearly to that from all of it at 60 km/h.
        high_speed_share: "1", 0.0 to 1.0, 1.0;
        group vehicle: VehicleParams,
        "What the plausibility checks know of the vehicle. The defaults follow from the paper's tables 8 and 9." {
            /// K_t/l, front wheel angle per wheel angle over the wheelbase: (1/17)/2.635.
            curvature_gain_per_m: "1/m", 0.001 to 0.1, 0.022_324;
            /// Stability factor A = m*(l_r*K_r - l_f*K_f)/(2*l^2*K_f*K_r).
            stability_factor_s2_per_m2: "s2/m2", 0.0 to 0.01, 0.001_753;
            /// Aligning torque on the column per lateral acceleration, K_aln*m*l_r/(2*l*K_f).
            aligning_gain_nm_s2_per_m: "N.m.s2/m", 0.0 to 20.0, 0.987_4;
            /// B_s.
            column_damping_nm_s: "N.m.s/rad", 0.0 to 10.0, 0.57;
            /// t'_f of the lane preview's sender.
            far_time_s: "s", 0.1 to 3.0, 0.7;
            /// t'_n of it.
            near_time_s: "s", 0.0 to 5.0, 0.3;
        }
        /// The guidance law: 0 is equation (9), 1 is driver activity.
        law: "1", 0.0 to 1.0, 0.0;
        /// Least share of equation (9) that driver activity leaves to a driver who works against it.
        activity_lambda_min: "1", 0.05 to 1.0, 0.3;
        /// What the Column message carries: 0 is the hands' torque, 1 a torsion bar's and the angle of its column, 2 a bar's and the
        /// angle of its wheel. The rest of this list counts with a bar alone.
        torque_sensor: "1", 0.0 to 2.0, 0.0;
        /// J_w, inertia of the wheel on its bar.
        wheel_inertia_kg_m2: "kg.m2", 0.005 to 0.5, 0.044;
        /// B_w, damping of the wheel.
        wheel_damping_nm_s: "N.m.s/rad", 0.0 to 5.0, 0.05;
        /// Dry friction of the wheel.
        wheel_friction_nm: "N.m", 0.0 to 5.0, 0.2;
        /// K_tb, stiffness of the bar.
        bar_stiffness_nm_per_rad: "N.m/rad", 5.0 to 1000.0, 143.24;
        /// Time between two Column messages, as the observer of the hands' torque takes it.
        column_period_s: "s", 0.001 to 0.02, 0.002;
        /// Bandwidth of that observer; times the period at most 1. What it tells is three lags of 1/bandwidth late.
        observer_bandwidth_rad_per_s: "rad/s", 5.0 to 400.0, 100.0;
    }
}

impl Default for Params {
    fn default() -> Self {
        Self::PAPER
    }
}

/// A parameter, or a product of some, out of its range.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ParamError {
    /// The parameter's name as in [`PARAMETERS`], or the product's formula.
    pub name: &'static str,
    /// The value it had.
    pub value: f64,
    /// Least allowed value.
    pub min: f64,
    /// Largest allowed value.
    pub max: f64,
    /// SI unit of all three, or [`WHOLE`].
    pub unit: &'static str,
}

impl fmt::Display for ParamError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            name,
            value,
            min,
            max,
            unit,
        } = self;
        match *unit {
            WHOLE => write!(f, "{name} = {value} is not a whole number from {min} to {max}"),
            "1" => write!(f, "{name} = {value} is outside [{min}, {max}]"),
            unit => write!(f, "{name} = {value} is outside [{min}, {max}] {unit}"),
        }
    }
}

impl core::error::Error for ParamError {}

impl Params {
    /// Whether the column's torque is that of a torsion bar.
    #[must_use]
    pub const fn has_bar(&self) -> bool {
        self.torque_sensor != 0.0
    }

    /// Checks every parameter against its range. The ends of a range are in it, also as the nearest f32, which is what
    /// the bus carries. [`crate::controller::config::Config::new`] checks products of them too.
    ///
    /// # Errors
    /// The first parameter that is not a number within its range.
    pub const fn check(&self) -> Result<(), ParamError> {
        // By reference: a constant indexed by itself would be put on the stack whole.
        const LIST: &[Parameter] = &PARAMETERS;
        let values = self.to_values();
        let mut i = 0;
        while i < LIST.len() {
            let Parameter {
                name, unit, min, max, ..
            } = LIST[i];
            if let Err(error) = in_range(name, values[i], [min, max], unit) {
                return Err(error);
            }
            i += 1;
        }
        Ok(())
    }
}

/// Refuses what is none of the whole numbers below `end`, be it too large or broken, in one way.
pub(crate) const fn whole(name: &'static str, value: f64, end: usize) -> Result<(), ParamError> {
    if value >= 0.0 && value < end as f64 && value == value as u32 as f64 {
        return Ok(());
    }
    Err(ParamError {
        name,
        value,
        min: 0.0,
        max: (end - 1) as f64,
        unit: WHOLE,
    })
}

/// A bound that an f32 does not hold must not refuse the f32 next to it.
pub(crate) const fn in_range(
    name: &'static str,
    value: f64,
    [min, max]: [f64; 2],
    unit: &'static str,
) -> Result<(), ParamError> {
    let (least, most) = (f64::min(min, min as f32 as f64), f64::max(max, max as f32 as f64));
    // NaN compares false, so it is rejected too.
    if value >= least && value <= most {
        Ok(())
    } else {
        Err(ParamError {
            name,
            value,
            min,
            max,
            unit,
        })
    }
}
