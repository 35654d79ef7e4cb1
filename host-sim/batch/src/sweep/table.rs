//! The table of drives as CSV and, with the feature `parquet`, as Parquet: a row a drive. The whole sweep and the
//! scenario that it varies are in the file's metadata, so a row says with its file what was driven.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::PathBuf;

use super::{DesignPoint, Driven, Sweep, value};
use crate::Away;
use crate::entries::{Entry, EntryKind};

/// Both tables on their way. Without the feature `parquet` there is only the CSV file.
pub(super) struct Tables {
    version: String,
    csv: csv::Writer<BufWriter<File>>,
    #[cfg(feature = "parquet")]
    parquet: crate::parquet::Table,
}

impl Tables {
    /// At the places of the CSV and of the Parquet file.
    pub(super) fn create(sweep: &Sweep, version: &str, [csv, parquet]: &[PathBuf; 2]) -> io::Result<Self> {
        let columns = columns(sweep);
        let mut table = csv::Writer::from_writer(BufWriter::new(File::create(csv)?));
        table.write_record(columns.iter().map(|(name, _)| name))?;
        #[cfg(not(feature = "parquet"))]
        let _ = parquet;
        Ok(Self {
            version: version.into(),
            csv: table,
            #[cfg(feature = "parquet")]
            parquet: crate::parquet::Table::create(
                columns,
                &[("haptic.version", version), ("haptic.sweep", sweep.text())],
                File::create(parquet)?,
            )?,
        })
    }

    pub(super) fn row(&mut self, point: &DesignPoint, driven: &Driven) -> io::Result<()> {
        let entries = entries(point, driven, &self.version);
        self.csv.write_record(entries.iter().map(Entry::to_string))?;
        #[cfg(feature = "parquet")]
        self.parquet.row(entries)?;
        Ok(())
    }

    pub(super) fn finish(self) -> io::Result<()> {
        let file = self
            .csv
            .into_inner()
            .map_err(|e| io::Error::other(e.to_string()))?;
        synced(file)?;
        #[cfg(feature = "parquet")]
        self.parquet.finish()?;
        Ok(())
    }
}

/// Names of the columns, and what they hold. What is varied is a column of numbers if all its values are numbers.
fn columns(sweep: &Sweep) -> Vec<(String, EntryKind)> {
    use EntryKind::{Flag, Number, Text, Whole};
    let named = |name: &str, kind| (name.to_owned(), kind);
    let mut columns: Vec<_> = [("drive", Whole), ("seed", Whole), ("version", Text)]
        .map(|(name, kind)| named(name, kind))
        .into();
    for axis in sweep.axes() {
        for (i, column) in axis.columns.iter().enumerate() {
            let is_text = |row: &Vec<_>| value::number(&row[i]).is_none();
            let kind = if axis.rows().is_some_and(|rows| rows.iter().any(is_text)) {
                Text
            } else {
                Number
            };
            columns.push(named(
                if column.name == "seed" {
                    "vary.seed"
                } else {
                    &column.name
                },
                kind,
            ));
        }
    }
    columns.extend([named("diverged", Flag), named("end_m", Number)]);
    columns.extend(
        Away::NAMES
            .into_iter()
            .zip([Number, Text, Number, Number])
            .map(|(name, kind)| named(name, kind)),
    );
    columns.extend(sweep.metrics().iter().map(|metric| named(metric.name, Number)));
    columns
}

/// A drive in the order of the columns.
fn entries<'a>(point: &'a DesignPoint, driven: &Driven, version: &str) -> Vec<Entry<'a>> {
    let mut entries = vec![
        Entry::Whole(point.drive),
        Entry::Whole(point.seed),
        Entry::Text(version.into()),
    ];
    entries.extend(point.values.iter().map(Entry::Value));
    let Away {
        guidance_left_s,
        guidance_left_why,
        guidance_back_s,
        unguided_s,
    } = driven.away;
    entries.extend([
        Entry::Flag(driven.diverged),
        Entry::Number(Some(driven.end_m)),
        Entry::Number(guidance_left_s),
        Entry::Text(guidance_left_why.map_or(String::new(), |why| why.to_string())),
        Entry::Number(guidance_back_s),
        Entry::Number(unguided_s),
    ]);
    entries.extend(driven.metrics.iter().copied().map(Entry::Number));
    entries
}

fn synced(mut file: BufWriter<File>) -> io::Result<()> {
    file.flush()?;
    file.get_ref().sync_all()
}
