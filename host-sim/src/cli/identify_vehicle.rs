//! `host-sim identify-vehicle LOG`.

use std::path::PathBuf;

use clap::Args;
use haptic_analysis::identify::Options;
use haptic_batch::vehicle::{identify, scenario_file};
use haptic_log::formats::Contents;
use haptic_report::document::write_bytes;
use haptic_report::studies::vehicle::report;
use haptic_vehicle::Known;

use super::recording::ReadingArguments;
use super::results::{LevelArgument, ResultArguments};
use super::{BadInput, Outcome, in_file};

const OUT: &str =
    "Directory for the results, a report and vehicle.toml, a scenario with this vehicle; default: no files";

#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.help(OUT)))]
pub(super) struct Arguments {
    /// Recorded drive: a table (.csv, .parquet, .mat, .mf4) with time_s, wheel_angle_rad, yaw_rate_rad_per_s, speed_m_per_s and, for the
    /// column, driver_torque_nm and guidance_torque_nm; or the bus (candump -L, .asc, .blf)
    #[arg(value_name = "LOG")]
    log: PathBuf,
    /// Mass as it was driven, kg (100 to 50000)
    #[arg(long, value_name = "KG")]
    mass: f64,
    /// Distance of the axles, m (0.5 to 15)
    #[arg(long, value_name = "M")]
    wheelbase: f64,
    /// Centre of gravity to the front axle, m, if it is known: wheelbase * load of the rear axle / mass
    #[arg(long, value_name = "M")]
    l_f: Option<f64>,
    /// Yaw inertia, kg.m2, if it is known: with it the tyres can be told
    #[arg(long, value_name = "KG_M2", requires = "l_f")]
    yaw_inertia: Option<f64>,
    /// Angle of the steering wheel per angle of the front wheels, if it is known (5 to 50)
    #[arg(long, value_name = "RATIO")]
    steering_ratio: Option<f64>,
    #[command(flatten)]
    reading: ReadingArguments,
    #[command(flatten)]
    level: LevelArgument,
    #[command(flatten)]
    results: ResultArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let known = Known {
        l_f_m: arguments.l_f,
        yaw_inertia_kg_m2: arguments.yaw_inertia,
        steering_ratio: arguments.steering_ratio,
        ..Known::new(arguments.mass, arguments.wheelbase)?
    };
    let known = known.checked()?;
    let path = &arguments.log;
    let output = arguments.results.begin("identify-vehicle")?;
    let recording = match arguments.reading.read(path)? {
        Contents::Channels(recording) => recording,
        Contents::Frames(log) => arguments.reading.channels(path, &log)?,
    };
    let bridge_s = arguments
        .reading
        .max_gap()?
        .unwrap_or(Options::default().bridge_s);
    let found = identify(&recording, &known, bridge_s, arguments.level.level).map_err(in_file(path))?;
    let file = scenario_file(&found.identification, &path.display().to_string());
    if let (Some(place), Some(text)) = (output.place(), file.map_err(in_file(path))?) {
        write_bytes(&place.join("vehicle.toml"), text)?;
    }
    let holds = found.identification.checks.iter().all(|check| check.holds);
    output.show(&report(&found, &path.display().to_string()), &found, holds)
}
