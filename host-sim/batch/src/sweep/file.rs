//! The form of a sweep file, and what its fields mean. docs/sweeps.md lists them.

use haptic_metrics::{DEFINITIONS, Definition};
use haptic_sim::input::{InputError, parse_toml};
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::axis::{Axis, Column, Kind};
use super::value::Distribution;
use super::vary::varied;
use crate::engine::{StudyError, refuse};
use crate::files::one;

/// How sampled fields are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Design {
    /// Each drive by itself.
    #[default]
    Random,
    /// Every field once in each of as many equal slices as there are samples.
    LatinHypercube,
    /// The low-discrepancy sequence of Sobol, shifted by the seed.
    Sobol,
    /// Two such samples and their mixtures (Saltelli et al. 2010), for Sobol indices.
    Saltelli,
}

impl std::fmt::Display for Design {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::Random => "random",
            Self::LatinHypercube => "latin-hypercube",
            Self::Sobol => "sobol",
            Self::Saltelli => "saltelli",
        })
    }
}

/// When to stop before all samples are driven.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stop {
    /// The metric whose mean has to be known.
    pub metric: String,
    /// Half the width of its confidence interval, in the metric's unit.
    pub half_width: f64,
    /// Confidence, 0 to 1.
    #[serde(default = "usual_confidence")]
    pub confidence: f64,
    /// Fewest samples.
    #[serde(default = "fewest_samples")]
    pub least: u64,
}

fn usual_confidence() -> f64 {
    0.95
}

fn fewest_samples() -> u64 {
    100
}

/// The whole file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SweepFile {
    /// A scenario file to vary; in its place `scenario`, or the defaults.
    pub base: Option<String>,
    pub scenario: Option<Table>,
    #[serde(default)]
    pub design: Design,
    pub samples: Option<u64>,
    #[serde(default = "one")]
    pub repeats: u64,
    #[serde(default = "one")]
    pub seed: u64,
    pub window: Option<[f64; 2]>,
    pub metrics: Option<Vec<String>>,
    pub judge: Option<String>,
    pub limit: Option<f64>,
    /// The varied field whose values are told apart.
    pub compare: Option<String>,
    pub stop: Option<Stop>,
    #[serde(default)]
    pub vary: Table,
    #[serde(default)]
    pub table: Vec<TableFile>,
    /// Courses by the name that scenarios give them, where the text needs no other file.
    #[serde(default)]
    pub courses: Table,
}

/// Fields that vary together: rows of a CSV file, or of the text.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TableFile {
    pub file: Option<String>,
    pub columns: Option<Vec<String>>,
    pub rows: Option<Vec<Vec<Value>>>,
    /// Whether a row is drawn for each sample; else each sample meets every row.
    #[serde(default)]
    pub choice: bool,
}

impl SweepFile {
    pub(super) fn parse(name: &str, text: &str) -> Result<Self, InputError> {
        parse_toml(name, text)
    }

    /// What varies, by name.
    pub(super) fn axes(&self, name: &str) -> Result<Vec<Axis>, InputError> {
        let mut axes = Vec::new();
        varied(name, "", &self.vary, &mut axes)?;
        axes.sort_by(|a, b| a.columns[0].name.cmp(&b.columns[0].name));
        for (i, table) in self.table.iter().enumerate() {
            axes.push(
                table
                    .axis(&format!("table {}", i + 1))
                    .map_err(|e| InputError::new(name, e))?,
            );
        }
        let columns = || axes.iter().flat_map(|a| &a.columns);
        for column in columns() {
            if let Some(over) = &column.over
                && !columns().any(|other| other.name == *over && other.name != column.name)
            {
                let message = format!("vary.{}: over = {over:?} is no other varied field", column.name);
                return Err(InputError::new(name, message));
            }
        }
        let mut paths: Vec<&String> = axes
            .iter()
            .flat_map(|a| &a.columns)
            .flat_map(|c| &c.paths)
            .collect();
        paths.sort_unstable();
        if let Some(twice) = paths.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(InputError::new(name, format!("{} is varied twice", twice[0])));
        }
        for path in paths {
            if ["road", "lane", "turn"].contains(&path.as_str()) {
                let cure = "vary `course` over files that hold the lanes (`host-sim course FILE --out DIR` writes them)";
                return Err(InputError::new(
                    name,
                    format!("vary.{path}: cannot be varied; {cure}"),
                ));
            }
        }
        Ok(axes)
    }

    /// The metrics of the table.
    pub(super) fn metrics(&self, name: &str) -> Result<Vec<&'static Definition>, InputError> {
        let Some(names) = &self.metrics else {
            // It takes another drive, without the failure.
            return Ok(DEFINITIONS
                .iter()
                .filter(|d| d.name != "time_to_recover_s")
                .collect());
        };
        if names.is_empty() {
            return Err(InputError::new(name, "metrics: at least one"));
        }
        names
            .iter()
            .map(|metric| definition(name, "metrics", metric))
            .collect()
    }
}

/// A metric by its name.
pub(super) fn definition(file: &str, field: &str, metric: &str) -> Result<&'static Definition, InputError> {
    DEFINITIONS.iter().find(|d| d.name == metric).ok_or_else(|| {
        let all: Vec<&str> = DEFINITIONS.iter().map(|d| d.name).collect();
        InputError::new(
            file,
            format!("{field}: no metric {metric:?}; there are {}", all.join(", ")),
        )
    })
}

impl TableFile {
    fn axis(&self, at: &str) -> Result<Axis, StudyError> {
        let (Some(columns), Some(rows)) = (&self.columns, &self.rows) else {
            return refuse(format!("{at}: needs file, or columns and rows"));
        };
        if columns.is_empty() || rows.is_empty() {
            return refuse(format!("{at}: at least one column and one row"));
        }
        if let Some(row) = rows.iter().position(|row| row.len() != columns.len()) {
            return refuse(format!(
                "{at}: row {} has {} values, the table {} columns",
                row + 1,
                rows[row].len(),
                columns.len()
            ));
        }
        let column = |name: &String| Column {
            name: name.clone(),
            paths: vec![name.clone()],
            times: 1.0,
            over: None,
        };
        let kind = if self.choice {
            Kind::Sampled(Distribution::Choice(rows.clone()))
        } else {
            Kind::Grid(rows.clone())
        };
        Ok(Axis {
            columns: columns.iter().map(column).collect(),
            kind,
        })
    }
}
