//! What is wrong, as exceptions of Python: `InputError`, and `RangeError` with its field, value and range. The classes
//! are Python's (`_errors.py`), so that they can be pickled and documented there.

use haptic_core::params::ParamError;
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

/// A value outside its range.
pub(crate) fn range(py: Python<'_>, error: &RangeError) -> PyErr {
    let RangeError {
        field,
        value,
        min,
        max,
        unit,
    } = error;
    raise(
        py,
        "RangeError",
        (error.to_string(), field.as_str(), *value, *min, *max, *unit),
    )
}

/// A parameter of the controller outside its range.
pub(crate) fn parameter(py: Python<'_>, error: &ParamError) -> PyErr {
    let ParamError {
        name,
        value,
        min,
        max,
        unit,
        ..
    } = *error;
    raise(py, "RangeError", (error.to_string(), name, value, min, max, unit))
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
    within(py, field, value, [f64::MIN, f64::MAX], unit)
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
