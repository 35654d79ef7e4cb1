//! From a log as recorded to signals that an estimator can be given: what is wrong is found, repaired or left out, and
//! listed.
//!
//! Single samples first ([`faults`]): what is no number, stuck or a spike is bridged, in the lane signals by the
//! smoother of [`super::lane`]. Then stretches ([`stretches`]) in which the record is no driving: hands off, standstill,
//! lane changes, pauses of a signal longer than [`Options::bridge_s`], and what the caller leaves out. What remains is
//! a set of stretches, each with an unknown of its own for what the integral of e_y was before it.

mod faults;
mod stretches;

use std::ops::Range;

use serde::Serialize;

pub use faults::ColumnFaults;
pub use stretches::{LeftOut, Reason};

use super::lane::{LaneDoubt, LaneNoise, Smoothed, smooth};
use super::options::Options;
use super::wheel::{FIT_ROW_S, WheelMotion};
use haptic_recording::{COLUMNS, DriveLog};

/// Changes of e_y, e_theta, wheel angle, T_h and T_d below which a sample is never out of line: m, rad, rad, N.m, N.m.
const LEAST: [f64; 5] = [5e-3, 5e-4, 1e-2, 0.06, 0.06];

/// Error of a bridged lane signal, in torque by the driver's usual gains, above which the rows are left out, N.m.
const LARGEST_BRIDGED_NM: f64 = 0.05;
/// The driver's usual (K_d + K_nms)*a_1 and (K_d + K_nms)*a_3, to weigh errors of e_y and e_theta.
const USUAL_GAINS: [f64; 2] = [0.4, 14.8];

/// What was found in a log and what was done about it.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Preflight {
    /// What was found when the log was read: what, found, done.
    pub reading: Vec<[String; 3]>,
    /// By column: e_y_m, e_theta_rad, wheel_angle_rad, guidance_torque_nm, driver_torque_nm.
    pub columns: Vec<(&'static str, ColumnFaults)>,
    /// Camera noise of e_y, m, and of e_theta, rad.
    pub lane_noise: [LaneNoise; 2],
    /// Stretches that were left out.
    pub left_out: Vec<LeftOut>,
    /// Pauses up to so long were bridged, s.
    pub bridge_s: f64,
    /// Seconds of the record, and its rows.
    pub recorded_s: f64,
    #[serde(skip)]
    pub(crate) recorded_rows: usize,
    /// Seconds that the estimate rests on.
    pub used_s: f64,
}

impl Preflight {
    /// In words: what, found, done.
    pub fn findings(&self) -> Vec<[String; 3]> {
        let mut out = self.reading.clone();
        let bridged = match self.bridge_s {
            0.0 => "cut".to_owned(),
            s => format!("bridged, or cut where longer than {s} s"),
        };
        for (name, faults) in &self.columns {
            let mut add = |count: usize, found: &str, done: &str| {
                if count > 0 {
                    let found = if count == 1 {
                        found.replacen("values", "value", 1)
                    } else {
                        found.to_owned()
                    };
                    out.push([(*name).to_owned(), format!("{count} {found}"), done.to_owned()]);
                }
            };
            add(faults.missing, "values missing or no number", &bridged);
            add(faults.stuck, "values stuck", &bridged);
            add(faults.spikes, "values out of line", "bridged");
            add(
                faults.held_rows,
                "rows for each fresh value",
                "only fresh values used",
            );
            if faults.step > 0.0 {
                let found = format!("moves in steps of {:.2e}", faults.step);
                out.push([(*name).to_owned(), found, "weighed by where it steps".to_owned()]);
            }
        }
        for ((name, unit), noise) in [("e_y_m", "m"), ("e_theta_rad", "rad")]
            .into_iter()
            .zip(&self.lane_noise)
        {
            if noise.smoothed {
                out.push([
                    name.to_owned(),
                    format!("noise of {:.1e} {unit}", noise.noise_sd),
                    format!("smoothed to {:.1e} {unit}", noise.left_sd),
                ]);
            }
            if noise.outliers > 0 {
                let values = if noise.outliers == 1 { "value" } else { "values" };
                let found = format!("{} {values} beyond 5 standard deviations", noise.outliers);
                out.push([name.to_owned(), found, "left out".to_owned()]);
            }
        }
        for l in &self.left_out {
            let found = format!("{:.1} to {:.1} s: {}", l.from_s, l.to_s, l.reason);
            out.push(["stretch".to_owned(), found, "left out".to_owned()]);
        }
        let found = format!("{:.1} s", self.recorded_s);
        out.push(["record".to_owned(), found, format!("{:.1} s used", self.used_s)]);
        out
    }
}

/// A log that is ready.
#[derive(Debug, Clone)]
pub(crate) struct Prepared {
    pub log: DriveLog,
    /// Rows that are driving, in order.
    pub stretches: Vec<Range<usize>>,
    /// What is not known of the lane signals for the whole record.
    pub lane_doubts: Vec<LaneDoubt>,
    /// The motion of the wheel above a torsion bar, where there is one.
    pub wheel: Option<WheelMotion>,
    pub preflight: Preflight,
}

impl Prepared {
    /// Leaves the first of so many rows each.
    fn keep_every(&mut self, every: usize) {
        if every < 2 {
            return;
        }
        let (rows, rate_hz) = (self.log.len(), 1.0 / self.log.dt_s);
        let found = format!("{rows} at {rate_hz:.0} Hz");
        self.preflight
            .reading
            .push(["rows".to_owned(), found, format!("one of {every} used")]);
        self.log.keep_every(every);
        let doubts = self.lane_doubts.iter_mut().map(|doubt| &mut doubt.signal);
        let wheel = self
            .wheel
            .iter_mut()
            .flat_map(|w| [&mut w.rate, &mut w.acceleration]);
        for signal in doubts.chain(wheel) {
            *signal = signal.iter().copied().step_by(every).collect();
        }
        for stretch in &mut self.stretches {
            *stretch = stretch.start.div_ceil(every)..stretch.end.div_ceil(every);
        }
    }
}

