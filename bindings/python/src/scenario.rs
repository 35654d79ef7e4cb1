//! A scenario in Python: the fields of a scenario file as keywords, checked by the simulator itself.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use haptic_batch::files::load_lane;
use haptic_sim::input::{InputError, parse_toml};
use haptic_sim::models::road::{DEFAULT_LANE_WIDTH_M, LaneChoice, SEGMENT_FIELDS};
use haptic_sim::scenario::ScenarioBuilder;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple, PyType};
use toml::{Table, Value};

use crate::errors;

/// Everything that decides a run, checked.
///
/// The keywords are the fields of a scenario file (examples/every-field.toml lists names, units, ranges and defaults); what is not
/// given keeps its default, so ``Scenario()`` is the paper's driver 1 with medium reliance at 60 km/h.
///
/// Parameters
/// ----------
/// course : str, path or mapping, optional
///     ``"paper-course"``, a course file, or its content: ``{"lane_width_m": 3.6, "segment": [{"length_m": 100.0}]}``.
///     An OpenDRIVE file (.xodr) is one too; ``road``, ``lane`` and ``turn`` choose from it.
/// speed_m_per_s : float, optional
///     Constant speed, 5.5 to 70.
/// speed : mapping, optional
///     In its place one that changes through points by time or by place: ``{"time_s": [0, 10, 15],
///     "speed_m_per_s": [16, 16, 11]}``, ``{"place_m": [0, 200, 300], "speed_m_per_s": [22, 22, 14]}``.
/// condition : {"manual", "high", "mid", "low"}, optional
///     How much the driver relies on the guidance.
/// sensors : {"paper", "exact"}, optional
///     What the controller sees.
/// seed : int, optional
///     Root of all random numbers.
/// driver, vehicle, guidance, failure, driver_change, world, sensor_errors, tolerances, column, assist : mapping, optional
///     The tables of the file, such as ``driver={"t_p_s": 0.3}``.
///
/// Raises
/// ------
/// RangeError
///     A value outside its range; the exception has ``field``, ``value``, ``min``, ``max`` and ``unit``.
/// InputError
///     An unknown field, a value of the wrong kind, values that do not go together.
#[pyclass(frozen, module = "haptic_guidance")]
pub(crate) struct Scenario {
    pub(crate) inner: haptic_sim::Scenario,
    /// The fields that were given.
    fields: Table,
    /// Where a course file is looked for.
    folder: PathBuf,
}

impl Scenario {
    /// From the text of a file, which says the same as `fields`.
    fn make(
        py: Python<'_>,
        name: &str,
        text: &str,
        fields: Table,
        folder: &Path,
        refused: impl FnOnce(InputError) -> PyErr,
    ) -> PyResult<Self> {
        let open = |named: &str, lane: &LaneChoice| load_lane(&folder.join(named), lane);
        let builder = ScenarioBuilder::from_toml(name, text, open).map_err(refused)?;
        let inner = builder.build().map_err(|error| errors::scenario(py, &error))?;
        Ok(Self {
            inner,
            fields,
            folder: folder.into(),
        })
    }

    fn of_fields(py: Python<'_>, mut fields: Table, folder: &Path) -> PyResult<Self> {
        if let Some(Value::Table(course)) = fields.get_mut("course") {
            complete(course);
        }
        let text = fields.to_string();
        Self::make(py, "scenario", &text, fields, folder, |error| {
            errors::in_keywords(py, &text, &error.to_string())
        })
    }
}

/// Writes out what a course file may leave out, and a course in a scenario may not.
fn complete(course: &mut Table) {
    course
        .entry("name")
        .or_insert_with(|| Value::String("course".into()));
    if course.contains_key("opendrive") {
        return;
    }
    course
        .entry("lane_width_m")
        .or_insert(Value::Float(DEFAULT_LANE_WIDTH_M));
    let Some(Value::Array(segments)) = course.get_mut("segment") else {
        return;
    };
    for segment in segments.iter_mut().filter_map(Value::as_table_mut) {
        // Behind the length each quantity has three fields: for the whole segment, at its start and at its end.
        for fields in SEGMENT_FIELDS[1..].chunks_exact(3) {
            let [whole, start, end] = [0, 1, 2].map(|i| fields[i].name);
            if segment.contains_key(start) || segment.contains_key(end) {
                continue;
            }
            let constant = segment.remove(whole).unwrap_or(Value::Float(0.0));
            for name in [start, end] {
                segment.insert(name.into(), constant.clone());
            }
        }
    }
}

