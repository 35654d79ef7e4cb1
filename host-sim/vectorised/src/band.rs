//! The band of the shipping ECU's monitor in several runs, a little narrower: whoever is within this one is within that.

use haptic_core::controller::config::LEAST_BAND_NM;
use haptic_core::safety::monitor::{ASTRAY_MS, RATE_SPAN_US};

use super::counts::{flag, truncated};
use super::lanes::lanes;
use super::rejected::Reason;

/// Who decides the torque.
pub(super) const GUIDED: i32 = 0;
pub(super) const HANDOVER: i32 = 1;
pub(super) const OFF: i32 = 2;

/// Half the band of the monitor at least, mN.m, and for how many steps a torque may be beyond it.
const BAND_MNM: f64 = LEAST_BAND_NM * 1e3;
/// The monitor takes rates over at least this, ms.
const RATE_SPAN_MS: i32 = RATE_SPAN_US / 1000;

lanes! {
    /// What the monitor compares the torque with.
    pub(super) struct Band {
        half: f64 = 0.0,
        before_ms: i32 = 0,
        last_ms: i32 = 0,
        low: i32 = 0,
        high: i32 = 0,
        torque: i32 = 0,
        astray: i32 = 0,
    } beside {
        /// mN.m per m, per rad, per m/s, per rad/s; the last is what its coarse arithmetic may be off by, mN.m.
        gains: [[f64; N]; 4] = [[0.0; N]; 4],
        before: [[f64; N]; 2] = [[0.0; N]; 2],
        last: [[f64; N]; 2] = [[0.0; N]; 2],
    }
}

impl<const N: usize> Band<N> {
    pub(super) fn begin(
        &mut self,
        lane: usize,
        [on_e_y, on_e_y_rate, on_e_theta, on_e_theta_rate]: [f64; 4],
        probe_nm: f64,
    ) {
        self.clear(lane);
        let gains = [on_e_y, on_e_theta, on_e_y_rate, on_e_theta_rate].map(|gain| gain * 1e3);
        for (all, gain) in self.gains.iter_mut().zip(gains) {
            all[lane] = gain;
        }
        // Errors are cut to 1 mm and 0.1 mrad there, rates to 40 mm/s and 2 mrad/s; gains are whole numbers.
        let [e_y, e_theta, e_y_rate, e_theta_rate] = gains;
        let coarse = 8.0 + 2e-3 * e_y + 3e-4 * e_theta + 0.1 * e_y_rate + 4e-3 * e_theta_rate;
        // While there is a probe the monitor's is wider by it, to the next whole mN.m.
        self.half[lane] = BAND_MNM - coarse + probe_nm * 1e3;
        for errors in self.before.iter_mut().chain(&mut self.last) {
            errors[lane] = 0.0;
        }
    }

    /// What the lane errors ask for: proportional part, and with rates.
    #[inline(always)]
    pub(super) fn picture(&mut self, seen: &[[f64; N]; 2], own: &[i32; N], hears: &[i32; N]) {
        let [per_m, per_rad, per_mps, per_radps] = &self.gains;
        for l in 0..N {
            let hears = hears[l] != 0;
            let is_old = (self.last_ms[l].wrapping_sub(self.before_ms[l]) > RATE_SPAN_MS) & hears;
            for i in 0..2 {
                self.before[i][l] = if is_old {
                    self.last[i][l]
                } else {
                    self.before[i][l]
                };
                self.last[i][l] = if hears { seen[i][l] } else { self.last[i][l] };
            }
            self.before_ms[l] = if is_old {
                self.last_ms[l]
            } else {
                self.before_ms[l]
            };
            self.last_ms[l] = if hears { own[l] } else { self.last_ms[l] };
            let span_ms = self.last_ms[l].wrapping_sub(self.before_ms[l]).max(1);
            let per_s = 1e3 / f64::from(span_ms);
            let [e_y, e_theta] = [self.last[0][l], self.last[1][l]];
            let position = per_m[l] * e_y + per_rad[l] * e_theta;
            let rate = per_mps[l] * (e_y - self.before[0][l]) * per_s
                + per_radps[l] * (e_theta - self.before[1][l]) * per_s;
            let both = position + rate;
            let high = position.max(both).max(0.0) + self.half[l];
            let low = position.min(both).min(0.0) - self.half[l];
            self.high[l] = truncated(high.min(1e6));
            self.low[l] = truncated(low.max(-1e6));
        }
    }

    /// Without a picture the band grows: the monitor's by as much a millisecond, from 9 ms of that on.
    pub(super) fn grow(&mut self, lane: usize, lost_ms: u32) {
        if lost_ms > 10 {
            (self.low[lane], self.high[lane]) = (self.low[lane] - 1, self.high[lane] + 1);
        }
    }

    /// Counts the steps in which the torque is away from that.
    #[inline(always)]
    pub(super) fn judge(
        &mut self,
        applied: &[i32; N],
        mode: &[i32; N],
        matters: &[i32; N],
        suspect: &mut [i32; N],
    ) {
        let mut torques = [0; N];
        for l in 0..N {
            torques[l] = (applied[l] >> 12).wrapping_mul(1000) / 4096;
        }
        for l in 0..N {
            let torque = torques[l];
            let is_within = (torque >= self.low[l]) & (torque <= self.high[l]);
            let is_falling = torque.wrapping_abs() < self.torque[l].wrapping_abs();
            let longer = self.astray[l].wrapping_add(if is_falling { 0 } else { 1 });
            self.astray[l] = if is_within { 0 } else { longer };
            suspect[l] |= flag((self.astray[l] > ASTRAY_MS) & (mode[l] == GUIDED))
                & matters[l]
                & Reason::MonitorBand.bit();
            self.torque[l] = torque;
        }
    }
}
