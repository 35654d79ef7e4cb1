//! The driver of equations (7) and (8) as a linear combination of signals that can be computed from a log.
//!
//! For a known muscle (K_nms, t_nms) the driver's torque is
//! `T_d = sum_i gain_i * L[u_i](t - t_p) - K_hg * L[T_h](t) - K_nms * L[phi](t)`, with L the muscle's lag
//! `1/(1 + t_nms s)`, `u = (e_y, Int e_y, e_theta)` and `gain_i = (K_d + K_nms) * a_i`: linear in everything but
//! the delay. This is why K_d and a_i cannot be told apart.
//!
//! Hold: e_y, e_theta and the wheel angle are continuous, so they are taken as straight lines between samples,
//! lowered by a twelfth of the second difference so that the area under a bend is right, and the lag's response
//! to those lines is exact. T_h is what the ECU decided in its last millisecond and holds for the rest of it:
//! its value belongs to the middle of that millisecond, from where it is moved to the sample instant along its
//! slope, and then taken as the others. Where T_h jumps faster than the torque envelope can move, a probe
//! switched (or the guidance failed), and the old value is held up to the instant that [`super::switches`] finds. Half a
//! millisecond matters: with a 2.5 Hz sine as probe it is 10 ms of t_p. The delay is exact for the same lines, at
//! any fraction of a sample, and so is its derivative:
//! `d/dt_p L[u](t - t_p) = -(u - L[u])(t - t_p) / t_nms`.

use super::road::road;
use super::switches::Switches;
use super::wide::{BLOCK, integral, window};
use haptic_recording::DriveLog;

/// The muscle of equation (8), taken as known (table 4).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Muscle {
    /// Reflex gain K_nms, N.m/rad.
    pub k_nms: f64,
    /// Time constant t_nms, s.
    pub t_nms_s: f64,
}

impl Default for Muscle {
    fn default() -> Self {
        Self {
            k_nms: 1.0,
            t_nms_s: 0.1,
        }
    }
}

/// The ECU decides a torque every so many seconds, counted from time zero of the log.
const ECU_PERIOD_S: f64 = 1e-3;

/// Share of that period by which a time stamp may be rounded: one at the ECU's instant must not fall before it.
const TIME_STAMP_ROUNDING: f64 = 0.1;

/// Weights of `L[u](t_j + tau) = decay * m_j + w0 * u_j + w1 * u_{j+1}` for u straight from j to j+1.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LagWeights {
    pub decay: f64,
    pub w0: f64,
    pub w1: f64,
}

impl LagWeights {
    pub(crate) fn after(tau_s: f64, dt_s: f64, t_nms_s: f64) -> Self {
        let decay = (-tau_s / t_nms_s).exp();
        let w1 = tau_s / dt_s - t_nms_s / dt_s * (1.0 - decay);
        Self {
            decay,
            w0: 1.0 - decay - w1,
            w1,
        }
    }
}

/// A signal and the muscle's response to it, at the sample instants.
#[derive(Debug, Clone)]
pub(crate) struct Lagged {
    pub raw: Vec<f64>,
    pub lagged: Vec<f64>,
}

impl Lagged {
    fn straight(raw: Vec<f64>, dt_s: f64, t_nms_s: f64) -> Self {
        let lagged = lag(&raw, dt_s, t_nms_s, |_, to| to);
        Self { raw, lagged }
    }
}

/// Response of the lag, from the steady state of the first sample, to straight lines from each sample to
/// `end(this, next)`.
fn lag(u: &[f64], dt_s: f64, t_nms_s: f64, end: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    let w = LagWeights::after(dt_s, dt_s, t_nms_s);
    let mut m = u[0];
    std::iter::once(m)
        .chain(u.windows(2).map(|pair| {
            m = w.decay * m + w.w0 * pair[0] + w.w1 * end(pair[0], pair[1]);
            m
        }))
        .collect()
}

