//! Identification of a recorded drive.

use std::path::PathBuf;

use haptic_analysis::identify::{
    DriveLog, FixError, Layout, Mapping, Options, Recording, of_table, open_mapped,
};
use haptic_batch::StudyError;
use haptic_batch::identify::{
    Method, identify as one, identify_pieces, identify_several as several, single_track,
};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::{self, within};
use crate::interrupt::interruptible;
use crate::run::python;
use crate::scenario::Scenario;

/// A drive as Python has it: a path, or columns by name.
#[derive(FromPyObject)]
pub(crate) enum Drive<'py> {
    File(PathBuf),
    Columns(Bound<'py, PyDict>),
}

/// How to identify, as keywords of `haptic_guidance.identify` have it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct How<'py> {
    manual: bool,
    assisted: bool,
    fix: Vec<String>,
    estimate: Vec<String>,
    between: Vec<[f64; 2]>,
    as_published: bool,
    pieces: bool,
    max_gap: f64,
    preprocessing: bool,
    lane_smoothing: bool,
    maps: Vec<String>,
    layout: Option<String>,
    dbc: Option<PathBuf>,
    bus: Option<String>,
    vehicle: Option<Bound<'py, Scenario>>,
}

impl How<'_> {
    fn options(&self, py: Python<'_>) -> PyResult<Options> {
        let refused = |error: FixError| errors::input(py, error);
        let mut options = Options::given(self.manual, &self.fix).map_err(refused)?;
        for what in &self.estimate {
            options.estimate(what).map_err(refused)?;
        }
        let (from, to): (Vec<f64>, Vec<f64>) = self.between.iter().map(|[from, to]| (from, to)).unzip();
        options.between(&from, &to).map_err(refused)?;
        options.bridge_s = within(py, "max_gap", self.max_gap, [0.0, 1.0], "s")?;
        options.assisted = self.assisted;
        options.leave_out = self.preprocessing;
        options.lane_noise = self.lane_smoothing;
        Ok(options)
    }

    /// The log of a drive, and what a reader of the results has to know of it.
    fn open(
        &self,
        py: Python<'_>,
        drive: &Drive<'_>,
        options: &Options,
    ) -> PyResult<(DriveLog, Vec<String>)> {
        let maps = self.maps.iter().map(|map| map.parse());
        let maps = maps.collect::<Result<Vec<Mapping>, _>>();
        let maps = maps.map_err(|error| errors::input(py, error))?;
        let layout = self.layout.as_deref().map(Layout::named).transpose();
        let layout = layout.map_err(|error| errors::input(py, error))?;
        let how = Recording {
            dbc: self.dbc.as_deref(),
            bus: self.bus.as_deref(),
            vehicle: self
                .vehicle
                .as_ref()
                .map(|scenario| single_track(&scenario.get().inner)),
            manual: self.manual,
            stretches: &options.stretches,
            watch: None,
        };
        match drive {
            Drive::File(path) => {
                let opened = open_mapped(path, layout.as_ref(), &maps, &how);
                opened.map_err(|error| errors::input(py, in_keywords(&error.to_string())))
            }
            Drive::Columns(columns) => of_table(table_of(py, columns)?, &maps, &how)
                .map_err(|error| errors::input(py, format!("columns: {}", in_keywords(&error.to_string())))),
        }
    }
}

/// A sentence that names options of the command line, with the keywords of `identify` in their place.
fn in_keywords(sentence: &str) -> String {
    ["map", "time", "layout", "dbc", "bus", "manual"]
        .iter()
        .fold(sentence.to_owned(), |text, name| {
            text.replace(&format!("--{name} "), &format!("{name} "))
        })
}

/// Findings of an identification, for `haptic_guidance.identify`: of one drive, or of several of one driver.
#[pyfunction]
pub(crate) fn identify<'py>(
    py: Python<'py>,
    drives: Vec<Drive<'py>>,
    how: How<'py>,
) -> PyResult<Bound<'py, PyDict>> {
    let options = how.options(py)?;
    let opened = drives.iter().map(|drive| how.open(py, drive, &options));
    let (mut logs, mut notes): (Vec<_>, Vec<_>) = opened.collect::<PyResult<Vec<_>>>()?.into_iter().unzip();
    let method = if how.as_published {
        Method::Paper
    } else {
        Method::NoiseModel
    };
    let in_pieces = how.pieces;
    let drive = interruptible(py, None, move |_| match logs.len() {
        1 if in_pieces => identify_pieces("drive", &logs.remove(0), &options).map_err(StudyError::from),
        1 => one("drive", &logs.remove(0), &options, method).map_err(StudyError::from),
        _ => several("drives", &logs, &options),
    })?
    .map_err(|error| errors::input(py, error))?;
    let converted = notes.drain(..1).flatten();
    let mut found = drive.results.identification;
    found.notes.splice(0..0, converted);
    let made = PyDict::new(py);
    made.set_item("results", python(py, &found)?)?;
    made.set_item("pieces", python(py, &drive.results.pieces)?)?;
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

/// Named arrays.
fn table_of(py: Python<'_>, columns: &Bound<'_, PyDict>) -> PyResult<Vec<(String, Vec<f64>)>> {
    let mut table = Vec::new();
    for (name, values) in columns {
        let name: String = name.extract()?;
        let values: PyReadonlyArray1<'_, f64> = values.extract().map_err(|_| {
            errors::input(
                py,
                format!("{name}: a one-dimensional array of float64 is wanted"),
            )
        })?;
        table.push((name, values.as_array().to_vec()));
    }
    Ok(table)
}
