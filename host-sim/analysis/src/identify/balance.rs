//! The torques on the steering column against its motion: a check of the sensors that does not need the driver.
//!
//! `T_d + T_h = J_s phi'' + B_s phi' - T_a`, with T_a the vehicle's answer to the wheel angle: whatever the driver does,
//! the recorded torques have to add up to what the recorded angle takes. With unknown column and vehicle,
//! `T_d = S (sum m_i x_i[phi] - T_h)` is regressed on the angle's derivatives and lags and on T_h, all through the same
//! low-pass. S other than 1 is a scale, S below 0 a sign, and what the derivatives of T_d and T_h explain beside it a
//! delay: `T_d(t + d) = T_d + d T_d'`. Shifts are taken out and the regression repeated until none is left.
//!
//! Dry friction `F sign(phi')` is one more regressor. While the wheel sticks, friction is whatever holds it, up to F, and
//! the motion tells nothing of the torques. So where there is friction, only the rows count in which the wheel slides for
//! as long as the low-pass remembers.
//!
//! Gusts and an unsteady road turn the wheel too, and the torques answer to that: what is left unexplained is then no noise, and only
//! signs are told (`verdict`). A power assist turns it with the driver: T_d then acts at more than its scale.
//!
//! What it cannot see: a scale that T_d and T_h share, a delay that all three share, and the camera. A column
//! that does not answer so (a servo that is not in T_h) leaves much unexplained; then nothing is said. Nor is
//! anything where the speed changes: the vehicle's answer is one at one speed.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::switches::Switches;
use super::wide::{add_times, dot, lagged, median};
use haptic_recording::DriveLog;

/// Explained share of T_d above which it tells scales and instants too: gusts of 250 N leave 87 % and make a scale of 0.2 of a right one, a motor's
/// ripple of 0.06 N.m leaves 98.8 % and makes one of 0.78, and without them it is more than 99.5 %.
const BALANCE_CLOSE: f64 = 0.99;
/// Time constant of each stage of the low-pass, s.
const STAGE_S: f64 = 0.06;
/// Lags of the wheel angle that stand for the vehicle, s.
const VEHICLE_LAGS_S: [f64; 2] = [0.1, 0.3];
/// After so long the low-pass and the lags have forgotten where they began, s.
const SETTLE_S: f64 = 1.5;
/// Length of the blocks over which errors are taken as independent, s.
const BLOCK_S: f64 = 1.5;
/// Rows up to so far apart lie between the stages of the low-pass; of slower ones its derivatives are off by up to half a row themselves, s.
const FINE_ROWS_S: f64 = 0.025;
/// Rounds of shifting.
const ROUNDS: usize = 4;
/// Time constant of the smoother that the wheel's rate is taken behind, s, and the rate at which friction has two thirds of
/// its value, rad/s: slower is lost in the steps of the angle's sensor.
const RATE_S: f64 = 0.02;
const SLIDES_RAD_S: f64 = 0.01;
/// Share of the low-pass's memory in which the wheel has to slide for a row to count beside friction.
const SLIDING: f64 = 0.75;
/// Standard errors, and N.m, beyond which there is friction.
const FRICTION_SURE: f64 = 5.0;
const FRICTION_NM: f64 = 0.02;
/// Fewest seconds of sliding that say something of the sensors.
const FEWEST_SLIDING_S: f64 = 15.0;

/// What the balance of torques says of the sensors.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Balance {
    /// Share of the driver's torque that column and guidance explain, 0 to 1.
    pub explained: f64,
    /// Scale of T_d over that of T_h, and its standard error; none without T_h.
    pub scale: Option<[f64; 2]>,
    /// By how much T_d is late against the wheel angle, and its standard error, s.
    pub driver_late_s: [f64; 2],
    /// By how much T_h is late against the wheel angle, and its standard error, s; none without T_h.
    pub guidance_late_s: Option<[f64; 2]>,
    /// By how much T_h is late against T_d, and its standard error, s; none without T_h.
    pub between_s: Option<[f64; 2]>,
    /// Torque per angle at slow motion, and its standard error, N.m/rad: positive, or a sign is wrong.
    pub stiffness: [f64; 2],
    /// Dry friction of the column, and its standard error, N.m; none where there is none to be seen. The rest is then of the
    /// rows in which the wheel slides.
    pub friction_nm: Option<[f64; 2]>,
    /// What T_d has beyond that, and its standard error, N.m: the sensor's offset, and that of the wheel angle and of the road.
    #[serde(skip)]
    pub(crate) offset_nm: [f64; 2],
    /// Seconds that all this rests on.
    pub seconds: f64,
    /// Steps of the wheel angle's sensor, rad, where most rows bring no other angle; else 0.
    #[serde(skip)]
    pub(crate) angle_step_rad: f64,
    /// What the part that is not explained could make of the scale at most, if it were all guidance torque.
    #[serde(skip)]
    pub(crate) scale_leeway: f64,
    /// What it could make of the delay of T_d at most, s, if it were all rate of T_d.
    #[serde(skip)]
    pub(crate) late_leeway_s: f64,
    /// Time that straight lines between rows leave open, s: half of their distance, and all of it where they are uneven or far apart.
    #[serde(skip)]
    pub(crate) row_leeway_s: f64,
    /// Whether rows are uneven and far apart: what lines between them leave open hides scales and instants.
    #[serde(skip)]
    pub(crate) is_sparse: bool,
}

