//! What is wrong, as exceptions of Python: `InputError`, and `RangeError` with its field, value and range. The classes
//! are Python's (`_errors.py`), so that they can be pickled and documented there.

use haptic_core::controller::params::ParamError;
use haptic_sim::input::RangeError;
use haptic_sim::scenario::ScenarioError;
use pyo3::prelude::*;

fn raise(py: Python<'_>, class: &str, arguments: impl for<'py> pyo3::call::PyCallArgs<'py>) -> PyErr {
    let made = py
        .import("haptic_guidance._errors")
        .and_then(|module| module.getattr(class)?.call1(arguments));
    match made {
        Ok(exception) => PyErr::from_value(exception),
        Err(error) => error,
    }
}

/// Input that cannot be used, and why.
pub(crate) fn input(py: Python<'_>, message: impl std::fmt::Display) -> PyErr {
    raise(py, "InputError", (message.to_string(),))
}

/// A name that is none of those known in a place.
pub(crate) fn unknown(py: Python<'_>, place: &str, name: &str, known: &[&str]) -> PyErr {
    let made = py
        .import("haptic_guidance._errors")
        .and_then(|module| module.getattr("unknown")?.call1((place, name, known)));
    made.map_or_else(|error| error, PyErr::from_value)
}

/// What is wrong with a text that was made of keywords: the keyword in the place of line and column.
pub(crate) fn in_keywords(py: Python<'_>, text: &str, refusal: &str) -> PyErr {
    let line = refusal
        .split_once("TOML parse error at line ")
        .and_then(|(_, rest)| rest.split_once(',')?.0.parse().ok());
    // Behind the line that marks the place.
    let what = refusal.rsplit_once('^').map(|(_, what)| what.trim());
    let (Some(line), Some(what)) = (line, what) else {
        return input(py, refusal);
    };
    let lines: Vec<&str> = text.lines().take(line).collect();
    let table = lines.iter().rfind(|line| line.starts_with('['));
    let table = table.map_or("", |table| table.trim_matches(['[', ']']));
    let mut names = what.split('`').skip(1).step_by(2);
    let key = lines.last().and_then(|line| line.split_once(" = "));
    let place = match (table, key) {
        (table, None) => table.to_owned(),
        ("", Some((key, _))) => key.to_owned(),
        (table, Some((key, _))) => format!("{table}.{key}"),
    };
    match (what, names.next()) {
        (what, Some(name)) if what.starts_with("unknown field") => {
            let table = if table.is_empty() { "Scenario" } else { table };
            unknown(py, table, name, &names.collect::<Vec<_>>())
        }
        (what, Some(name)) if what.starts_with("unknown variant") => {
            unknown(py, &place, name, &names.collect::<Vec<_>>())
        }
        _ => input(py, format!("{place}: {what}")),
    }
}

/// A value outside its range.
pub(crate) fn range(py: Python<'_>, error: &RangeError) -> PyErr {
    let e = error;
    raise(
        py,
        "RangeError",
        (e.to_string(), e.field.as_str(), e.value, e.min, e.max, e.unit),
    )
}

/// A parameter of the controller outside its range.
pub(crate) fn parameter(py: Python<'_>, error: &ParamError) -> PyErr {
    let e = error;
    raise(
        py,
        "RangeError",
        (e.to_string(), e.name, e.value, e.min, e.max, e.unit),
    )
}

/// A scenario that cannot be.
pub(crate) fn scenario(py: Python<'_>, error: &ScenarioError) -> PyErr {
    match error {
        ScenarioError::Range(error) | ScenarioError::AfterTheEnd(error) => range(py, error),
        other => input(py, other),
    }
}

/// Refuses NaN and infinity, which a bus cannot carry and a sensor does not give.
pub(crate) fn finite(py: Python<'_>, field: &str, value: f64, unit: &'static str) -> PyResult<f64> {
    if value.is_finite() {
        return Ok(value);
    }
    let message = format!("{field} = {value} {unit} is no finite number");
    Err(raise(
        py,
        "RangeError",
        (message, field, value, f64::MIN, f64::MAX, unit),
    ))
}

/// Refuses a value outside `min` to `max`, and NaN.
pub(crate) fn within(
    py: Python<'_>,
    field: &str,
    value: f64,
    [min, max]: [f64; 2],
    unit: &'static str,
) -> PyResult<f64> {
    haptic_sim::input::in_range(field, value, min..=max, unit)
        .map(|()| value)
        .map_err(|error| range(py, &error))
}

/// Refuses a whole number outside `min` to `max`, negative ones among them.
pub(crate) fn whole(
    py: Python<'_>,
    field: &str,
    value: i64,
    [min, max]: [i64; 2],
    unit: &'static str,
) -> PyResult<u64> {
    within(py, field, value as f64, [min as f64, max as f64], unit).map(|_| value as u64)
}

/// An instant of a clock that counts microseconds.
pub(crate) fn clock(py: Python<'_>, t_us: i64) -> PyResult<u64> {
    if t_us >= 0 {
        return Ok(t_us as u64);
    }
    whole(py, "t_us", t_us, [0, i64::MAX], "us")
}
