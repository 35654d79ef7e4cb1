//! Which stretches of a record are driving: what is not is found and left out, with the reason.

use std::fmt;
use std::ops::Range;

use serde::Serialize;

use crate::identify::lane::LaneNoise;
use crate::identify::options::Options;
use crate::identify::wide::{median, running_mean};
use haptic_recording::DriveLog;

/// Why a stretch was left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reason {
    /// The caller said so.
    Asked,
    /// A signal paused for longer than is bridged.
    Pause,
    /// The driver's torque is zero although there is something to steer.
    HandsOff,
    /// Nothing moves.
    Standstill,
    /// The target line moved by a lane.
    LaneChange,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Asked => "outside of the stretches asked for",
            Self::Pause => "a signal is missing or stuck",
            Self::HandsOff => "hands off",
            Self::Standstill => "standstill",
            Self::LaneChange => "lane change",
        })
    }
}

/// A stretch that was left out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LeftOut {
    /// First instant, s.
    pub from_s: f64,
    /// Last instant, s.
    pub to_s: f64,
    /// Why.
    pub reason: Reason,
}

/// A torque that stays within a band of this width, N.m, for [`HANDS_OFF_S`], and that near zero or, for a sensor may have an offset, near
/// the middle of the drive's torques, is of nobody's hands, ...
const HANDS_OFF_NM: f64 = 0.032;
const HANDS_OFF_OFFSET_NM: f64 = 0.1;
const HANDS_OFF_S: f64 = 2.0;
/// Half the stretch that a sensor's noise is averaged over before that, s: hands move more slowly. Where the noise would fill the band even so,
/// it is averaged over up to ten times as much, and the torque must be noise alone: it scatters by no more than so many times the noise.
const HANDS_NOISE_S: [f64; 2] = [0.05, 0.5];
const HANDS_SCATTER: f64 = 1.25;
/// In rows that are farther apart, s, a driver looks like noise too.
const HANDS_ROW_S: f64 = 0.02;
/// A mean of noise stays within so many of its standard deviations for some seconds.
const NOISE_BAND: f64 = 8.0;
/// ... if the far point and the guidance would have asked this of any driver meanwhile, N.m.
const ASKED_NM: f64 = 0.05;
/// A driver whose torque usually moves by so many of those bands in [`HANDS_OFF_S`] is never quiet for twice as long.
const RESTLESS: f64 = 3.0;
/// Nothing moves for so long: the car stands.
const STANDSTILL_S: f64 = 3.0;
/// Rounding of the wheel angle, rad, that is no movement.
const WHEEL_ROUNDING_RAD: f64 = 0.002;
/// Lane errors move by more than their noise times this where a car moves.
const NOISE_RANGE: f64 = 10.0;
/// A jump of e_y by this, m, in [`JUMP_ROWS`] rows is a change of the target line.
const LANE_JUMP_M: f64 = 1.5;
const JUMP_ROWS: usize = 3;
/// Left out around a lane change, s: the driver is on the way before, and settles after.
const LANE_CHANGE_S: [f64; 2] = [6.0, 8.0];
/// Shortest stretch of driving that is worth its own unknown, s.
const SHORTEST_S: f64 = 3.0;

