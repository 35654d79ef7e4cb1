//! What a varied field takes: values in a list, or a distribution.

use crate::engine::{StudyError, refuse};
use haptic_sim::input::InputError;
use statrs::distribution::{ContinuousCDF, Normal};
use toml::{Table, Value};

/// Where a sampled field takes its values from.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Distribution {
    Uniform([f64; 2]),
    LogUniform([f64; 2]),
    Normal {
        mean: f64,
        sd: f64,
        within: [f64; 2],
    },
    /// The logarithm is normal, about that of the median.
    LogNormal {
        median: f64,
        sd_log: f64,
        within: [f64; 2],
    },
    /// Each row as often as any other.
    Choice(Vec<Vec<Value>>),
}

impl Distribution {
    /// The values of the columns below which the share `u` lies, 0 to 1 without its ends.
    pub(super) fn at(&self, u: f64) -> Vec<Value> {
        let number = match self {
            Self::Uniform([low, high]) => (low + u * (high - low)).clamp(*low, *high),
            Self::LogUniform([low, high]) => (low * (high / low).powf(u)).clamp(*low, *high),
            Self::Normal { mean, sd, within } => truncated(*mean, *sd, *within, u),
            Self::LogNormal {
                median,
                sd_log,
                within,
            } => {
                let logs = within.map(f64::ln);
                truncated(median.ln(), *sd_log, logs, u)
                    .exp()
                    .clamp(within[0], within[1])
            }
            Self::Choice(rows) => {
                let row = (u * rows.len() as f64) as usize;
                return rows[row.min(rows.len() - 1)].clone();
            }
        };
        vec![Value::Float(number)]
    }

    /// Rows to choose from, if these are what it takes.
    pub(super) fn rows(&self) -> Option<&[Vec<Value>]> {
        match self {
            Self::Choice(rows) => Some(rows),
            _ => None,
        }
    }

    /// Values that a check should try: its ends where it has any.
    pub(super) fn extremes(&self) -> Vec<Vec<Value>> {
        match self {
            Self::Choice(rows) => rows.clone(),
            _ => [1e-12, 0.5, 1.0 - 1e-12].map(|u| self.at(u)).to_vec(),
        }
    }
}

/// A quantile of a normal distribution of which only a range is left.
fn truncated(mean: f64, sd: f64, [low, high]: [f64; 2], u: f64) -> f64 {
    let standard = Normal::standard();
    let [from, to] = [low, high].map(|end| standard.cdf((end - mean) / sd));
    (mean + sd * standard.inverse_cdf(from + u * (to - from))).clamp(low, high)
}

/// Puts a value at a path such as `driver.t_p_s` or `course.segment.1.length_m`; a table that is missing is made.
///
/// # Errors
/// A part of the path that is neither a table nor a place in a list.
pub(super) fn put(table: &mut Table, path: &str, value: Value) -> Result<(), StudyError> {
    let mut parts = path.split('.').peekable();
    let first = parts.next().unwrap_or("");
    if parts.peek().is_none() {
        table.insert(first.into(), value);
        return Ok(());
    }
    let missing = || Value::Table(Table::new());
    let mut place = table.entry(first).or_insert_with(missing);
    while let Some(part) = parts.next() {
        let is_last = parts.peek().is_none();
        place = match place {
            Value::Table(table) if table.is_empty() && part.parse::<usize>().is_ok() => {
                return refuse(format!(
                    "{path}: there is no list before {part:?}; a course's segments have to stand in [scenario]"
                ));
            }
            Value::Table(table) if is_last => {
                table.insert(part.into(), value);
                return Ok(());
            }
            Value::Table(table) => table.entry(part).or_insert_with(missing),
            Value::Array(list) => {
                let count = list.len();
                let item = part.parse().ok().and_then(|i: usize| list.get_mut(i));
                item.ok_or_else(|| {
                    format!("{path}: {part:?} is no place in a list of {count}, counted from 0")
                })?
            }
            _ => return refuse(format!("{path}: what is before {part:?} is a value, not a table")),
        };
        if is_last {
            *place = value;
            return Ok(());
        }
    }
    Ok(())
}

