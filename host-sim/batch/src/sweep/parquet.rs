//! The table of a sweep's drives as Parquet.

use std::fs::File;
use std::io;

use super::axis::Kind as AxisKind;
use super::table::header;
use super::{DesignPoint, Driven, Sweep, value};
use crate::parquet::{Cell, ParquetColumn, Table};

pub(super) struct ParquetTable {
    table: Table,
    version: String,
    /// Which of what is varied is a column of texts.
    of_texts: Vec<bool>,
}

impl ParquetTable {
    pub(super) fn create(sweep: &Sweep, version: &str, file: File) -> io::Result<Self> {
        let of_texts = of_texts(sweep);
        let columns = header(sweep).into_iter().zip(columns(sweep, &of_texts));
        let metadata = [("haptic.version", version), ("haptic.sweep", sweep.text())];
        Ok(Self {
            table: Table::create(columns, &metadata, file)?,
            version: version.into(),
            of_texts,
        })
    }

    pub(super) fn row(&mut self, point: &DesignPoint, driven: &Driven) -> io::Result<()> {
        let numbers = [
            Cell::Whole(point.drive),
            Cell::Whole(point.seed),
            Cell::Text(self.version.clone()),
        ];
        let varied = point.values.iter().zip(&self.of_texts);
        let varied = varied.map(|(own, of_texts)| match of_texts {
            true => Cell::Text(value::text(own)),
            false => Cell::Number(value::number(own)),
        });
        let why = driven.away.guidance_left_why;
        let own = [
            Cell::Flag(driven.diverged),
            Cell::Number(Some(driven.end_m)),
            Cell::Number(driven.away.guidance_left_s),
            Cell::Text(why.map_or(String::new(), |why| why.to_string())),
            Cell::Number(driven.away.guidance_back_s),
            Cell::Number(driven.away.unguided_s),
        ];
        let metrics = driven.metrics.iter().map(|value| Cell::Number(*value));
        self.table
            .row(numbers.into_iter().chain(varied).chain(own).chain(metrics))
    }

    pub(super) fn finish(self) -> io::Result<()> {
        self.table.finish()
    }
}

/// What is varied is a column of numbers if all its values are numbers.
fn of_texts(sweep: &Sweep) -> Vec<bool> {
    let mut found = Vec::new();
    for axis in sweep.axes() {
        let rows = match &axis.kind {
            AxisKind::Grid(rows) => Some(rows.as_slice()),
            AxisKind::Sampled(distribution) => distribution.rows(),
        };
        for i in 0..axis.columns.len() {
            found.push(rows.is_some_and(|rows| rows.iter().any(|row| value::number(&row[i]).is_none())));
        }
    }
    found
}

/// Empty columns in the order of [`header`].
fn columns(sweep: &Sweep, of_texts: &[bool]) -> Vec<ParquetColumn> {
    let (number, text) = (
        || ParquetColumn::Number(Vec::new()),
        || ParquetColumn::Text(Vec::new()),
    );
    let whole = || ParquetColumn::Whole(Vec::new());
    let mut columns = vec![whole(), whole(), text()];
    columns.extend(of_texts.iter().map(|is| if *is { text() } else { number() }));
    columns.extend([ParquetColumn::Flag(Vec::new()), number()]);
    columns.extend([number(), text(), number(), number()]);
    columns.extend(sweep.metrics().iter().map(|_| number()));
    columns
}
