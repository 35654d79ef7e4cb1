//! The monitor's own limits and choices, straight from the SI parameters and past the rest of the configuration.

use super::LEAST_BAND_NM;
use crate::controller::params::{FDCA, Params};
use crate::safety::monitor::{Fdca, Monitor};

/// Half the monitor's band, N.m: how far an honest law may be from the monitor's coarse one. Both take rates from the
/// same samples, the law with its filter, the monitor over 50 to 60 ms, so that they differ by the change of a rate
/// times the difference of their delays: the errors' second derivatives are up to 4 m/s2 and 1 rad/s2 on a road. Noise
/// of 15 mm and 1.5 mrad, three times what a camera has, moves the law's rates by its share of a sample.
pub(super) const fn monitor_band_nm(p: &Params) -> f64 {
    if p.law == FDCA {
        // The monitor's own has the law's filter.
        return LEAST_BAND_NM;
    }
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

impl Monitor {
    /// The monitor's own limits, straight from the SI parameters and past the configuration above.
    #[must_use]
    pub const fn new(p: &Params) -> Self {
        Self {
            limit_mnm: (p.torque_limit_nm * 1e3 + 0.5) as i32,
            growth_mnm_per_ms: (p.wind_up_nm_per_s + 0.999) as i32,
            fall_mnm_per_ms: (p.reduction_nm_per_s + 0.999) as i32,
            band_mnm: (monitor_band_nm(p) * 1e3 + 0.5) as i32,
            probe_mnm: (p.probe_amplitude_nm * 1e3 + 0.999) as i32,
            gains_mnm: if p.law == FDCA {
                // A gain below zero says so: (9) has none.
                [0, 0, -1, 0]
            } else {
                [
                    (p.k_1 * p.a_1 * 1e3 + 0.5) as i32,
                    (p.k_1 * p.a_3 * 1e3 + 0.5) as i32,
                    (p.k_1 * p.a_2 * 1e3 + 0.5) as i32,
                    (p.k_1 * p.a_4 * 1e3 + 0.5) as i32,
                ]
            },
        }
    }
}

impl Fdca {
    /// The monitor's own choices, straight from the SI parameters.
    #[must_use]
    pub const fn new(p: &Params) -> Self {
        let v = &p.vehicle;
        Self {
            k_y: (p.fdca_k_y_rad_per_m * 1e3 * 256.0 + 0.5) as i32,
            k_psi: (p.fdca_k_psi * 256.0 + 0.5) as i32,
            lohs: (p.fdca_lohs * 65_536.0 + 0.5) as i32,
            aligning: (v.aligning_gain_nm_s2_per_m * 1_048.576 + 0.5) as i32,
            curvature: (v.curvature_gain_per_m * 262_144.0 + 0.5) as i32,
            stability: (v.stability_factor_s2_per_m2 * 67_108_864.0 + 0.5) as i32,
            filter: (1e4 / (2.0 * core::f64::consts::PI * p.rate_corner_hz) + 0.5) as i32,
            speed: 0,
            e_theta_urad: 0,
            rate_urps: 0,
            apart_us: 0,
            unsettled_us: 0,
        }
    }
}
