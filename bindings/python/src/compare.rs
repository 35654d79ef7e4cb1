//! A comparison of laws and drivers, with those of the caller's own.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use haptic_batch::compare::{Compare, CompareResults, Kinds, METRICS};
use haptic_batch::engine::{Watch, on_threads};
use haptic_sim::drivers::{AnyDriver, with_remnant};
use haptic_sim::kind::{Kind, Make, Origin, Parameter};
use haptic_sim::laws::{self, Law};
use haptic_sim::models::STEP_S;
use haptic_sim::parts::{self, Driver};
use haptic_sim::scenario::Scenario;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::driver_view::DriverView;
use crate::errors;
use crate::interrupt::interruptible;
use crate::run::python;

/// What a guidance law sees in a step of 1 ms: what the bus brought.
#[pyclass(frozen, get_all, module = "haptic_guidance")]
pub(crate) struct LawView {
    /// Number of the step.
    step: u32,
    /// e_y', m, positive where the middle of the lane is to the left.
    e_y_m: f64,
    /// Its rate, m/s.
    e_y_rate_m_per_s: f64,
    /// e_theta', rad.
    e_theta_rad: f64,
    /// Its rate, rad/s.
    e_theta_rate_rad_per_s: f64,
    /// T_d as its sensor has it, N.m.
    driver_torque_nm: f64,
    /// phi as its sensor has it, rad.
    wheel_angle_rad: f64,
    /// Its rate, rad/s.
    wheel_rate_rad_per_s: f64,
    /// The guidance torque of the last step, N.m.
    guidance_torque_nm: f64,
    /// Speed, m/s.
    speed_m_per_s: f64,
    /// Yaw rate, rad/s.
    yaw_rate_rad_per_s: f64,
    /// K_hg as the ECU estimates it; None without an estimate.
    k_hg: Option<f64>,
}

impl From<&laws::LawView> for LawView {
    fn from(view: &laws::LawView) -> Self {
        Self {
            step: view.step,
            e_y_m: view.e_y_m,
            e_y_rate_m_per_s: view.e_y_rate_m_per_s,
            e_theta_rad: view.e_theta_rad,
            e_theta_rate_rad_per_s: view.e_theta_rate_rad_per_s,
            driver_torque_nm: view.driver_torque_nm,
            wheel_angle_rad: view.wheel_angle_rad,
            wheel_rate_rad_per_s: view.wheel_rate_rad_per_s,
            guidance_torque_nm: view.guidance_torque_nm,
            speed_m_per_s: view.speed_m_per_s,
            yaw_rate_rad_per_s: view.yaw_rate_rad_per_s,
            k_hg: view.k_hg,
        }
    }
}

/// The first exception of the caller's laws and drivers. Behind it none is asked any more.
type Raised = Arc<Mutex<Option<PyErr>>>;

fn keep(raised: &Raised, error: PyErr) {
    let mut first = raised.lock().unwrap_or_else(PoisonError::into_inner);
    first.get_or_insert(error);
}

fn has_raised(raised: &Raised) -> bool {
    raised.lock().unwrap_or_else(PoisonError::into_inner).is_some()
}

/// A law or a driver that is an object of Python's; a copy of it is made by `copy.deepcopy`.
struct Object {
    object: Option<Py<PyAny>>,
    look_ahead_s: [f64; 2],
    raised: Raised,
}

impl Object {
    /// Calls a factory with its parameters as keywords.
    fn new(scenario: &Scenario, factory: &Py<PyAny>, named: &[(&str, f64)], raised: &Raised) -> Self {
        let driver = scenario.driver();
        let made = Python::attach(|py| {
            let keywords = PyDict::new(py);
            for (name, value) in named {
                keywords.set_item(name, value)?;
            }
            let object = factory.bind(py).call((), Some(&keywords))?;
            let look_ahead_s = match object.getattr_opt("look_ahead_s")? {
                Some(own) => own.extract()?,
                None => [driver.t_n, driver.t_f],
            };
            Ok((object.unbind(), look_ahead_s))
        });
        let made = made.map_err(|error| keep(raised, error)).ok();
        let look_ahead_s = made.as_ref().map_or([driver.t_n, driver.t_f], |made| made.1);
        Self {
            object: made.map(|made| made.0),
            look_ahead_s,
            raised: Arc::clone(raised),
        }
    }

    /// What a method answers; NaN once anything has raised.
    fn call(
        &self,
        method: &str,
        view: impl for<'py> FnOnce(Python<'py>) -> PyResult<Bound<'py, PyAny>>,
    ) -> f64 {
        let Some(object) = self.object.as_ref().filter(|_| !has_raised(&self.raised)) else {
            return f64::NAN;
        };
        let answer = Python::attach(|py| object.bind(py).call_method1(method, (view(py)?,))?.extract());
        answer.unwrap_or_else(|error| {
            keep(&self.raised, error);
            f64::NAN
        })
    }
}

impl Clone for Object {
    fn clone(&self) -> Self {
        let copied = self.object.as_ref().map(|object| {
            Python::attach(|py| {
                let copied = py.import("copy")?.call_method1("deepcopy", (object.bind(py),))?;
                Ok(copied.unbind())
            })
        });
        Self {
            object: copied.and_then(|copied| copied.map_err(|error| keep(&self.raised, error)).ok()),
            look_ahead_s: self.look_ahead_s,
            raised: Arc::clone(&self.raised),
        }
    }
}

