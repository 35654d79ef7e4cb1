//! What a pickle holds of a value that has only attributes: all of them, by name.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

/// What makes the value again, and its arguments.
pub(crate) type Parts<'py> = (Bound<'py, PyAny>, Bound<'py, PyTuple>);

/// The attributes of a value whose class has a `_of` that takes them.
pub(crate) fn attributes<'py, T>(of: &Bound<'py, T>) -> PyResult<Parts<'py>> {
    let (py, of) = (of.py(), of.as_any());
    let made = PyDict::new(py);
    for name in of.dir()? {
        let name: String = name.extract()?;
        let value = of.getattr(&name)?;
        if !name.starts_with('_') && !value.is_callable() {
            made.set_item(name, value)?;
        }
    }
    Ok((of.get_type().getattr("_of")?, PyTuple::new(py, [made])?))
}

/// One of them.
pub(crate) fn part<'py, T: FromPyObjectOwned<'py>>(parts: &Bound<'py, PyDict>, name: &str) -> PyResult<T> {
    parts.as_any().get_item(name)?.extract().map_err(Into::into)
}
