//! Parameters of the vehicle and its steering column, table 9.
//!
//! Stiffnesses are per tyre, as in equations (1) and (2). The equations themselves are in `plant`.

use serde::{Deserialize, Serialize};

use crate::input::{RangeError, in_range};

/// Table 9, SI units. Every value has to be positive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VehicleParameters {
    /// m, mass, kg.
    pub m: f64,
    /// I, yaw inertia, kg.m^2.
    #[serde(rename = "I", alias = "i")]
    pub i: f64,
    /// l_f, front axle to centre of gravity, m.
    pub l_f: f64,
    /// l_r, rear axle to centre of gravity, m.
    pub l_r: f64,
    /// K_f, cornering stiffness of a front tyre, N/rad.
    #[serde(rename = "K_f", alias = "k_f")]
    pub k_f: f64,
    /// K_r, cornering stiffness of a rear tyre, N/rad.
    #[serde(rename = "K_r", alias = "k_r")]
    pub k_r: f64,
    /// K_s, spring constant around the kingpin, N.m/rad.
    #[serde(rename = "K_s", alias = "k_s")]
    pub k_s: f64,
    /// E_t, pneumatic and castor trail, m (the paper's table leaves the unit out).
    #[serde(rename = "E_t", alias = "e_t")]
    pub e_t: f64,
    /// B_s, damping of the column, N.m.s/rad.
    #[serde(rename = "B_s", alias = "b_s")]
    pub b_s: f64,
    /// J_s, inertia of the column, kg.m^2.
    #[serde(rename = "J_s", alias = "j_s")]
    pub j_s: f64,
    /// K_t, front wheel angle per steering wheel angle.
    #[serde(rename = "K_t", alias = "k_t")]
    pub k_t: f64,
}

impl Default for VehicleParameters {
    /// Table 9.
    fn default() -> Self {
        Self {
            m: 1100.0,
            i: 2940.0,
            l_f: 1.0,
            l_r: 1.635,
            k_f: 53_300.0,
            k_r: 117_000.0,
            k_s: 48_510.0,
            e_t: 0.026,
            b_s: 0.57,
            j_s: 0.11,
            k_t: 1.0 / 17.0,
        }
    }
}

impl VehicleParameters {
    /// K_aln of equation (4): aligning torque on the column per side-slip angle of the front wheels, N.m/rad.
    pub fn aligning_stiffness(&self) -> f64 {
        let lever = 2.0 * self.e_t * self.k_f;
        lever * self.k_t / (1.0 + lever / self.k_s)
    }

    /// Whether every value is one that a road vehicle can have.
    ///
    /// # Errors
    /// The first field out of range, with its value and range.
    pub fn check(&self) -> Result<(), RangeError> {
        in_range("m", self.m, 100.0..=50_000.0, "kg")?;
        in_range("I", self.i, 100.0..=500_000.0, "kg.m^2")?;
        in_range("l_f", self.l_f, 0.1..=10.0, "m")?;
        in_range("l_r", self.l_r, 0.1..=10.0, "m")?;
        in_range("K_f", self.k_f, 1e3..=1e6, "N/rad")?;
        in_range("K_r", self.k_r, 1e3..=1e6, "N/rad")?;
        in_range("K_s", self.k_s, 1e2..=1e7, "N.m/rad")?;
        in_range("E_t", self.e_t, 0.001..=0.2, "m")?;
        in_range("B_s", self.b_s, 0.01..=10.0, "N.m.s/rad")?;
        in_range("J_s", self.j_s, 0.01..=2.0, "kg.m^2")?;
        in_range("K_t", self.k_t, 0.02..=0.2, "")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_9_gives_the_known_aligning_stiffness() {
        // 2*0.026*53300/17 / (1 + 2*0.026*53300/48510) by hand: 163.035 / 1.057135 = 154.22
        assert!((VehicleParameters::default().aligning_stiffness() - 154.22).abs() < 0.01);
    }
}
