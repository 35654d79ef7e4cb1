//! Drivers who keep the lane in a real car.
//!
//! The paper's drivers hold the wheel so loosely (K_nms of 1 N.m/rad) that the friction of a column alone carries them metres
//! aside at 120 km/h. Hands that steer hold it several times stiffer and answer sooner. So do these: with a remnant of 0.4 N.m
//! they keep the lane as people do (`cargo xtask availability` prints their SDLP).

use rand::RngExt;
use rand::rngs::Xoshiro256PlusPlus;

use crate::models::driver::{ArmGains, DriverParameters};
use crate::scenario::ScenarioBuilder;

/// Corner of their remnant, Hz: lane keeping wanders slowly.
const REMNANT_CORNER_HZ: f64 = 0.1;

/// One of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LaneKeeper {
    /// Processing delay, s: 0.1 to 0.3.
    pub t_p: f64,
    /// Reliance on the guidance, 0 to 1: 0 works against all of it (K_hg of 1), 1 against nothing.
    pub reliance: f64,
    /// Standard deviation of the remnant, N.m: 0 to 5.
    pub remnant_sd_nm: f64,
}

impl LaneKeeper {
    /// Any of them.
    pub fn draw(rng: &mut Xoshiro256PlusPlus, remnant_sd_nm: f64) -> Self {
        Self {
            t_p: rng.random_range(0.1..0.3),
            reliance: rng.random(),
            remnant_sd_nm,
        }
    }

    /// Lets this driver drive a scenario at a speed; where the speed changes, the highest.
    pub fn drives(&self, scenario: ScenarioBuilder, v_m_per_s: f64) -> ScenarioBuilder {
        let driver = DriverParameters {
            a_1: 0.2,
            k_nms: 5.0,
            t_nms: 0.05,
            t_p: self.t_p,
            remnant_sd_nm: self.remnant_sd_nm,
            remnant_corner_hz: REMNANT_CORNER_HZ,
            ..DriverParameters::default()
        };
        scenario
            .driver(driver)
            .gains(arm(v_m_per_s, self.reliance))
            .manual_k_d(arm(v_m_per_s, 0.0).k_d)
    }
}

/// The arm of a driver who has learnt what the wheel asks for at an angle: it grows with v^2/(1 + K*v^2), K the stability
/// factor of table 9, and so does the driver's stiffness, which the paper gives for 60 km/h.
fn arm(v_m_per_s: f64, reliance: f64) -> ArmGains {
    const STABILITY_S2_PER_M2: f64 = 0.00175;
    let heaviness = |v: f64| v * v / (1.0 + STABILITY_S2_PER_M2 * v * v);
    let heavier = (heaviness(v_m_per_s) / heaviness(60.0 / 3.6) - 1.0).max(0.0);
    ArmGains {
        k_d: (5.0 - reliance) * (1.0 + 1.5 * heavier) - 1.0,
        k_hg: 1.0 - reliance,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand, at 60 km/h, the arm is the paper's. At 120 km/h the wheel is 377.36/186.92 times as heavy: K_d of
    /// 5*(1 + 1.5*1.0189) - 1.
    #[test]
    fn the_arm_is_the_papers_at_60_km_h_and_stiffer_beyond() {
        assert_eq!(arm(60.0 / 3.6, 0.0).k_d, ArmGains::MANUAL.k_d);
        assert_eq!(arm(40.0 / 3.6, 1.0), ArmGains { k_d: 3.0, k_hg: 0.0 });
        assert!((arm(120.0 / 3.6, 0.0).k_d - 11.6415).abs() < 0.001);
    }
}
