//! The lists of a scenario's fields: name, symbol, unit, range, default and meaning, one list for each table.
//!
//! A name is the paper's symbol in small letters, or words where the paper has none, and behind it the SI unit:
//! `t_p_s`, `k_d_nm_per_rad`, `remnant_sd_nm`. What has no unit has none in its name ([`suffix`]).
//!
//! [`fields!`] makes the struct of a table from its list. Reading and writing TOML, the checks, the units of a sweep, the
//! variables of an FMU, the stub for Python and the tables of `docs/files.md` follow from it.

use std::fmt;
use std::marker::PhantomData;

/// Why numbers by name are no table: a name that there is not, or one that lacks.
pub use serde::de::value::Error as NotATable;
use serde::de::value::MapDeserializer;
use serde::de::{self, Deserialize, DeserializeOwned, Deserializer, MapAccess, Visitor};
use serde::ser::{Serialize, SerializeMap, Serializer};

use crate::input::{RangeError, in_range};

/// What a field may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Range {
    /// A number from one to another.
    Between(f64, f64),
    /// One of some words.
    OneOf(&'static [&'static str]),
    /// A whole number from 0.
    Whole,
    /// `true` or `false`.
    Flag,
}

/// A field of a table of a scenario file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Field {
    /// Its name in a file, with its unit.
    pub name: &'static str,
    /// The paper's symbol; empty where the paper has none.
    pub symbol: &'static str,
    /// SI unit; empty for what has none.
    pub unit: &'static str,
    /// What it may be.
    pub range: Range,
    /// The number that it is if a file says nothing; none of a word, and of what may be missing.
    pub default: Option<f64>,
    /// What it is.
    pub meaning: &'static str,
}

impl Field {
    /// The one of a list that has a name; a name that none has does not compile.
    pub const fn named(list: &'static [Self], name: &str) -> &'static Self {
        let mut i = 0;
        while i < list.len() {
            let (one, other) = (list[i].name.as_bytes(), name.as_bytes());
            let mut k = 0;
            while k < one.len() && k < other.len() && one[k] == other[k] {
                k += 1;
            }
            if k == one.len() && k == other.len() {
                return &list[i];
            }
            i += 1;
        }
        panic!("no field has this name")
    }

    /// Its least and largest value; all numbers for what is none.
    pub const fn ends(&self) -> [f64; 2] {
        match self.range {
            Range::Between(from, to) => [from, to],
            _ => [f64::NEG_INFINITY, f64::INFINITY],
        }
    }

    /// Whether a value may be chosen.
    ///
    /// # Errors
    /// The field, the value and its range.
    pub fn check(&self, value: f64) -> Result<(), RangeError> {
        let [from, to] = self.ends();
        in_range(self.name, value, from..=to, self.unit)
    }
}

/// How a unit stands at the end of a name: `N.m/rad` as `nm_per_rad`, `1/m` as `per_m`, `kg.m2` as `kg_m2`.
pub fn suffix(unit: &str) -> String {
    let plain = |part: &str| {
        let part = part.trim_matches(['(', ')']);
        part.replace("N.m.s", "nms")
            .replace("N.m", "nm")
            .replace('.', "_")
            .to_lowercase()
    };
    match unit.split_once('/') {
        Some(("1", under)) => format!("per_{}", plain(under)),
        Some((over, under)) => format!("{}_per_{}", plain(over), plain(under)),
        None => plain(unit),
    }
}

/// A name without its unit.
fn stem<'a>(name: &'a str, unit: &str) -> &'a str {
    let bare = name
        .strip_suffix(&suffix(unit))
        .map(|bare| bare.strip_suffix('_').unwrap_or(bare));
    bare.filter(|_| !unit.is_empty()).unwrap_or(name)
}

/// The type of a field.
pub trait FieldValue: Serialize + DeserializeOwned {
    /// Its value, if that is a number.
    fn number(&self) -> Option<f64> {
        None
    }
}

impl FieldValue for f64 {
    fn number(&self) -> Option<f64> {
        Some(*self)
    }
}

impl FieldValue for Option<f64> {
    fn number(&self) -> Option<f64> {
        *self
    }
}

impl FieldValue for Option<u64> {}
impl FieldValue for bool {}

/// A table of a scenario file, or a part of one.
pub trait Fields: Default {
    /// The table's name.
    const TABLE: &'static str;
    /// Whether a file that has the table has to give every field.
    const COMPLETE: bool = false;

    /// The list.
    fn fields() -> Vec<&'static Field>;

    /// The numbers, in the order of the list.
    fn numbers(&self) -> Vec<Option<f64>>;

    /// Reads the value of a field; whether there is one of that name.
    ///
    /// # Errors
    /// A value of another kind.
    fn read<'de, A: MapAccess<'de>>(&mut self, name: &str, map: &mut A) -> Result<bool, A::Error>;

    /// Writes every field.
    ///
    /// # Errors
    /// Those of the writer.
    fn write<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error>;