/// Response of the lag to the torque that the ECU held, of which the log has samples.
fn lagged_guidance(log: &DriveLog, t_nms_s: f64) -> Vec<f64> {
    let (torque, dt_s) = (&log.guidance_torque_nm, log.dt_s);
    let switches = Switches::of(log);
    let steps = &switches.steps;
    let rest: Vec<f64> = torque.iter().zip(steps).map(|(t, s)| t - s).collect();
    let last = rest.len() - 1;
    let moved: Vec<f64> = (0..=last)
        .map(|k| {
            let (before, after) = (k.saturating_sub(1), (k + 1).min(last));
            let slope = (rest[after] - rest[before]) / ((after - before) as f64 * dt_s);
            let ticks = log.time_s(k) / ECU_PERIOD_S;
            let age = ticks - (ticks + TIME_STAMP_ROUNDING).floor();
            rest[k] + slope * (age - 0.5) * ECU_PERIOD_S
        })
        .collect();
    let continuous = lag(&lines(&moved), dt_s, t_nms_s, |_, to| to);
    let mut stepped = lag(steps, dt_s, t_nms_s, |from, _| from);
    if switches.clock.is_some() {
        let decay = (-dt_s / t_nms_s).exp();
        let mut more = 0.0;
        for k in 1..stepped.len() {
            let rise = steps[k] - steps[k - 1];
            more *= decay;
            if rise != 0.0 {
                more += rise * (1.0 - (-switches.before_row_s(k, dt_s) / t_nms_s).exp());
            }
            stepped[k] += more;
        }
    }
    continuous.iter().zip(&stepped).map(|(c, s)| c + s).collect()
}

/// Everything about a log that does not depend on the parameters sought.
#[derive(Debug, Clone)]
pub(crate) struct Signals {
    pub dt_s: f64,
    pub t_nms_s: f64,
    /// e_y, Int e_y and e_theta.
    pub visual: [Lagged; 3],
    /// The turn of the road, rad/s, and its heading, as [`super::road`] has them.
    pub road: [Lagged; 2],
    /// T_h and the muscle's response to it.
    pub guidance: Vec<f64>,
    pub guidance_raw: Vec<f64>,
    /// The wheel angle and the muscle's response to it.
    pub wheel: Lagged,
    /// T_d.
    pub torque: Vec<f64>,
    /// T_d + K_nms * L[phi]: what the visual and the haptic part have to explain.
    pub target: Vec<f64>,
    /// Whether T_h is other than zero anywhere.
    pub guided: bool,
}

impl Signals {
    /// Prepares `log`. The integral of e_y starts at zero: what it was before the record is a constant in the
    /// torque, which the estimators take as one more unknown.
    pub(crate) fn new(log: &DriveLog, muscle: Muscle) -> Self {
        let (dt_s, t_nms_s) = (log.dt_s, muscle.t_nms_s);
        let e_y = lines(&log.e_y_m);
        let int_e_y = integral(&e_y, dt_s);
        let visual = [e_y, int_e_y, lines(&log.e_theta_rad)].map(|raw| Lagged::straight(raw, dt_s, t_nms_s));
        let road = road(log).map(|raw| Lagged::straight(raw, dt_s, t_nms_s));
        let phi = Lagged::straight(lines(&log.wheel_angle_rad), dt_s, t_nms_s);
        let guidance = lagged_guidance(log, t_nms_s);
        let target = log
            .driver_torque_nm
            .iter()
            .zip(&phi.lagged)
            .map(|(t, p)| t + muscle.k_nms * p)
            .collect();
        let guided = log.guidance_torque_nm.iter().any(|&t| t != 0.0);
        Self {
            dt_s,
            t_nms_s,
            visual,
            road,
            guidance,
            guidance_raw: log.guidance_torque_nm.clone(),
            wheel: phi,
            torque: log.driver_torque_nm.clone(),
            target,
            guided,
        }
    }

    /// What a driver sees whose own line lies beside the target line by an offset, m, and by so much for each rad/s of the road's
    /// turn.
    pub(crate) fn beside(&mut self, offset: f64, bend: f64) {
        let dt_s = self.dt_s;
        let [turn, heading] = self.road.clone();
        let add = |u: &mut Lagged, more: &Lagged, ramp: f64| {
            for (all, more) in [(&mut u.raw, &more.raw), (&mut u.lagged, &more.lagged)] {
                for (k, (x, more)) in all.iter_mut().zip(more).enumerate() {
                    *x += bend * more + ramp * k as f64 * dt_s;
                }
            }
        };
        add(&mut self.visual[0], &turn, 0.0);
        add(&mut self.visual[1], &heading, offset);
    }

