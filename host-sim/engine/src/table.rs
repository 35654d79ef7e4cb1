//! A table of rows as CSV and, with the feature `parquet`, as Parquet, of one list of columns.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::PathBuf;

use super::{Entry, EntryKind};

/// Both tables on their way. Without the feature `parquet` there is only the CSV file.
pub struct Tables {
    csv: csv::Writer<BufWriter<File>>,
    #[cfg(feature = "parquet")]
    parquet: super::parquet::Table,
}

impl Tables {
    /// Begins both with their columns, at the places of the CSV and of the Parquet file. The Parquet file holds the metadata too.
    ///
    /// # Errors
    /// What the disk says.
    pub fn create(
        columns: Vec<(String, EntryKind)>,
        metadata: &[(&str, &str)],
        [csv, parquet]: &[PathBuf; 2],
    ) -> io::Result<Self> {
        let mut table = csv::Writer::from_writer(BufWriter::new(File::create(csv)?));
        table.write_record(columns.iter().map(|(name, _)| name))?;
        #[cfg(not(feature = "parquet"))]
        let _ = (metadata, parquet);
        Ok(Self {
            csv: table,
            #[cfg(feature = "parquet")]
            parquet: super::parquet::Table::create(columns, metadata, File::create(parquet)?)?,
        })
    }

    /// A row, with an entry of its kind for each column.
    ///
    /// # Errors
    /// What the disk says.
    pub fn row(&mut self, entries: Vec<Entry<'_>>) -> io::Result<()> {
        self.csv.write_record(entries.iter().map(Entry::to_string))?;
        #[cfg(feature = "parquet")]
        self.parquet.row(entries)?;
        Ok(())
    }

    /// Writes what is left, down to the disk.
    ///
    /// # Errors
    /// What the disk says.
    pub fn finish(self) -> io::Result<()> {
        let mut file = self
            .csv
            .into_inner()
            .map_err(|e| io::Error::other(e.to_string()))?;
        file.flush()?;
        file.get_ref().sync_all()?;
        #[cfg(feature = "parquet")]
        self.parquet.finish()?;
        Ok(())
    }
}
