//! The shipping ECU as a part of somebody else's simulation.

use haptic_core::controller::config::Setup;
use haptic_core::controller::params::{PARAMETERS, Params};
use haptic_core::ecu::Boot;
use haptic_core::quantity::{Instant, Torque};
use haptic_core::safety::envelope::LimitReason;
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList, PyTuple};

use crate::bus::Frame;
use crate::errors::{self, clock};
use crate::history::History;
use crate::pickle::Parts;
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
///
/// A clone and its original give the same bits for the same frames. A pickle holds the parameters and all that the ECU
/// has heard, and drives again when it is loaded.
#[pyclass(module = "haptic_guidance")]
#[derive(Clone)]
pub(crate) struct Ecu {
    inner: haptic_core::ecu::Ecu,
    params: Params,
    engaged: bool,
    /// The clock at the start.
    start_us: u32,
    history: History,
}

/// Its clock: the lowest 32 bits count.
fn instant(py: Python<'_>, t_us: i64) -> PyResult<u32> {
    clock(py, t_us).map(|t_us| t_us as u32)
}

fn params_of(py: Python<'_>, params: Option<&Bound<'_, PyAny>>) -> PyResult<Params> {
    let Some(params) = params else {
        return Ok(Params::PAPER);
    };
    if let Ok(scenario) = params.cast::<Scenario>() {
        return Ok(scenario.get().inner.controller_params());
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
    Ok(Params::from_values(&values))
}

impl Ecu {
    fn made(py: Python<'_>, params: Params, engaged: bool, start_us: u32) -> PyResult<Self> {
        let setup = Setup::new(&params).map_err(|error| errors::parameter(py, &error))?;
        let now = Instant::from_us(start_us);
        let inner = if engaged {
            haptic_core::ecu::Ecu::engaged(&setup, now)
        } else {
            haptic_core::ecu::Ecu::new(Some(&setup), Boot::default(), now)
        };
        Ok(Self {
            inner,
            params,
            engaged,
            start_us,
            history: History::new(start_us),
        })
    }
}

#[pymethods]
impl Ecu {
    #[new]
    #[pyo3(signature = (params = None, *, engaged = false, t_us = 0))]
    fn new(py: Python<'_>, params: Option<&Bound<'_, PyAny>>, engaged: bool, t_us: i64) -> PyResult<Self> {
        Self::made(py, params_of(py, params)?, engaged, instant(py, t_us)?)
    }

    /// From what `__reduce__` took apart.
    #[staticmethod]
    fn _of(
        py: Python<'_>,
        values: [f64; PARAMETERS.len()],
        engaged: bool,
        start_us: u32,
        history: &[u8],
    ) -> PyResult<Self> {
        let mut ecu = Self::made(py, Params::from_values(&values), engaged, start_us)?;
        let inner = &mut ecu.inner;
        let history = py.detach(|| History::replay(history, start_us, inner));
        ecu.history = history.ok_or_else(|| errors::input(py, "this is no pickle of an Ecu"))?;
        Ok(ecu)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Parts<'py>> {
        let history = PyBytes::new(py, &self.history.to_bytes());
        let parts = (self.params.to_values(), self.engaged, self.start_us, history);
        Ok((py.get_type::<Self>().getattr("_of")?, parts.into_pyobject(py)?))
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
        t_us: i64,
    ) -> PyResult<Option<String>> {
        let (frame, t_us) = (Frame::checked(py, id, &data)?, instant(py, t_us)?);
        let used = self.inner.receive(&frame, Instant::from_us(t_us));
        self.history.frame(&frame, t_us);
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
    fn step(&mut self, py: Python<'_>, t_us: i64) -> PyResult<Step> {
        let t_us = instant(py, t_us)?;
        let step = self.inner.step(Instant::from_us(t_us));
        let telemetry = self.inner.background_step();
        self.history.step(t_us);
        let mut frames = [Frame::from(&step.guidance); 4];
        let mut count = 1;
        for frame in step.others.iter().chain(&telemetry) {
            frames[count] = Frame::from(frame);
            count += 1;
        }
        let command = step.command;
        Ok(Step {
            torque: command.torque,
            mode: command.mode,
            limit: command.limit,
            faults: command.faults,
            warning: command.warning,
            permitted: step.permitted,
            frames,
            count,
        })
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
#[pyclass(frozen, eq, module = "haptic_guidance")]
#[derive(PartialEq)]
pub(crate) struct Step {
    torque: Torque,
    mode: Mode,
    limit: LimitReason,
    faults: FaultSet,
    warning: bool,
    permitted: bool,
    frames: [Frame; 4],
    count: usize,
}

/// Torque in N.m, mode, limit and faults.
type Decided = (f64, u32, i64, u32);

#[pymethods]
impl Step {
    /// Guidance torque to apply until the next step, N.m, positive turns left.
    #[getter]
    fn torque_nm(&self) -> f64 {
        self.torque.nm()
    }

    /// Mode of the ECU: ``"Boot"``, ``"Standby"``, ``"Active"``, ``"Fade"``, ``"Handover"``, ``"Fault"``, ``"Locked"``.
    #[getter]
    fn mode(&self) -> String {
        format!("{:?}", self.mode)
    }

    /// The limit that held the torque back, ``"None"`` if none did.
    #[getter]
    fn limit(&self) -> String {
        format!("{:?}", self.limit)
    }

    /// Names of the faults present.
    #[getter]
    fn faults<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        fault_names(py, self.faults)
    }

    /// Whether the driver is asked to take over.
    #[getter]
    fn warning(&self) -> bool {
        self.warning
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

    /// From what `__reduce__` took apart.
    #[staticmethod]
    fn _of(py: Python<'_>, decided: Decided, flags: [bool; 2], frames: Vec<Py<Frame>>) -> PyResult<Self> {
        let (torque_nm, mode, limit, faults) = decided;
        let known = (Mode::from_code(mode), LimitReason::from_code(limit));
        let ((Some(mode), Some(limit)), Some(first)) = (known, frames.first()) else {
            return Err(errors::input(py, "this is no pickle of a Step"));
        };
        let mut places = [*first.get(); 4];
        for (place, frame) in places.iter_mut().zip(&frames) {
            *place = *frame.get();
        }
        let [warning, permitted] = flags;
        Ok(Self {
            torque: Torque::from_nm(torque_nm),
            mode,
            limit,
            faults: FaultSet::from_bits(faults),
            warning,
            permitted,
            frames: places,
            count: frames.len().min(places.len()),
        })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Parts<'py>> {
        let decided = (
            self.torque.nm(),
            self.mode as u32,
            self.limit as i64,
            self.faults.bits(),
        );
        let parts = (decided, [self.warning, self.permitted], self.frames(py)?);
        Ok((py.get_type::<Self>().getattr("_of")?, parts.into_pyobject(py)?))
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
