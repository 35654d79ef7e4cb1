//! The table `vary` of a sweep file: each field's list, range or distribution.

use haptic_sim::input::InputError;
use serde::Deserialize;
use toml::{Table, Value};

use super::axis::{Axis, Column, Kind, MOST_VALUES};
use super::value::Distribution;
use crate::engine::{StudyError, refuse};

/// One varied field.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct VaryFile {
    fields: Option<Vec<String>>,
    times: Option<f64>,
    over: Option<String>,
    list: Option<Vec<Value>>,
    from: Option<f64>,
    to: Option<f64>,
    count: Option<u32>,
    step: Option<f64>,
    uniform: Option<[f64; 2]>,
    log_uniform: Option<[f64; 2]>,
    normal: Option<[f64; 2]>,
    lognormal: Option<[f64; 2]>,
    truncate: Option<[f64; 2]>,
    choice: Option<Vec<Value>>,
}

/// What tells a varied field from a table of more fields.
const KINDS: [&str; 7] = [
    "list",
    "from",
    "uniform",
    "log_uniform",
    "normal",
    "lognormal",
    "choice",
];

/// Walks through `vary`, whose names may be written with dots or as tables.
pub(super) fn varied(file: &str, above: &str, table: &Table, axes: &mut Vec<Axis>) -> Result<(), InputError> {
    for (key, value) in table {
        let path = if above.is_empty() {
            key.clone()
        } else {
            format!("{above}.{key}")
        };
        let error = |e: StudyError| InputError::new(file, format!("vary.{path}: {e}"));
        match value {
            Value::Array(list) => {
                let form = VaryFile {
                    list: Some(list.clone()),
                    ..VaryFile::default()
                };
                axes.push(form.axis(&path).map_err(error)?);
            }
            Value::Table(form) if KINDS.iter().any(|kind| form.contains_key(*kind)) => {
                let form: VaryFile = form
                    .clone()
                    .try_into()
                    .map_err(|e: toml::de::Error| error(e.message().into()))?;
                axes.push(form.axis(&path).map_err(error)?);
            }
            Value::Table(more) => varied(file, &path, more, axes)?,
            _ => {
                let form = "takes a list [..] or a table with one of";
                let kinds = KINDS.join(", ");
                return Err(error(
                    format!("{form} {kinds}; a fixed value belongs to [scenario]").into(),
                ));
            }
        }
    }
    Ok(())
}

impl VaryFile {
    fn axis(&self, path: &str) -> Result<Axis, StudyError> {
        let paths = self.fields.clone().unwrap_or_else(|| vec![path.into()]);
        if paths.is_empty() {
            return refuse("fields: at least one");
        }
        let kinds = [
            self.list.is_some(),
            self.from.is_some(),
            self.uniform.is_some(),
            self.log_uniform.is_some(),
            self.normal.is_some(),
            self.lognormal.is_some(),
            self.choice.is_some(),
        ];
        if kinds.iter().filter(|there| **there).count() != 1 {
            return refuse(format!("exactly one of {}", KINDS.join(", ")));
        }
        if self.truncate.is_some() && self.normal.is_none() && self.lognormal.is_none() {
            return refuse("truncate goes with normal and lognormal alone");
        }
        if self.from.is_none() && (self.to.is_some() || self.count.is_some() || self.step.is_some()) {
            return refuse("to, count and step go with from alone");
        }
        let kind = match (&self.list, &self.choice, self.from) {
            (Some(list), ..) => Kind::Grid(rows("list", list)?),
            (_, Some(list), _) => Kind::Sampled(Distribution::Choice(rows("choice", list)?)),
            (.., Some(from)) => Kind::Grid(self.range(from)?),
            _ => Kind::Sampled(self.distribution()?),
        };
        Ok(Axis {
            columns: vec![Column {
                name: path.into(),
                paths,
                times: self.times.unwrap_or(1.0),
                over: self.over.clone(),
            }],
            kind,
        })
    }

    fn range(&self, from: f64) -> Result<Vec<Vec<Value>>, StudyError> {
        let to = self.to.ok_or("a range has from, to, and count or step")?;
        let [low, high] = ends("from, to", [from, to])?;
        let count = match (self.count, self.step) {
            (Some(count), None) if (2..=MOST_VALUES).contains(&count) => count,
            (Some(count), None) => return refuse(format!("count = {count} is outside 2 to {MOST_VALUES}")),
            (None, Some(step)) => {
                // A thousandth of a step is an error of rounding, not a value too few.
                let count = ((high - low) / step + 1e-3).floor() + 1.0;
                if !(step > 0.0 && count <= f64::from(MOST_VALUES)) {
                    return refuse(format!(
                        "step = {step} is outside {} to {}",
                        (high - low) / f64::from(MOST_VALUES),
                        high - low
                    ));
                }
                return Ok((0..count as u32)
                    .map(|i| vec![Value::Float((low + f64::from(i) * step).min(high))])
                    .collect());
            }
            _ => return refuse("a range has either count or step"),
        };
        let last = f64::from(count - 1);
        let at = |i: u32| {
            if i + 1 == count {
                high
            } else {
                (low * (last - f64::from(i)) + high * f64::from(i)) / last
            }
        };
        Ok((0..count).map(|i| vec![Value::Float(at(i))]).collect())
    }

    fn distribution(&self) -> Result<Distribution, StudyError> {
        let within = self.truncate.map(|within| ends("truncate", within)).transpose()?;
        if let Some(of) = self.uniform {
            return Ok(Distribution::Uniform(ends("uniform", of)?));
        }
        if let Some(of) = self.log_uniform {
            let of = ends("log_uniform", of)?;
            return if of[0] > 0.0 {
                Ok(Distribution::LogUniform(of))
            } else {
                refuse("log_uniform: above 0")
            };
        }
        if let Some([mean, sd]) = self.normal {
            if !(mean.is_finite() && sd > 0.0 && sd.is_finite()) {
                return refuse(format!(
                    "normal = [{mean}, {sd}]: mean and standard deviation, which is above 0"
                ));
            }
            let within = within.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
            return Ok(Distribution::Normal { mean, sd, within });
        }
        let [median, sd_log] = self.lognormal.unwrap_or_default();
        if !(median > 0.0 && median.is_finite() && sd_log > 0.0 && sd_log.is_finite()) {
            return refuse(format!(
                "lognormal = [{median}, {sd_log}]: median and standard deviation of the natural logarithm, both above 0"
            ));
        }
        let within = within.unwrap_or([0.0, f64::INFINITY]);
        if within[0] < 0.0 {
            return refuse(format!(
                "truncate = [{}, {}]: a lognormal value is above 0",
                within[0], within[1]
            ));
        }
        Ok(Distribution::LogNormal {
            median,
            sd_log,
            within,
        })
    }
}

fn rows(field: &str, list: &[Value]) -> Result<Vec<Vec<Value>>, StudyError> {
    if list.is_empty() || list.len() > MOST_VALUES as usize {
        return refuse(format!("{field}: 1 to {MOST_VALUES} values, not {}", list.len()));
    }
    Ok(list.iter().map(|value| vec![value.clone()]).collect())
}

fn ends(field: &str, [low, high]: [f64; 2]) -> Result<[f64; 2], StudyError> {
    if low < high && low.is_finite() && high.is_finite() {
        return Ok([low, high]);
    }
    refuse(format!(
        "{field} = {low}, {high}: two numbers, the lower one first"
    ))
}
