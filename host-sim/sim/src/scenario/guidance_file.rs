//! The table `guidance` of a scenario file: the controller's parameters by their names in the one list of
//! [`haptic_core::controller::params`], and beside them the camera's look-ahead and the host's request for a probe.
//!
//! A new parameter of the controller is a field here by itself. Not here: ranges, which the scenario checks.

use std::fmt;

use haptic_core::controller::params::{PARAMETERS, ParamError, Params};
use serde::de::{self, Deserialize, Deserializer, MapAccess, Visitor};
use serde::ser::{Serialize, SerializeMap, Serializer};

use super::GuidanceParameters;
use crate::input::RangeError;

/// What the controller takes for granted, whatever the driver is; the vehicle's group follows from `[vehicle]`.
const NOT_IN_THE_FILE: [&str; 2] = ["t_nms_s", "k_nms"];

/// Names of the file that differ from the list's: the paper writes K_1.
const OWN_NAMES: [(&str, &str); 1] = [("k_1", "K_1")];

/// Other names that are still read.
const OLD_NAMES: [(&str, &str); 5] = [
    ("a_1", "a1"),
    ("a_2", "a2"),
    ("a_3", "a3"),
    ("a_4", "a4"),
    ("least_speed_m_per_s", "least_speed_mps"),
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
    ("vehicle.column_damping_nm_s", "vehicle.B_s"),
    ("vehicle.far_time_s", "guidance.t_f"),
    ("vehicle.near_time_s", "guidance.t_n"),
];

/// A field of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Field {
    /// By its place in [`PARAMETERS`].
    Parameter(usize),
    NearTime,
    FarTime,
    Probe,
}

impl Field {
    fn all() -> impl Iterator<Item = Self> {
        let is_here = |i: &usize| {
            let name = PARAMETERS[*i].name;
            !NOT_IN_THE_FILE.contains(&name) && !name.contains('.')
        };
        let parameters = (0..PARAMETERS.len()).filter(is_here).map(Self::Parameter);
        parameters.chain([Self::NearTime, Self::FarTime, Self::Probe])
    }

    fn name(self) -> &'static str {
        match self {
            Self::Parameter(i) => name_in_file(PARAMETERS[i].name),
            Self::NearTime => "t_n",
            Self::FarTime => "t_f",
            Self::Probe => "probe",
        }
    }

    fn is_called(self, name: &str) -> bool {
        let old = |i: usize| OLD_NAMES.contains(&(PARAMETERS[i].name, name)) || PARAMETERS[i].name == name;
        self.name() == name || matches!(self, Self::Parameter(i) if old(i))
    }
}

fn name_in_file(name: &'static str) -> &'static str {
    let own = OWN_NAMES.iter().find(|(listed, _)| *listed == name);
    own.map_or(name, |(_, own)| own)
}

/// A refusal by the controller's parameters: the file's field or formula, its value and its range.
pub(super) fn in_words_of_the_file(error: &ParamError) -> RangeError {
    let formula = FORMULAS.iter().find(|(name, _)| *name == error.name);
    let field = match (formula, error.name.split_once(" * ")) {
        (Some((_, formula)), _) => (*formula).into(),
        (None, Some((_, gain))) => format!("guidance: K_1*{gain}"),
        (None, None) => format!("guidance.{}", name_in_file(error.name)),
    };
    RangeError {
        field,
        value: error.value,
        min: error.min,
        max: error.max,
        unit: if error.unit == "1" { "" } else { error.unit },
    }
}

/// The table; a field that is not there has its default.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct GuidanceFile(pub(super) GuidanceParameters);

impl Serialize for GuidanceFile {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let values = self.0.controller.to_values();
        let mut map = serializer.serialize_map(None)?;
        for field in Field::all() {
            match field {
                Field::Parameter(i) => map.serialize_entry(field.name(), &values[i])?,
                Field::NearTime => map.serialize_entry(field.name(), &self.0.t_n)?,
                Field::FarTime => map.serialize_entry(field.name(), &self.0.t_f)?,
                Field::Probe => map.serialize_entry(field.name(), &self.0.probe)?,
            }
        }
        map.end()
    }
}

impl<'de> Deserialize<'de> for GuidanceFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Fields)
    }
}

struct Fields;

impl<'de> Visitor<'de> for Fields {
    type Value = GuidanceFile;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table of guidance parameters")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<GuidanceFile, A::Error> {
        let mut guidance = GuidanceParameters::default();
        let mut values = guidance.controller.to_values();
        let mut seen = Vec::new();
        while let Some(field) = map.next_key::<Field>()? {
            if seen.contains(&field) {
                return Err(de::Error::duplicate_field(field.name()));
            }
            seen.push(field);
            match field {
                Field::Parameter(i) => values[i] = map.next_value()?,
                Field::NearTime => guidance.t_n = map.next_value()?,
                Field::FarTime => guidance.t_f = map.next_value()?,
                Field::Probe => guidance.probe = map.next_value()?,
            }
        }
        guidance.controller = Params::from_values(&values);
        Ok(GuidanceFile(guidance))
    }
}

impl<'de> Deserialize<'de> for Field {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Name;

        impl Visitor<'_> for Name {
            type Value = Field;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a field")
            }

            fn visit_str<E: de::Error>(self, name: &str) -> Result<Field, E> {
                Field::all().find(|field| field.is_called(name)).ok_or_else(|| {
                    let names: Vec<_> = Field::all().map(|field| format!("`{}`", field.name())).collect();
                    E::custom(format!(
                        "unknown field `{name}`, expected one of {}",
                        names.join(", ")
                    ))
                })
            }
        }

        deserializer.deserialize_identifier(Name)
    }
}