pub(super) fn stretches(
    raw: &DriveLog,
    log: &DriveLog,
    bad: &[Vec<bool>],
    noise: [LaneNoise; 2],
    options: &Options,
) -> (Vec<Range<usize>>, Vec<LeftOut>) {
    let n = log.len();
    let mut reason: Vec<Option<Reason>> = vec![None; n];
    let mut mark = |range: Range<usize>, why: Reason| {
        for r in &mut reason[range.start.min(n)..range.end.min(n)] {
            r.get_or_insert(why);
        }
    };
    if !options.stretches.is_empty() {
        let asked = |k: usize| {
            let t = log.time_s(k);
            options
                .stretches
                .iter()
                .any(|&(from, to)| (from..=to).contains(&t))
        };
        for k in (0..n).filter(|&k| !asked(k)) {
            mark(k..k + 1, Reason::Asked);
        }
    }
    let rows = |s: f64| (s / log.dt_s).round() as usize;
    for column in bad {
        for run in true_runs(column) {
            if run.len() > rows(options.bridge_s) {
                mark(run, Reason::Pause);
            }
        }
    }
    if options.leave_out {
        for run in standstill(raw, noise, rows(STANDSTILL_S)) {
            mark(run, Reason::Standstill);
        }
        for run in hands_off(log, rows(HANDS_OFF_S)) {
            mark(run, Reason::HandsOff);
        }
        let jumps = (JUMP_ROWS..n).filter(|&k| (raw.e_y_m[k] - raw.e_y_m[k - JUMP_ROWS]).abs() > LANE_JUMP_M);
        // A sample that is out of line jumps back at once; a target line does not.
        let stays = |k: usize| (log.e_y_m[k] - log.e_y_m[k - JUMP_ROWS]).abs() > 0.5 * LANE_JUMP_M;
        for k in jumps.filter(|&k| stays(k)) {
            mark(
                k.saturating_sub(rows(LANE_CHANGE_S[0]))..k + rows(LANE_CHANGE_S[1]),
                Reason::LaneChange,
            );
        }
    }
    let free: Vec<bool> = reason.iter().map(Option::is_none).collect();
    let mut left_out: Vec<LeftOut> = Vec::new();
    for (k, why) in reason.iter().enumerate() {
        let Some(why) = *why else { continue };
        let t = log.time_s(k);
        match left_out.last_mut() {
            Some(last) if last.reason == why && t - last.to_s < 1.5 * log.dt_s => last.to_s = t,
            _ => left_out.push(LeftOut {
                from_s: t,
                to_s: t,
                reason: why,
            }),
        }
    }
    let stretches = true_runs(&free)
        .into_iter()
        .filter(|r| r.len() >= rows(SHORTEST_S))
        .collect();
    (stretches, left_out)
}

/// Runs of `true`.
fn true_runs(flags: &[bool]) -> Vec<Range<usize>> {
    let mut out = Vec::new();
    let mut from = None;
    for (k, &flag) in flags.iter().chain(std::iter::once(&false)).enumerate() {
        match (flag, from) {
            (true, None) => from = Some(k),
            (false, Some(start)) => {
                out.push(start..k);
                from = None;
            }
            _ => {}
        }
    }
    out
}

/// Longest runs in which `signal` stays within `width`, of at least `rows` rows, from the left.
fn quiet(signal: &[f64], width: f64, rows: usize) -> Vec<bool> {
    let mut out = vec![false; signal.len()];
    let mut from = 0;
    while from < signal.len() {
        let (mut low, mut high) = (signal[from], signal[from]);
        let mut to = from + 1;
        while to < signal.len() {
            let (l, h) = (low.min(signal[to]), high.max(signal[to]));
            if h - l > width {
                break;
            }
            (low, high, to) = (l, h, to + 1);
        }
        if to - from >= rows {
            out[from..to].fill(true);
            from = to;
        } else {
            from += ((to - from) / 4).max(1);
        }
    }
    out
}

/// The car stands: wheel angle, lane errors and guidance do not move for [`STANDSTILL_S`], and not because the road is
/// straight and all are zero.
fn standstill(log: &DriveLog, noise: [LaneNoise; 2], rows: usize) -> Vec<Range<usize>> {
    let width = |c: usize| (NOISE_RANGE * noise[c].noise_sd).max(1e-9);
    let phi = quiet(&log.wheel_angle_rad, WHEEL_ROUNDING_RAD, rows);
    let guidance = quiet(&log.guidance_torque_nm, 1e-3, rows);
    let e_y = quiet(&log.e_y_m, width(0), rows);
    let e_theta = quiet(&log.e_theta_rad, width(1), rows);
    let still: Vec<bool> = (0..log.len())
        .map(|k| phi[k] && guidance[k] && e_y[k] && e_theta[k])
        .collect();
    true_runs(&still)
        .into_iter()
        .filter(|r| r.len() >= rows)
        .filter(|r| {
            let k = r.start + r.len() / 2;
            log.wheel_angle_rad[k].abs() > WHEEL_ROUNDING_RAD || log.e_y_m[k].abs() > width(0)
        })
        .collect()
}

/// Standard deviation of a signal's noise: of three rows the middle one lies beside the mean of the others, in the median.
fn noise_of(signal: &[f64]) -> f64 {
    let mut beside: Vec<f64> = signal
        .windows(3)
        .map(|w| (w[1] - 0.5 * (w[0] + w[2])).abs())
        .collect();
    // Two thirds of the variance of such a difference are the middle row's; 1.4826 makes a standard deviation of a median.
    1.4826 * (2.0_f64 / 3.0).sqrt() * median(&mut beside)
}