impl Balance {
    /// Whether it tells scales and instants too, and not signs alone.
    pub(crate) fn is_close(&self) -> bool {
        self.explained >= BALANCE_CLOSE && !self.is_sparse
    }
}

/// A signal and its derivatives through the low-pass.
struct Passed {
    value: Vec<f64>,
    rate: Vec<f64>,
    acceleration: Vec<f64>,
}

fn pass(u: &[f64], dt: f64, shift_s: f64) -> Passed {
    let n = u.len();
    let read = |k: usize| {
        let place = (k as f64 + shift_s / dt).clamp(0.0, (n - 1) as f64);
        let (whole, share) = (place as usize, place.fract());
        u[whole] + share * (u[(whole + 1).min(n - 1)] - u[whole])
    };
    let share = 1.0 - (-dt / STAGE_S).exp();
    let mut stage = [read(0); 4];
    let mut out = Passed {
        value: Vec::with_capacity(n),
        rate: Vec::with_capacity(n),
        acceleration: Vec::with_capacity(n),
    };
    for k in 0..n {
        let mut input = read(k);
        for s in &mut stage {
            *s += share * (input - *s);
            input = *s;
        }
        let [_, b, c, d] = stage;
        // Of sampled filters: share times (c - d) is the last step of d over 1 - share.
        let gain = share / (dt * (1.0 - share));
        out.value.push(d);
        out.rate.push(gain * (c - d));
        out.acceleration.push(gain * gain * (b - 2.0 * c + d));
    }
    // Those are differences to the row before: half a row late, and a whole one.
    for k in 1..n {
        out.rate[k - 1] = 0.5 * (out.rate[k - 1] + out.rate[k]);
        out.acceleration[k - 1] = out.acceleration[k];
    }
    out
}

/// T_h for lines between its rows: a switch is put where it was, not half a row before its row.
fn held(log: &DriveLog) -> Vec<f64> {
    let switches = Switches::of(log);
    let mut out = log.guidance_torque_nm.clone();
    for (k, torque) in out.iter_mut().enumerate().skip(1) {
        let rise = switches.steps[k] - switches.steps[k - 1];
        if rise != 0.0 {
            *torque -= rise * (0.5 - switches.before_row_s(k, log.dt_s) / log.dt_s);
        }
    }
    out
}

/// Which way the wheel turns, between -1 and 1 where it hardly does.
fn turning(phi: &[f64], dt: f64) -> Vec<f64> {
    // Backwards too, so that nothing is late.
    let mut smooth = lagged(phi, dt, RATE_S);
    smooth.reverse();
    let mut smooth = lagged(&smooth, dt, RATE_S);
    smooth.reverse();
    let last = smooth.len() - 1;
    (0..=last)
        .map(|k| {
            let (before, after) = (k.saturating_sub(1), (k + 1).min(last));
            let rate = (smooth[after] - smooth[before]) / ((after - before).max(1) as f64 * dt);
            rate / rate.hypot(SLIDES_RAD_S)
        })
        .collect()
}

