//! Parameters of the vehicle and its steering column, table 9.
//!
//! Stiffnesses are per tyre, as in equations (1) and (2). The equations themselves are in `plant`.

use crate::fields::fields;

fields! {
    /// Table 9, SI units. Every value has to be positive.
    #[derive(Copy)]
    VehicleParameters, "vehicle" {
        /// mass
        m: f64 = 1100.0, "m_kg", "m", "kg", Between(100.0, 50_000.0);
        /// yaw inertia
        i: f64 = 2940.0, "i_kg_m2", "I", "kg.m2", Between(100.0, 500_000.0);
        /// centre of gravity to the front axle
        l_f: f64 = 1.0, "l_f_m", "l_f", "m", Between(0.1, 10.0);
        /// centre of gravity to the rear axle
        l_r: f64 = 1.635, "l_r_m", "l_r", "m", Between(0.1, 10.0);
        /// cornering stiffness of one front tyre
        k_f: f64 = 53_300.0, "k_f_n_per_rad", "K_f", "N/rad", Between(1e3, 1e6);
        /// cornering stiffness of one rear tyre
        k_r: f64 = 117_000.0, "k_r_n_per_rad", "K_r", "N/rad", Between(1e3, 1e6);
        /// stiffness of the steering, around the kingpin
        k_s: f64 = 48_510.0, "k_s_nm_per_rad", "K_s", "N.m/rad", Between(1e2, 1e7);
        /// trail, pneumatic and castor (the paper's table leaves the unit out)
        e_t: f64 = 0.026, "e_t_m", "E_t", "m", Between(0.001, 0.2);
        /// damping of the column
        b_s: f64 = 0.57, "b_s_nms_per_rad", "B_s", "N.m.s/rad", Between(0.01, 10.0);
        /// inertia of the column
        j_s: f64 = 0.11, "j_s_kg_m2", "J_s", "kg.m2", Between(0.01, 2.0);
        /// front wheel angle per steering wheel angle: 1/17
        k_t: f64 = 1.0 / 17.0, "k_t", "K_t", "", Between(0.02, 0.2);
    }
}

impl VehicleParameters {
    /// K_aln of equation (4): aligning torque on the column per side-slip angle of the front wheels, N.m/rad.
    pub fn aligning_stiffness(&self) -> f64 {
        let lever = 2.0 * self.e_t * self.k_f;
        lever * self.k_t / (1.0 + lever / self.k_s)
    }

    /// What the vehicle does while it corners steadily.
    pub fn steady_cornering(&self) -> SteadyCornering {
        let l = self.l_f + self.l_r;
        let steer = self.l_r * self.k_r - self.l_f * self.k_f;
        SteadyCornering {
            curvature_gain_per_m: self.k_t / l,
            stability_factor_s2_per_m2: self.m * steer / (2.0 * l * l * self.k_f * self.k_r),
            aligning_gain_nm_s2_per_m: self.aligning_stiffness() * self.m * self.l_r / (2.0 * l * self.k_f),
        }
    }
}

/// A vehicle in a steady curve.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SteadyCornering {
    /// Curvature of the path per angle of the steering wheel at a crawl, 1/m.
    pub curvature_gain_per_m: f64,
    /// How the curvature falls with the speed squared; above zero the vehicle understeers, s2/m2.
    pub stability_factor_s2_per_m2: f64,
    /// Aligning torque on the column per lateral acceleration, N.m per m/s2.
    pub aligning_gain_nm_s2_per_m: f64,
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