/// Hands are off where the torque is quiet near zero although there was something to steer, or for long in a drive whose
/// driver is not that quiet.
fn hands_off(log: &DriveLog, rows: usize) -> Vec<Range<usize>> {
    let mut usual: Vec<f64> = log
        .driver_torque_nm
        .chunks_exact(rows.max(1))
        .map(|c| c.iter().fold(f64::MIN, |a, &b| a.max(b)) - c.iter().fold(f64::MAX, |a, &b| a.min(b)))
        .collect();
    let restless = median(&mut usual) > RESTLESS * HANDS_OFF_NM;
    let torque = &log.driver_torque_nm;
    let noise_nm = noise_of(torque);
    let [least, most] = HANDS_NOISE_S.map(|s| (s / log.dt_s) as usize);
    let needed = (0.5 * (NOISE_BAND * noise_nm / HANDS_OFF_NM).powi(2)) as usize;
    let half = if log.dt_s > HANDS_ROW_S {
        least
    } else {
        needed.clamp(least, most)
    };
    let mean = running_mean(torque, half);
    let mut still = quiet(&mean, HANDS_OFF_NM, rows);
    let offset = median(&mut torque.clone());
    for (still, mean) in still.iter_mut().zip(&mean) {
        *still &= mean.abs().min((mean - offset).abs()) <= HANDS_OFF_OFFSET_NM;
    }
    let is_noise = |run: &Range<usize>| {
        let (torque, mean) = (&torque[run.clone()], &mean[run.clone()]);
        let scatter: f64 = torque.iter().zip(mean).map(|(t, m)| (t - m).powi(2)).sum();
        half == least || (scatter / run.len() as f64).sqrt() <= HANDS_SCATTER * noise_nm
    };
    true_runs(&still)
        .into_iter()
        .filter(|r| r.len() >= rows && is_noise(r))
        // At their ends the mean is half of hands.
        .map(|r| r.start.saturating_sub(half)..(r.end + half).min(log.len()))
        .filter(|r| {
            let asked: f64 = r
                .clone()
                .map(|k| {
                    let visual = super::USUAL_GAINS[1] * log.e_theta_rad[k]
                        + super::USUAL_GAINS[0] * log.e_y_m[k]
                        - log.wheel_angle_rad[k];
                    visual * visual
                })
                .sum::<f64>();
            (asked / r.len() as f64).sqrt() > ASKED_NM || (restless && r.len() >= 2 * rows)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A driver who swings by 0.3 N.m at 0.4 Hz, but for 20 s in the middle, under a sensor's noise of 0.03 N.m: those 20 s are left out, to
    /// half a second at either end, and nothing of a driver who holds on with a quarter of that and the noise.
    #[test]
    fn hands_are_off_below_a_sensors_noise_too() {
        let mut state: u64 = 5;
        let mut noise = move || -> f64 {
            let uniform = |_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (state >> 11) as f64 / (1_u64 << 53) as f64
            };
            0.03 * ((0..12).map(uniform).sum::<f64>() - 6.0)
        };
        let mut log = |held: f64| {
            let swing = |k: usize| 0.3 * (0.8 * std::f64::consts::PI * k as f64 / 100.0).sin();
            let is_middle = |k: usize| (4000..6000).contains(&k);
            let torque = (0..10_000).map(|k| swing(k) * if is_middle(k) { held } else { 1.0 } + noise());
            DriveLog {
                dt_s: 0.01,
                driver_torque_nm: torque.collect(),
                e_y_m: vec![0.5; 10_000],
                e_theta_rad: vec![0.0; 10_000],
                wheel_angle_rad: vec![0.0; 10_000],
                ..DriveLog::default()
            }
        };
        let off = hands_off(&log(0.0), 200);
        let [from, to] = [off[0].start, off[off.len() - 1].end];
        assert!(from.abs_diff(4000) < 60 && to.abs_diff(6000) < 60, "{off:?}");
        let off_rows: usize = off.iter().map(Range::len).sum();
        assert!(off_rows > 1800, "{off:?}");
        assert_eq!(hands_off(&log(0.25), 200), []);
    }
}
