//! The closed loop step by step.

use haptic_core::safety::faults::FaultSet;
use haptic_log::trace::CHANNELS;
use haptic_sim::action::WorldFaults;
use haptic_sim::guidance::AnyGuidance;
use haptic_sim::parts::PaperPair;
use haptic_sim::simulation::Ending;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::bus::Frame;
use crate::driver_view::DriverView;
use crate::ecu::fault_names;
use crate::errors::{finite, whole, within};
use crate::pickle::{Parts, attributes, part};
use crate::scenario::Scenario;

/// Steps between two looks at Ctrl-C, 0.1 s of work at the most.
const STEPS_IN_ONE_GO: u32 = 10_000;

/// What comes from outside in one step; the default lets the scenario have its way.
///
/// Parameters
/// ----------
/// engage : bool, optional
///     Whether the host asks for guidance; it does if not given.
/// authority : float, optional
///     Share of the guidance torque that the host allows, 0 to 1; all of it if not given.
/// probe : bool, optional
///     Whether the host asks for the probe; as the scenario has it if not given.
/// hand_torque_nm : float, optional
///     Torque of a hand on the wheel beside the driver model's, N.m, positive turns left.
/// torque_lost, lane_lost : bool, optional
///     The guidance torque does not reach the column; the lane preview does not reach the controller.
#[pyclass(frozen, eq, module = "haptic_guidance")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Action {
    inner: haptic_sim::Action,
}

type Given = (Option<bool>, Option<f64>, Option<bool>, f64, bool, bool);

impl Action {
    fn parts(&self) -> Given {
        let haptic_sim::Action {
            engage,
            authority,
            probe,
            hand_torque_nm,
            // Not in Python: a driver in Python has points of its own.
            beside_m: _,
            world: WorldFaults {
                torque_lost,
                lane_lost,
            },
        } = self.inner;
        (engage, authority, probe, hand_torque_nm, torque_lost, lane_lost)
    }
}

#[pymethods]
impl Action {
    #[new]
    #[pyo3(signature = (engage = None, authority = None, probe = None, hand_torque_nm = 0.0, torque_lost = false,
                        lane_lost = false))]
    fn new(
        py: Python<'_>,
        engage: Option<bool>,
        authority: Option<f64>,
        probe: Option<bool>,
        hand_torque_nm: f64,
        torque_lost: bool,
        lane_lost: bool,
    ) -> PyResult<Self> {
        if let Some(authority) = authority {
            within(py, "authority", authority, [0.0, 1.0], "")?;
        }
        let inner = haptic_sim::Action {
            engage,
            authority,
            probe,
            hand_torque_nm: finite(py, "hand_torque_nm", hand_torque_nm, "N.m")?,
            beside_m: 0.0,
            world: WorldFaults {
                torque_lost,
                lane_lost,
            },
        };
        Ok(Self { inner })
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, pyo3::types::PyType>, Bound<'py, PyTuple>)> {
        let parts = slf.get().parts().into_pyobject(slf.py())?;
        Ok((slf.get_type(), parts))
    }

    fn __repr__(&self) -> String {
        let (engage, authority, probe, hand_torque_nm, torque_lost, lane_lost) = self.parts();
        format!(
            "Action(engage={engage:?}, authority={authority:?}, probe={probe:?}, \
             hand_torque_nm={hand_torque_nm}, torque_lost={torque_lost}, lane_lost={lane_lost})"
        )
    }
}

/// What came of one step.
#[pyclass(frozen, get_all, module = "haptic_guidance")]
pub(crate) struct Outcome {
    /// Time since the start of the run, s.
    time_s: f64,
    /// e_y at the driver's near point, m.
    e_y_m: f64,
    /// e_theta at the driver's far point, rad.
    e_theta_rad: f64,
    /// Torque of driver and hand on the column, N.m.
    driver_torque_nm: f64,
    /// Angle of the steering wheel, rad.
    wheel_angle_rad: f64,
    /// Torque that the guidance decided, N.m.
    decided_torque_nm: f64,
    /// Torque that was applied, N.m.
    guidance_torque_nm: f64,
    /// Whether a limit held the torque back.
    guidance_limited: bool,
    /// Mode of the ECU, such as ``"Active"``; None without guidance.
    mode: Option<String>,
    /// Names of the faults that it reports.
    faults: Py<PyTuple>,
    /// Whether it asks the driver to take over.
    warning: bool,
    /// K_hg and its standard deviation as its last telemetry has them, once identified.
    k_hg: Option<(f64, f64)>,
    /// Why the guidance is away, such as ``"HandsOff"``; None if it is not.
    unguided: Option<String>,
    /// The truth of this instant by the names of `Run`'s columns, every 5 ms; None in between.
    sample: Option<Py<PyDict>>,
    /// Frames to the ECU, in order of sending.
    frames_in: Vec<Py<Frame>>,
    /// Frames from it, the guidance frame first.
    frames_out: Vec<Py<Frame>>,
}

