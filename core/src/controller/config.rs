//! The parameters checked, and turned into the immutable configuration of every block.
//!
//! Everything is `const`, so that a firmware image checks its built-in set at compile time and carries no float code
//! for it. Not here: the list of parameters with their ranges ([`crate::controller::params`]).

#![expect(
    clippy::as_conversions,
    clippy::arithmetic_side_effects,
    clippy::float_arithmetic,
    clippy::indexing_slicing,
    reason = "parameters are SI values in f64, turned into bits at compile time or before the first step"
)]

mod monitor;
mod sensor;

use crate::controller::params::{DRIVER_ACTIVITY, LAWS, ParamError, Params, SENSORS, in_range, whole};
use crate::estimator::{BLOCK_S, Complex, Estimator, QUIET, T_NMS_SD_S};
use crate::law::probe::Probe;
use crate::law::schedule::Schedule;
use crate::law::{Coefficients, Law, LawWords};
use crate::observer::{Sensor, SensorWords};
use crate::quantity::{
    CurvaturePerAngle, Micros, Ratio, Seconds, Speed, StabilityFactor, Torque, TorquePerAcceleration,
    TorquePerAngle, TorquePerLength, TorquePerSpeed, TorquePerTurningRate, TorqueRate,
};
use crate::safety::envelope::Envelope;
use crate::safety::monitor::Monitor;
use crate::safety::plausibility::Plausibility;
use crate::safety::redundant::words;
use monitor::monitor_band_nm;
pub use sensor::hands_lag_s;

words! {
    /// The checked configuration of every block of the controller.
    pub struct Config {
        /// The guidance law: [`Config::law`].
        law: LawWords,
        /// Torque limits.
        pub envelope: Envelope,
        /// Margins of the input checks.
        pub plausibility: Plausibility,
        /// Slowest speed that is guided.
        pub least_speed: Speed,
        /// The probe.
        pub probe: Probe,
        /// Shares of the torque at the ends of the schedule, 1 between them at 60 km/h.
        pub schedule: Schedule,
        /// What the column's sensor measures: [`Config::sensor`].
        sensor: SensorWords,
    }
}

/// Largest product K_1*a', in N.m per unit: keeps the law's wide sum inside an `i64`.
const MAX_GAIN: f64 = 32.0;
const PROBE_SLOPE: &str = "2 * pi * probe_amplitude_nm * probe_frequency_hz";
/// Half the monitor's band, N.m: at least, and at most. As wide as the absolute limit it would guard nothing.
pub const LEAST_BAND_NM: f64 = 0.3;
const MOST_BAND_NM: f64 = 5.0;
const BAND: &str = "the monitor's band for k_1 * (a_1, a_2, a_3, a_4) at rate_corner_hz";
/// Steepest slope of the probe, N.m/s.
const MAX_PROBE_SLOPE: f64 = 3.5;

impl Config {
    /// The paper's parameters, checked at compile time.
    pub const PAPER: Self = match Self::new(&Params::PAPER) {
        Ok(config) => config,
        Err(_) => panic!("the paper's parameters are in range"),
    };

    /// Checks every parameter, and their products.
    ///
    /// # Errors
    /// The first that is not a number within its range.
    pub const fn new(p: &Params) -> Result<Self, ParamError> {
        match Self::check(p) {
            Ok(()) => Ok(Self::from_params(p)),
            Err(error) => Err(error),
        }
    }

    /// The law; `None` where the memory is damaged.
    #[must_use]
    pub const fn law(&self) -> Option<Law<'_>> {
        self.law.law()
    }

    /// The sensor of the column; `None` where the memory is damaged.
    #[must_use]
    pub const fn sensor(&self) -> Option<Sensor<'_>> {
        self.sensor.sensor()
    }

    const fn check(p: &Params) -> Result<(), ParamError> {
        // Before their ranges, so that a law or sensor that there is not is refused in one way, be it 3 or 0.5.
        let choices = [
            whole("law", p.law, LAWS.len()),
            whole("torque_sensor", p.torque_sensor, SENSORS.len()),
            p.check(),
        ];
        if let Err(error) = first_error(&choices) {
            return Err(error);
        }
        let slope = 2.0 * core::f64::consts::PI * p.probe_amplitude_nm * p.probe_frequency_hz;
        let gains = [0.0, MAX_GAIN];
        first_error(&[
            in_range(PROBE_SLOPE, slope, [0.0, MAX_PROBE_SLOPE], "N.m/s"),
            in_range("k_1 * a_1", p.k_1 * p.a_1, gains, "N.m/m"),
            in_range("k_1 * a_2", p.k_1 * p.a_2, gains, "N.m.s/m"),
            in_range("k_1 * a_3", p.k_1 * p.a_3, gains, "N.m/rad"),
            in_range("k_1 * a_4", p.k_1 * p.a_4, gains, "N.m.s/rad"),
            sensor::check(p),
        ])
    }

    /// The configuration of parameters that are in range.
    const fn from_params(p: &Params) -> Self {
        let v = &p.vehicle;
        let between_us = (f64::max(v.far_time_s - v.near_time_s, 0.0) * 1e6 + 0.5) as u32;
        Self {
            law: law(p),
            envelope: Envelope {
                absolute: Torque::from_nm(p.torque_limit_nm),
                wind_up: TorqueRate::from_nm_per_s(p.wind_up_nm_per_s),
                reduction: TorqueRate::from_nm_per_s(p.reduction_nm_per_s),
            },
            plausibility: Plausibility {
                curvature_gain: CurvaturePerAngle::from_per_m(v.curvature_gain_per_m),
                stability_factor: StabilityFactor::from_s2_per_m2(v.stability_factor_s2_per_m2),
                aligning_gain: TorquePerAcceleration::from_nm_s2_per_m(v.aligning_gain_nm_s2_per_m),
                column_damping: TorquePerTurningRate::from_nm_s_per_rad(sensor::lower_damping(p)),
                far_time: Seconds::from_s(v.far_time_s),
                near_time: Seconds::from_s(v.near_time_s),
                between: Micros::from_us(between_us),
            },
            least_speed: Speed::from_m_per_s(p.least_speed_m_per_s),
            probe: Probe {
                amplitude: Torque::from_nm(p.probe_amplitude_nm),
                phase_per_us: phase_per_us(p.probe_frequency_hz),
            },
            schedule: Schedule::new(p.low_speed_share, p.high_speed_share),
            sensor: sensor::sensor(p),
        }
    }
}

