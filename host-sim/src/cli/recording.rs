//! A recorded drive as an argument: the file, and what its channels and frames are.

use std::path::PathBuf;

use clap::Args;
use haptic_analysis::identify::{DriveLog, LogError, Mapping, open_mapped};

#[derive(Debug, Args)]
pub(super) struct RecordingArguments {
    /// Recorded drive: a table (.csv, .parquet, .mat, .mf4) with time_s, e_y_m, e_theta_rad (the driver's points),
    /// wheel_angle_rad, guidance_torque_nm, driver_torque_nm, or the bus (candump -L, .asc, .blf)
    #[arg(value_name = "LOG")]
    pub(super) log: PathBuf,
    /// What the frames of a recording of the bus mean, if not the built-in core/haptic.dbc
    #[arg(long, value_name = "FILE")]
    dbc: Option<PathBuf>,
    /// A channel of another name or unit, such as wheel_angle_rad=SteeringAngle*0.0174533 or driver_torque_nm=TorsionBar;
    /// without a scale its unit is converted if the file says it; may be repeated
    #[arg(long, value_name = "NAME=CHANNEL[*SCALE]")]
    map: Vec<String>,
}

impl RecordingArguments {
    /// The log, and what a reader of the results has to know of it.
    pub(super) fn open(&self, manual: bool) -> Result<(DriveLog, Vec<String>), LogError> {
        let maps = self
            .map
            .iter()
            .map(|map| map.parse())
            .collect::<Result<Vec<Mapping>, _>>()?;
        open_mapped(&self.log, self.dbc.as_deref(), &maps, manual)
    }
}
