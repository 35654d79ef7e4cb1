//! The paper's participants as drivers with a known truth.

use haptic_batch::engine::Watch;
use haptic_batch::experiment::{Experiment, ExperimentPlan, experiment as run};
use haptic_sim::participants::participants as published;
use haptic_sim::scenario::{GuidanceParameters, Scenario};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::{self, within};
use crate::interrupt::interruptible;
use crate::run::python;

/// Results and recorded drives, for `haptic_guidance.experiment`.
#[pyfunction]
pub(crate) fn experiment<'py>(
    py: Python<'py>,
    participants: Vec<i64>,
    probe_nm: f64,
    seed: u64,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let most = published().len() as f64;
    let numbers = participants.into_iter().map(|number| {
        // In range as checked.
        within(py, "participants", number as f64, [1.0, most], "").map(|number| number as u32)
    });
    let plan = ExperimentPlan {
        participants: numbers.collect::<PyResult<_>>()?,
        probe_nm,
        seed,
    };
    if plan.participants.is_empty() {
        return Err(errors::input(py, "participants: at least one is wanted"));
    }
    check_probe(py, probe_nm)?;
    let found = interruptible(py, progress, move |progress| {
        run(&plan, &Watch::new(&|now| progress.hear(now)))
    })?
    .map_err(|error| errors::input(py, error))?;
    let made = PyDict::new(py);
    made.set_item("results", python(py, &found)?)?;
    made.set_item("drives", recorded(py, &found)?)?;
    Ok(made)
}

/// The controller's own range, before anything is driven.
fn check_probe(py: Python<'_>, probe_nm: f64) -> PyResult<()> {
    let mut guidance = GuidanceParameters::default();
    guidance.controller.probe_amplitude_nm = probe_nm;
    let scenario = Scenario::builder().guidance(guidance).build();
    scenario.map(|_| ()).map_err(|error| errors::scenario(py, &error))
}

/// What was recorded of each drive, as columns that `identify` takes.
fn recorded<'py>(py: Python<'py>, found: &Experiment) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let columns = |drive: &haptic_batch::experiment::Drive| {
        let log = &drive.log;
        let times = (0..log.e_y_m.len()).map(|row| log.start_s + row as f64 * log.dt_s);
        let made = PyDict::new(py);
        made.set_item("time_s", PyArray1::from_vec(py, times.collect()))?;
        for (name, column) in [
            ("e_y_m", &log.e_y_m),
            ("e_theta_rad", &log.e_theta_rad),
            ("wheel_angle_rad", &log.wheel_angle_rad),
            ("guidance_torque_nm", &log.guidance_torque_nm),
            ("driver_torque_nm", &log.driver_torque_nm),
        ] {
            made.set_item(name, PyArray1::from_slice(py, column))?;
        }
        Ok(made)
    };
    found.drives.iter().map(columns).collect()
}