#[pymethods]
impl Scenario {
    #[new]
    #[pyo3(signature = (**fields))]
    fn new(py: Python<'_>, fields: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let fields = fields.map_or_else(|| Ok(Table::new()), |given| table(given, ""))?;
        Self::of_fields(py, fields, Path::new(""))
    }

    /// A scenario from a mapping of the same fields as the keywords.
    ///
    /// Parameters
    /// ----------
    /// fields : dict
    ///     Fields and tables of a scenario file.
    ///
    /// Returns
    /// -------
    /// Scenario
    #[classmethod]
    fn from_dict(class: &Bound<'_, PyType>, fields: &Bound<'_, PyDict>) -> PyResult<Self> {
        Self::new(class.py(), Some(fields))
    }

    /// A scenario from the text of a scenario file.
    ///
    /// Parameters
    /// ----------
    /// text : str
    ///     TOML. A course file that it names is looked for in the current folder.
    ///
    /// Returns
    /// -------
    /// Scenario
    #[staticmethod]
    fn from_toml(py: Python<'_>, text: &str) -> PyResult<Self> {
        let refused = |error| errors::input(py, error);
        let fields = parse_toml("scenario", text).map_err(refused)?;
        Self::make(py, "scenario", text, fields, Path::new(""), refused)
    }

    /// Reads a scenario file.
    ///
    /// Parameters
    /// ----------
    /// path : str or path
    ///     The file. A course file that it names is looked for beside it.
    ///
    /// Returns
    /// -------
    /// Scenario
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let name = path.display().to_string();
        let refused = |error| errors::input(py, error);
        let text = std::fs::read_to_string(&path).map_err(|e| refused(InputError::new(&name, e)))?;
        let fields = parse_toml(&name, &text).map_err(refused)?;
        Self::make(py, &name, &text, fields, folder, refused)
    }

    /// A scenario like this one with some fields changed; a table is changed field by field.
    ///
    /// Parameters
    /// ----------
    /// **fields
    ///     As of `Scenario`.
    ///
    /// Returns
    /// -------
    /// Scenario
    #[pyo3(signature = (**fields))]
    fn replace(&self, py: Python<'_>, fields: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let changes = fields.map_or_else(|| Ok(Table::new()), |given| table(given, ""))?;
        let mut merged = self.fields.clone();
        // A new course is looked for where the caller is, the old one where it was found.
        let folder = match changes.get("course") {
            Some(_) => Path::new(""),
            None => &self.folder,
        };
        // A speed takes the place of the other form of it.
        for (one, other) in [("speed", "speed_m_per_s"), ("speed_m_per_s", "speed")] {
            if changes.contains_key(one) {
                merged.remove(other);
            }
        }
        for (name, value) in changes {
            match (merged.get_mut(&name), value) {
                (Some(Value::Table(old)), Value::Table(new))
                    if !["course", "speed"].contains(&name.as_str()) =>
                {
                    old.extend(new);
                }
                (_, value) => {
                    merged.insert(name, value);
                }
            }
        }
        Self::of_fields(py, merged, folder)
    }

    /// The fields that were given, as a mapping that `from_dict` takes.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let mut fields = self.fields.clone();
        // A course file may not be there where the mapping is read.
        let whole: Table = toml::from_str(&self.inner.to_toml()).map_err(|error| errors::input(py, error))?;
        if let Some(course @ Value::Table(_)) = whole.get("course") {
            fields.insert("course".into(), course.clone());
            // These chose it from its file.
            for field in ["road", "lane", "turn"] {
                fields.remove(field);
            }
        }
        dict(py, &fields)
    }

    /// Every value as the text of a scenario file that needs no other file.
    ///
    /// Returns
    /// -------
    /// str
    fn to_toml(&self) -> String {
        self.inner.to_toml()
    }

    /// Speed at the start, km/h: that of the whole run unless it changes.
    #[getter]
    fn speed_kmh(&self) -> f64 {
        self.inner.speed_kmh()
    }

    /// Speed at the start, m/s: that of the whole run unless it changes.
    #[getter]
    fn speed_m_per_s(&self) -> f64 {
        self.inner.speed_m_per_s()
    }

    /// How the driver drives: ``"manual"``, ``"high"``, ``"mid"``, ``"low"`` or ``"custom"``.
    #[getter]
    fn condition(&self) -> String {
        self.inner.condition().to_string()
    }

    /// K_d, torque of the driver's arm per target angle, N.m/rad.
    #[getter]
    fn k_d(&self) -> f64 {
        self.inner.gains().k_d
    }

    /// K_hg, share of the guidance torque that the driver's arm works against.
    #[getter]
    fn k_hg(&self) -> f64 {
        self.inner.gains().k_hg
    }

    /// t_p, processing delay of the driver, s.
    #[getter]
    fn t_p_s(&self) -> f64 {
        self.inner.driver().t_p
    }

    /// When the guidance fails, s; None if it does not.
    #[getter]
    fn failure_time_s(&self) -> Option<f64> {
        self.inner.failure().at_s()
    }

    /// Name of the course.
    #[getter]
    fn course_name(&self) -> &str {
        self.inner.course().name()
    }

    /// Length of the course, m.
    #[getter]
    fn course_length_m(&self) -> f64 {
        self.inner.course().length_m()
    }

    /// Width of the lane, m.
    #[getter]
    fn lane_width_m(&self) -> f64 {
        self.inner.course().lane_width_m()
    }

    /// How long a run lasts that does not diverge, s.
    #[getter]
    fn duration_s(&self) -> f64 {
        self.inner.duration_s()
    }

    /// Root of all random numbers.
    #[getter]
    fn seed(&self) -> u64 {
        self.inner.seed()
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.inner == other.inner
    }

    fn __repr__(&self) -> String {
        let mut text = String::from("Scenario(");
        for (i, (name, value)) in self.fields.iter().enumerate() {
            let comma = if i == 0 { "" } else { ", " };
            // Writing to a string does not fail.
            let _ = write!(text, "{comma}{name}={value}");
        }
        text + ")"
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let py = slf.py();
        let class = py.get_type::<Self>();
        let fields = slf.get().to_dict(py)?;
        Ok((class.getattr("from_dict")?, PyTuple::new(py, [fields])?))
    }
}

