//! What a study hands over: one self-contained HTML report, time series as CSV, results as JSON.
//!
//! A [`Report`] is one value, drawn as a page ([`Report::to_html`]) and for a terminal ([`Report::to_text`]). It has a title and sections; a
//! [`Section`] is a heading and blocks: text, tables, figures, events. A terminal shows no figures. Everything in it is data and is escaped when it is written, so a name from a scenario file can hold any
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
pub use files::{WriteError, write_bytes, write_file, write_json};
pub use metric_tables::{definitions_table, metrics_table};
pub use provenance::{Provenance, Stamped};
pub use trace_csv::{SeriesFormat, write_trace};

use std::collections::BTreeMap;

use haptic_log::Event;

use crate::plot::{Figure, PlotError};

/// A document for a browser, a printer or a terminal.
#[derive(Debug, Clone, Default)]
pub struct Report {
    /// Heading of the document and name of its window.
    pub title: String,
    /// One or two sentences below the title: what this is and what to keep in mind.
    pub summary: String,
    /// What a reader of the results has to know: a page shows it behind the summary, a terminal beside the results.
    pub notes: Vec<String>,
    /// In reading order.
    pub sections: Vec<Section>,
    /// Which program made it, of what.
    pub provenance: Provenance,
}

/// A part of a report.
#[derive(Debug, Clone, Default)]
pub struct Section {
    /// Its heading.
    pub heading: String,
    /// Its content in reading order.
    pub blocks: Vec<Block>,
}

impl Section {
    /// A heading and what stands below it.
    pub fn new(heading: impl Into<String>, blocks: Vec<Block>) -> Self {
        Self {
            heading: heading.into(),
            blocks,
        }
    }

    /// A heading and one table.
    pub fn of_table(heading: impl Into<String>, table: Table) -> Self {
        Self::new(heading, vec![Block::Table(table)])
    }
}

/// A piece of a section.
#[derive(Debug, Clone)]
pub enum Block {
    /// A paragraph.
    Text(String),
    /// A table; without rows it is not shown.
    Table(Table),
    /// A drawing and what it shows.
    Figure {
        /// Its files are `NAME.svg`, `NAME.txt` with the caption, and `NAME.png` if one is asked for.
        name: String,
        /// The drawing.
        figure: Figure,
        /// The sentence below it.
        caption: String,
    },
    /// What happened when.
    Events(Vec<Event>),
    /// What a terminal leaves out.
    OnPage(Box<Block>),
    /// What a page leaves out.
    OnTerminal(Box<Block>),
}

impl Block {
    /// A drawing with no more points than can be seen, the name of its files, and what it shows.
    pub fn figure(name: impl Into<String>, figure: Figure, caption: impl Into<String>) -> Self {
        Self::Figure {
            name: name.into(),
            figure: figure.thinned(),
            caption: caption.into(),
        }
    }

    /// Whether a page shows it.
    fn is_on_page(&self) -> bool {
        match self {
            Self::Table(table) => !table.rows.is_empty(),
            Self::OnTerminal(_) => false,
            Self::OnPage(block) => block.is_on_page(),
            Self::Text(_) | Self::Figure { .. } | Self::Events(_) => true,
        }
    }

    /// The block for a page, which a terminal leaves out.
    pub fn on_page(self) -> Self {
        Self::OnPage(Box::new(self))
    }

    /// The block for a terminal, which a page leaves out.
    pub fn on_terminal(self) -> Self {
        Self::OnTerminal(Box::new(self))
    }
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
    /// A table with its caption, headings and rows.
    pub fn new<C: Into<String>>(
        caption: impl Into<String>,
        columns: impl IntoIterator<Item = C>,
        rows: impl IntoIterator<Item = Vec<Cell>>,
    ) -> Self {
        Self {
            caption: caption.into(),
            columns: columns.into_iter().map(Into::into).collect(),
            rows: rows.into_iter().collect(),
        }
    }

