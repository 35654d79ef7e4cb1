//! Four design choices (FDCA): `d_fb = SoHF*(k_y*e_y + k_psi*e_psi)`, `T = LoHA*(d_fb + d_ff - d) + K*(LoHS*d_ff + d_fb)`, d the
//! wheel angle. Source: van Paassen, Boink, Abbink, Mulder 2017; defaults from the code of tud-hri/joan in its form with angles (a
//! later version has torques, and looks 0.8 s ahead). The rates of the errors, which that code forms and leaves unused, are left out.
//!
//! Chosen here, because ECU and car differ from that simulator: e_y is e_y', 0.3 s ahead, e_psi is e_theta', 0.7 s ahead. The
//! angle that the path needs is that of the curvature 0.7 s ahead, `d_ff = kappa*(1 + A*v^2)/G`, `kappa = (r + de_theta'/dt)/v`, with
//! the ECU's curvature gain G and stability factor A. K, there the stiffness of the wheel, is the car's aligning torque per wheel
//! angle, `K = c*v^2*G/(1 + A*v^2)`, so that LoHS = 1 carries a steady curve.
//!
//! By time to lane crossing (Zwaan, Petermeijer, Abbink 2019, of which the abstract was seen):
//! `LoHA = min + (max - min)*sat((t_hi - TLC)/(t_hi - t_lo))`. Thresholds, ends, and TLC are chosen here: the near point's 0.3 s, and
//! the time after which it leaves the lane at its rate.

use super::{Kind, Law, LawView, Make, boxed};
use crate::kind::{Origin, Parameter};
use crate::models::road::DEFAULT_LANE_WIDTH_M;
use crate::scenario::Scenario;

/// Half of what a vehicle of 1.7 m has beside it in its lane, m.
const HALF_ROOM_M: f64 = 0.5 * (DEFAULT_LANE_WIDTH_M - 1.7);

/// FDCA in a car.
#[derive(Debug, Clone)]
struct Fdca {
    k_y: f64,
    k_psi: f64,
    lohs: f64,
    sohf: f64,
    loha: f64,
    /// G, A and c.
    car: [f64; 3],
}

impl Fdca {
    fn new(scenario: &Scenario, v: &[f64]) -> Self {
        let car = scenario.controller_params().vehicle;
        Self {
            k_y: v[0],
            k_psi: v[1],
            lohs: v[2],
            sohf: v[3],
            loha: v.get(4).copied().unwrap_or(0.0),
            car: [
                car.curvature_gain_per_m,
                car.stability_factor_s2_per_m2,
                car.aligning_gain_nm_s2_per_m,
            ],
        }
    }
}

impl Law for Fdca {
    fn ask(&mut self, view: &LawView) -> f64 {
        let [gain, stability, aligning] = self.car;
        // A standing car has no path.
        let v = view.speed_m_per_s.max(1.0);
        let curvature_per_rad = gain / (1.0 + stability * v * v);
        let curvature = (view.yaw_rate_rad_per_s + view.e_theta_rate_rad_per_s) / v;
        let forward = curvature / curvature_per_rad;
        let back = self.sohf * (self.k_y * view.e_y_m + self.k_psi * view.e_theta_rad);
        let stiffness = aligning * v * v * curvature_per_rad;
        self.loha * (back + forward - view.wheel_angle_rad) + stiffness * (self.lohs * forward + back)
    }
}

/// FDCA whose authority grows as the lane's edge comes near.
#[derive(Debug, Clone)]
struct ByTime {
    fdca: Fdca,
    loha: [f64; 2],
    tlc_s: [f64; 2],
    near_s: f64,
}

impl Law for ByTime {
    fn ask(&mut self, view: &LawView) -> f64 {
        let [low_s, high_s] = self.tlc_s;
        // An error that grows moves the near point towards the edge on its side.
        let outward = view.e_y_rate_m_per_s * view.e_y_m.signum();
        let left_m = HALF_ROOM_M - view.e_y_m.abs();
        let tlc_s = if left_m <= 0.0 {
            0.0
        } else if outward > 0.0 {
            self.near_s + left_m / outward
        } else {
            f64::INFINITY
        };
        let share = ((high_s - tlc_s) / (high_s - low_s)).clamp(0.0, 1.0);
        self.fdca.loha = self.loha[0] + (self.loha[1] - self.loha[0]) * share;
        self.fdca.ask(view)
    }
}

pub(super) const KIND: Kind<dyn Law> = Kind {
    name: "fdca",
    source: "van Paassen et al. 2017; tud-hri/joan",
    origin: Origin::After,
    parameters: &[
        Parameter::published("k_y_rad_per_m", 0.15, [0.0, 10.0]).tuned(0.05, 0.5),
        Parameter::published("k_psi", 2.5, [0.0, 50.0]),
        Parameter::published("lohs", 1.0, [0.0, 2.0]).tuned(0.2, 1.0),
        Parameter::published("sohf", 1.0, [0.0, 10.0]),
        Parameter::published("loha_nm_per_rad", 0.0, [0.0, 50.0]),
    ],
    make: Make::Part(|scenario, v| boxed(Fdca::new(scenario, v))),
};

pub(super) const BY_TIME: Kind<dyn Law> = Kind {
    name: "authority_by_tlc",
    source: "Zwaan et al. 2019 (abstract)",
    origin: Origin::After,
    parameters: &[
        Parameter::published("k_y_rad_per_m", 0.15, [0.0, 10.0]).tuned(0.05, 0.5),
        Parameter::published("k_psi", 2.5, [0.0, 50.0]),
        Parameter::published("lohs", 1.0, [0.0, 2.0]).tuned(0.2, 1.0),
        Parameter::published("sohf", 1.0, [0.0, 10.0]),
        Parameter::ours("loha_min_nm_per_rad", 0.0, [0.0, 50.0]),
        Parameter::ours("loha_max_nm_per_rad", 2.0, [0.0, 50.0]),
        Parameter::ours("tlc_low_s", 1.0, [0.1, 5.0]),
        // Above the range of the low one, so that no pair is upside down.
        Parameter::ours("tlc_high_s", 6.0, [5.001, 30.0]),
    ],
    make: Make::Part(|scenario, v| {
        boxed(ByTime {
            fdca: Fdca::new(scenario, &v[..4]),
            loha: [v[4], v[5]],
            tlc_s: [v[6], v[7]],
            near_s: scenario.guidance().t_n,
        })
    }),
};
