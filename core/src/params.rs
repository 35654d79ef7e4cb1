//! Parameters in SI, checked once and turned into the immutable configuration of the controller.
//!
//! A rejected parameter is named with its value and its range. Everything is `const`, so that a firmware
//! image checks its built-in set at compile time and carries no float code for it.

use core::fmt;

use crate::envelope::Envelope;
use crate::law::Law;
use crate::monitor::Monitor;
use crate::plausibility::Plausibility;
use crate::probe::Probe;
use crate::quantity::{Gain, Speed, Torque};
use crate::reliance::{BLOCK_S, Reliance};
use crate::vital::vital;

/// Parameters of the guidance controller, SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// K_1, overall gain, N.m, 0 to 4.
    pub k_1: f64,
    /// a1' on e_y', 1/m, 0 to 100.
    pub a_1: f64,
    /// a2' on de_y'/dt, s/m, 0 to 100.
    pub a_2: f64,
    /// a3' on e_theta', 1/rad, 0 to 100.
    pub a_3: f64,
    /// a4' on de_theta'/dt, s/rad, 0 to 100.
    pub a_4: f64,
    /// Corner of the low-pass on both rates, Hz, 0.5 to 60 (half the camera's sample rate).
    pub rate_corner_hz: f64,
    /// L, absolute limit of the guidance torque, N.m, 0.1 to 5. Profiles in use: 5 (paper, section 3.2) and
    /// 3 (production units that fault above 3).
    pub torque_limit_nm: f64,
    /// Largest growth of the torque, N.m/s, 0.5 to 4 (lateral jerk and acceleration limits of ISO 11270).
    pub wind_up_nm_per_s: f64,
    /// Largest fall of the torque, N.m/s, 4 (a planned fade) to 8.
    pub reduction_nm_per_s: f64,
    /// Slowest speed that is guided, m/s, 0.5 to 30.
    pub least_speed_mps: f64,
    /// Amplitude of the probe, N.m, 0 to 0.3.
    pub probe_amplitude_nm: f64,
    /// Frequency of the probe, Hz, 1 to 5. Its steepest slope, 2*pi*amplitude*frequency, is at most 3.5 N.m/s,
    /// so that the wind-up limit leaves room for it and nominal guidance together.
    pub probe_frequency_hz: f64,
    /// t_nms of the driver's arm, s, 0.01 to 1: what the estimator of reliance assumes.
    pub t_nms_s: f64,
    /// K_nms of the driver's arm, N.m/rad, 0 to 10, likewise.
    pub k_nms: f64,
    /// The vehicle as the plausibility checks know it.
    pub vehicle: VehicleParams,
}

/// What the plausibility checks know of the vehicle. The defaults follow from the paper's tables 8 and 9.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VehicleParams {
    /// K_t/l, front wheel angle per wheel angle over the wheelbase, 1/m, 0.001 to 0.1.
    pub curvature_gain_1pm: f64,
    /// Stability factor `A = m*(l_r*K_r - l_f*K_f)/(2*l^2*K_f*K_r)`, s2/m2, 0 to 0.01.
    pub stability_factor_s2pm2: f64,
    /// Aligning torque on the column per lateral acceleration `K_aln*m*l_r/(2*l*K_f)`, N.m.s2/m, 0 to 20.
    pub aligning_gain_nms2pm: f64,
    /// B_s, N.m.s/rad, 0 to 10.
    pub column_damping_nms: f64,
    /// t'_f of the lane preview's sender, s, 0.1 to 3.
    pub far_time_s: f64,
}

impl Params {
    /// Table 8 of the paper, its 5 N.m limit, and a 10 Hz corner for the rates (docs/numerics.md says why).
    pub const PAPER: Self = Self {
        k_1: 0.25,
        a_1: 2.0,
        a_2: 0.05,
        a_3: 40.0,
        a_4: 1.0,
        rate_corner_hz: 10.0,
        torque_limit_nm: 5.0,
        wind_up_nm_per_s: 4.0,
        reduction_nm_per_s: 8.0,
        least_speed_mps: 5.0,
        probe_amplitude_nm: 0.2,
        probe_frequency_hz: 2.5,
        t_nms_s: 0.1,
        k_nms: 1.0,
        vehicle: VehicleParams {
            // (1/17) / 2.635
            curvature_gain_1pm: 0.022_324,
            stability_factor_s2pm2: 0.001_753,
            aligning_gain_nms2pm: 0.987_4,
            column_damping_nms: 0.57,
            far_time_s: 0.7,
        },
    };
}

