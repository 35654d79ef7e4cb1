//! What a study hands over: one self-contained HTML report, time series as CSV, results as JSON.
//!
//! A [`Table`] is one value, shown on a page and on a terminal ([`Table::to_text`]). A [`Report`] is a title and sections; a [`Section`] is a heading and blocks: text, tables, figures, events.
//! Everything in it is data and is escaped when it is written, so a name from a scenario file can hold any
//! character. The HTML loads nothing from anywhere. Files are written whole or not at all ([`write_file`]), and
//! those of a study together or not at all ([`FileSet`]).
//!
//! What to report is decided by studies, NOT here.

mod chart;
mod file_set;
mod files;
mod html;
mod metric_tables;
mod provenance;
mod text;
mod trace_csv;

pub use file_set::{FileSet, Owner};
pub use files::{WriteError, write_file, write_json};
pub use metric_tables::{definitions_table, metrics_table};
pub use provenance::{Provenance, Stamped};
pub use trace_csv::{SeriesFormat, write_trace};

use haptic_log::Event;

use crate::plot::{Figure, PlotError};

/// A document for a browser or a printer.
#[derive(Debug, Clone, Default)]
pub struct Report {
    /// Heading of the document and name of its window.
    pub title: String,
    /// One or two sentences below the title: what this is and what to keep in mind.
    pub summary: String,
    /// In reading order.
    pub sections: Vec<Section>,
    /// Which program made it, of what.
    pub provenance: Option<Provenance>,
}

/// A part of a report.
#[derive(Debug, Clone, Default)]
pub struct Section {
    /// Its heading.
    pub heading: String,
    /// Its content in reading order.
    pub blocks: Vec<Block>,
}

/// A piece of a section.
#[derive(Debug, Clone)]
pub enum Block {
    /// A paragraph.
    Text(String),
    /// A table.
    Table(Table),
    /// A drawing and what it shows.
    Figure {
        /// The drawing.
        figure: Figure,
        /// The sentence below it.
        caption: String,
    },
    /// What happened when.
    Events(Vec<Event>),
}

/// A table with one heading per column.
#[derive(Debug, Clone, Default)]
pub struct Table {
    /// The sentence above it; may be empty.
    pub caption: String,
    /// Headings; quantities with their unit.
    pub columns: Vec<String>,
    /// Each as long as `columns`.
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    /// A table of names and values.
    pub fn of_pairs<N: Into<String>, V: Into<String>>(
        columns: [&str; 2],
        pairs: impl IntoIterator<Item = (N, V)>,
    ) -> Self {
        let row = |(name, value): (N, V)| vec![Cell::Text(name.into()), Cell::Text(value.into())];
        Self {
            caption: String::new(),
            columns: columns.map(String::from).to_vec(),
            rows: pairs.into_iter().map(row).collect(),
        }
    }
}

/// A cell of a table.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Words, set at the left.
    Text(String),
    /// A number, set at the right; no value, or one that is not finite, is a dash.
    Number {
        /// The number.
        value: Option<f64>,
        /// Digits after the point.
        decimals: usize,
    },
    /// A number whose sign is what it says ([`signed`]).
    Signed(f64),
}

impl Cell {
    /// A number that there is.
    pub fn number(value: f64, decimals: usize) -> Self {
        Self::Number {
            value: Some(value),
            decimals,
        }
    }
}

/// A number with its sign, and with as many digits as tell it from zero: three behind the point at least.
pub fn signed(value: f64) -> String {
    let enough = (3..18).find(|decimals| value.abs() >= 0.5 * 0.1_f64.powi(*decimals));
    match enough {
        Some(decimals) => format!("{value:+.0$}", decimals as usize),
        None if value.is_nan() => "\u{2013}".into(),
        None => "0".into(),
    }
}

impl Report {
    /// The report as one HTML document.
    ///
    /// # Errors
    /// A figure cannot be drawn.
    pub fn to_html(&self) -> Result<String, PlotError> {
        html::document(self)
    }
}

#[cfg(test)]
mod tests;
