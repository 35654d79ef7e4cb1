//! Identification of a recorded drive.

use std::fmt::Write;
use std::path::PathBuf;

use haptic_analysis::identify::{COLUMNS, DriveLog, Mapping, Options, Recording, SPEED_COLUMN, open_mapped};
use haptic_batch::identify::{Method, single_track};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors;
use crate::interrupt::interruptible;
use crate::run::python;
use crate::scenario::Scenario;

/// Findings of an identification, for `haptic_guidance.identify`.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "keywords of Python")]
pub(crate) fn identify<'py>(
    py: Python<'py>,
    path: Option<PathBuf>,
    columns: Option<&Bound<'py, PyDict>>,
    manual: bool,
    fix: Vec<String>,
    estimate: Vec<String>,
    between: Vec<[f64; 2]>,
    as_published: bool,
    maps: Vec<String>,
    dbc: Option<PathBuf>,
    vehicle: Option<&Bound<'py, Scenario>>,
) -> PyResult<Bound<'py, PyDict>> {
    let mut options = Options::given(manual, &fix).map_err(|error| errors::input(py, error))?;
    for what in &estimate {
        options.estimate(what).map_err(|error| errors::input(py, error))?;
    }
    let (from, to): (Vec<f64>, Vec<f64>) = between.into_iter().map(|[from, to]| (from, to)).unzip();
    options
        .between(&from, &to)
        .map_err(|error| errors::input(py, error))?;
    let (name, (log, converted)) = match (path, columns) {
        (Some(path), _) => {
            let maps = maps
                .iter()
                .map(|map| map.parse())
                .collect::<Result<Vec<Mapping>, _>>();
            let maps = maps.map_err(|error| errors::input(py, error))?;
            let how = Recording {
                dbc: dbc.as_deref(),
                vehicle: vehicle.map(|scenario| single_track(&scenario.get().inner)),
                manual,
            };
            let opened = open_mapped(&path, &maps, &how).map_err(|error| errors::input(py, error))?;
            (path.display().to_string(), opened)
        }
        (None, Some(columns)) => ("columns".to_owned(), (log_of(py, columns, manual)?, Vec::new())),
        (None, None) => return Err(errors::input(py, "neither a path nor columns")),
    };
    let method = if as_published {
        Method::Paper
    } else {
        Method::NoiseModel
    };
    let drive = interruptible(py, None, move |_| {
        haptic_batch::identify::identify(&name, &log, &options, method)
    })?
    .map_err(|error| errors::input(py, error))?;
    let mut found = drive.results.identification;
    found.notes.splice(0..0, converted);
    let made = PyDict::new(py);
    made.set_item("results", python(py, &found)?)?;
    let units = PyDict::new(py);
    for (name, unit, _) in found.parameters.list() {
        units.set_item(name, unit)?;
    }
    made.set_item("units", units)?;
    let traces = PyDict::new(py);
    for (name, trace) in [
        ("time_s", found.traces.time_s),
        ("measured_nm", found.traces.measured_nm),
        ("simulated_nm", found.traces.simulated_nm),
        ("residual_nm", found.traces.residual_nm),
    ] {
        traces.set_item(name, PyArray1::from_vec(py, trace))?;
    }
    made.set_item("traces", traces)?;
    Ok(made)
}

/// The log of named arrays. They pass through the reader of log files, which checks them; numbers are written so that
/// they are read back bit for bit.
fn log_of(py: Python<'_>, columns: &Bound<'_, PyDict>, manual: bool) -> PyResult<DriveLog> {
    let mut given = Vec::new();
    for (name, values) in columns {
        let name: String = name.extract()?;
        if COLUMNS.contains(&name.as_str()) || name == SPEED_COLUMN {
            let values: PyReadonlyArray1<'_, f64> = values.extract().map_err(|_| {
                errors::input(
                    py,
                    format!("{name}: a one-dimensional array of float64 is wanted"),
                )
            })?;
            given.push((name, values));
        }
    }
    let rows = given.first().map_or(0, |(_, values)| values.as_array().len());
    if let Some((name, values)) = given.iter().find(|(_, values)| values.as_array().len() != rows) {
        let found = values.as_array().len();
        let message = format!("{name}: {found} rows where {} has {rows}", given[0].0);
        return Err(errors::input(py, message));
    }
    let names: Vec<_> = given.iter().map(|(name, _)| name.as_str()).collect();
    let mut text = names.join(",") + "\n";
    for row in 0..rows {
        for (i, (_, values)) in given.iter().enumerate() {
            let comma = if i == 0 { "" } else { "," };
            // Writing to a string does not fail.
            let _ = write!(text, "{comma}{}", values.as_array()[row]);
        }
        text.push('\n');
    }
    DriveLog::read(text.as_bytes(), manual).map_err(|error| errors::input(py, format!("columns: {error}")))
}
