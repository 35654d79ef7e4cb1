//! The paper's law, equation (9): `T = K_1*(a1'*e_y' + a2'*de_y'/dt + a3'*e_theta' + a4'*de_theta'/dt)`. Source: Wang, Zheng,
//! Nacpil and Nakano 2022, table 8.

use super::{Kind, Law, LawView, Make, boxed};
use crate::kind::{Origin, Parameter};

/// The gains of (9).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gains {
    /// K_1, N.m.
    pub k_1: f64,
    /// a_1' to a_4'.
    pub a: [f64; 4],
}

impl Gains {
    /// Table 8.
    pub const PAPER: Self = Self {
        k_1: 0.25,
        a: [2.0, 0.05, 40.0, 1.0],
    };

    /// What K_1 is multiplied with.
    pub(super) fn bracket(&self, view: &LawView) -> f64 {
        let [a_1, a_2, a_3, a_4] = self.a;
        a_1 * view.e_y_m
            + a_2 * view.e_y_rate_m_per_s
            + a_3 * view.e_theta_rad
            + a_4 * view.e_theta_rate_rad_per_s
    }
}

impl Law for Gains {
    fn ask(&mut self, view: &LawView) -> f64 {
        self.k_1 * self.bracket(view)
    }

    fn k_1(&self) -> Option<f64> {
        Some(self.k_1)
    }
}

pub(super) const KIND: Kind<dyn Law> = Kind {
    name: "paper",
    source: "Wang et al. 2022, (9), table 8",
    origin: Origin::Published,
    parameters: &[
        Parameter::published("k_1", 0.25, [0.0, 4.0]).tuned(0.25, 0.45),
        Parameter::published("a_1", 2.0, [0.0, 100.0]).tuned(2.0, 6.0),
        Parameter::published("a_2", 0.05, [0.0, 100.0]),
        Parameter::published("a_3", 40.0, [0.0, 100.0]),
        Parameter::published("a_4", 1.0, [0.0, 100.0]),
    ],
    make: Make::Part(|_, v| {
        boxed(Gains {
            k_1: v[0],
            a: [v[1], v[2], v[3], v[4]],
        })
    }),
};
