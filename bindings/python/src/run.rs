//! Whole runs and the paper's evaluation.

use haptic_batch::engine::Watch;
use haptic_batch::readings::Readings;
use haptic_core::bus::Frame;
use haptic_metrics::{DEFINITIONS, Window};
use haptic_sim::simulation::Run;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;

use crate::ecu::fault_names;
use crate::errors;
use crate::interrupt::interruptible;
use crate::scenario::Scenario;

/// The columns as arrays, which own what they show.
fn columns<'py>(py: Python<'py>, run: &Run) -> PyResult<Bound<'py, PyDict>> {
    let made = PyDict::new(py);
    for channel in run.trace.channels() {
        let column = run.trace.samples.iter().map(channel.value).collect();
        made.set_item(channel.name, PyArray1::from_vec(py, column))?;
    }
    Ok(made)
}

/// What JSON holds, as Python's own values.
pub(crate) fn python<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).map_err(|error| errors::input(py, error))?;
    py.import("json")?.call_method1("loads", (text,))
}

/// Time, identifier and eight bytes of each frame.
fn bus<'py>(py: Python<'py>, frames: &[(u32, Frame)]) -> PyResult<Bound<'py, PyDict>> {
    let made = PyDict::new(py);
    let times = frames.iter().map(|(step, _)| u64::from(*step) * 1000).collect();
    made.set_item("t_us", PyArray1::from_vec(py, times))?;
    let ids = frames.iter().map(|(_, frame)| frame.id()).collect();
    made.set_item("id", PyArray1::from_vec(py, ids))?;
    let data: Vec<Vec<u8>> = frames.iter().map(|(_, frame)| frame.data().to_vec()).collect();
    made.set_item(
        "data",
        PyArray2::from_vec2(py, &data).map_err(|error| errors::input(py, error))?,
    )?;
    Ok(made)
}

/// What telemetry says of K_hg, 50 times a second; NaN where it says nothing.
fn k_hg<'py>(py: Python<'py>, readings: &Readings) -> PyResult<Bound<'py, PyDict>> {
    let made = PyDict::new(py);
    let all = || readings.readings.iter();
    let part = |i: usize| {
        all()
            .map(|r| r.estimate.map_or(f64::NAN, |parts| parts[i]))
            .collect()
    };
    made.set_item(
        "time_s",
        PyArray1::from_vec(py, all().map(|r| r.time_s).collect()),
    )?;
    made.set_item("k_hg", PyArray1::from_vec(py, part(0)))?;
    made.set_item("sd", PyArray1::from_vec(py, part(1)))?;
    Ok(made)
}

/// Columns, results, events and frames of a run, for `haptic_guidance.simulate`.
#[pyfunction]
pub(crate) fn simulate<'py>(
    py: Python<'py>,
    scenario: &Bound<'py, Scenario>,
    record_bus: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let wanted = scenario.get().inner.clone();
    wanted
        .check_times()
        .map_err(|error| errors::scenario(py, &error))?;
    let single = interruptible(py, None, move |_| haptic_batch::run::run(wanted, record_bus))?
        .map_err(|error| errors::input(py, error))?;
    let made = PyDict::new(py);
    made.set_item("columns", columns(py, &single.run)?)?;
    made.set_item("steps", single.run.steps)?;
    made.set_item("results", python(py, &single.results)?)?;
    let events = single
        .reported
        .iter()
        .map(|event| (event.time_s, event.what.as_str()));
    made.set_item("events", events.collect::<Vec<_>>())?;
    let said = single.said.iter().map(|said| {
        let faults = fault_names(py, said.faults)?;
        Ok((said.time_s, format!("{:?}", said.mode), faults))
    });
    made.set_item("said", said.collect::<PyResult<Vec<_>>>()?)?;
    made.set_item("unguided", python(py, &single.unguided)?)?;
    made.set_item("k_hg", k_hg(py, &single.readings)?)?;
    if record_bus {
        made.set_item("bus", bus(py, &single.bus)?)?;
    }
    Ok(made)
}

/// Results of the paper's evaluation, for `haptic_guidance.evaluate`.
#[pyfunction]
pub(crate) fn evaluate<'py>(
    py: Python<'py>,
    scenario: &Bound<'py, Scenario>,
    window_m: Option<[f64; 2]>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let base = scenario.get().inner.clone();
    let window = window_m.map(|[from_m, to_m]| Window { from_m, to_m });
    let evaluation = interruptible(py, progress, move |progress| {
        haptic_batch::evaluate::evaluate(&base, window, &Watch::new(&|now| progress.hear(now)))
    })?
    .map_err(|error| errors::input(py, error))?;
    let made = PyDict::new(py);
    made.set_item("results", python(py, &evaluation.results)?)?;
    let runs = evaluation.runs.iter().map(|(_, run)| columns(py, run));
    made.set_item("columns", runs.collect::<PyResult<Vec<_>>>()?)?;
    Ok(made)
}

/// What each metric means.
///
/// Returns
/// -------
/// list of dict
///     With ``name``, ``label``, ``unit``, ``definition`` and ``source``.
#[pyfunction]
pub(crate) fn metric_definitions(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    let described = DEFINITIONS.iter().map(|definition| {
        let entry = PyDict::new(py);
        entry.set_item("name", definition.name)?;
        entry.set_item("label", definition.label)?;
        entry.set_item("unit", definition.unit)?;
        entry.set_item("definition", definition.definition)?;
        entry.set_item("source", definition.source)?;
        Ok(entry)
    });
    described.collect()
}