/// Examines, repairs and cuts `log`.
pub(crate) fn prepare(log: &DriveLog, options: &Options) -> Prepared {
    let dt = log.dt_s;
    let columns = log.signals();
    let examine = |c: usize, signal: &[f64]| faults::examine(signal, dt, LEAST[c], c < 2);
    let mut angle = examine(2, columns[2]);
    let (hands_nm, wheel) = hands(&mut angle.signal, columns[4], dt, options);
    let examined = [
        examine(0, columns[0]),
        examine(1, columns[1]),
        angle,
        examine(3, columns[3]),
        // A bar's torque swings with the wheel, faster than hands: what is out of line is seen in the hands' torque.
        examine(4, &hands_nm),
    ];
    let lane = [0, 1].map(|c| {
        options
            .lane_noise
            .then(|| smoothed_lane(&examined[c], c, &examined[2].signal, dt, options))
    });
    let bad = bad_rows(&examined, &lane);
    let mut lane_noise = [LaneNoise::default(); 2];
    let [e_y, e_theta, phi, t_h, t_d] = examined;
    let named = [&e_y, &e_theta, &phi, &t_h, &t_d];
    let mut preflight = Preflight {
        columns: COLUMNS[1..]
            .iter()
            .copied()
            .zip(named.map(|e| e.faults))
            .collect(),
        reading: log.findings.clone(),
        bridge_s: options.bridge_s,
        recorded_s: log.len() as f64 * dt,
        recorded_rows: log.len(),
        ..Preflight::default()
    };
    let [y, theta] = lane;
    let mut lane_doubts = Vec::new();
    let mut take = |smoothed: Option<Smoothed>, raw: Vec<f64>, lane: usize| {
        let Some(s) = smoothed else { return raw };
        lane_noise[lane] = s.noise;
        let doubt = |signal| LaneDoubt {
            lane,
            from: 0,
            signal,
        };
        lane_doubts.extend(s.doubts.into_iter().map(doubt));
        s.signal
    };
    let clean = DriveLog {
        start_s: log.start_s,
        dt_s: dt,
        e_y_m: take(y, e_y.signal, 0),
        e_theta_rad: take(theta, e_theta.signal, 1),
        wheel_angle_rad: phi.signal,
        guidance_torque_nm: t_h.signal,
        driver_torque_nm: t_d.signal,
        approximate_points: log.approximate_points,
        resampling: log.resampling.clone(),
        speeds_m_per_s: log.speeds_m_per_s,
        findings: Vec::new(),
    };
    preflight.lane_noise = lane_noise;
    let (stretches, left_out) = stretches::stretches(log, &clean, &bad, lane_noise, options);
    preflight.left_out = left_out;
    preflight.used_s = stretches.iter().map(|s| s.len() as f64 * dt).sum();
    let mut prepared = Prepared {
        log: clean,
        stretches,
        lane_doubts,
        wheel,
        preflight,
    };
    if prepared.wheel.is_some() {
        // Rows of 0.05 s do not make 0.055 of it.
        prepared.keep_every((FIT_ROW_S / dt + 1e-6) as usize);
    }
    prepared
}

/// By column, the rows that are not to be used, unless others make up for them.
fn bad_rows(examined: &[faults::Examined; 5], lane: &[Option<Smoothed>; 2]) -> Vec<Vec<bool>> {
    let mut bad: Vec<Vec<bool>> = examined.iter().map(|e| e.bad.clone()).collect();
    for (c, s) in lane.iter().enumerate() {
        if let Some(s) = s {
            for (b, e) in bad[c].iter_mut().zip(&s.error_sd) {
                *b &= e * USUAL_GAINS[c] > LARGEST_BRIDGED_NM;
            }
            for (b, &burst) in bad[c].iter_mut().zip(&s.bursts) {
                *b |= burst;
            }
        }
    }
    bad
}

/// The torque of the hands, N.m, from that of a bar above which a wheel turns, if there is one, and how the wheel moves. The angle becomes that of the
/// wheel.
fn hands(
    angle_rad: &mut [f64],
    torque_nm: &[f64],
    dt: f64,
    options: &Options,
) -> (Vec<f64>, Option<WheelMotion>) {
    let mut hands_nm = torque_nm.to_vec();
    let Some(inertia) = options.wheel_inertia else {
        return (hands_nm, None);
    };
    if let Some(stiffness) = options.bar_stiffness {
        let bar_nm = faults::examine(torque_nm, dt, LEAST[4], false).signal;
        for (phi, bar) in angle_rad.iter_mut().zip(bar_nm) {
            *phi += bar / stiffness;
        }
    }
    let wheel = WheelMotion::of(angle_rad, dt);
    wheel.add_to(&mut hands_nm, inertia, options.wheel_damping());
    (hands_nm, Some(wheel))
}

/// e_y (lane 0) or e_theta (1) without the camera's noise.
fn smoothed_lane(
    examined: &faults::Examined,
    lane: usize,
    wheel_angle: &[f64],
    dt: f64,
    options: &Options,
) -> Smoothed {
    smooth(
        &examined.signal,
        wheel_angle,
        dt,
        (2 - lane, !options.plain_smoother),
        &examined.weight,
        [0.1 * examined.faults.step, LEAST[lane]],
    )
}