/// Weighs the torques of `log` over the `stretches`; none if there is too little of them.
pub(crate) fn balance(log: &DriveLog, stretches: &[Range<usize>], manual: bool) -> Option<Balance> {
    if log.changes_speed() {
        return None;
    }
    let settle = (SETTLE_S / log.dt_s) as usize;
    let rows: Vec<usize> = stretches
        .iter()
        .flat_map(|s| s.start + settle..s.end.max(s.start + settle))
        .collect();
    if rows.len() < 10 * settle.min(120) {
        return None;
    }
    let turning = turning(&log.wheel_angle_rad, log.dt_s);
    let all = weighed(log, &rows, manual, &turning)?;
    let sure = |[value, error]: &[f64; 2]| *value > (FRICTION_SURE * error).max(FRICTION_NM);
    if all.friction_nm.filter(sure).is_none() {
        return Some(Balance {
            friction_nm: None,
            ..all
        });
    }
    let amount: Vec<f64> = turning.iter().map(|t| t.abs()).collect();
    let sliding = pass(&amount, log.dt_s, 0.0).value;
    let rows: Vec<usize> = rows.into_iter().filter(|&k| sliding[k] > SLIDING).collect();
    if (rows.len() as f64) * log.dt_s < FEWEST_SLIDING_S {
        return Some(Balance {
            explained: 0.0,
            ..all
        });
    }
    weighed(log, &rows, manual, &turning)
}

/// The usual step of an angle that most rows do not change; else 0.
fn step_of(angle: &[f64], rows: &[usize]) -> f64 {
    let change = |&k: &usize| (angle[k] - angle[k.saturating_sub(1)]).abs();
    let mut changes: Vec<f64> = rows.iter().map(change).filter(|c| *c > 1e-9).collect();
    if changes.is_empty() || 2 * changes.len() > rows.len() {
        return 0.0;
    }
    median(&mut changes)
}

/// The balance over `rows`.
fn weighed(log: &DriveLog, rows: &[usize], manual: bool, turning: &[f64]) -> Option<Balance> {
    let dt = log.dt_s;
    let is_even = log.resampling.is_empty();
    // Where most rows of a grid are bridged, those that are left are farther apart than it.
    let apart_s = dt * log.slow_noise();
    let guided = !manual && rows.iter().any(|&k| log.guidance_torque_nm[k] != 0.0);
    let held = held(log);
    let phi = pass(&log.wheel_angle_rad, dt, 0.0);
    let mut columns = Columns::default();
    for column in [&phi.acceleration, &phi.rate, &phi.value] {
        columns.push(column, rows);
    }
    for t in VEHICLE_LAGS_S {
        columns.push(&lagged(&phi.value, dt, t), rows);
    }
    let stiff = 2..columns.scale.len();
    columns.push(&vec![1.0; log.len()], rows);
    columns.push(&pass(turning, dt, 0.0).value, rows);
    // Where the columns of the torques begin.
    let d = columns.scale.len();
    let (mut driver_late, mut guidance_late) = (0.0_f64, 0.0_f64);
    let mut found = None;
    for _ in 0..ROUNDS {
        let driver = pass(&log.driver_torque_nm, dt, driver_late);
        columns.truncate(d);
        columns.push(&driver.rate, rows);
        if guided {
            let guidance = pass(&held, dt, guidance_late);
            columns.push(&guidance.value, rows);
            columns.push(&guidance.rate, rows);
        }
        let torque: Vec<f64> = rows.iter().map(|&k| driver.value[k]).collect();
        let fit = regress(&torque, &mut columns, (BLOCK_S / dt) as usize)?;
        let step = -fit.weights[d];
        driver_late += step.clamp(-0.03, 0.03);
        let mut more = 0.0_f64;
        let error = |i: usize| fit.errors[(i, i)].max(0.0).sqrt();
        let mut scale = None;
        let mut late = None;
        let mut between = None;
        if guided {
            let s = -fit.weights[d + 1];
            scale = Some([s, error(d + 1)]);
            if s.abs() > 0.1 {
                more = -fit.weights[d + 2] / s;
                guidance_late += more.clamp(-0.03, 0.03);
                late = Some([guidance_late, error(d + 2) / s.abs()]);
                let variance = fit.errors[(d, d)] + fit.errors[(d + 2, d + 2)] / (s * s)
                    - 2.0 * fit.errors[(d, d + 2)] / s;
                between = Some([guidance_late - driver_late, variance.max(0.0).sqrt()]);
            }
        }
        let stiffness: f64 = stiff.clone().map(|i| fit.weights[i]).sum();
        let variance: f64 = stiff
            .clone()
            .flat_map(|i| stiff.clone().map(move |j| (i, j)))
            .map(|ij| fit.errors[ij])
            .sum();
        found = Some(Balance {
            explained: fit.explained,
            scale,
            driver_late_s: [driver_late, error(d)],
            guidance_late_s: late,
            between_s: between,
            stiffness: [stiffness, variance.max(0.0).sqrt()],
            friction_nm: Some([fit.weights[d - 1], error(d - 1)]),
            offset_nm: [fit.weights[d - 2], error(d - 2)],
            seconds: rows.len() as f64 * dt,
            angle_step_rad: step_of(&log.wheel_angle_rad, rows),
            scale_leeway: if guided { fit.leeway[d + 1] } else { 0.0 },
            late_leeway_s: fit.leeway[d],
            row_leeway_s: if is_even && dt <= FINE_ROWS_S {
                0.5 * apart_s
            } else {
                apart_s
            },
            is_sparse: !is_even && apart_s > FINE_ROWS_S,
        });
        if driver_late.abs() > 0.3 || guidance_late.abs() > 0.3 || (step.abs() < 5e-4 && more.abs() < 5e-4) {
            break;
        }
    }
    found
}

