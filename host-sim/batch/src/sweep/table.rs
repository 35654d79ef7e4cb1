//! The table of drives as CSV and, with the feature `parquet`, as Parquet: a row a drive. The whole sweep and the
//! scenario that it varies are in the file's metadata, so a row says with its file what was driven.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::{DesignPoint, Driven, Sweep, value};
use crate::Away;

/// Both tables on their way. Without the feature `parquet` there is only the CSV file.
pub(super) struct Tables {
    version: String,
    csv: csv::Writer<BufWriter<File>>,
    #[cfg(feature = "parquet")]
    parquet: super::parquet::ParquetTable,
}

impl Tables {
    /// At the places of the CSV and of the Parquet file.
    pub(super) fn create(sweep: &Sweep, version: &str, [csv, parquet]: &[PathBuf; 2]) -> io::Result<Self> {
        let mut table = csv::WriterBuilder::new().from_writer(BufWriter::new(create(csv)?));
        table.write_record(header(sweep))?;
        #[cfg(not(feature = "parquet"))]
        let _ = parquet;
        Ok(Self {
            version: version.into(),
            csv: table,
            #[cfg(feature = "parquet")]
            parquet: super::parquet::ParquetTable::create(sweep, version, create(parquet)?)?,
        })
    }

    pub(super) fn row(&mut self, point: &DesignPoint, driven: &Driven) -> io::Result<()> {
        let numbers = [
            point.drive.to_string(),
            point.seed.to_string(),
            self.version.clone(),
        ];
        let varied = point.values.iter().map(value::text);
        let own = [u8::from(driven.diverged).to_string(), driven.end_m.to_string()];
        let own = own.into_iter().chain(driven.away.texts());
        let metrics = driven
            .metrics
            .iter()
            .map(|value| value.map_or(String::new(), |value| value.to_string()));
        self.csv
            .write_record(numbers.into_iter().chain(varied).chain(own).chain(metrics))?;
        #[cfg(feature = "parquet")]
        self.parquet.row(point, driven)?;
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

/// Names of the columns.
pub(super) fn header(sweep: &Sweep) -> Vec<String> {
    let varied = sweep
        .columns()
        .map(|name| if name == "seed" { "vary.seed" } else { name });
    let names = ["drive", "seed", "version"]
        .into_iter()
        .chain(varied)
        .chain(["diverged", "end_m"])
        .chain(Away::NAMES);
    names
        .chain(sweep.metrics().iter().map(|d| d.name))
        .map(String::from)
        .collect()
}

fn create(path: &Path) -> io::Result<File> {
    File::create(path)
}

pub(super) fn synced(mut file: BufWriter<File>) -> io::Result<()> {
    file.flush()?;
    file.get_ref().sync_all()
}