impl Default for Params {
    fn default() -> Self {
        Self::PAPER
    }
}

/// A parameter out of its range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParamError {
    /// The parameter's name, as the field of [`Params`] or a product of them.
    pub name: &'static str,
    /// The value it had.
    pub value: f64,
    /// Least allowed value.
    pub min: f64,
    /// Largest allowed value.
    pub max: f64,
}

impl fmt::Display for ParamError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} = {} is outside [{}, {}]",
            self.name, self.value, self.min, self.max
        )
    }
}

impl core::error::Error for ParamError {}

vital! {
    /// The checked configuration of every block of the controller.
    pub struct Config {
        /// Equation (9).
        pub law: Law,
        /// Torque limits.
        pub envelope: Envelope,
        /// Margins of the input checks.
        pub plausibility: Plausibility,
        /// Slowest speed that is guided.
        pub least_speed: Speed,
        /// The probe.
        pub probe: Probe,
    }
}

/// Largest product K_1*a', in N.m per unit: keeps the law's wide sum inside an `i64`.
const MAX_GAIN: f64 = 32.0;
/// Steepest slope of the probe, N.m/s.
const MAX_PROBE_SLOPE: f64 = 3.5;

impl Config {
    /// The paper's parameters, checked at compile time.
    pub const PAPER: Self = match Self::new(&Params::PAPER) {
        Ok(config) => config,
        Err(_) => panic!("the paper's parameters are in range"),
    };

    /// Checks every parameter. The ends of a range are in it, also as the nearest f32.
    ///
    /// # Errors
    /// The first parameter that is not a number within its range.
    pub const fn new(p: &Params) -> Result<Self, ParamError> {
        let v = &p.vehicle;
        let checks = [
            ("k_1", p.k_1, 0.0, 4.0),
            ("a_1", p.a_1, 0.0, 100.0),
            ("a_2", p.a_2, 0.0, 100.0),
            ("a_3", p.a_3, 0.0, 100.0),
            ("a_4", p.a_4, 0.0, 100.0),
            ("rate_corner_hz", p.rate_corner_hz, 0.5, 60.0),
            ("torque_limit_nm", p.torque_limit_nm, 0.1, 5.0),
            ("wind_up_nm_per_s", p.wind_up_nm_per_s, 0.5, 4.0),
            ("reduction_nm_per_s", p.reduction_nm_per_s, 4.0, 8.0),
            ("least_speed_mps", p.least_speed_mps, 0.5, 30.0),
            ("probe_amplitude_nm", p.probe_amplitude_nm, 0.0, 0.3),
            ("probe_frequency_hz", p.probe_frequency_hz, 1.0, 5.0),
            ("t_nms_s", p.t_nms_s, 0.01, 1.0),
            ("k_nms", p.k_nms, 0.0, 10.0),
            (
                "2 * pi * probe_amplitude_nm * probe_frequency_hz",
                2.0 * core::f64::consts::PI * p.probe_amplitude_nm * p.probe_frequency_hz,
                0.0,
                MAX_PROBE_SLOPE,
            ),
            ("vehicle.curvature_gain_1pm", v.curvature_gain_1pm, 0.001, 0.1),
            (
                "vehicle.stability_factor_s2pm2",
                v.stability_factor_s2pm2,
                0.0,
                0.01,
            ),
            ("vehicle.aligning_gain_nms2pm", v.aligning_gain_nms2pm, 0.0, 20.0),
            ("vehicle.column_damping_nms", v.column_damping_nms, 0.0, 10.0),
            ("vehicle.far_time_s", v.far_time_s, 0.1, 3.0),
            ("k_1 * a_1", p.k_1 * p.a_1, 0.0, MAX_GAIN),
            ("k_1 * a_2", p.k_1 * p.a_2, 0.0, MAX_GAIN),
            ("k_1 * a_3", p.k_1 * p.a_3, 0.0, MAX_GAIN),
            ("k_1 * a_4", p.k_1 * p.a_4, 0.0, MAX_GAIN),
        ];
        let mut i = 0;
        while i < checks.len() {
            let (name, value, min, max) = checks[i];
            // The bus carries an f32: a bound that is none must not be refused for its rounding.
            let (least, most) = (f64::min(min, min as f32 as f64), f64::max(max, max as f32 as f64));
            // NaN compares false, so it is rejected too.
            if !(value >= least && value <= most) {
                return Err(ParamError {
                    name,
                    value,
                    min,
                    max,
                });
            }
            i += 1;
        }
        Ok(Self {
            law: Law {
                e_y: Gain::from_si(p.k_1 * p.a_1),
                e_y_rate: Gain::from_si(p.k_1 * p.a_2),
                e_theta: Gain::from_si(p.k_1 * p.a_3),
                e_theta_rate: Gain::from_si(p.k_1 * p.a_4),
                tau: (256e6 / (2.0 * core::f64::consts::PI * p.rate_corner_hz) + 0.5) as u32,
            },
            envelope: Envelope {
                absolute: Torque::from_nm(p.torque_limit_nm),
                wind_up: Torque::from_nm(p.wind_up_nm_per_s),
                reduction: Torque::from_nm(p.reduction_nm_per_s),
                window: Torque::from_nm(1.2),
                override_from: Torque::from_nm(0.8),
                override_slope: Gain::from_si(3.0),
            },
            plausibility: Plausibility {
                curvature_gain: Gain::from_si(v.curvature_gain_1pm),
                stability_factor: Gain::from_si(v.stability_factor_s2pm2),
                aligning_gain: Gain::from_si(v.aligning_gain_nms2pm),
                column_damping: Gain::from_si(v.column_damping_nms),
                far_time: Gain::from_si(v.far_time_s),
                lane_margin: Gain::from_si(0.4),
                column_margin: Gain::from_si(0.6),
            },
            least_speed: Speed::from_mps(p.least_speed_mps),
            probe: Probe {
                amplitude: Torque::from_nm(p.probe_amplitude_nm),
                phase_per_us: phase_per_us(p.probe_frequency_hz),
            },
        })
    }
}

