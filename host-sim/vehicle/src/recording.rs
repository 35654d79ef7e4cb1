//! The columns of a vehicle out of a recording, on one even grid.

use haptic_log::recording::{Group, Recording, RecordingError, Series};

use super::VehicleColumns;

/// Most rows a second that are used: the column moves more slowly.
const MOST_RATE_HZ: f64 = 100.0;

/// A column's name, and its name and factor on the project's own bus.
type Name = (&'static str, &'static str, f64);

const ANGLE: Name = (
    "wheel_angle_rad",
    "Column_WheelAngle",
    std::f64::consts::PI / 180.0,
);
const YAW_RATE: Name = ("yaw_rate_rad_per_s", "Vehicle_YawRate", 1.0);
const SPEED: Name = ("speed_m_per_s", "Vehicle_Speed1", 1.0);
const DRIVER: Name = ("driver_torque_nm", "Column_DriverTorque", 1.0);
const MOTOR: Name = ("guidance_torque_nm", "Column_MotorTorque", 1.0);

fn find(recording: &Recording, (name, on_bus, factor): Name) -> Result<(&Group, Series), RecordingError> {
    let own = recording.find(name);
    match (own, recording.find(on_bus)) {
        (Err(_), Ok((group, series))) => {
            let values = series.values.iter().map(|value| factor * value).collect();
            Ok((
                group,
                Series {
                    values,
                    ..series.clone()
                },
            ))
        }
        (own, _) => own.map(|(group, series)| (group, series.clone())),
    }
}

/// Why a recording has no vehicle's columns.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ColumnsError {
    /// A column is missing.
    #[error(
        "{0}; wanted are time_s, wheel_angle_rad, yaw_rate_rad_per_s (or driven_curvature_1pm) and speed_m_per_s, and for the column driver_torque_nm and guidance_torque_nm: --map names others"
    )]
    Missing(String),
    /// The columns do not go on one grid.
    #[error(transparent)]
    Grid(#[from] RecordingError),
}

impl VehicleColumns {
    /// The columns of a recording at its wheel angle's rate, 100 Hz at most. Pauses of up to `bridge_s` are bridged by a straight line.
    ///
    /// # Errors
    /// A column that is missing; columns that share no time.
    pub fn of(recording: &Recording, bridge_s: f64) -> Result<Self, ColumnsError> {
        let missing = |error: RecordingError| ColumnsError::Missing(error.to_string());
        let angle = find(recording, ANGLE).map_err(missing)?;
        let rate_hz = angle.0.sample_rate_hz().min(MOST_RATE_HZ);
        let (turn, is_curvature) = match (find(recording, YAW_RATE), recording.find("driven_curvature_1pm")) {
            (Ok(turn), _) => (turn, false),
            (Err(_), Ok((group, curvature))) => ((group, curvature.clone()), true),
            (Err(error), _) => return Err(missing(error)),
        };
        let wanted = [
            Some(angle),
            Some(turn),
            Some(find(recording, SPEED).map_err(missing)?),
            find(recording, DRIVER).ok(),
            find(recording, MOTOR).ok(),
        ];
        let found: Vec<bool> = wanted.iter().map(Option::is_some).collect();
        let alone = |(group, series): (&Group, Series)| Group::new(group.time_s.clone(), vec![series]);
        let groups: Vec<Group> = wanted.into_iter().flatten().map(alone).collect();
        let even = Recording::from(groups).resampled(rate_hz, Some(bridge_s))?;
        let mut columns = even.channels.into_iter().map(|series| series.values);
        let mut next = |is_there: bool| if is_there { columns.next() } else { None };
        let [angle, turn, speed, driver, guidance] = [0, 1, 2, 3, 4].map(|k| next(found[k]));
        let (turn, speed) = (turn.unwrap_or_default(), speed.unwrap_or_default());
        let yaw_rate = |(turn, v): (&f64, &f64)| if is_curvature { turn * v } else { *turn };
        Ok(Self {
            time_s: even.time_s,
            wheel_angle_rad: angle.unwrap_or_default(),
            yaw_rate_rad_per_s: turn.iter().zip(&speed).map(yaw_rate).collect(),
            speed_m_per_s: speed,
            driver_torque_nm: driver,
            guidance_torque_nm: guidance,
        })
    }
}