#[pymethods]
impl Outcome {
    /// From what `__reduce__` took apart.
    #[staticmethod]
    fn _of(parts: &Bound<'_, PyDict>) -> PyResult<Self> {
        Ok(Self {
            time_s: part(parts, "time_s")?,
            e_y_m: part(parts, "e_y_m")?,
            e_theta_rad: part(parts, "e_theta_rad")?,
            driver_torque_nm: part(parts, "driver_torque_nm")?,
            wheel_angle_rad: part(parts, "wheel_angle_rad")?,
            decided_torque_nm: part(parts, "decided_torque_nm")?,
            guidance_torque_nm: part(parts, "guidance_torque_nm")?,
            guidance_limited: part(parts, "guidance_limited")?,
            mode: part(parts, "mode")?,
            faults: part(parts, "faults")?,
            warning: part(parts, "warning")?,
            k_hg: part(parts, "k_hg")?,
            unguided: part(parts, "unguided")?,
            sample: part(parts, "sample")?,
            frames_in: part(parts, "frames_in")?,
            frames_out: part(parts, "frames_out")?,
        })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Parts<'py>> {
        attributes(slf)
    }
}

fn outcome(py: Python<'_>, from: &haptic_sim::Outcome<'_>) -> PyResult<Outcome> {
    let frames = |frames: &[haptic_core::bus::Frame]| {
        let frames = frames.iter().map(|frame| Py::new(py, Frame::from(frame)));
        frames.collect::<PyResult<Vec<_>>>()
    };
    let sample = from.sample.as_ref().map(|sample| {
        let values = PyDict::new(py);
        for channel in &CHANNELS {
            let value = (channel.value)(sample);
            if !channel.is_optional || !value.is_nan() {
                values.set_item(channel.name, value)?;
            }
        }
        Ok::<_, PyErr>(values.unbind())
    });
    let faults = from.status.map_or(FaultSet::NONE, |status| status.faults);
    Ok(Outcome {
        mode: from.status.map(|status| format!("{:?}", status.mode)),
        faults: fault_names(py, faults)?.unbind(),
        warning: from.status.is_some_and(|status| status.warning),
        k_hg: from
            .status
            .and_then(|status| status.k_hg)
            .map(|[k_hg, sd]| (k_hg, sd)),
        unguided: from.unguided.map(|why| why.to_string()),
        time_s: from.time_s(),
        e_y_m: from.preview.e_y_m,
        e_theta_rad: from.preview.e_theta_rad,
        driver_torque_nm: from.observation.driver_torque_nm,
        wheel_angle_rad: from.observation.wheel_angle_rad,
        decided_torque_nm: from.decided.torque_nm,
        guidance_torque_nm: from.applied_torque_nm,
        guidance_limited: from.decided.limited,
        sample: sample.transpose()?,
        frames_in: frames(from.frames_in)?,
        frames_out: frames(from.frames_out)?,
    })
}

/// A closed loop under way: driver, guidance, column, vehicle and road.
///
/// A clone and its original give the same bits for the same actions. A pickle holds the scenario and the actions, and
/// drives again when it is loaded.
///
/// Parameters
/// ----------
/// scenario : Scenario
/// own_driver : bool, optional
///     Whether you drive: nobody is at the wheel but the hand of each action, and :meth:`view` says what you see.
#[pyclass(module = "haptic_guidance")]
pub(crate) struct Simulation {
    inner: haptic_sim::Simulation,
    scenario: Py<Scenario>,
    own_driver: bool,
    /// Each action, with the number of steps that it lasted.
    actions: Vec<(u32, Action)>,
}

impl Simulation {
    fn remember(&mut self, action: Action, steps: u32) {
        match self.actions.last_mut() {
            Some((count, last)) if *last == action => *count += steps,
            _ => self.actions.push((steps, action)),
        }
    }
}

