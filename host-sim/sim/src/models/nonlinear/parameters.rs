//! What a scenario may say of its world. Everything is off by default: then the paper's plant drives.

use serde::{Deserialize, Serialize};

use crate::fields::{FieldValue, fields};

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

impl FieldValue for Tyres {}

fields! {
    /// What is less than ideal in the world.
    #[derive(Copy)]
    WorldParameters, "world" {
        /// tyres in proportion to slip, or up to the friction of the road with a falling trail
        tyres: Tyres = Tyres::Linear, "tyres", "", "", OneOf(&["linear", "saturating"]);
        /// friction between saturating tyres and road
        mu: f64 = 1.0, "mu", "", "", Between(0.05, 1.5);
        /// share of the trail E_t that stays when the pneumatic trail has fallen
        castor_share: f64 = 0.4, "castor_share", "", "", Between(0.0, 1.0);
        /// of the whole road beside the course's own, positive: left edge higher
        bank_rad: f64 = 0.0, "bank_rad", "", "rad", Between(-0.3, 0.3);
        /// dry friction of the column (Dahl)
        friction_nm: f64 = 0.0, "friction_nm", "", "N.m", Between(0.0, 5.0);
        /// wheel angle at which it gives way: 0.2 degrees
        friction_give_rad: f64 = 0.2_f64.to_radians(), "friction_give_rad", "", "rad", Between(0.0005, 0.1);
        /// power assist at 3 N.m of driver torque and standstill, with the square of the torque up to there
        assist_nm: f64 = 0.0, "assist_nm", "", "N.m", Between(0.0, 30.0);
        /// speed at which the assist is half of that: 60 km/h
        assist_speed_m_per_s: f64 = 60.0 / 3.6, "assist_speed_m_per_s", "", "m/s", Between(0.2, 300.0);
        /// time constant of the motor
        motor_lag_s: f64 = 0.0, "motor_lag_s", "", "s", Between(0.0, 0.1);
        /// error of its torque as a share
        motor_error: f64 = 0.0, "motor_error", "", "", Between(-0.5, 0.5);
        /// amplitude of its ripple, 24 in a turn of the wheel
        motor_ripple_nm: f64 = 0.0, "motor_ripple_nm", "", "N.m", Between(0.0, 1.0);
        /// steady side force, to the left
        wind_n: f64 = 0.0, "wind_n", "", "N", Between(-5000.0, 5000.0);
        /// standard deviation of its gusts
        gust_sd_n: f64 = 0.0, "gust_sd_n", "", "N", Between(0.0, 5000.0);
        /// corner of the gusts' low-pass
        gust_corner_hz: f64 = 0.2, "gust_corner_hz", "", "Hz", Between(0.01, 10.0);
        /// how far before the centre of gravity the side force attacks
        wind_lever_m: f64 = 0.3, "wind_lever_m", "", "m", Between(-3.0, 3.0);
    }
}

impl WorldParameters {
    /// Whether the paper's plant is all there is to it.
    pub fn is_ideal(&self) -> bool {
        let off = [
            self.bank_rad,
            self.friction_nm,
            self.assist_nm,
            self.motor_lag_s,
            self.motor_error,
            self.motor_ripple_nm,
            self.wind_n,
            self.gust_sd_n,
        ];
        self.tyres == Tyres::Linear && off.iter().all(|value| *value == 0.0)
    }

    /// Torque of the power assist, N.m: with the square of the driver's torque up to 3 N.m, as most boost curves
    /// bend, constant beyond, and falling with speed.
    pub(super) fn assist_nm(&self, hands_nm: f64, v_m_per_s: f64) -> f64 {
        let share = (hands_nm.abs() / FULL_ASSIST_AT_NM).min(1.0);
        let slowness = self.assist_speed_m_per_s / (self.assist_speed_m_per_s + v_m_per_s);
        self.assist_nm * slowness * share * share * hands_nm.signum()
    }
}
