//! A recorded drive as an argument: the file, and what its channels and frames are.

use std::path::{Path, PathBuf};

use clap::Args;
use haptic_analysis::identify::{DriveLog, Layout, Mapping, Recording, open_mapped};
use haptic_batch::files::load_scenario;
use haptic_batch::identify::single_track;

use super::BadInput;

#[derive(Debug, Args)]
pub(super) struct RecordingArguments {
    /// Recorded drive: a table (.csv, .parquet, .mat, .mf4) with time_s, e_y_m, e_theta_rad (the driver's points),
    /// wheel_angle_rad, guidance_torque_nm, driver_torque_nm, or the bus (candump -L, .asc, .blf)
    #[arg(value_name = "LOG")]
    pub(super) log: PathBuf,
    /// What the frames of a recording of the bus mean, if not the built-in core/haptic.dbc
    #[arg(long, value_name = "FILE")]
    dbc: Option<PathBuf>,
    /// The bus of a recording of several, by its name there: an interface (can0) or the number of a channel (1)
    #[arg(long, value_name = "NAME")]
    bus: Option<String>,
    /// The vehicle of a recording of the bus, if not that of table 9: a scenario file whose [vehicle] says what it is. The
    /// bus does not carry the driver's far point; it is computed with this vehicle
    #[arg(long, value_name = "FILE.toml")]
    vehicle: Option<PathBuf>,
    /// A channel of another name or unit, such as wheel_angle_rad=SteeringAngle*0.0174533 or driver_torque_nm=TorsionBar;
    /// without a scale its unit is converted if the file says it; may be repeated
    #[arg(long, value_name = "NAME=CHANNEL[*SCALE]")]
    map: Vec<String>,
    /// Whose recording it is: openlka, openpilot, sadc, udacity, cognitive-driver-model, or a layout of one's own. Of a drive
    /// that an automation shares in turns, --manual takes the stretches by hand, otherwise the others are taken
    #[arg(long, value_name = "NAME|FILE.toml")]
    layout: Option<String>,
}

impl RecordingArguments {
    /// The log, of which these stretches will be used, and what a reader of the results has to know of it.
    pub(super) fn open(
        &self,
        manual: bool,
        stretches: &[(f64, f64)],
    ) -> Result<(DriveLog, Vec<String>), BadInput> {
        self.open_other(&self.log, manual, stretches)
    }

    /// The same of another file, understood in the same way.
    pub(super) fn open_other(
        &self,
        path: &Path,
        manual: bool,
        stretches: &[(f64, f64)],
    ) -> Result<(DriveLog, Vec<String>), BadInput> {
        let maps = self
            .map
            .iter()
            .map(|map| map.parse())
            .collect::<Result<Vec<Mapping>, _>>();
        let maps = maps.map_err(|e| format!("--{e}"))?;
        let layout = self.layout.as_deref().map(Layout::named).transpose()?;
        let vehicle = self.vehicle.as_deref().map(load_scenario).transpose()?;
        let recording = Recording {
            dbc: self.dbc.as_deref(),
            bus: self.bus.as_deref(),
            vehicle: vehicle.as_ref().map(single_track),
            manual,
            stretches,
        };
        Ok(open_mapped(path, layout.as_ref(), &maps, &recording)?)
    }
}