/// The first error of a list.
const fn first_error(checks: &[Result<(), ParamError>]) -> Result<(), ParamError> {
    let mut i = 0;
    while i < checks.len() {
        if let Err(error) = checks[i] {
            return Err(error);
        }
        i += 1;
    }
    Ok(())
}

/// The law of parameters that are in range.
const fn law(p: &Params) -> LawWords {
    let coefficients = &Coefficients {
        e_y: TorquePerLength::from_nm_per_m(p.k_1 * p.a_1),
        e_y_rate: TorquePerSpeed::from_nm_s_per_m(p.k_1 * p.a_2),
        e_theta: TorquePerAngle::from_nm_per_rad(p.k_1 * p.a_3),
        e_theta_rate: TorquePerTurningRate::from_nm_s_per_rad(p.k_1 * p.a_4),
        tau: (256e6 / (2.0 * core::f64::consts::PI * p.rate_corner_hz) + 0.5) as u32,
    };
    LawWords::new(if p.law == DRIVER_ACTIVITY {
        Law::DriverActivity {
            coefficients,
            least_share: Ratio::from_si(p.activity_lambda_min),
        }
    } else {
        Law::Paper(coefficients)
    })
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
    /// The estimator of K_hg.
    pub estimator: Estimator,
}

impl Setup {
    /// The paper's parameters.
    pub const PAPER: Self = Self {
        config: Config::PAPER,
        monitor: Monitor::new(&Params::PAPER),
        estimator: Estimator::new(&Params::PAPER),
    };

    /// Checks every parameter.
    ///
    /// # Errors
    /// The first parameter that is not a number within its range.
    pub const fn new(p: &Params) -> Result<Self, ParamError> {
        match Self::check(p) {
            Ok(()) => Ok(Self {
                config: Config::from_params(p),
                monitor: Monitor::new(p),
                estimator: Estimator::new(p),
            }),
            Err(error) => Err(error),
        }
    }

    /// Checks every parameter as [`Setup::new`] does, without making a setup, which takes ten times the stack.
    ///
    /// # Errors
    /// The first parameter that is not a number within its range.
    #[inline(never)]
    pub const fn check(p: &Params) -> Result<(), ParamError> {
        if let Err(error) = Config::check(p) {
            return Err(error);
        }
        // Gains that an honest law may use and the monitor cannot follow contradict each other.
        in_range(BAND, monitor_band_nm(p), [LEAST_BAND_NM, MOST_BAND_NM], "N.m")
    }
}

impl Estimator {
    /// The estimator's settings.
    #[must_use]
    const fn new(p: &Params) -> Self {
        let turns = p.probe_frequency_hz * 2.0 * core::f64::consts::PI;
        let [re, im] = sensor::arm(p, turns, p.t_nms_s);
        let [slower_re, slower_im] = sensor::arm(p, turns, p.t_nms_s + T_NMS_SD_S);
        Self {
            phase_per_us: phase_per_us(p.probe_frequency_hz),
            periods: (p.probe_frequency_hz * BLOCK_S + 0.5) as u32,
            amplitude_nm: p.probe_amplitude_nm as f32,
            arm: Complex {
                re: re as f32,
                im: im as f32,
            },
            slower: Complex {
                re: (slower_re - re) as f32,
                im: (slower_im - im) as f32,
            },
            k_nms: p.k_nms as f32,
            unsure: sensor::unsure(p, turns, [re, im]) as f32,
            quiet: if p.has_bar() { sensor::QUIET } else { QUIET },
        }
    }
}

#[cfg(test)]
mod tests;
