//! Several drives of one driver in one fit: the records one after the other, each with its own preflight, and a constant of
//! its own for each stretch. The driver, the muscle and the disturbance are the same in all.

use super::lane::LaneDoubt;
use super::noise_model;
use super::options::Options;
use super::prepare::{Prepared, prepare};
use super::result::Identification;
use super::tracking::{Tracking, follow};
use haptic_recording::{DriveLog, LogError, refuse};

/// Sample periods that differ by less than this share are the same.
const SAME_PERIOD: f64 = 1e-4;
/// The ECU's period, s: the place of a row in it says how long T_h has been held.
const ECU_PERIOD_S: f64 = 1e-3;
/// Rows within which the next drive finds its place in the ECU's period.
const MOST_PADDING: usize = 60;

/// Identifies the one driver of all `logs` by the noise model.
///
/// # Errors
/// No log; logs of different rates.
pub fn identify_together(logs: &[DriveLog], options: &Options) -> Result<Identification, LogError> {
    Ok(fitted(logs, options)?.1)
}

/// Identifies the driver of several logs, and follows that driver through all drives.
///
/// # Errors
/// As [`identify_together`].
pub fn identify_together_and_track(
    logs: &[DriveLog],
    options: &Options,
) -> Result<(Identification, Tracking), LogError> {
    let (prepared, found) = fitted(logs, options)?;
    let tracking = follow(&prepared, options, &found);
    Ok((found, tracking))
}

fn fitted(logs: &[DriveLog], options: &Options) -> Result<(Prepared, Identification), LogError> {
    let Some(first) = logs.first() else {
        return refuse("no drive is given, one is wanted at least");
    };
    if let Some(other) = logs
        .iter()
        .find(|l| (l.dt_s / first.dt_s - 1.0).abs() > SAME_PERIOD)
    {
        return refuse(format!(
            "one drive has {:.3} rows a second, another {:.3}: one rate is wanted",
            1.0 / first.dt_s,
            1.0 / other.dt_s
        ));
    }
    let (prepared, options) = noise_model::with_inertia_sought(options, |options| {
        let mut all = prepare(first, options);
        for log in &logs[1..] {
            all.append(prepare(log, options));
        }
        all
    });
    let mut found = noise_model::identify_prepared(&prepared, &options);
    if logs.len() > 1 {
        found.notes.insert(
            0,
            format!(
                "{} drives in one fit; times count on from drive to drive",
                logs.len()
            ),
        );
    }
    Ok((prepared, found))
}

impl Prepared {
    /// Puts another drive behind this one.
    fn append(&mut self, next: Self) {
        let phase = |t: f64| (t / ECU_PERIOD_S).rem_euclid(1.0);
        let wanted = phase(next.log.start_s);
        // So many rows of nothing that T_h is as old at the next drive's rows as it was.
        let miss = |pad: usize| {
            let d = (phase(self.log.time_s(self.log.len() + pad)) - wanted).abs();
            d.min(1.0 - d)
        };
        let padding = (0..MOST_PADDING)
            .find(|&pad| miss(pad) < 0.02)
            .or_else(|| (0..MOST_PADDING).min_by(|&a, &b| miss(a).total_cmp(&miss(b))))
            .unwrap_or(0);
        let from = self.log.len() + padding;
        let later = self.log.time_s(from) - next.log.start_s;
        let log = &mut self.log;
        for (all, more) in [
            (&mut log.e_y_m, next.log.e_y_m),
            (&mut log.e_theta_rad, next.log.e_theta_rad),
            (&mut log.wheel_angle_rad, next.log.wheel_angle_rad),
            (&mut log.guidance_torque_nm, next.log.guidance_torque_nm),
            (&mut log.driver_torque_nm, next.log.driver_torque_nm),
        ] {
            let first = more.first().copied().unwrap_or(0.0);
            all.extend(std::iter::repeat_n(first, padding));
            all.extend(more);
        }
        if let (Some(all), Some(more)) = (&mut self.wheel, next.wheel) {
            for (all, more) in [
                (&mut all.rate, more.rate),
                (&mut all.acceleration, more.acceleration),
            ] {
                all.resize(from, 0.0);
                all.extend(more);
            }
        }
        self.stretches
            .extend(next.stretches.into_iter().map(|s| s.start + from..s.end + from));
        let moved = |d: LaneDoubt| LaneDoubt {
            from: d.from + from,
            ..d
        };
        self.lane_doubts.extend(next.lane_doubts.into_iter().map(moved));
        let (sum, more) = (&mut self.preflight, next.preflight);
        sum.reading.extend(more.reading);
        for ((_, all), (_, faults)) in sum.columns.iter_mut().zip(more.columns) {
            all.missing += faults.missing;
            all.stuck += faults.stuck;
            all.spikes += faults.spikes;
            all.held_rows = all.held_rows.max(faults.held_rows);
            all.step = all.step.max(faults.step);
        }
        for (all, noise) in sum.lane_noise.iter_mut().zip(more.lane_noise) {
            all.noise_sd = all.noise_sd.max(noise.noise_sd);
            all.left_sd = all.left_sd.max(noise.left_sd);
            all.outliers += noise.outliers;
            all.smoothed |= noise.smoothed;
        }
        sum.left_out.extend(more.left_out.into_iter().map(|mut l| {
            l.from_s += later;
            l.to_s += later;
            l
        }));
        sum.recorded_s += more.recorded_s;
        sum.recorded_rows += more.recorded_rows;
        sum.used_s += more.used_s;
    }
}
