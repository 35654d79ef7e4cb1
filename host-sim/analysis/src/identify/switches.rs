//! Where a probe switched between two rows.
//!
//! A torque that moves faster than the torque envelope can has switched between the row before and the row that shows it. A
//! binary probe switches at multiples of a period of its own. Where one period of whole milliseconds and one phase put every
//! switch between its two rows, they tell the instants; where the phase is free, it is the latest one. Where no period
//! fits, the instant may be any between the rows, and the row itself is taken.

use haptic_recording::{DriveLog, SWITCH_RATE_NM_S};

/// Periods that are tried, s; a shorter one than so many rows would fit anything.
const PERIOD_STEP_S: f64 = 1e-3;
const LONGEST_PERIOD_S: f64 = 2.0;
const FEWEST_ROWS: f64 = 3.0;
/// Fewer switches than this fit a period by chance.
const FEWEST: usize = 8;
/// What rounding of the time stamps may move a switch by, in rows.
const ROUNDING: f64 = 0.01;

/// The switches of a guidance torque.
#[derive(Debug, Clone)]
pub(super) struct Switches {
    /// The sum of all switches up to each row, N.m.
    pub steps: Vec<f64>,
    /// Period of the probe and the latest instant from the first row on that its switches may have, s.
    pub clock: Option<[f64; 2]>,
    /// How many there are.
    pub count: usize,
}

impl Switches {
    pub(super) fn of(log: &DriveLog) -> Self {
        let dt_s = log.dt_s;
        let mut steps = vec![0.0];
        let mut rows = Vec::new();
        for (k, w) in log.guidance_torque_nm.windows(2).enumerate() {
            let rise = w[1] - w[0];
            let switched = rise.abs() > SWITCH_RATE_NM_S * dt_s;
            steps.push(steps[k] + if switched { rise } else { 0.0 });
            if switched {
                rows.push(k + 1);
            }
        }
        Self {
            steps,
            clock: clock(&rows, dt_s),
            count: rows.len(),
        }
    }

    /// How long before row `k` the switch that it shows was, s.
    pub(super) fn before_row_s(&self, k: usize, dt_s: f64) -> f64 {
        self.clock.map_or(0.0, |[period_s, phase_s]| {
            let since = (k as f64 * dt_s - phase_s).rem_euclid(period_s);
            // A row at the instant itself, but for rounding, shows the new value.
            if since > period_s - ROUNDING * dt_s {
                0.0
            } else {
                since.min(dt_s)
            }
        })
    }

    /// Whether switches lie at unknown instants between rows.
    pub(super) fn are_untimed(&self) -> bool {
        self.count >= FEWEST && self.clock.is_none()
    }
}

/// The period and the latest phase with which every switch lies in the row before the one that shows it.
fn clock(rows: &[usize], dt_s: f64) -> Option<[f64; 2]> {
    if rows.len() < FEWEST {
        return None;
    }
    let from = (FEWEST_ROWS * dt_s / PERIOD_STEP_S).ceil() as usize;
    let to = (LONGEST_PERIOD_S / PERIOD_STEP_S) as usize;
    // A multiple of a period fits only where the probe skips switches; the longest that fits says the most.
    (from..=to).rev().find_map(|ms| {
        let period_s = ms as f64 * PERIOD_STEP_S;
        let first_s = rows[0] as f64 * dt_s;
        let (mut low, mut high) = (0.0_f64, 0.0_f64);
        for &k in rows {
            let off = (k as f64 * dt_s - first_s + 0.5 * period_s).rem_euclid(period_s) - 0.5 * period_s;
            (low, high) = (low.min(off), high.max(off));
            if high - low > (1.0 + ROUNDING) * dt_s {
                return None;
            }
        }
        Some([period_s, (first_s + low).rem_euclid(period_s)])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(rate_hz: f64, switch_s: impl Fn(usize) -> f64) -> DriveLog {
        let mut sign = 1.0;
        let mut next = 0;
        let torque: Vec<f64> = (0..(40.0 * rate_hz) as usize)
            .map(|k| {
                while switch_s(next) <= k as f64 / rate_hz + 1e-9 {
                    sign = -sign;
                    next += 1;
                }
                0.2 * sign
            })
            .collect();
        DriveLog {
            dt_s: 1.0 / rate_hz,
            driver_torque_nm: torque.clone(),
            guidance_torque_nm: torque,
            ..DriveLog::default()
        }
    }

    /// A probe of 0.25 s at 50 rows a second switches on a row and in the middle between two by turns; at 120 on each row.
    #[test]
    fn a_switch_between_two_rows_is_put_where_it_was() {
        let clocked = |n: usize| 0.25 * (n + 1) as f64;
        let s = Switches::of(&log(50.0, clocked));
        for n in 0..20 {
            let row = (clocked(n) * 50.0).ceil();
            let before_s = s.before_row_s(row as usize, 0.02);
            assert!(
                (before_s - (row * 0.02 - clocked(n))).abs() < 1e-9,
                "{n} {before_s}"
            );
        }
        let s = Switches::of(&log(120.0, clocked));
        assert!((0..20).all(|n| s.before_row_s(30 * (n + 1), 1.0 / 120.0) < 1e-9));
    }

    #[test]
    fn switches_of_no_period_are_said_to_be_untimed() {
        let s = Switches::of(&log(50.0, |n| {
            0.3 * (n + 1) as f64 + 0.07 * ((n * n) as f64).sin()
        }));
        assert!(s.are_untimed() && s.before_row_s(100, 0.02) == 0.0);
    }
}
