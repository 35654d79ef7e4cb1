//! A driver who changes while driving: a constrained extended Kalman filter over a recorded drive.
//!
//! The paper's discussion asks for a nonlinear filter for drivers whose parameters are not constant. Here the
//! state is the arm's torque, the remnant, the constant of [`super::noise_model`], and the parameters gain_1..3,
//! K_hg and t_p, which wander as random walks. The model is that of [`super::signals`]: nonlinear only in
//! t_p times the gains. After each update K_hg and t_p are put back into their intervals, and the rest of the
//! state moves with them as its covariance says (a projection in the metric of the covariance).
//!
//! The remnant's corner and size are those that the noise model finds over the whole drive. How fast the
//! parameters may wander is a choice, not a finding: [`WANDERING_PER_ROOT_S`]. It trades noise for delay: with a
//! 0.2 N.m probe K_hg then has a standard deviation near 0.08 and follows a step within about 15 s.
//!
//! What is not here: the live estimate on the ECU, which has no record of the drive to look at.

use nalgebra::{SMatrix, SVector};
use serde::Serialize;

use super::noise_model::{self, LONGEST_DELAY_S};
use super::options::{BEND_RAD_S, Options};
use super::prepare::{Prepared, prepare};
use super::result::Identification;
use super::signals::{LagWeights, Signals};
use haptic_recording::DriveLog;

const ARM: usize = 0;
const REMNANT: usize = 1;
const OFFSET: usize = 2;
const GAIN: usize = 3;
const K_HG: usize = 6;
const T_P: usize = 7;
const COUNT: usize = 8;

type State = SVector<f64, COUNT>;
type Covariance = SMatrix<f64, COUNT, COUNT>;

/// Standard deviation that gain_1, gain_2, gain_3, K_hg and t_p gather in a second: some percent of their
/// defaults in table 4.
pub const WANDERING_PER_ROOT_S: [f64; 5] = [0.01, 0.001, 0.3, 0.03, 0.003];
/// Standard deviation before the first row: the width of table 4's intervals, roughly.
const BEFORE: [f64; 5] = [0.5, 0.1, 5.0, 0.5, 0.15];
/// Standard deviation of the torque sensor's rounding to 0.005 N.m.
const SENSOR_SD_NM: f64 = 0.0015;

/// A parameter over time.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct History {
    /// Estimate at each of [`Tracking::time_s`].
    pub estimate: Vec<f64>,
    /// Its standard deviation.
    pub standard_deviation: Vec<f64>,
}

/// The driver over time.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Tracking {
    /// Time, s.
    pub time_s: Vec<f64>,
    /// (K_d + K_nms)*a_i.
    pub gain: [History; 3],
    /// Reaction to the guidance torque.
    pub k_hg: History,
    /// Processing delay, s.
    pub t_p: History,
}

/// Follows the driver of `log`, which goes through the same preflight as for an identification: what is left out there is
/// left out here. Parameters fixed in `options` stay fixed; of a manual drive K_hg stays zero.
pub fn track(log: &DriveLog, options: &Options) -> Tracking {
    identify_and_track(log, options).1
}

/// Identifies the driver of `log` by the noise model, and follows that driver through it.
pub fn identify_and_track(log: &DriveLog, options: &Options) -> (Identification, Tracking) {
    let (prepared, options) = noise_model::with_inertia_sought(options, |options| prepare(log, options));
    let whole = noise_model::identify_prepared(&prepared, &options);
    let tracking = follow(&prepared, &options, &whole);
    (whole, tracking)
}

