//! A recording of a layout, row by row, with what the ECU would have seen.

use haptic_analysis::identify::{Layout, Mapping};
use haptic_log::formats::Format;

/// The guidance's near and far point ahead, s (table 8).
const POINTS_S: [f64; 2] = [0.3, 0.7];
/// Slower rows are no drive, m/s.
const LEAST_M_PER_S: f64 = 8.0;
/// A yaw angle that goes further within a row is no vehicle's, rad: the recording lies between pi and -pi there.
const YAW_STEP_RAD: f64 = 0.1;

/// A recording, row by row.
pub(super) struct Rows {
    pub(super) time_s: Vec<f64>,
    /// Whether an automation steers too.
    pub(super) shared: Vec<bool>,
    pub(super) speed_m_per_s: Vec<f64>,
    pub(super) driver_nm: Vec<f64>,
    /// Zero by hand.
    pub(super) guidance_nm: Vec<f64>,
    pub(super) wheel_rad: Vec<f64>,
    /// Lane errors of a lane that is the way which the vehicle goes.
    pub(super) e_y_m: Vec<f64>,
    pub(super) e_theta_rad: Vec<f64>,
    /// Measured, or, where it is not, of curvature and speed.
    pub(super) yaw_rate_rad_per_s: Vec<f64>,
    pub(super) driven_1pm: Vec<f64>,
    /// 0 where it is not recorded: no bank of the road is known then.
    pub(super) roll_rad: Vec<f64>,
    /// The curvature that is planned, 1/m, and the lane's offset, m; none without them.
    pub(super) road: Option<[Vec<f64>; 2]>,
}

impl Rows {
    /// The rows of a file; none where it is refused as a whole, or lacks what is asked.
    pub(super) fn read(
        layout: &Layout,
        bytes: &[u8],
        format: Option<Format>,
        maps: &[Mapping],
    ) -> Option<Self> {
        let signals = layout.signals(bytes, format, maps).ok()?;
        let (time_s, mut table) = (signals.time_s, signals.columns);
        let yaw = table.remove("yaw_angle_rad");
        let mut column = |name: &str| table.remove(name);
        let shared: Vec<bool> = column("shared")?.iter().map(|s| *s > 0.5).collect();
        let mut guidance_nm = column("guidance_torque_nm")?;
        for (torque, shared) in guidance_nm.iter_mut().zip(&shared) {
            *torque *= f64::from(u8::from(*shared));
        }
        let speed_m_per_s = column("speed_m_per_s")?;
        let driven_1pm = column("driven_curvature_1pm")?;
        let measured = |k: usize| {
            let moved = yaw.as_ref()?.get(k + 1)? - yaw.as_ref()?[k];
            (moved.abs() < YAW_STEP_RAD).then(|| moved / (time_s[k + 1] - time_s[k]))
        };
        let rate = |k: usize| measured(k).unwrap_or(driven_1pm[k] * speed_m_per_s[k]);
        let yaw_rate_rad_per_s: Vec<f64> = (0..time_s.len()).map(rate).collect();
        let [near, far] = POINTS_S.map(|ahead_s| turned(&time_s, &yaw_rate_rad_per_s, ahead_s));
        // On an arc the way goes aside by half of what its direction turns.
        let lateral = |(near, v): (f64, &f64)| 0.5 * POINTS_S[0] * v * near;
        let level = vec![0.0; time_s.len()];
        Some(Self {
            e_y_m: near.into_iter().zip(&speed_m_per_s).map(lateral).collect(),
            e_theta_rad: far,
            driver_nm: column("driver_torque_nm")?,
            wheel_rad: column("wheel_angle_rad")?,
            time_s,
            shared,
            speed_m_per_s,
            guidance_nm,
            yaw_rate_rad_per_s,
            driven_1pm,
            roll_rad: column("roll_angle_rad").unwrap_or(level),
            road: column("curvature_1pm")
                .zip(column("offset_m"))
                .map(<[_; 2]>::from),
        })
    }

    /// Stretches of one way of driving, fast enough.
    pub(super) fn stretches(&self) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
        let kind = |k: &usize| (self.speed_m_per_s[*k] > LEAST_M_PER_S).then_some(self.shared[*k]);
        let rows: Vec<usize> = (0..self.time_s.len()).collect();
        let parts: Vec<_> = rows
            .chunk_by(|a, b| kind(a) == kind(b))
            .filter(|part| kind(&part[0]).is_some())
            .map(|part| part[0]..part[part.len() - 1] + 1)
            .collect();
        parts.into_iter()
    }
}

/// How far the vehicle turns within so many seconds from each row on; behind the end it goes straight.
pub(super) fn turned(time_s: &[f64], yaw_rate_rad_per_s: &[f64], ahead_s: f64) -> Vec<f64> {
    let from = |k: usize| {
        let until_s = time_s[k] + ahead_s;
        let spans = time_s[k..].windows(2).zip(&yaw_rate_rad_per_s[k..]);
        spans
            .take_while(|(span, _)| span[0] < until_s)
            .map(|(span, rate)| rate * (span[1].min(until_s) - span[0]))
            .sum()
    };
    (0..time_s.len()).map(from).collect()
}
