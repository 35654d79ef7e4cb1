//! A log as a CSV file, in the columns that are read.

use std::io::{self, Write};

use super::{COLUMNS, DriveLog};

impl DriveLog {
    /// Writes the log: times to the microsecond, the others to the nano of their units.
    ///
    /// # Errors
    /// What `out` says.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}", COLUMNS.join(","))?;
        for k in 0..self.len() {
            write!(out, "{:.6}", self.time_s(k))?;
            for column in [
                &self.e_y_m,
                &self.e_theta_rad,
                &self.wheel_angle_rad,
                &self.guidance_torque_nm,
                &self.driver_torque_nm,
            ] {
                write!(out, ",{:.9}", column[k])?;
            }
            writeln!(out)?;
        }
        Ok(())
    }
}