/// A mapping as TOML; `place` names it in errors.
fn table(fields: &Bound<'_, PyDict>, place: &str) -> PyResult<Table> {
    let mut made = Table::new();
    for (key, value) in fields {
        let name: String = key.extract()?;
        let here = format!("{place}{name}");
        if !value.is_none() {
            made.insert(name, toml_value(&value, &here)?);
        }
    }
    Ok(made)
}

fn toml_value(value: &Bound<'_, PyAny>, place: &str) -> PyResult<Value> {
    if value.is_instance_of::<PyBool>() {
        return Ok(Value::Boolean(value.extract()?));
    }
    if value.is_instance_of::<PyInt>() {
        return Ok(Value::Integer(value.extract()?));
    }
    if value.is_instance_of::<PyFloat>() {
        return Ok(Value::Float(value.extract()?));
    }
    if value.is_instance_of::<PyString>() {
        return Ok(Value::String(value.extract()?));
    }
    if let Ok(fields) = value.cast::<PyDict>() {
        return Ok(Value::Table(table(fields, &format!("{place}."))?));
    }
    if value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>() {
        let items = value.try_iter()?.map(|item| toml_value(&item?, place));
        return Ok(Value::Array(items.collect::<PyResult<_>>()?));
    }
    // Numbers of NumPy, and paths.
    if let Ok(number) = value.extract::<i64>() {
        return Ok(Value::Integer(number));
    }
    if let Ok(number) = value.extract::<f64>() {
        return Ok(Value::Float(number));
    }
    if let Ok(path) = value.extract::<PathBuf>() {
        return Ok(Value::String(path.display().to_string()));
    }
    let kind = value.get_type().name()?;
    Err(errors::input(
        value.py(),
        format!("{place}: a {kind} is no number, no text and no table"),
    ))
}

fn dict<'py>(py: Python<'py>, fields: &Table) -> PyResult<Bound<'py, PyDict>> {
    let made = PyDict::new(py);
    for (name, value) in fields {
        made.set_item(name, python_value(py, value)?)?;
    }
    Ok(made)
}

fn python_value<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        Value::Boolean(value) => PyBool::new(py, *value).to_owned().into_any(),
        Value::Integer(value) => value.into_pyobject(py)?.into_any(),
        Value::Float(value) => value.into_pyobject(py)?.into_any(),
        Value::String(value) => value.into_pyobject(py)?.into_any(),
        Value::Table(fields) => dict(py, fields)?.into_any(),
        Value::Array(items) => {
            let items = items.iter().map(|item| python_value(py, item));
            PyList::new(py, items.collect::<PyResult<Vec<_>>>()?)?.into_any()
        }
        Value::Datetime(date) => date.to_string().into_pyobject(py)?.into_any(),
    })
}