struct Regression {
    weights: DVector<f64>,
    errors: DMatrix<f64>,
    explained: f64,
    /// What each weight would be off by if all that is left over were that column's own part.
    leeway: DVector<f64>,
}

/// Columns over the same rows, each of length one.
#[derive(Default)]
struct Columns {
    scaled: Vec<Vec<f64>>,
    scale: Vec<f64>,
    /// Products of each with those before it and itself, for as many as they were asked for.
    gram: Vec<Vec<f64>>,
}

/// Rows that stay near while all products of them are formed.
const NEAR: usize = 256;

impl Columns {
    fn push(&mut self, u: &[f64], rows: &[usize]) {
        let mut column: Vec<f64> = rows.iter().map(|&k| u[k]).collect();
        let scale = dot(&column, &column).sqrt().max(1e-300);
        column.iter_mut().for_each(|x| *x /= scale);
        self.scaled.push(column);
        self.scale.push(scale);
    }

    fn truncate(&mut self, count: usize) {
        self.scaled.truncate(count);
        self.scale.truncate(count);
        self.gram.truncate(count);
    }

    /// All products of the columns, and those with `y`.
    fn products(&mut self, y: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
        let (m, known) = (self.scaled.len(), self.gram.len());
        let mut with_y: DVector<f64> = DVector::zeros(m);
        self.gram.extend((known..m).map(|i| vec![0.0; i + 1]));
        for (number, y) in y.chunks(NEAR).enumerate() {
            let here: Vec<&[f64]> = self
                .scaled
                .iter()
                .map(|x| &x[number * NEAR..][..y.len()])
                .collect();
            for (sum, x) in with_y.iter_mut().zip(&here) {
                *sum += dot(x, y);
            }
            for (i, sums) in self.gram.iter_mut().enumerate().skip(known) {
                for (sum, x) in sums.iter_mut().zip(&here) {
                    *sum += dot(x, here[i]);
                }
            }
        }
        let gram = |i: usize, j: usize| self.gram[i.max(j)][i.min(j)];
        (DMatrix::from_fn(m, m, gram), with_y)
    }
}

/// Least squares of `y` on the columns, with errors from the sums over blocks of neighbours.
fn regress(y: &[f64], columns: &mut Columns, block: usize) -> Option<Regression> {
    let m = columns.scale.len();
    let (mut gram, with_y) = columns.products(y);
    for i in 0..m {
        gram[(i, i)] += 1e-10;
    }
    let inverse = gram.cholesky()?.inverse();
    let weights: DVector<f64> = &inverse * with_y;
    let mean = y.iter().sum::<f64>() / y.len() as f64;
    let spread: f64 = y.iter().map(|y| (y - mean).powi(2)).sum();
    let mut meat: DMatrix<f64> = DMatrix::zeros(m, m);
    let (mut left, mut squares) = (Vec::new(), 0.0);
    for (number, y) in y.chunks(block.max(1)).enumerate() {
        let from = number * block.max(1);
        left.clear();
        left.extend_from_slice(y);
        for (x, w) in columns.scaled.iter().zip(weights.iter()) {
            add_times(&mut left, -w, &x[from..]);
        }
        squares += dot(&left, &left);
        let sum = DVector::from_fn(m, |i, _| dot(&columns.scaled[i][from..], &left));
        meat += &sum * sum.transpose();
    }
    let errors: DMatrix<f64> = &inverse * meat * &inverse;
    let scale = &columns.scale;
    Some(Regression {
        weights: DVector::from_fn(m, |i, _| weights[i] / scale[i]),
        errors: DMatrix::from_fn(m, m, |i, j| errors[(i, j)] / (scale[i] * scale[j])),
        explained: if spread > 0.0 { 1.0 - squares / spread } else { 0.0 },
        leeway: DVector::from_fn(m, |i, _| (squares * inverse[(i, i)]).sqrt() / scale[i]),
    })
}