    /// A signal that the driver might have seen, as [`Signals::visual`].
    pub(crate) fn seen(&self, raw: &[f64]) -> Lagged {
        Lagged::straight(lines(raw), self.dt_s, self.t_nms_s)
    }

    /// Whole samples of the delay, rounded up, and the weights of the rest.
    pub(crate) fn delay(&self, t_p_s: f64) -> Delay {
        let samples = (t_p_s / self.dt_s).ceil().max(0.0);
        let tau_s = samples * self.dt_s - t_p_s;
        Delay {
            samples: samples as usize,
            fraction: tau_s / self.dt_s,
            weights: LagWeights::after(tau_s, self.dt_s, self.t_nms_s),
            per_t_nms: 1.0 / self.t_nms_s,
        }
    }
}

/// A delay, split for reading signals in the past.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Delay {
    pub samples: usize,
    fraction: f64,
    weights: LagWeights,
    per_t_nms: f64,
}

impl Delay {
    /// `L[u](t_k - t_p)` and its derivative with respect to t_p; `k` must be at least the delay.
    #[inline]
    pub(crate) fn read(&self, u: &Lagged, k: usize) -> (f64, f64) {
        let j = k - self.samples;
        let (u0, u1) = (u.raw[j], u.raw[(j + 1).min(u.raw.len() - 1)]);
        let value = self.weights.decay * u.lagged[j] + self.weights.w0 * u0 + self.weights.w1 * u1;
        let input = u0 + self.fraction * (u1 - u0);
        (value, (value - input) * self.per_t_nms)
    }

    /// [`Delay::read`] of the [`BLOCK`] of rows from `first` on; those behind the record mean nothing.
    #[inline(always)]
    pub(crate) fn read_block(
        &self,
        u: &Lagged,
        first: usize,
        value: &mut [f64; BLOCK],
        slope: &mut [f64; BLOCK],
    ) {
        let j = first - self.samples;
        let mut spare = [[0.0; BLOCK]; 3];
        let [spare_0, spare_1, spare_2] = &mut spare;
        let lagged = window(&u.lagged, j, spare_0);
        let (u0, u1) = (window(&u.raw, j, spare_1), window(&u.raw, j + 1, spare_2));
        for i in 0..BLOCK {
            value[i] = self.weights.decay * lagged[i] + self.weights.w0 * u0[i] + self.weights.w1 * u1[i];
            let input = u0[i] + self.fraction * (u1[i] - u0[i]);
            slope[i] = (value[i] - input) * self.per_t_nms;
        }
    }

    /// `u(t_k - t_p)` itself and its derivative with respect to t_p.
    #[inline]
    pub(crate) fn read_raw(&self, u: &[f64], k: usize, dt_s: f64) -> (f64, f64) {
        let j = k - self.samples;
        let (u0, u1) = (u[j], u[(j + 1).min(u.len() - 1)]);
        (u0 + self.fraction * (u1 - u0), (u0 - u1) / dt_s)
    }
}