#[pymethods]
impl Simulation {
    #[new]
    #[pyo3(signature = (scenario, own_driver = false))]
    fn new(scenario: Py<Scenario>, own_driver: bool) -> Self {
        let of = &scenario.get().inner;
        let pair = if own_driver {
            PaperPair::without_driver(of)
        } else {
            PaperPair::new(of)
        };
        Self {
            inner: haptic_sim::Simulation::with_driver_vehicle(of, pair, AnyGuidance::new(of)),
            scenario,
            own_driver,
            actions: Vec::new(),
        }
    }

    /// What the driver sees and feels in the next step.
    ///
    /// Returns
    /// -------
    /// DriverView or None
    ///     None once the run has ended.
    fn view(&self) -> Option<DriverView> {
        self.inner.view().map(DriverView::from)
    }

    /// Moves the loop.
    ///
    /// Parameters
    /// ----------
    /// action : Action, optional
    ///     What comes from outside.
    /// steps : int, optional
    ///     How many milliseconds the action lasts.
    ///
    /// Returns
    /// -------
    /// Outcome or None
    ///     Of the last of the steps; None once the run has ended.
    #[pyo3(signature = (action = None, steps = 1))]
    fn step(
        &mut self,
        py: Python<'_>,
        action: Option<&Bound<'_, Action>>,
        steps: i64,
    ) -> PyResult<Option<Outcome>> {
        // In range as checked.
        let steps = whole(py, "steps", steps, [1, i64::from(u32::MAX)], "")? as u32;
        let action = action.map_or(
            Action {
                inner: haptic_sim::Action::default(),
            },
            |action| *action.get(),
        );
        let mut left = steps - 1;
        while left > 0 {
            let now = left.min(STEPS_IN_ONE_GO);
            let inner = &mut self.inner;
            let before = inner.steps();
            py.detach(|| (0..now).all(|_| inner.step(&action.inner).is_some()));
            let moved = self.inner.steps() - before;
            if moved > 0 {
                self.remember(action, moved);
            }
            py.check_signals()?;
            left -= now;
            if self.inner.ending().is_some() {
                return Ok(None);
            }
        }
        let before = self.inner.steps();
        let last = match self.inner.step(&action.inner) {
            Some(from) => Some(outcome(py, &from)?),
            None => None,
        };
        if self.inner.steps() > before {
            self.remember(action, 1);
        }
        Ok(last)
    }

    /// Steps so far; one is 1 ms.
    #[getter]
    fn steps(&self) -> u32 {
        self.inner.steps()
    }

    /// How the run ended: ``"course-end"``, ``"diverged"``, or None while it goes on.
    #[getter]
    fn ending(&self) -> Option<&'static str> {
        self.inner.ending().map(|ending| match ending {
            Ending::CourseEnd => "course-end",
            Ending::Diverged { .. } => "diverged",
        })
    }

    /// The scenario.
    #[getter]
    fn scenario(&self, py: Python<'_>) -> Py<Scenario> {
        self.scenario.clone_ref(py)
    }

    /// A simulation in the same state, independent from now on.
    ///
    /// Returns
    /// -------
    /// Simulation
    #[pyo3(name = "clone")]
    fn copy(&self, py: Python<'_>) -> Self {
        Self {
            inner: self.inner.clone(),
            scenario: self.scenario.clone_ref(py),
            own_driver: self.own_driver,
            actions: self.actions.clone(),
        }
    }

    fn __copy__(&self, py: Python<'_>) -> Self {
        self.copy(py)
    }

    fn __deepcopy__(&self, py: Python<'_>, _memo: &Bound<'_, PyAny>) -> Self {
        self.copy(py)
    }

    fn __getstate__<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyTuple>>> {
        let actions = self.actions.iter();
        let actions = actions.map(|(steps, action)| (*steps, Py::new(py, *action)?).into_pyobject(py));
        actions.collect()
    }

    fn __setstate__(&mut self, py: Python<'_>, actions: Vec<(u32, Py<Action>)>) -> PyResult<()> {
        for (steps, action) in actions {
            self.step(py, Some(action.bind(py)), i64::from(steps))?;
        }
        Ok(())
    }

    fn __getnewargs__(&self, py: Python<'_>) -> (Py<Scenario>, bool) {
        (self.scenario.clone_ref(py), self.own_driver)
    }
}
