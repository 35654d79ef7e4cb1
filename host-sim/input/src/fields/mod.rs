//! The lists of a scenario's fields: name, symbol, unit, range, default and meaning, one list for each table.
//!
//! A name is the paper's symbol in small letters, or words where the paper has none, and behind it the SI unit:
//! `t_p_s`, `k_d_nm_per_rad`, `remnant_sd_nm`. What has no unit has none in its name ([`suffix`]).
//!
//! `fields!` makes the struct of a table from its list. Reading and writing TOML, the checks, the units of a sweep, the
//! variables of an FMU, the stub for Python and `examples/every-field.toml` follow from it.

mod in_file;

use serde::de::{DeserializeOwned, MapAccess};
use serde::ser::{Serialize, SerializeMap};

use crate::range::{RangeError, in_range};

pub use in_file::{InFile, from_numbers};
/// Why numbers by name are no table: a name that there is not, or one that lacks.
pub use toml::de::Error as NotATable;

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
        // By hand, as no constant function can compare strings or loop with `for`.
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
#[macro_export]
macro_rules! default_number {
    (f64, $default:expr) => {
        Some($default)
    };
    ($other:ident, $default:expr) => {
        None
    };
}
pub use default_number;

/// Makes the struct of a table from the list of its fields, each `/// meaning` and
/// `field: type = default, name, symbol, unit, range;`. With `complete` a file has to give every field.
#[macro_export]
macro_rules! fields {
    (
        $(#[$doc:meta])*
        $Struct:ident, $table:literal $(, $complete:ident)? {
            $($(#[doc = $meaning:literal])+ $field:ident: $type:ident $(<$of:ident>)? = $default:expr,
                $name:literal, $symbol:literal, $unit:literal, $range:expr;)*
        }
    ) => {
        $(#[$doc])*
        #[derive(Debug, Clone, PartialEq)]
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
            // Which word it is does not matter, only that one is there.
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
pub use fields;

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
    }
}