/// 2^32 turns for each second's 10^6 microseconds.
const fn phase_per_us(frequency_hz: f64) -> u32 {
    (frequency_hz * 4_294.967_296 + 0.5) as u32
}

/// Everything that parameters decide: the controller's configuration, the monitor's and the estimator's.
#[derive(Debug, Clone, Copy)]
pub struct Setup {
    /// Law, envelope, plausibility.
    pub config: Config,
    /// The monitor's own limits.
    pub monitor: Monitor,
    /// The estimator of reliance.
    pub reliance: Reliance,
}

impl Setup {
    /// The paper's parameters.
    pub const PAPER: Self = Self {
        config: Config::PAPER,
        monitor: Monitor::new(&Params::PAPER),
        reliance: Reliance::new(&Params::PAPER),
    };

    /// Checks every parameter.
    ///
    /// # Errors
    /// The first parameter that is not a number within its range.
    pub const fn new(p: &Params) -> Result<Self, ParamError> {
        match Config::new(p) {
            Ok(config) => Ok(Self {
                config,
                monitor: Monitor::new(p),
                reliance: Reliance::new(p),
            }),
            Err(error) => Err(error),
        }
    }
}

impl Reliance {
    /// The estimator's settings.
    #[must_use]
    const fn new(p: &Params) -> Self {
        let turns = p.probe_frequency_hz * 2.0 * core::f64::consts::PI;
        Self {
            phase_per_us: phase_per_us(p.probe_frequency_hz),
            periods: (p.probe_frequency_hz * BLOCK_S + 0.5) as u32,
            amplitude_nm: p.probe_amplitude_nm as f32,
            lag: (turns * p.t_nms_s) as f32,
            k_nms: p.k_nms as f32,
        }
    }
}

impl Monitor {
    /// The monitor's own limits, straight from the SI parameters and past the configuration above.
    #[must_use]
    pub const fn new(p: &Params) -> Self {
        Self {
            limit_mnm: (p.torque_limit_nm * 1e3 + 0.5) as i32,
            growth_mnm_per_ms: (p.wind_up_nm_per_s + 0.999) as i32,
            probe_mnm: (p.probe_amplitude_nm * 1e3 + 0.999) as i32,
            gains_mnm: [
                (p.k_1 * p.a_1 * 1e3 + 0.5) as i32,
                (p.k_1 * p.a_3 * 1e3 + 0.5) as i32,
                (p.k_1 * p.a_2 * 1e3 + 0.5) as i32,
                (p.k_1 * p.a_4 * 1e3 + 0.5) as i32,
            ],
        }
    }
}
