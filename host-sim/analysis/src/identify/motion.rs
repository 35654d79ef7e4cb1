//! What no vehicle and no sensor does: signals that are dead, have lost their sign, jump, or turn against each other.
//!
//! Within a second or two the road is as good as straight, and what a driver's corrections do is the vehicle's motion alone: a
//! wheel turned left lowers e_theta, and the vehicle then moves towards where e_theta says, so that e_y falls with a
//! negative e_theta. Regressions of what is left beside running means show the signs.

use std::ops::Range;

use super::result::Refutation;
use super::verdict::{CERTAIN, SIGNS};
use super::wide::running_mean;
use haptic_recording::DriveLog;

/// Span of the running means, s, of the differences, s, and of the blocks that errors are taken from, s.
const MEAN_S: f64 = 2.0;
const DIFFERENCE_S: f64 = 0.1;
const BLOCK_S: f64 = 4.0;
/// Lag of the vehicle's turn behind the wheel angle, s.
const VEHICLE_S: f64 = 0.12;
/// A torque that never is below minus this, N.m, although the wheel goes this far to both sides, rad, has no sign.
const NEVER_BELOW_NM: f64 = 0.02;
const BOTH_SIDES_RAD: f64 = 0.03;
/// A jump of the wheel angle is larger than this, rad, and than so many times the largest usual step between rows.
const JUMP_RAD: f64 = 0.01;
const BEYOND_USUAL: f64 = 4.0;
/// Shares of the rows that are usual.
const USUAL: f64 = 0.999;
/// Before and after a jump the angle is taken over so long, s.
const AROUND_S: f64 = 0.15;

/// What the signals themselves refute. The signs of the lane are looked at only where they `may_be_swapped`: in a drive without any
/// weaving what is left beside the running means is the road's.
pub(super) fn of_motion(log: &DriveLog, stretches: &[Range<usize>], may_be_swapped: bool) -> Vec<Refutation> {
    let mut out: Vec<Refutation> = dead(log).into_iter().collect();
    out.extend(unsigned(log));
    out.extend(jump(log, stretches));
    if out.is_empty() && may_be_swapped {
        out.extend(lane_signs(log, stretches));
    }
    out
}

/// A lane signal or a wheel angle that never moves.
fn dead(log: &DriveLog) -> Option<Refutation> {
    let signals = [
        ("e_y_m", &log.e_y_m),
        ("e_theta_rad", &log.e_theta_rad),
        ("wheel_angle_rad", &log.wheel_angle_rad),
    ];
    let (name, value) = signals.into_iter().find_map(|(name, u)| {
        let first = *u.first()?;
        u.iter().all(|x| *x == first).then_some((name, first))
    })?;
    Some(Refutation {
        assumption: "every column is a signal",
        evidence: format!("{name} is {value} throughout"),
        cause: format!("{name} is dead, or was never connected"),
        cure: format!("record {name}"),
    })
}

fn unsigned(log: &DriveLog) -> Option<Refutation> {
    let beyond = |u: &[f64], share: f64| {
        let mut u = u.to_vec();
        u.sort_by(f64::total_cmp);
        u.get((share * u.len() as f64) as usize).copied()
    };
    let least = log.driver_torque_nm.iter().copied().fold(f64::INFINITY, f64::min);
    let right = beyond(&log.wheel_angle_rad, 0.05)?;
    let left = beyond(&log.wheel_angle_rad, 0.95)?;
    let is = least > -NEVER_BELOW_NM && right < -BOTH_SIDES_RAD && left > BOTH_SIDES_RAD;
    is.then(|| Refutation {
        assumption: SIGNS,
        evidence: format!(
            "driver_torque_nm is never below {least:.3} N.m, while the wheel goes from {right:.2} to {left:.2} rad"
        ),
        cause: "driver_torque_nm is recorded without its sign".to_owned(),
        cure: "record it with its sign; from the amount alone it cannot be had".to_owned(),
    })
}

/// A wheel angle that has another zero from one row to the next.
fn jump(log: &DriveLog, stretches: &[Range<usize>]) -> Option<Refutation> {
    let phi = &log.wheel_angle_rad;
    let mut steps: Vec<f64> = phi.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    steps.sort_by(f64::total_cmp);
    let usual = *steps.get((USUAL * steps.len() as f64) as usize)?;
    let around = ((AROUND_S / log.dt_s) as usize).max(1);
    let mean = |rows: Range<usize>| phi[rows.clone()].iter().sum::<f64>() / rows.len() as f64;
    let within = |k: usize| {
        stretches
            .iter()
            .any(|s| s.start + around < k && k + around < s.end)
    };
    let at = (around..phi.len().saturating_sub(around + 1))
        .filter(|&k| within(k))
        .max_by(|&a, &b| {
            (phi[a + 1] - phi[a])
                .abs()
                .total_cmp(&(phi[b + 1] - phi[b]).abs())
        })?;
    let step = phi[at + 1] - phi[at];
    let stays = mean(at + 1..at + 1 + around) - mean(at + 1 - around..at + 1);
    let is = step.abs() > JUMP_RAD.max(BEYOND_USUAL * usual) && stays / step > 0.6 && stays / step < 1.6;
    is.then(|| {
        let time_s = log.time_s(at + 1);
        Refutation {
            assumption: "wheel_angle_rad has one zero",
            evidence: format!(
                "it jumps by {:.2} deg in one row at {time_s:.1} s and stays there; other rows move by {:.2} deg at most",
                step.to_degrees(),
                usual.to_degrees()
            ),
            cause: "the sensor of the wheel angle got a new zero".to_owned(),
            cure: format!("one part alone: --to {time_s:.1}, or --from {:.1}", time_s + log.dt_s),
        }
    })
}