impl Law for Object {
    fn ask(&mut self, view: &laws::LawView) -> f64 {
        let torque_nm = self.call("ask", |py| Ok(Bound::new(py, LawView::from(view))?.into_any()));
        if !torque_nm.is_finite() && !has_raised(&self.raised) {
            let (step, at_s) = (view.step, f64::from(view.step) * STEP_S);
            let what =
                format!("a law answered {torque_nm} N.m at {at_s:.3} s (step {step}): a number is wanted");
            keep(&self.raised, Python::attach(|py| errors::input(py, what)));
        }
        torque_nm
    }
}

impl Driver for Object {
    fn look_ahead_s(&self) -> [f64; 2] {
        self.look_ahead_s
    }

    fn step(&mut self, view: &parts::DriverView) -> f64 {
        let torque_nm = self.call("step", |py| {
            Ok(Bound::new(py, DriverView::from(*view))?.into_any())
        });
        // What raised ends the comparison; until then nobody steers.
        if torque_nm.is_finite() { torque_nm } else { 0.0 }
    }
}

/// Default, least and largest value, and if tuning varies it the two ends of that.
type Given = Vec<f64>;

/// A kind of the caller's: its name, its parameters, its factory. It lives as long as the program, as kinds do.
fn kind<P: ?Sized>(
    py: Python<'_>,
    name: &str,
    factory: &Bound<'_, PyAny>,
    raised: &Raised,
    boxed: fn(&Scenario, Object) -> Box<P>,
) -> PyResult<Kind<P>> {
    let given: Vec<(String, Given)> = match factory.getattr_opt("parameters")? {
        None => Vec::new(),
        Some(given) => given
            .call_method0("items")?
            .try_iter()?
            .map(|item| item?.extract())
            .collect::<PyResult<_>>()?,
    };
    let parameters = given.into_iter().map(|(parameter, values)| {
        let here = format!("{name}.parameters[{parameter:?}]");
        let own = |range| Parameter::ours(parameter.leak(), values[0], range);
        match values[..] {
            [_, low, high] => Ok(own([low, high])),
            [_, low, high, from, to] => Ok(own([low, high]).tuned(from, to)),
            _ => Err(errors::input(
                py,
                format!("{here}: default, least, largest, and where tuning begins and ends"),
            )),
        }
    });
    let parameters: &'static [Parameter] = parameters.collect::<PyResult<Vec<_>>>()?.leak();
    let (factory, raised) = (factory.clone().unbind(), Arc::clone(raised));
    let make = move |scenario: &Scenario, values: &[f64]| {
        let named: Vec<(&str, f64)> = parameters
            .iter()
            .map(|p| p.name)
            .zip(values.iter().copied())
            .collect();
        Ok(boxed(scenario, Object::new(scenario, &factory, &named, &raised)))
    };
    Ok(Kind {
        name: name.to_owned().leak(),
        source: "Python",
        origin: Origin::Ours,
        parameters,
        make: Make::Given(Box::leak(Box::new(make))),
    })
}

/// Results and a row for each drive, for `haptic_guidance.compare`.
#[pyfunction]
pub(crate) fn compare<'py>(
    py: Python<'py>,
    path: PathBuf,
    laws: &Bound<'py, PyDict>,
    drivers: &Bound<'py, PyDict>,
    threads: Option<u32>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let raised = Raised::default();
    let mut kinds = Kinds::default();
    for (name, factory) in laws {
        let name: String = name.extract()?;
        kinds
            .laws
            .push(kind::<dyn Law>(py, &name, &factory, &raised, |_, law| {
                Box::new(law)
            })?);
    }
    for (name, factory) in drivers {
        let name: String = name.extract()?;
        let boxed = |scenario: &Scenario, driver| -> Box<dyn AnyDriver> { with_remnant(scenario, driver) };
        kinds.drivers.push(kind(py, &name, &factory, &raised, boxed)?);
    }
    let heard = Arc::clone(&raised);
    let found = interruptible(py, progress, move |progress| {
        let compare = Compare::load(&path, &kinds).map_err(|e| e.to_string())?;
        let hear = |now| match progress.hear(now) {
            // Who waits raises what was raised.
            ControlFlow::Continue(()) if has_raised(&heard) => ControlFlow::Break(()),
            heard => heard,
        };
        let watch = Watch::new(&hear);
        let results = on_threads(threads, || compare.run(&watch)).map_err(|e| e.to_string())?;
        results.map_err(|e| e.to_string())
    });
    let first = raised.lock().unwrap_or_else(PoisonError::into_inner).take();
    if let Some(error) = first {
        return Err(error);
    }
    let found = found?.map_err(|error| errors::input(py, error))?;
    let made = PyDict::new(py);
    made.set_item("results", python(py, &found)?)?;
    made.set_item("drives", drives(py, &found)?)?;
    Ok(made)
}

/// A row for each drive.
fn drives<'py>(py: Python<'py>, found: &CompareResults) -> PyResult<Bound<'py, PyList>> {
    let rows = PyList::empty(py);
    for row in &found.rows {
        let made = PyDict::new(py);
        for (name, value) in ["law", "driver", "world", "road"].into_iter().zip(&row.names) {
            made.set_item(name, value)?;
        }
        made.set_item("speed_kmh", row.speed_kmh)?;
        made.set_item("seed", row.seed)?;
        for (metric, value) in METRICS.iter().zip(row.driven.values) {
            made.set_item(metric.name, value)?;
        }
        made.set_item("off_road", row.driven.off_road)?;
        made.set_item("guidance_left_by_itself", row.driven.left_by_itself)?;
        made.set_item("failed_off_road", row.driven.failed_off_road)?;
        rows.append(made)?;
    }
    Ok(rows)
}