/// Follows the driver of a log that was prepared, from what was found over the whole of it.
pub(crate) fn follow(prepared: &Prepared, options: &Options, whole: &Identification) -> Tracking {
    let log = &prepared.log;
    let p = &whole.parameters;
    let found = [&p.gain_1, &p.gain_2, &p.gain_3, &p.k_hg, &p.t_p];
    let mut signals = Signals::new(log, whole.muscle(options.muscle));
    if let Some(line) = whole.line {
        let [offset, bend] = [line.offset, line.bend].map(|p| p.optimum.unwrap_or(0.0));
        signals.beside(offset, bend / BEND_RAD_S);
    }
    let first = (LONGEST_DELAY_S / signals.dt_s).ceil() as usize + 1;
    let dt = signals.dt_s;

    let remnant = whole.remnant;
    let corner_hz = remnant.and_then(|r| r.corner_hz).unwrap_or(0.5);
    let rho = (-std::f64::consts::TAU * corner_hz * dt).exp();
    let remnant_variance = remnant
        .and_then(|r| r.sd_nm)
        .unwrap_or(0.1)
        .powi(2)
        .max(SENSOR_SD_NM.powi(2));
    let sensor_variance = remnant.map_or(0.0, |r| r.white_sd_nm).max(SENSOR_SD_NM).powi(2);

    let mut x = State::zeros();
    let mut covariance = Covariance::zeros();
    let mut wandering = State::zeros();
    wandering[REMNANT] = remnant_variance * (1.0 - rho * rho);
    for (i, parameter) in found.into_iter().enumerate() {
        x[GAIN + i] = parameter.optimum.unwrap_or(0.0);
        if !parameter.fixed && parameter.optimum.is_some() {
            covariance[(GAIN + i, GAIN + i)] = BEFORE[i].powi(2);
            wandering[GAIN + i] = WANDERING_PER_ROOT_S[i].powi(2) * dt;
        }
    }
    let lag = LagWeights::after(dt, dt, signals.t_nms_s);
    let mut out = Tracking::default();
    for stretch in &prepared.stretches {
        let from = stretch.start + first;
        if from >= stretch.end {
            continue;
        }
        // Over a gap the driver stays about the same; arm, remnant and the integral of e_y are anybody's guess.
        for (i, variance) in [
            (ARM, remnant_variance),
            (REMNANT, remnant_variance),
            (OFFSET, 1.0),
        ] {
            x[i] = 0.0;
            covariance.row_mut(i).fill(0.0);
            covariance.column_mut(i).fill(0.0);
            covariance[(i, i)] = variance;
        }
        // The target is T_d + K_nms L[phi]: at the first row it is all arm, give or take the remnant.
        x[ARM] = signals.target[from - 1];
        for k in from..stretch.end {
            predict(&signals, lag, rho, k, &mut x, &mut covariance);
            for i in 0..COUNT {
                covariance[(i, i)] += wandering[i];
            }
            update(signals.target[k], sensor_variance, &mut x, &mut covariance);
            confine(K_HG, 0.0, 1.0, &mut x, &covariance);
            confine(T_P, 0.0, LONGEST_DELAY_S, &mut x, &covariance);
            out.push(log.time_s(k), &x, &covariance);
        }
    }
    out
}

impl Tracking {
    fn push(&mut self, time_s: f64, x: &State, covariance: &Covariance) {
        self.time_s.push(time_s);
        let [g1, g2, g3] = &mut self.gain;
        for (i, course) in [g1, g2, g3, &mut self.k_hg, &mut self.t_p]
            .into_iter()
            .enumerate()
        {
            course.estimate.push(x[GAIN + i]);
            course
                .standard_deviation
                .push(covariance[(GAIN + i, GAIN + i)].max(0.0).sqrt());
        }
    }
}

/// Moves state and covariance from row `k - 1` to row `k`.
fn predict(s: &Signals, lag: LagWeights, rho: f64, k: usize, x: &mut State, covariance: &mut Covariance) {
    let mut f = Covariance::identity();
    f[(ARM, ARM)] = lag.decay;
    f[(REMNANT, REMNANT)] = rho;
    f[(ARM, OFFSET)] = lag.w0 + lag.w1;
    let delay = s.delay(x[T_P].clamp(0.0, LONGEST_DELAY_S));
    let mut by_delay = 0.0;
    for (i, u) in s.visual.iter().enumerate() {
        let (u0, d0) = delay.read_raw(&u.raw, k - 1, s.dt_s);
        let (u1, d1) = delay.read_raw(&u.raw, k, s.dt_s);
        f[(ARM, GAIN + i)] = lag.w0 * u0 + lag.w1 * u1;
        by_delay += x[GAIN + i] * (lag.w0 * d0 + lag.w1 * d1);
    }
    // The guidance's part of the arm torque, in the hold that the lagged signal was made with.
    f[(ARM, K_HG)] = -(s.guidance[k] - lag.decay * s.guidance[k - 1]);
    let mut arm = f[(ARM, ARM)] * x[ARM] + f[(ARM, OFFSET)] * x[OFFSET];
    for i in 0..4 {
        arm += f[(ARM, GAIN + i)] * x[GAIN + i];
    }
    f[(ARM, T_P)] = by_delay;
    x[ARM] = arm;
    x[REMNANT] *= rho;
    *covariance = f * *covariance * f.transpose();
}

/// Takes in one sample of the arm's torque with the remnant on it.
fn update(measured: f64, sensor_variance: f64, x: &mut State, covariance: &mut Covariance) {
    let cross: State = covariance.column(ARM) + covariance.column(REMNANT);
    let innovation_variance = cross[ARM] + cross[REMNANT] + sensor_variance;
    let gain = cross / innovation_variance;
    *x += gain * (measured - x[ARM] - x[REMNANT]);
    *covariance -= gain * cross.transpose();
    // Rounding would otherwise make it lose its symmetry over tens of thousands of rows.
    *covariance = (*covariance + covariance.transpose()) * 0.5;
}

/// Projects the state onto `low <= x_i <= high` in the metric of its covariance.
fn confine(i: usize, low: f64, high: f64, x: &mut State, covariance: &Covariance) {
    let excess = x[i] - x[i].clamp(low, high);
    if excess != 0.0 && covariance[(i, i)] > 0.0 {
        *x -= covariance.column(i) * (excess / covariance[(i, i)]);
        x[i] = x[i].clamp(low, high);
    }
}