    /// Whether every value is in its range.
    ///
    /// # Errors
    /// The first field out of range, with its table, value and range.
    fn check(&self) -> Result<(), RangeError> {
        for (field, number) in Self::fields().iter().zip(self.numbers()) {
            if let Some(number) = number {
                field.check(number).map_err(|e| e.within(Self::TABLE))?;
            }
        }
        Ok(())
    }
}

/// The default that stands in a list: of numbers alone.
macro_rules! default_number {
    (f64, $default:expr) => {
        Some($default)
    };
    ($other:ident, $default:expr) => {
        None
    };
}
pub(crate) use default_number;

/// Makes the struct of a table from the list of its fields, each `/// meaning` and
/// `field: type = default, name, symbol, unit, range;`. With `complete` a file has to give every field.
macro_rules! fields {
    (
        $(#[$doc:meta])*
        $Struct:ident, $table:literal $(, $complete:ident)? {
            $($(#[doc = $meaning:literal])+ $field:ident: $type:ident $(<$of:ident>)? = $default:expr,
                $name:literal, $symbol:literal, $unit:literal, $range:expr;)*
        }
    ) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct $Struct {
            $($(#[doc = $meaning])+ #[doc = concat!("\n\n`", $table, ".", $name, "`, ", $unit)]
            pub $field: $type $(<$of>)?,)*
        }

        impl $Struct {
            /// Its fields.
            pub const FIELDS: &'static [$crate::fields::Field] = {
                #[allow(unused_imports, reason = "not every table has each kind")]
                use $crate::fields::Range::{Between, Flag, OneOf, Whole};
                &[$($crate::fields::Field {
                    name: $name,
                    symbol: $symbol,
                    unit: $unit,
                    range: $range,
                    default: $crate::fields::default_number!($type, $default),
                    meaning: concat!($($meaning),+),
                },)*]
            };
        }

        impl Default for $Struct {
            fn default() -> Self {
                Self { $($field: $default,)* }
            }
        }

        impl $crate::fields::Fields for $Struct {
            const TABLE: &'static str = $table;
            $(const COMPLETE: bool = stringify!($complete).len() > 0;)?

            fn fields() -> Vec<&'static $crate::fields::Field> {
                Self::FIELDS.iter().collect()
            }

            fn numbers(&self) -> Vec<Option<f64>> {
                use $crate::fields::FieldValue;
                vec![$(self.$field.number(),)*]
            }

            fn read<'de, A: serde::de::MapAccess<'de>>(&mut self, name: &str, map: &mut A) -> Result<bool, A::Error> {
                match name {
                    $($name => self.$field = map.next_value()?,)*
                    _ => return Ok(false),
                }
                Ok(true)
            }

            fn write<M: serde::ser::SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
                $(map.serialize_entry($name, &self.$field)?;)*
                Ok(())
            }
        }
    };
}
pub(crate) use fields;

/// Two lists in one table.
impl<A: Fields, B: Fields> Fields for (A, B) {
    const TABLE: &'static str = A::TABLE;

    fn fields() -> Vec<&'static Field> {
        [A::fields(), B::fields()].concat()
    }

    fn numbers(&self) -> Vec<Option<f64>> {
        [self.0.numbers(), self.1.numbers()].concat()
    }

    fn read<'de, M: MapAccess<'de>>(&mut self, name: &str, map: &mut M) -> Result<bool, M::Error> {
        Ok(self.0.read(name, map)? || self.1.read(name, map)?)
    }

    fn write<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
        self.0.write(map)?;
        self.1.write(map)
    }
}

/// A table as it stands in a file; a field that is not there has its default.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct InFile<T>(pub(crate) T);

impl<T: Fields> Serialize for InFile<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        self.0.write(&mut map)?;
        map.end()
    }
}

impl<'de, T: Fields> Deserialize<'de> for InFile<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Rows<T>(PhantomData<T>);

        impl<'de, T: Fields> Visitor<'de> for Rows<T> {
            type Value = InFile<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a table [{}]", T::TABLE)
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<InFile<T>, A::Error> {
                let mut table = T::default();
                let mut given = Vec::new();
                while let Some(name) = map.next_key::<Name<T>>()? {
                    table.read(name.0, &mut map)?;
                    given.push(name.0);
                }
                match T::fields()
                    .iter()
                    .find(|field| T::COMPLETE && !given.contains(&field.name))
                {
                    Some(missing) => Err(de::Error::missing_field(missing.name)),
                    None => Ok(InFile(table)),
                }
            }
        }

        deserializer.deserialize_map(Rows(PhantomData))
    }
}

/// A table of numbers by their names; what is not there has its default.
///
/// # Errors
/// A name that is none.
pub fn from_numbers<T: Fields>(numbers: impl Iterator<Item = (&'static str, f64)>) -> Result<T, NotATable> {
    InFile::deserialize(MapDeserializer::new(numbers)).map(|table| table.0)
}

/// The name of a field that there is.
struct Name<T>(&'static str, PhantomData<T>);

impl<'de, T: Fields> Deserialize<'de> for Name<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        let fields = T::fields();
        let known = fields.iter().find(|field| field.name == name);
        known.map(|field| Name(field.name, PhantomData)).ok_or_else(|| {
            let names: Vec<_> = fields.iter().map(|field| format!("`{}`", field.name)).collect();
            de::Error::custom(format!(
                "unknown field `{name}`, expected one of {}",
                names.join(", ")
            ))
        })
    }
}

