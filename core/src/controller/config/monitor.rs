//! The monitor's own limits and choices, straight from the SI parameters and past the rest of the configuration.

use super::LEAST_BAND_NM;
use crate::controller::params::Params;
use crate::safety::monitor::{DISTRUSTED, LAG_MS, Monitor, YIELD_MNM_PER_MS};

/// Half the monitor's band, N.m: how far an honest law may be from the monitor's coarse one. Both take rates from the
/// same samples, the law with its filter, the monitor over 50 to 60 ms, so that they differ by the change of a rate
/// times the difference of their delays: the errors' second derivatives are up to 4 m/s2 and 1 rad/s2 on a road. Noise
/// of 15 mm and 1.5 mrad, three times what a camera has, moves the law's rates by its share of a sample.
pub(super) const fn monitor_band_nm(p: &Params) -> f64 {
    let tau_s = 1.0 / (2.0 * core::f64::consts::PI * p.rate_corner_hz);
    let apart_s = f64::max(tau_s - 0.02, 0.06 - tau_s);
    let noise_per_s = 1.5 / (tau_s + 1.0 / 120.0);
    let a_rate = p.k_1 * p.a_2 * (4.0 * apart_s + 0.015 * noise_per_s);
    let theta_rate = p.k_1 * p.a_4 * (apart_s + 0.001_5 * noise_per_s);
    // A sample that is 30 ms old goes on at rates that differ by as much.
    let ahead = 0.03 * p.k_1 * (p.a_1 * 4.0 + p.a_3) * apart_s;
    let carried = 0.03 * p.k_1 * (p.a_1 * 1.5 + p.a_3 * 0.3);
    f64::max(LEAST_BAND_NM, 2.0 * (a_rate + theta_rate + ahead) + carried)
}

/// How long a bar's torque has to last, us, until guidance has yielded to the hands, and how far it may be beyond theirs meanwhile, mN.m.
/// After two time constants the observer's three lags have let a third of a torque through; from then on the limit L goes at the rate of
/// yielding, and the estimate settles: after ten 0.3 % are left. The margin is what the wheel's friction, its damping at 3 rad/s and its
/// inertia at 30 rad/s2 take: by so much the acceleration that the monitor finds may be wrong, in steps of an angle and behind its lags.
const fn bar_bound(p: &Params) -> [i32; 2] {
    if !p.has_bar() {
        return [0; 2];
    }
    let each_s = 1.0 / p.observer_bandwidth_rad_per_s;
    let yields_s = p.torque_limit_nm / YIELD_MNM_PER_MS as f64;
    let window_us = 1e6 * (2.0 * each_s + f64::max(8.0 * each_s, yields_s));
    let margin_nm = p.wheel_friction_nm + 3.0 * p.wheel_damping_nm_s + 30.0 * p.wheel_inertia_kg_m2;
    [(window_us + 0.5) as i32, (margin_nm * 1e3 + 0.999) as i32]
}

/// Inertia by the square of the monitor's lag, N.m per rad; 0 without a bar.
const fn wheel_mnm_per_mrad(p: &Params) -> i32 {
    let lag_s = LAG_MS as f64 * 1e-3;
    if p.has_bar() {
        (p.wheel_inertia_kg_m2 / (lag_s * lag_s) + 0.5) as i32
    } else {
        0
    }
}

/// How fast a torque may fall that is allowed to fall so many times as fast as usual. With a bar it may yield as fast to a hand that nobody
/// sees.
const fn fall_mnm_per_ms(p: &Params, times: i32) -> i32 {
    let fall = times * (p.reduction_nm_per_s + 0.999) as i32;
    let yields = if p.has_bar() { YIELD_MNM_PER_MS } else { 0 };
    if fall < yields { yields } else { fall }
}

impl Monitor {
    /// The monitor's own limits, straight from the SI parameters and past the configuration above.
    #[must_use]
    pub const fn new(p: &Params) -> Self {
        let [window_us, margin_mnm] = bar_bound(p);
        Self {
            limit_mnm: (p.torque_limit_nm * 1e3 + 0.5) as i32,
            growth_mnm_per_ms: (p.wind_up_nm_per_s + 0.999) as i32,
            fall_mnm_per_ms: fall_mnm_per_ms(p, 1),
            handover_fall_mnm_per_ms: fall_mnm_per_ms(p, DISTRUSTED),
            band_mnm: (monitor_band_nm(p) * 1e3 + 0.5) as i32,
            probe_mnm: (p.probe_amplitude_nm * 1e3 + 0.999) as i32,
            gains_mnm: [
                (p.k_1 * p.a_1 * 1e3 + 0.5) as i32,
                (p.k_1 * p.a_3 * 1e3 + 0.5) as i32,
                (p.k_1 * p.a_2 * 1e3 + 0.5) as i32,
                (p.k_1 * p.a_4 * 1e3 + 0.5) as i32,
            ],
            window_us,
            margin_mnm,
            wheel_mnm_per_mrad: wheel_mnm_per_mrad(p),
        }
    }
}