/// Corners of the straight lines that have, between samples, the area of the parabolas through them.
fn lines(u: &[f64]) -> Vec<f64> {
    let mut out = u.to_vec();
    for (corner, w) in out[1..].iter_mut().zip(u.windows(3)) {
        *corner -= (w[0] - 2.0 * w[1] + w[2]) / 12.0;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 40 s at 120 Hz of e_y = sin 2t, e_theta = cos 0.7t, phi = sin t, T_h = 0.2 switching sign each second.
    fn log() -> DriveLog {
        let dt_s = 1.0 / 120.0;
        let t: Vec<f64> = (0..4800).map(|k| f64::from(k) * dt_s).collect();
        DriveLog {
            start_s: 0.0,
            dt_s,
            e_y_m: t.iter().map(|t| (2.0 * t).sin()).collect(),
            e_theta_rad: t.iter().map(|t| (0.7 * t).cos()).collect(),
            wheel_angle_rad: t.iter().map(|t| t.sin()).collect(),
            guidance_torque_nm: (0..4800)
                .map(|k| if k / 120 % 2 == 0 { 0.2 } else { -0.2 })
                .collect(),
            driver_torque_nm: vec![0.0; 4800],
            approximate_points: false,
            resampling: Vec::new(),
            speeds_m_per_s: None,
            findings: Vec::new(),
        }
    }

    /// In the steady state, a lag T turns sin wt into sin(wt - atan wT)/sqrt(1 + (wT)^2), and a delay only moves
    /// it. The transient exp(-t/T) is gone after 3 s.
    #[test]
    fn delayed_and_lagged_sines_are_those_of_the_frequency_response() {
        let log = log();
        let s = Signals::new(&log, Muscle::default());
        let sine = |w: f64, t: f64| (w * t - (w * 0.1).atan()).sin() / (1.0 + (w * 0.1).powi(2)).sqrt();
        let cosine = |w: f64, t: f64| (w * t - (w * 0.1).atan()).cos() / (1.0 + (w * 0.1).powi(2)).sqrt();
        for t_p in [0.0, 0.0123, 0.1, 0.3337] {
            let delay = s.delay(t_p);
            for k in (480..4799).step_by(7) {
                let t = log.time_s(k) - t_p;
                let (value, slope) = delay.read(&s.visual[0], k);
                assert!((value - sine(2.0, t)).abs() < 1e-5, "{t_p} {k}");
                // The lines lie up to a twelfth of the second difference off the sine.
                assert!((slope + 2.0 * cosine(2.0, t)).abs() < 1e-3, "{t_p} {k}");
                // Int sin 2t = (1 - cos 2t)/2, whose constant passes the lag; lines lose dt^2/12 of its bend.
                let (value, _) = delay.read(&s.visual[1], k);
                assert!((value - (0.5 - 0.5 * cosine(2.0, t))).abs() < 2e-5);
                let (value, _) = delay.read(&s.visual[2], k);
                assert!((value - cosine(0.7, t)).abs() < 1e-5);
                // T_d is zero, so the target is K_nms times the lagged wheel angle.
                assert!((s.target[k] - sine(1.0, log.time_s(k))).abs() < 1e-5);
            }
        }
    }

    /// The ECU holds each millisecond what a sine was at its beginning, so the arm sees the sine half a millisecond
    /// late; a log that samples the held values at 120 Hz, whose instants lie 0, 1/3 and 2/3 ms after the ECU's, is
    /// read as just that.
    #[test]
    fn a_torque_held_by_the_ecu_is_read_at_the_middle_of_its_millisecond() {
        let mut log = log();
        let w = 15.0;
        log.guidance_torque_nm = (0..4800)
            .map(|k| 0.2 * (w * (f64::from(k) * 1000.0 / 120.0 + 1e-9).floor() * 1e-3).sin())
            .collect();
        let s = Signals::new(&log, Muscle::default());
        for k in 480..4700 {
            let t = log.time_s(k) - 0.5e-3;
            let want = 0.2 * (w * t - (w * 0.1).atan()).sin() / (1.0 + (w * 0.1).powi(2)).sqrt();
            assert!(
                (s.guidance[k] - want).abs() < 1e-5,
                "{k}: {} {want}",
                s.guidance[k]
            );
        }
    }

    /// A square wave that switches on a sample instant is held up to it: just at the switch, the lag's answer
    /// is still that of the old value. Steady state of a +-A square wave of half period P:
    /// A (1 - 2 e^{-t/T}/(1 + e^{-P/T})) after a rise.
    #[test]
    fn a_switching_torque_is_held_up_to_the_switch() {
        let s = Signals::new(&log(), Muscle::default());
        let rise = |t: f64| 0.2 * (1.0 - 2.0 * (-t / 0.1_f64).exp() / (1.0 + (-10.0_f64).exp()));
        for k in 0..120 {
            let t = k as f64 / 120.0;
            assert!((s.guidance[20 * 120 + k] - rise(t)).abs() < 1e-9);
        }
    }
}
