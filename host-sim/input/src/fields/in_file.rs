//! A table of fields in TOML: read with a default for what is not there, and written.

use std::fmt;
use std::marker::PhantomData;

use serde::de::{self, Deserialize, Deserializer, MapAccess, Visitor};
use serde::ser::{Serialize, SerializeMap, Serializer};

use super::Fields;

/// A table as it stands in a file; a field that is not there has its default.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct InFile<T>(pub T);

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
pub fn from_numbers<T: Fields>(
    numbers: impl Iterator<Item = (&'static str, f64)>,
) -> Result<T, toml::de::Error> {
    let numbers = numbers.map(|(name, number)| (name.to_owned(), number.into()));
    let table: InFile<T> = toml::Value::Table(numbers.collect()).try_into()?;
    Ok(table.0)
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
