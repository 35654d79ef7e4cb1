//! A log as a CSV file, in the columns that are read.

use std::io::{self, Write};

use haptic_log::table::TableWriter;

use super::{COLUMNS, DriveLog};

impl DriveLog {
    /// Writes the log: times to the microsecond, the others to the nano of their units.
    ///
    /// # Errors
    /// What `out` says.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut table = TableWriter::new(out, COLUMNS)?;
        for k in 0..self.len() {
            let time = format!("{:.6}", self.time_s(k));
            table
                .row(std::iter::once(time).chain(self.signals().map(|signal| format!("{:.9}", signal[k]))))?;
        }
        table.finish()
    }
}
