//! Sweeps: any field of a scenario as a list, a range or a distribution; each drive a row of a table.
//!
//! A [`Sweep`] is a sweep file with all that it names. Its drives are numbered from 0, and every one follows from its
//! number alone: so they may be driven by any thread, on any machine, again after a kill, and give the same table. They are driven
//! in chunks of a fixed number ([`Sweep::run_chunk`]). A [`Store`] keeps finished chunks in a directory, and
//! [`Store::finish`] makes the table and the [`Summary`] of them, in order. No trace is kept longer than its drive.
//!
//! - [`Sweep::load`], [`Sweep::from_text`]: the file, checked.
//! - [`run_all`]: all chunks of a shard, on threads.
//! - [`Store`]: chunks on a disk, resumed, merged.
//! - [`Summary`]: distributions, what matters most, the worst drives.
//!
//! Not here: the order of clusters and queues (whoever calls `run_chunk`), pictures.

mod axis;
mod chunk;
mod design;
mod drive;
mod effects;
mod file;
mod groups;
mod point;
mod resolve;
mod run;
mod saltelli;
mod store;
mod summary;
mod table;
#[cfg(test)]
mod tests;
mod units;
mod value;
mod vary;
mod vectorised;

pub use crate::engine::StoreError;
pub use chunk::Chunk;
pub use drive::Driven;
pub use effects::{Compared, Effect, Level};
pub use file::{Design, Stop};
pub use groups::Drives;
pub use run::{Shard, run_all};
pub use saltelli::SobolIndex;
pub use store::Store;
pub use summary::{Distribution, Summary, Worst};

use std::collections::BTreeMap;
use std::path::Path;

use haptic_metrics::{Definition, Window};
use haptic_sim::input::{InputError, in_range};
use haptic_sim::models::road::Course;
use haptic_sim::scenario::Scenario;
use toml::{Table, Value};

use crate::engine::{StudyError, refuse};
use axis::{Axis, Kind};
use design::Places;
use file::{SweepFile, definition};

/// Most drives of a sweep.
pub const MOST_DRIVES: u64 = 1_000_000_000;
/// Most samples: Sobol's sequence has 32 bits.
const MOST_SAMPLES: u64 = 100_000_000;
/// Most drives of a chunk: what a kill costs a thread.
const MOST_OF_A_CHUNK: u64 = 256;

/// A sweep, checked.
#[derive(Debug, Clone)]
pub struct Sweep {
    /// The file as errors name it.
    name: String,
    /// All of it, without another file.
    text: String,
    scenario: Table,
    courses: BTreeMap<String, Course>,
    grid: Vec<Axis>,
    sampled: Vec<Axis>,
    design: Design,
    places: Places,
    samples: u64,
    repeats: u64,
    seed: u64,
    window: Option<Window>,
    metrics: Vec<&'static Definition>,
    judge: &'static Definition,
    limit: Option<f64>,
    /// The axis whose values are told apart, among all.
    compare: Option<usize>,
    stop: Option<Stop>,
}

/// What is varied in a drive.
#[derive(Debug, Clone, PartialEq)]
pub struct DesignPoint {
    /// Number of the drive, from 0.
    pub drive: u64,
    /// Its scenario's seed.
    pub seed: u64,
    /// One value for each of [`Sweep::columns`].
    pub values: Vec<Value>,
    /// Number of the sample that it belongs to.
    pub sample: u64,
    /// Place within Saltelli's design.
    role: u64,
    /// For each axis, grid first: its row, or the sixteenth of its distribution.
    levels: Vec<u32>,
}

/// Most values of a field that are told apart: a figure has as many styles.
const MOST_COMPARED: usize = 7;
/// Slices of a distribution in a summary.
const SLICES: f64 = 16.0;

impl Sweep {
    /// Reads a sweep file with all that it names.
    ///
    /// # Errors
    /// The file, the field, its value and its range.
    pub fn load(path: &Path) -> Result<Self, InputError> {
        Self::from_text(&path.display().to_string(), &resolve::read(path)?)
    }

