//! The shipping ECU as a part of somebody else's simulation.

use haptic_core::config::Setup;
use haptic_core::controller::Command;
use haptic_core::ecu::Boot;
use haptic_core::faults::{Fault, FaultSet};
use haptic_core::params::{PARAMETERS, Params};
use haptic_core::quantity::Instant;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};

use crate::bus::Frame;
use crate::errors;
use crate::scenario::Scenario;

/// The shipping steering ECU: frames in, frames out, a millisecond a step.
///
/// Parameters
/// ----------
/// params : dict or Scenario, optional
///     Parameters by name (`parameters` lists them), or the scenario whose controller it is; the paper's if not given.
/// engaged : bool, optional
///     Guiding from the start with every sender trusted, as studies of drivers have it. Otherwise the ECU boots as on
///     a vehicle: Standby, and Active on a rise of ``engage`` after half a second of valid data.
/// t_us : int, optional
///     The clock at the start, microseconds.
///
/// Raises
/// ------
/// RangeError
///     A parameter, or a product of some, outside its range.
/// InputError
///     An unknown parameter.
///
/// Notes
/// -----
/// The clock is the ECU's own: a count of microseconds that wraps every 71.6 minutes, so only its lowest 32 bits
/// count. A step that comes late is a fault to it, as on a vehicle.
#[pyclass(module = "haptic_guidance")]
#[derive(Clone)]
pub(crate) struct Ecu {
    inner: haptic_core::ecu::Ecu,
}

fn instant(t_us: u64) -> Instant {
    Instant::from_us(t_us as u32)
}

fn setup_of(py: Python<'_>, params: Option<&Bound<'_, PyAny>>) -> PyResult<Setup> {
    let Some(params) = params else {
        return Ok(Setup::PAPER);
    };
    if let Ok(scenario) = params.cast::<Scenario>() {
        return Ok(*scenario.get().inner.setup());
    }
    let given = params.cast::<PyDict>()?;
    let mut values = Params::PAPER.to_values();
    for (name, value) in given {
        let name: String = name.extract()?;
        let Some(place) = PARAMETERS.iter().position(|parameter| parameter.name == name) else {
            let names: Vec<_> = PARAMETERS.iter().map(|parameter| parameter.name).collect();
            let message = format!(
                "{name}: no parameter of the controller; one of {}",
                names.join(", ")
            );
            return Err(errors::input(py, message));
        };
        values[place] = value.extract()?;
    }
    Setup::new(&Params::from_values(&values)).map_err(|error| errors::parameter(py, &error))
}

#[pymethods]
impl Ecu {
    #[new]
    #[pyo3(signature = (params = None, *, engaged = false, t_us = 0))]
    fn new(py: Python<'_>, params: Option<&Bound<'_, PyAny>>, engaged: bool, t_us: u64) -> PyResult<Self> {
        let (setup, now) = (setup_of(py, params)?, instant(t_us));
        let inner = if engaged {
            haptic_core::ecu::Ecu::engaged(&setup, now)
        } else {
            haptic_core::ecu::Ecu::new(Some(&setup), Boot::default(), now)
        };
        Ok(Self { inner })
    }

    /// Takes a frame from the bus.
    ///
    /// Parameters
    /// ----------
    /// id : int
    ///     11-bit identifier.
    /// data : bytes
    ///     Up to eight bytes.
    /// t_us : int
    ///     When it arrived, microseconds.
    ///
    /// Returns
    /// -------
    /// str or None
    ///     Why the ECU does not use it, such as ``"Crc"`` or ``"Repeated"``; None if it does, or if the frame is none
    ///     of its inputs.
    fn receive(
        &mut self,
        py: Python<'_>,
        id: i64,
        data: std::borrow::Cow<'_, [u8]>,
        t_us: u64,
    ) -> PyResult<Option<String>> {
        let frame = Frame::checked(py, id, &data)?;
        let used = self.inner.receive(&frame, instant(t_us));
        Ok(used.err().map(|reject| format!("{reject:?}")))
    }