/// A field of a CSV table as a value of TOML: a whole number, a number, a truth value or a text.
pub(super) fn from_csv(field: &str) -> Value {
    let field = field.trim();
    if let Ok(whole) = field.parse() {
        Value::Integer(whole)
    } else if let Ok(x) = field.parse::<f64>()
        && x.is_finite()
    {
        Value::Float(x)
    } else {
        match field {
            "true" => Value::Boolean(true),
            "false" => Value::Boolean(false),
            text => Value::String(text.into()),
        }
    }
}

/// Rows of a CSV table whose header names fields.
///
/// # Errors
/// A line with another number of fields, a table without rows.
pub(super) fn read_csv(name: &str, text: &str) -> Result<(Vec<String>, Vec<Vec<Value>>), InputError> {
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let bad = |e: csv::Error| InputError::new(name, e);
    let columns: Vec<String> = reader.headers().map_err(bad)?.iter().map(String::from).collect();
    let mut rows = Vec::new();
    for record in reader.records() {
        rows.push(record.map_err(bad)?.iter().map(from_csv).collect());
    }
    if rows.is_empty() {
        return Err(InputError::new(
            name,
            "no row below the header, which names the fields",
        ));
    }
    Ok((columns, rows))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::number;

    fn at(distribution: &Distribution, u: f64) -> f64 {
        number(&distribution.at(u)[0]).unwrap()
    }

    /// Quantiles from tables: 1.959964 at 97.5 %, 0.674490 at 75 %. The truncated one by hand: between 0 and infinity
    /// the median of a standard normal is its 75 % quantile.
    #[test]
    fn quantiles_are_those_of_the_tables() {
        let everything = [f64::NEG_INFINITY, f64::INFINITY];
        let normal = Distribution::Normal {
            mean: 3.0,
            sd: 2.0,
            within: everything,
        };
        assert!((at(&normal, 0.975) - (3.0 + 2.0 * 1.959_964)).abs() < 1e-5);
        let half = Distribution::Normal {
            mean: 0.0,
            sd: 1.0,
            within: [0.0, f64::INFINITY],
        };
        assert!((at(&half, 0.5) - 0.674_490).abs() < 1e-5);
        let log = Distribution::LogNormal {
            median: 0.1,
            sd_log: 0.5,
            within: [0.0, f64::INFINITY],
        };
        assert!((at(&log, 0.975) - 0.1 * (0.5 * 1.959_964_f64).exp()).abs() < 1e-6);
        assert_eq!(at(&Distribution::Uniform([2.0, 4.0]), 0.25), 2.5);
        assert!((at(&Distribution::LogUniform([1.0, 100.0]), 0.5) - 10.0).abs() < 1e-12);
    }

    #[test]
    fn a_path_reaches_tables_and_lists() {
        let mut table: Table = toml::from_str("[[course.segment]]\nlength_m = 1.0\n").unwrap();
        put(&mut table, "course.segment.0.length_m", Value::Float(2.0)).unwrap();
        put(&mut table, "world.mu", Value::Float(0.5)).unwrap();
        put(&mut table, "speed_m_per_s", Value::Integer(50)).unwrap();
        assert_eq!(table["course"]["segment"][0]["length_m"].as_float(), Some(2.0));
        assert_eq!(table["world"]["mu"].as_float(), Some(0.5));
        let error = put(&mut table, "course.segment.3.length_m", Value::Float(2.0))
            .unwrap_err()
            .to_string();
        assert!(error.contains("list of 1"), "{error}");
        assert!(put(&mut table, "speed_m_per_s.x", Value::Float(2.0)).is_err());
    }

    #[test]
    fn a_table_of_cars_is_read() {
        let (columns, rows) = read_csv(
            "cars.csv",
            "vehicle.m_kg,world.tyres\n1100,linear\n1500.5,saturating\n",
        )
        .unwrap();
        assert_eq!(columns, ["vehicle.m_kg", "world.tyres"]);
        assert_eq!(
            rows[1],
            [Value::Float(1500.5), Value::String("saturating".into())]
        );
        assert!(read_csv("cars.csv", "vehicle.m_kg\n").is_err());
    }
}
