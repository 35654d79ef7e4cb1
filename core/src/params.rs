//! Parameters in SI, checked once and turned into the immutable configuration of the controller.
//!
//! A rejected parameter is named with its value and its range. Everything is `const`, so that a firmware
//! image checks its built-in set at compile time and carries no float code for it.

use core::fmt;

use crate::envelope::Envelope;
use crate::law::Law;
use crate::quantity::{Gain, Torque};

/// Parameters of the guidance controller, SI units. The default is the paper's table 8.
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

/// The checked configuration of every block of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    pub(crate) law: Law,
    pub(crate) envelope: Envelope,
}

/// Largest product K_1*a', in N.m per unit: keeps the law's wide sum inside an `i64`.
const MAX_GAIN: f64 = 32.0;

impl Config {
    /// The paper's parameters, checked at compile time.
    pub const PAPER: Self = match Self::new(&Params::PAPER) {
        Ok(config) => config,
        Err(_) => panic!("the paper's parameters are in range"),
    };

    /// Checks every parameter.
    ///
    /// # Errors
    /// The first parameter that is not a number within its range.
    pub const fn new(p: &Params) -> Result<Self, ParamError> {
        let checks = [
            ("k_1", p.k_1, 0.0, 4.0),
            ("a_1", p.a_1, 0.0, 100.0),
            ("a_2", p.a_2, 0.0, 100.0),
            ("a_3", p.a_3, 0.0, 100.0),
            ("a_4", p.a_4, 0.0, 100.0),
            ("rate_corner_hz", p.rate_corner_hz, 0.5, 60.0),
            ("torque_limit_nm", p.torque_limit_nm, 0.1, 5.0),
            ("k_1 * a_1", p.k_1 * p.a_1, 0.0, MAX_GAIN),
            ("k_1 * a_2", p.k_1 * p.a_2, 0.0, MAX_GAIN),
            ("k_1 * a_3", p.k_1 * p.a_3, 0.0, MAX_GAIN),
            ("k_1 * a_4", p.k_1 * p.a_4, 0.0, MAX_GAIN),
        ];
        let mut i = 0;
        while i < checks.len() {
            let (name, value, min, max) = checks[i];
            // NaN compares false, so it is rejected too.
            if !(value >= min && value <= max) {
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
            },
        })
    }
}