/// Names that older files have, where they are not the name without its unit or had another unit: table, old name, new name, old unit, and how much of the new unit that is.
const OLD_NAMES: [(&str, &str, &str, &str, f64); 21] = [
    ("", "speed", "speed_m_per_s", "km/h", 1.0 / 3.6),
    ("", "speeds_kmh", "speeds_m_per_s", "km/h", 1.0 / 3.6),
    ("tuning", "speeds_kmh", "speeds_m_per_s", "km/h", 1.0 / 3.6),
    ("training", "speeds_kmh", "speeds_m_per_s", "km/h", 1.0 / 3.6),
    ("held_out", "speeds_kmh", "speeds_m_per_s", "km/h", 1.0 / 3.6),
    ("speed", "kmh", "speed_m_per_s", "km/h", 1.0 / 3.6),
    ("speed", "time", "time_s", "", 1.0),
    ("speed", "place", "place_m", "", 1.0),
    ("world", "friction_give", "friction_give_rad", "deg", DEG),
    ("world", "assist_speed", "assist_speed_m_per_s", "km/h", 1.0 / 3.6),
    ("sensor_errors", "angle_bias", "angle_bias_rad", "deg", DEG),
    (
        "sensor_errors",
        "yaw_rate_bias",
        "yaw_rate_bias_rad_per_s",
        "mrad/s",
        1e-3,
    ),
    (
        "sensor_errors",
        "yaw_rate_noise",
        "yaw_rate_noise_rad_per_s",
        "mrad/s",
        1e-3,
    ),
    (
        "sensor_errors",
        "heading_noise",
        "heading_noise_rad",
        "mrad",
        1e-3,
    ),
    ("sensor_errors", "camera_yaw", "camera_yaw_rad", "mrad", 1e-3),
    (
        "sensor_errors",
        "dropouts",
        "dropout_rate_per_s",
        "1/h",
        1.0 / 3600.0,
    ),
    ("sensor_errors", "dropout", "dropout_duration_s", "", 1.0),
    (
        "sensor_errors",
        "line_jumps",
        "line_jump_rate_per_s",
        "1/h",
        1.0 / 3600.0,
    ),
    ("tolerances", "angle_bias", "angle_bias_rad", "deg", DEG),
    ("tolerances", "camera_yaw", "camera_yaw_rad", "mrad", 1e-3),
    (
        "tolerances",
        "yaw_rate_bias",
        "yaw_rate_bias_rad_per_s",
        "mrad/s",
        1e-3,
    ),
];
const DEG: f64 = std::f64::consts::PI / 180.0;

/// What the first field is called that a text calls by an old name; `known` are the fields of a table.
pub(crate) fn old_name(text: &str, known: impl Fn(&str) -> Vec<&'static Field>) -> Option<String> {
    let file: toml::Table = toml::from_str(text).ok()?;
    let in_table = |table: &str, name: &str, value: &toml::Value| {
        let full = |name: &str| format!("{table}{}{name}", if table.is_empty() { "" } else { "." });
        let listed = OLD_NAMES
            .iter()
            .find(|old| old.0 == table && old.1 == name && !value.is_table());
        if let Some((_, _, new, unit, factor)) = listed {
            let converted = match value.as_float().or(value.as_integer().map(|whole| whole as f64)) {
                _ if unit.is_empty() => String::new(),
                Some(value) => format!(": {value} {unit} are {}", value * factor),
                None => format!(": 1 {unit} is {factor}"),
            };
            return Some(format!("{} is called {new}{converted}", full(name)));
        }
        let spelt = |name: &str| name.replace('_', "").to_lowercase();
        let fields = known(table);
        let same = |field: &&&Field| spelt(stem(field.name, field.unit)) == spelt(name);
        let field = fields.iter().find(same).filter(|field| field.name != name)?;
        Some(format!("{} is called {}", full(name), field.name))
    };
    file.iter().find_map(|(name, value)| {
        let own = value.as_table().into_iter().flatten();
        in_table("", name, value).or_else(|| {
            own.into_iter()
                .find_map(|(field, value)| in_table(name, field, value))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_stands_at_the_end_of_a_name() {
        for (unit, expected) in [
            ("", ""),
            ("s", "s"),
            ("Hz", "hz"),
            ("1/m", "per_m"),
            ("N.m", "nm"),
            ("N.m.s/rad", "nms_per_rad"),
            ("kg.m2", "kg_m2"),
            ("rad/(m.s)", "rad_per_m_s"),
            ("rad/s", "rad_per_s"),
        ] {
            assert_eq!(suffix(unit), expected, "{unit}");
        }
        assert_eq!(
            [stem("t_p_s", "s"), stem("k_hg", ""), stem("tyres", "")],
            ["t_p", "k_hg", "tyres"]
        );
    }
}