    /// One step of the 1 kHz loop, and the background work behind it.
    ///
    /// Parameters
    /// ----------
    /// t_us : int
    ///     The clock, microseconds.
    ///
    /// Returns
    /// -------
    /// Step
    fn step(&mut self, t_us: u64) -> Step {
        let step = self.inner.step(instant(t_us));
        let telemetry = self.inner.background_step();
        let mut frames = [Frame::from(&step.guidance); 4];
        let mut count = 1;
        for frame in step.others.iter().chain(&telemetry) {
            frames[count] = Frame::from(frame);
            count += 1;
        }
        Step {
            command: step.command,
            permitted: step.permitted,
            frames,
            count,
        }
    }

    /// An ECU in the same state, independent from now on.
    ///
    /// Returns
    /// -------
    /// Ecu
    #[pyo3(name = "clone")]
    fn copy(&self) -> Self {
        self.clone()
    }

    fn __copy__(&self) -> Self {
        self.clone()
    }

    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }
}

/// The names of faults.
pub(crate) fn fault_names(py: Python<'_>, faults: FaultSet) -> PyResult<Bound<'_, PyTuple>> {
    let present = Fault::ALL.into_iter().filter(|fault| faults.contains(*fault));
    PyTuple::new(py, present.map(|fault| format!("{fault:?}")).collect::<Vec<_>>())
}

/// What one step of the ECU puts on the bus, and the command behind it.
#[pyclass(frozen, module = "haptic_guidance")]
pub(crate) struct Step {
    command: Command,
    permitted: bool,
    frames: [Frame; 4],
    count: usize,
}

#[pymethods]
impl Step {
    /// Guidance torque to apply until the next step, N.m, positive turns left.
    #[getter]
    fn torque_nm(&self) -> f64 {
        self.command.torque.nm()
    }

    /// Mode of the ECU: ``"Boot"``, ``"Standby"``, ``"Active"``, ``"Fade"``, ``"Handover"``, ``"Fault"``, ``"Locked"``.
    #[getter]
    fn mode(&self) -> String {
        format!("{:?}", self.command.mode)
    }

    /// The limit that held the torque back, ``"None"`` if none did.
    #[getter]
    fn limit(&self) -> String {
        format!("{:?}", self.command.limit)
    }

    /// Names of the faults present.
    #[getter]
    fn faults<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        fault_names(py, self.command.faults)
    }

    /// Whether the driver is asked to take over.
    #[getter]
    fn warning(&self) -> bool {
        self.command.warning
    }

    /// Whether the monitor gave its permission.
    #[getter]
    fn permitted(&self) -> bool {
        self.permitted
    }

    /// The frames sent, the guidance frame first.
    #[getter]
    fn frames<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let frames = self.frames[..self.count].iter().map(|frame| Py::new(py, *frame));
        PyList::new(py, frames.collect::<PyResult<Vec<_>>>()?)
    }

    fn __repr__(&self) -> String {
        format!("Step(torque_nm={}, mode='{}')", self.torque_nm(), self.mode())
    }
}

/// Every parameter of the controller.
///
/// Returns
/// -------
/// list of dict
///     With ``name``, ``meaning``, ``unit``, ``min``, ``max`` and ``default``.
#[pyfunction]
pub(crate) fn parameters(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    let described = PARAMETERS.iter().map(|parameter| {
        let entry = PyDict::new(py);
        entry.set_item("name", parameter.name)?;
        entry.set_item("meaning", parameter.meaning.trim())?;
        entry.set_item("unit", parameter.unit)?;
        entry.set_item("min", parameter.min)?;
        entry.set_item("max", parameter.max)?;
        entry.set_item("default", parameter.default)?;
        Ok(entry)
    });
    described.collect()
}