/// `u` less its running mean.
fn beside_mean(u: &[f64], half: usize) -> Vec<f64> {
    let mean = running_mean(u, half);
    u.iter().zip(mean).map(|(u, mean)| u - mean).collect()
}

fn rate(u: &[f64], half: usize, dt_s: f64) -> Vec<f64> {
    let last = u.len() - 1;
    (0..u.len())
        .map(|k| {
            let (from, to) = (k.saturating_sub(half), (k + half).min(last));
            (u[to] - u[from]) / ((to - from).max(1) as f64 * dt_s)
        })
        .collect()
}

/// A regression of `y` on `x` beside `z`: the weight of `x` in its standard errors, from the scatter of blocks.
fn weight_of(y: &[f64], x: &[f64], z: &[f64], rows: &[usize], block: usize) -> f64 {
    let product = |a: &[f64], b: &[f64]| rows.iter().map(|&k| a[k] * b[k]).sum::<f64>();
    // A column that is zero has no weight.
    let beside = |sum: f64| {
        let square = product(z, z);
        if square > 0.0 { sum / square } else { 0.0 }
    };
    let of_z = beside(product(x, z));
    let alone: Vec<f64> = x.iter().zip(z).map(|(x, z)| x - of_z * z).collect();
    let information = product(&alone, &alone);
    let weight = product(&alone, y) / information;
    let rest_z = beside(product(y, z) - weight * product(x, z));
    let scatter: f64 = rows
        .chunks(block)
        .map(|rows| {
            let score = |&k: &usize| alone[k] * (y[k] - weight * x[k] - rest_z * z[k]);
            rows.iter().map(score).sum::<f64>().powi(2)
        })
        .sum();
    let z = weight * information / scatter.sqrt();
    if z.is_finite() { z } else { 0.0 }
}

fn lane_signs(log: &DriveLog, stretches: &[Range<usize>]) -> Option<Refutation> {
    let dt_s = log.dt_s;
    let rows_of = |s: f64| ((s / dt_s).round() as usize).max(1);
    let (mean, half) = (rows_of(0.5 * MEAN_S), rows_of(DIFFERENCE_S));
    let rows: Vec<usize> = stretches
        .iter()
        .flat_map(|s| s.start + 2 * mean..s.end.saturating_sub(2 * mean).max(s.start + 2 * mean))
        .collect();
    let late = rows_of(VEHICLE_S);
    let phi: Vec<f64> = (0..log.len())
        .map(|k| log.wheel_angle_rad[k.saturating_sub(late)])
        .collect();
    let [phi, e_theta] = [&phi, &log.e_theta_rad].map(|u| beside_mean(u, mean));
    let [by_theta, by_y] = [&log.e_theta_rad, &log.e_y_m].map(|u| beside_mean(&rate(u, half, dt_s), mean));
    let none = vec![0.0; log.len()];
    let block = rows_of(BLOCK_S);
    let turns = weight_of(&by_theta, &phi, &none, &rows, block);
    let moves = weight_of(&by_y, &e_theta, &phi, &rows, block);
    let (turns_wrong, moves_wrong) = (turns > CERTAIN, moves < -CERTAIN);
    let swapped = match (turns_wrong, moves_wrong) {
        (true, true) => "e_theta_rad",
        (true, false) if moves > CERTAIN => "e_y_m and of e_theta_rad",
        (false, true) if turns < -CERTAIN => "e_y_m",
        _ => return None,
    };
    Some(Refutation {
        assumption: SIGNS,
        evidence: format!(
            "e_theta_rad {} where the wheel turns left ({turns:.0} standard errors), and e_y_m {} where e_theta_rad is positive \
             ({moves:.0})",
            if turns > 0.0 { "rises" } else { "falls" },
            if moves > 0.0 { "rises" } else { "falls" },
        ),
        cause: format!("the sign of {swapped} is swapped"),
        cure: format!("multiply {} by -1 in the log", swapped.replace("and of", "and")),
    })
}
