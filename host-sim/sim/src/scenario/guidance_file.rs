//! The table `guidance` of a scenario file: the controller's parameters by their names in the one list of
//! [`haptic_core::controller::params`], with their units, and beside them the camera's look-ahead and the host's request for a probe.
//!
//! A new parameter of the controller is a field here by itself. Not here: ranges, which the scenario checks.

use std::sync::LazyLock;

use haptic_core::controller::params::{PARAMETERS, ParamError, Parameter, Params};
use serde::de::MapAccess;
use serde::ser::SerializeMap;

use super::GuidanceParameters;
use crate::fields::{Field, Fields, Range, fields, suffix};
use crate::input::RangeError;

/// What the controller takes for granted, whatever the driver is; the vehicle's group follows from `[vehicle]`.
const NOT_IN_THE_FILE: [&str; 2] = ["t_nms_s", "k_nms"];

/// The paper's symbols of the controller's parameters.
const SYMBOLS: [(&str, &str); 5] = [
    ("k_1", "K_1"),
    ("a_1", "a'_1"),
    ("a_2", "a'_2"),
    ("a_3", "a'_3"),
    ("a_4", "a'_4"),
];

/// What is refused where the controller's parameter follows from several fields: name in the controller, formula.
const FORMULAS: [(&str, &str); 7] = [
    (
        "2 * pi * probe_amplitude_nm * probe_frequency_hz",
        "guidance: the probe's slope 2*pi*probe_amplitude_nm*probe_frequency_hz",
    ),
    ("vehicle.curvature_gain_per_m", "vehicle: K_t/(l_f + l_r)"),
    (
        "vehicle.stability_factor_s2_per_m2",
        "vehicle: the stability factor m*(l_r*K_r - l_f*K_f)/(2*(l_f + l_r)^2*K_f*K_r)",
    ),
    (
        "vehicle.aligning_gain_nm_s2_per_m",
        "vehicle: the aligning torque per lateral acceleration m*l_r*E_t*K_t/(l_f + l_r)/(1 + 2*E_t*K_f/K_s)",
    ),
    ("vehicle.column_damping_nm_s", "vehicle.b_s_nms_per_rad"),
    ("vehicle.far_time_s", "guidance.t_f_s"),
    ("vehicle.near_time_s", "guidance.t_n_s"),
];

/// The controller's parameters that a file may set, by their places in [`PARAMETERS`].
static LISTED: LazyLock<Vec<(usize, Field)>> = LazyLock::new(|| {
    let here =
        |parameter: &Parameter| !NOT_IN_THE_FILE.contains(&parameter.name) && !parameter.name.contains('.');
    let listed = PARAMETERS
        .iter()
        .enumerate()
        .filter(|(_, parameter)| here(parameter));
    let field = |(place, parameter): (usize, &'static Parameter)| {
        let symbol = SYMBOLS.iter().find(|(name, _)| *name == parameter.name);
        let field = Field {
            name: name_in_file(parameter).leak(),
            symbol: symbol.map_or("", |(_, symbol)| symbol),
            unit: unit_in_file(parameter.unit),
            range: Range::Between(parameter.min, parameter.max),
            default: Some(parameter.default),
            meaning: parameter.meaning.trim(),
        };
        (place, field)
    };
    listed.map(field).collect()
});

/// A parameter's name with its unit.
fn name_in_file(parameter: &Parameter) -> String {
    let unit = suffix(unit_in_file(parameter.unit));
    if parameter.name.ends_with(&unit) {
        return parameter.name.into();
    }
    format!("{}_{unit}", parameter.name)
}

fn unit_in_file(unit: &'static str) -> &'static str {
    if unit == "1" { "" } else { unit }
}

/// A refusal by the controller's parameters: the file's field or formula, its value and its range.
pub(super) fn in_words_of_the_file(error: &ParamError) -> RangeError {
    let formula = FORMULAS.iter().find(|(name, _)| *name == error.name);
    let named = |name: &str| {
        let parameter = PARAMETERS.iter().find(|parameter| parameter.name == name);
        parameter.map_or(name.into(), name_in_file)
    };
    let field = match (formula, error.name.split_once(" * ")) {
        (Some((_, formula)), _) => (*formula).into(),
        (None, Some((one, other))) => format!("guidance: {}*{}", named(one), named(other)),
        (None, None) => format!("guidance.{}", named(error.name)),
    };
    RangeError {
        field,
        value: error.value,
        min: error.min,
        max: error.max,
        unit: unit_in_file(error.unit),
    }
}

/// The controller in the table.
#[derive(Debug, Default)]
pub(super) struct ControllerInFile(Params);

impl Fields for ControllerInFile {
    const TABLE: &'static str = "guidance";

    fn fields() -> Vec<&'static Field> {
        LISTED.iter().map(|(_, field)| field).collect()
    }

    fn numbers(&self) -> Vec<Option<f64>> {
        let values = self.0.to_values();
        LISTED.iter().map(|(place, _)| Some(values[*place])).collect()
    }

    fn read<'de, A: MapAccess<'de>>(&mut self, name: &str, map: &mut A) -> Result<bool, A::Error> {
        let Some((place, _)) = LISTED.iter().find(|(_, field)| field.name == name) else {
            return Ok(false);
        };
        let mut values = self.0.to_values();
        values[*place] = map.next_value()?;
        self.0 = Params::from_values(&values);
        Ok(true)
    }

    fn write<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
        let mut numbers = Self::fields().into_iter().zip(self.numbers());
        numbers.try_for_each(|(field, number)| map.serialize_entry(field.name, &number))
    }
}

fields! {
    /// What is beside the controller in the table.
    #[derive(Copy)]
    CameraInFile, "guidance" {
        /// look-ahead time of the camera's near point
        t_n: f64 = 0.3, "t_n_s", "t'_n", "s", Between(0.0, 5.0);
        /// look-ahead time of its far point; the controller's plausibility checks divide by it
        t_f: f64 = 0.7, "t_f_s", "t'_f", "s", Between(0.1, 3.0);
        /// whether the host asks for the probe that reads K_hg
        probe: bool = false, "probe", "", "", Flag;
    }
}

/// The table.
pub(super) type GuidanceInFile = (ControllerInFile, CameraInFile);

impl From<GuidanceInFile> for GuidanceParameters {
    fn from((ControllerInFile(controller), CameraInFile { t_n, t_f, probe }): GuidanceInFile) -> Self {
        Self {
            controller,
            t_n,
            t_f,
            probe,
        }
    }
}

impl From<GuidanceParameters> for GuidanceInFile {
    fn from(guidance: GuidanceParameters) -> Self {
        let GuidanceParameters {
            controller,
            t_n,
            t_f,
            probe,
        } = guidance;
        (ControllerInFile(controller), CameraInFile { t_n, t_f, probe })
    }
}