    /// A sweep from a text that names no other file, as [`Sweep::text`] is one; `name` stands in errors.
    ///
    /// # Errors
    /// As [`Sweep::load`].
    pub fn from_text(name: &str, text: &str) -> Result<Self, InputError> {
        let file = SweepFile::parse(name, text)?;
        let bad = |message: String| InputError::new(name, message);
        if file.base.is_some() || file.table.iter().any(|table| table.file.is_some()) {
            return Err(bad("this text has to hold what it names".into()));
        }
        let (grid, sampled): (Vec<Axis>, Vec<Axis>) = file
            .axes(name)?
            .into_iter()
            .partition(|axis| matches!(axis.kind, Kind::Grid(_)));
        let samples = match (file.samples, sampled.is_empty()) {
            (Some(samples), false) => samples,
            (None, true) => 1,
            (Some(_), true) => {
                return Err(bad(
                    "samples: nothing is sampled; repeats drives each point again".into(),
                ));
            }
            (None, false) => return Err(bad("samples: how many are drawn".into())),
        };
        let whole = |field: &str, value: u64, most: u64| {
            in_range(field, value as f64, 1.0..=most as f64, "").map_err(|e| bad(e.to_string()))
        };
        whole("samples", samples, MOST_SAMPLES)?;
        whole("repeats", file.repeats, MOST_SAMPLES)?;
        let names: Vec<String> = sampled.iter().map(|axis| axis.columns[0].name.clone()).collect();
        let places = Places::new(file.design, samples, file.seed, &names).map_err(|e| bad(e.to_string()))?;
        let metrics = file.metrics(name)?;
        let judge = match &file.judge {
            Some(judge) => definition(name, "judge", judge)?,
            None => metrics
                .iter()
                .find(|d| d.name == "peak_lateral_error_m")
                .copied()
                .unwrap_or(metrics[0]),
        };
        if !metrics.iter().any(|d| d.name == judge.name) {
            return Err(bad(format!("judge = {:?} is not among the metrics", judge.name)));
        }
        let mut sweep = Self {
            name: name.into(),
            text: text.into(),
            courses: courses(name, &file.courses)?,
            scenario: file.scenario.unwrap_or_default(),
            grid,
            sampled,
            design: file.design,
            places,
            samples,
            repeats: file.repeats,
            seed: file.seed,
            window: file.window.map(|[from_m, to_m]| Window { from_m, to_m }),
            metrics,
            judge,
            limit: file.limit,
            compare: None,
            stop: file.stop,
        };
        if let Some(field) = &file.compare {
            sweep.compare = Some(sweep.compared(field).map_err(|e| bad(e.to_string()))?);
        }
        sweep.check()?;
        Ok(sweep)
    }

    /// The whole sweep as a text that names no other file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Drives, if none is saved by an early stop.
    pub fn drives(&self) -> u64 {
        let grid = self.grid_points().saturating_mul(self.repeats);
        grid.saturating_mul(self.samples)
            .saturating_mul(self.places.roles())
    }

    /// Drives of each chunk but the last.
    pub fn drives_of_a_chunk(&self) -> u64 {
        (self.drives() / 64).clamp(8, MOST_OF_A_CHUNK)
    }

    /// Chunks, numbered from 0.
    pub fn chunks(&self) -> u64 {
        self.drives().div_ceil(self.drives_of_a_chunk())
    }

    /// The drives of a chunk.
    pub fn drives_of(&self, chunk: u64) -> std::ops::Range<u64> {
        let size = self.drives_of_a_chunk();
        let from = (chunk * size).min(self.drives());
        from..(from + size).min(self.drives())
    }

    /// Names of what varies, in order of their columns.
    pub fn columns(&self) -> impl Iterator<Item = &str> {
        self.axes()
            .flat_map(|axis| &axis.columns)
            .map(|column| column.name.as_str())
    }

    /// The metrics of the table, in order of their columns.
    pub fn metrics(&self) -> &[&'static Definition] {
        &self.metrics
    }

    /// The metric by which drives are called bad.
    pub fn judge(&self) -> &'static Definition {
        self.judge
    }

    /// How samples are drawn.
    pub fn design(&self) -> Design {
        self.design
    }

    /// Number of samples.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// The axis of a field whose values are told apart.
    fn compared(&self, field: &str) -> Result<usize, StudyError> {
        let is_it = |axis: &Axis| axis.columns.iter().any(|column| column.name == field);
        let Some(place) = self.axes().position(is_it) else {
            let all: Vec<&str> = self.columns().collect();
            return refuse(format!(
                "compare = {field:?} is not varied; varied are {}",
                all.join(", ")
            ));
        };
        match self.axes().nth(place).and_then(Axis::rows).map(<[_]>::len) {
            Some(2..=MOST_COMPARED) => Ok(place),
            Some(rows) => refuse(format!(
                "compare = {field:?}: has {rows} values, 2 to {MOST_COMPARED} can be told apart"
            )),
            None => refuse(format!(
                "compare = {field:?}: is drawn from a distribution; only the values of a list or a choice can be told apart"
            )),
        }
    }

    fn axes(&self) -> impl Iterator<Item = &Axis> {
        self.grid.iter().chain(&self.sampled)
    }

    fn grid_points(&self) -> u64 {
        let rows = self.grid.iter().map(|axis| match &axis.kind {
            Kind::Grid(rows) => rows.len() as u64,
            Kind::Sampled(_) => 1,
        });
        rows.fold(1, u64::saturating_mul)
    }

    /// Drives of one sample: they follow each other.
    fn drives_of_a_sample(&self) -> u64 {
        self.grid_points() * self.repeats * self.places.roles()
    }
}

/// The courses that stand in the text.
fn courses(name: &str, table: &Table) -> Result<BTreeMap<String, Course>, InputError> {
    let course = |(course, value): (&String, &Value)| {
        let mut scenario = Table::new();
        scenario.insert("course".into(), value.clone());
        // Slow, so that the shortest course is long enough.
        scenario.insert("speed_m_per_s".into(), Value::Integer(6));
        let text = toml::to_string(&scenario).map_err(|e| InputError::new(name, e))?;
        let scenario: Scenario = Scenario::from_toml(name, &text, |other, _| {
            Err(InputError::new(
                name,
                format!("courses.{course}: names another course, {other:?}"),
            ))
        })?;
        Ok((course.clone(), scenario.course().clone()))
    };
    table.iter().map(course).collect()
}