    /// A table whose rows name the heading of each cell, all in the same order. Without a row it has no headings, and is not shown.
    pub fn of_rows<C: Into<String>, R: IntoIterator<Item = (C, Cell)>>(
        caption: impl Into<String>,
        rows: impl IntoIterator<Item = R>,
    ) -> Self {
        let mut table = Self::new::<String>(caption, [], []);
        for row in rows {
            let (columns, cells): (Vec<_>, _) = row.into_iter().unzip();
            table.columns = columns.into_iter().map(Into::into).collect();
            table.rows.push(cells);
        }
        table
    }

    /// A table of words.
    pub fn of_texts<T: Into<String>, const N: usize>(
        caption: &str,
        columns: [&str; N],
        rows: impl IntoIterator<Item = [T; N]>,
    ) -> Self {
        let cells = |row: [T; N]| row.map(Cell::text).to_vec();
        Self::new(caption, columns, rows.into_iter().map(cells))
    }

    /// A table of names and values.
    pub fn of_pairs<N: Into<String>, V: Into<String>>(
        columns: [&str; 2],
        pairs: impl IntoIterator<Item = (N, V)>,
    ) -> Self {
        let row = |(name, value): (N, V)| vec![Cell::text(name), Cell::text(value)];
        Self::new("", columns, pairs.into_iter().map(row))
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
    /// Words.
    pub fn text(text: impl Into<String>) -> Self {
        Self::Text(text.into())
    }

    /// A number, if there is one.
    pub fn number(value: impl Into<Option<f64>>, decimals: usize) -> Self {
        Self::Number {
            value: value.into(),
            decimals,
        }
    }

    /// How many of something there are.
    pub fn count(things: impl TryInto<u64>) -> Self {
        Self::number(things.try_into().ok().map(|things| things as f64), 0)
    }

    /// The ends of an interval, if there is one.
    pub fn ends(interval: impl Into<Option<[f64; 2]>>, decimals: usize) -> [Self; 2] {
        let ends = interval.into().map_or([None; 2], |ends| ends.map(Some));
        ends.map(|end| Self::number(end, decimals))
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

/// A figure as it is drawn.
pub(crate) struct Drawn<'a> {
    pub(crate) name: &'a str,
    pub(crate) caption: &'a str,
    pub(crate) svg: String,
}

/// The SVGs of figures by their names, one for each page of paper.
type Drawings<'a> = BTreeMap<&'a str, Vec<String>>;

impl Report {
    /// A report of these sections, without notes.
    pub fn new(title: impl Into<String>, summary: impl Into<String>, sections: Vec<Section>) -> Self {
        Self {
            title: title.into(),
            summary: summary.into(),
            sections,
            ..Self::default()
        }
    }

    /// The report with what a reader of the results has to know.
    pub fn with_notes(self, notes: Vec<String>) -> Self {
        Self { notes, ..self }
    }

    /// The report as one HTML document.
    ///
    /// # Errors
    /// A figure cannot be drawn.
    pub fn to_html(&self) -> Result<String, PlotError> {
        html::document(self, &Drawings::new())
    }

    /// The SVG of each figure with its name and caption, and the page that shows them: each is drawn once.
    pub(crate) fn drawn(&self) -> Result<(Vec<Drawn<'_>>, String), PlotError> {
        let mut drawings = Drawings::new();
        let mut all = Vec::new();
        for block in self.sections.iter().flat_map(|section| &section.blocks) {
            if let Block::Figure {
                name,
                figure,
                caption,
            } = block
            {
                let pages = html::drawn(figure)?;
                let svg = match pages.as_slice() {
                    [one] => one.clone(),
                    _ => figure.to_svg()?,
                };
                drawings.insert(name, pages);
                all.push(Drawn { name, caption, svg });
            }
        }
        let page = html::document(self, &drawings)?;
        Ok((all, page))
    }

    /// Results with where they come from.
    pub fn stamp<'a, T>(&self, results: &'a T) -> Stamped<'a, T> {
        self.provenance.clone().stamp(results)
    }
}

#[cfg(test)]
mod tests;
