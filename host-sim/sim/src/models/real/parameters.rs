//! What a scenario may say of its world. Everything is off by default: then the paper's plant drives.

use serde::{Deserialize, Serialize};

use crate::input::{RangeError, in_range};

/// Driver torque at which the power assist is whole, N.m.
pub const FULL_ASSIST_AT_NM: f64 = 3.0;

/// How tyres answer slip.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Tyres {
    /// In proportion, as the paper's.
    #[default]
    Linear,
    /// Up to the friction of the road, the trail falling.
    Saturating,
}

/// The table `[world]` of a scenario.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WorldParameters {
    /// How tyres answer slip.
    pub tyres: Tyres,
    /// Friction between saturating tyres and road.
    pub mu: f64,
    /// Share of the trail that stays when the pneumatic trail has fallen.
    pub castor_share: f64,
    /// Bank of the whole road beside the course's own, rad, positive where the left edge is the higher one.
    pub bank: f64,
    /// Dry friction of the column, N.m.
    pub friction: f64,
    /// Wheel angle at which it gives way, deg.
    pub friction_give: f64,
    /// Power assist at 3 N.m of driver torque and standstill, N.m.
    pub assist: f64,
    /// Speed at which the assist is half of that, km/h.
    pub assist_speed: f64,
    /// Time constant of the motor, s.
    pub motor_lag: f64,
    /// Error of its torque as a share.
    pub motor_error: f64,
    /// Amplitude of its torque ripple, N.m.
    pub motor_ripple: f64,
    /// Steady side force of the wind, N, to the left.
    pub wind: f64,
    /// Standard deviation of its gusts, N.
    pub gust_sd: f64,
    /// Corner of the gusts' low-pass, Hz.
    pub gust_corner: f64,
    /// How far before the centre of gravity the side force attacks, m.
    pub wind_lever: f64,
}

impl Default for WorldParameters {
    fn default() -> Self {
        Self {
            tyres: Tyres::Linear,
            mu: 1.0,
            castor_share: 0.4,
            bank: 0.0,
            friction: 0.0,
            friction_give: 0.2,
            assist: 0.0,
            assist_speed: 60.0,
            motor_lag: 0.0,
            motor_error: 0.0,
            motor_ripple: 0.0,
            wind: 0.0,
            gust_sd: 0.0,
            gust_corner: 0.2,
            wind_lever: 0.3,
        }
    }
}

impl WorldParameters {
    /// Whether every value is one that a road or a car can have.
    ///
    /// # Errors
    /// The first field out of range, with its value and range.
    pub fn check(&self) -> Result<(), RangeError> {
        in_range("mu", self.mu, 0.05..=1.5, "")?;
        in_range("castor_share", self.castor_share, 0.0..=1.0, "")?;
        in_range("bank", self.bank, -0.3..=0.3, "rad")?;
        in_range("friction", self.friction, 0.0..=5.0, "N.m")?;
        in_range("friction_give", self.friction_give, 0.05..=5.0, "deg")?;
        in_range("assist", self.assist, 0.0..=30.0, "N.m")?;
        in_range("assist_speed", self.assist_speed, 1.0..=1000.0, "km/h")?;
        in_range("motor_lag", self.motor_lag, 0.0..=0.1, "s")?;
        in_range("motor_error", self.motor_error, -0.5..=0.5, "")?;
        in_range("motor_ripple", self.motor_ripple, 0.0..=1.0, "N.m")?;
        in_range("wind", self.wind, -5000.0..=5000.0, "N")?;
        in_range("gust_sd", self.gust_sd, 0.0..=5000.0, "N")?;
        in_range("gust_corner", self.gust_corner, 0.01..=10.0, "Hz")?;
        in_range("wind_lever", self.wind_lever, -3.0..=3.0, "m")
    }

    /// Whether the paper's plant is all there is to it.
    pub fn is_ideal(&self) -> bool {
        let Self {
            tyres,
            bank,
            friction,
            assist,
            motor_lag,
            motor_error,
            motor_ripple,
            wind,
            gust_sd,
            ..
        } = *self;
        let off = [
            bank,
            friction,
            assist,
            motor_lag,
            motor_error,
            motor_ripple,
            wind,
            gust_sd,
        ];
        tyres == Tyres::Linear && off.iter().all(|value| *value == 0.0)
    }

    /// Torque of the power assist, N.m: with the square of the driver's torque up to 3 N.m, as most boost curves
    /// bend, constant beyond, and falling with speed.
    pub(super) fn assist_nm(&self, hands_nm: f64, v_m_per_s: f64) -> f64 {
        let share = (hands_nm.abs() / FULL_ASSIST_AT_NM).min(1.0);
        let slowness = self.assist_speed / (self.assist_speed + 3.6 * v_m_per_s);
        self.assist * slowness * share * share * hands_nm.signum()
    }
}
