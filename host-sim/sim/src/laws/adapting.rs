//! Laws whose gain on (9) follows the driver.
//!
//! *Driver activity*: `T = lambda*T_9`, `lambda = 1 - (1 - lambda_min)*max(0, -c)`, where c is the agreement of the pseudo-powers
//! `P_d = T_d*dphi/dt` and `P_h = T_9*dphi/dt`: `c = L[T_d*T_9*dphi^2]/L[|T_d*T_9|*dphi^2]`, L a low-pass. T_9 is what (9) asks for,
//! before any share of it is taken: with the torque applied in its place c would depend on lambda itself. Source: the pseudo-power
//! pair of Saito et al. and the cooperativeness of Nguyen, Rath, Lv, Guerra and Lauber 2021 (Sensors 21:4647), of both of which
//! abstracts were seen; c, lambda_min and the low-pass are chosen here, and the U-shape over the driver's activity is left out,
//! whose constants were not seen.
//!
//! *Running wide asks for more*: `dK_1/dt = 0.02*e_y'*tanh(T_h/0.1 N.m) - (K_1 - 0.25)/200 s`; K_1 from the published gain to
//! 1.8 of it. Ours.
//!
//! *By reliance*: K_1 from a table of K_hg as the ECU's probe tells it, 0.31 at 0, 0.36 at 0.5, 0.45 from 0.75 on, approached with
//! 0.05 N.m/s; the published gain without an estimate for 60 s. Ours; without the probe it is the paper's law.
//!
//! *Compensating*: `K_1 = c/(1 - K_hg)`; *linear*: `K_1 = k_1 + slope*(K_hg - 0.5)`. As by reliance, within bounds of their own. Ours: they
//! show what such a gain and a driver whose K_hg follows the guidance do to each other.

use super::{Gains, Kind, Law, LawView, Make, boxed, weight};
use crate::kind::{Origin, Parameter};
use crate::models::STEP_S;

#[derive(Debug, Clone)]
struct Activity {
    law: Gains,
    least: f64,
    weight: f64,
    /// `P_d*P_h` behind the low-pass, and its size behind the same one.
    agreement: [f64; 2],
    /// What of the law's torque is left.
    share: f64,
}

impl Law for Activity {
    fn ask(&mut self, view: &LawView) -> f64 {
        let asked_nm = self.law.ask(view);
        let rate = view.wheel_rate_rad_per_s;
        let product = view.driver_torque_nm * asked_nm * rate * rate;
        self.agreement[0] += self.weight * (product - self.agreement[0]);
        self.agreement[1] += self.weight * (product.abs() - self.agreement[1]);
        let [signed, size] = self.agreement;
        let against = if size > 0.0 {
            (-signed / size).max(0.0)
        } else {
            0.0
        };
        self.share = 1.0 - (1.0 - self.least) * against;
        self.share * asked_nm
    }

    fn k_1(&self) -> Option<f64> {
        Some(self.share * self.law.k_1)
    }
}

/// K_1 stays between the published gain and this times it.
const MOST: f64 = 1.8;

#[derive(Debug, Clone)]
struct RunningWide {
    law: Gains,
    rate: f64,
    forgets_s: f64,
}

impl Law for RunningWide {
    fn ask(&mut self, view: &LawView) -> f64 {
        let base = Gains::PAPER.k_1;
        let wide = view.e_y_m * (view.guidance_torque_nm / 0.1).tanh();
        let change = self.rate * wide - (self.law.k_1 - base) / self.forgets_s;
        self.law.k_1 = (self.law.k_1 + STEP_S * change).clamp(base, MOST * base);
        self.law.ask(view)
    }

    fn k_1(&self) -> Option<f64> {
        Some(self.law.k_1)
    }
}

/// K_hg, and K_1 there.
const TABLE: [[f64; 2]; 3] = [[0.0, 0.31], [0.5, 0.36], [0.75, 0.45]];
/// An estimate that has not changed for so many steps is none.
const STALE_STEPS: u32 = 60_000;

/// K_1 over K_hg.
#[derive(Debug, Clone)]
enum Rule {
    /// The table, of which so much of the excess over the published gain counts.
    Table(f64),
    /// So much over 1 - K_hg.
    Compensating(f64),
    /// A gain at K_hg 0.5, and a slope.
    Linear([f64; 2]),
}

impl Rule {
    fn at(&self, k_hg: f64) -> f64 {
        match self {
            Self::Table(scale) => Gains::PAPER.k_1 + scale * (table(k_hg) - Gains::PAPER.k_1),
            // At K_hg 1 nothing is left; the bound of the law holds.
            Self::Compensating(c) => c / (1.0 - k_hg).max(1e-6),
            Self::Linear([k_1, slope]) => k_1 + slope * (k_hg - 0.5),
        }
    }
}

fn table(k_hg: f64) -> f64 {
    let between = [[TABLE[0], TABLE[1]], [TABLE[1], TABLE[2]]];
    let found = between
        .into_iter()
        .find(|[low, high]| (low[0]..high[0]).contains(&k_hg));
    match found {
        Some([low, high]) => low[1] + (high[1] - low[1]) * (k_hg - low[0]) / (high[0] - low[0]),
        None if k_hg < TABLE[0][0] => TABLE[0][1],
        None => TABLE[2][1],
    }
}

#[derive(Debug, Clone)]
struct ByReliance {
    law: Gains,
    rule: Rule,
    /// The least and the largest K_1.
    bounds: [f64; 2],
    rate_nm_per_s: f64,
    last: Option<f64>,
    since: u32,
}

impl ByReliance {
    fn new(rule: Rule, bounds: [f64; 2], rate_nm_per_s: f64) -> Self {
        Self {
            law: Gains::PAPER,
            rule,
            bounds,
            rate_nm_per_s,
            last: None,
            since: 0,
        }
    }

    fn wanted(&self) -> f64 {
        let [least, most] = self.bounds;
        let fresh = self.last.filter(|_| self.since <= STALE_STEPS);
        let wanted = fresh.map_or(Gains::PAPER.k_1, |k_hg| self.rule.at(k_hg));
        // Not `clamp`: a file's bounds may cross.
        wanted.max(least).min(most)
    }
}

impl Law for ByReliance {
    fn ask(&mut self, view: &LawView) -> f64 {
        self.since = if view.k_hg == self.last {
            self.since.saturating_add(1)
        } else {
            0
        };
        self.last = view.k_hg;
        let most = self.rate_nm_per_s * STEP_S;
        self.law.k_1 += (self.wanted() - self.law.k_1).clamp(-most, most);
        self.law.ask(view)
    }

    fn k_1(&self) -> Option<f64> {
        Some(self.law.k_1)
    }
}

pub(super) const ACTIVITY: Kind<dyn Law> = Kind {
    name: "driver_activity",
    source: "Nguyen et al. 2021; Saito et al. (abstracts)",
    origin: Origin::After,
    parameters: &[
        Parameter::published("k_1", 0.25, [0.0, 4.0]).tuned(0.25, 0.45),
        Parameter::ours("lambda_min", 0.3, [0.0, 1.0]).tuned(0.0, 1.0),
        Parameter::ours("low_pass_s", 0.5, [0.01, 10.0]),
    ],
    make: Make::Part(|_, v| {
        boxed(Activity {
            law: Gains {
                k_1: v[0],
                ..Gains::PAPER
            },
            least: v[1],
            weight: weight(v[2]),
            agreement: [0.0; 2],
            share: 1.0,
        })
    }),
};

pub(super) const RUNNING_WIDE: Kind<dyn Law> = Kind {
    name: "running_wide",
    source: "ours",
    origin: Origin::Ours,
    parameters: &[
        Parameter::ours("rate_nm_per_m_s", 0.02, [0.0, 1.0]).tuned(0.005, 0.05),
        Parameter::ours("forgets_s", 200.0, [1.0, 10_000.0]).tuned(50.0, 500.0),
    ],
    make: Make::Part(|_, v| {
        boxed(RunningWide {
            law: Gains::PAPER,
            rate: v[0],
            forgets_s: v[1],
        })
    }),
};

pub(super) const BY_RELIANCE: Kind<dyn Law> = Kind {
    name: "by_reliance",
    source: "ours",
    origin: Origin::Ours,
    parameters: &[
        Parameter::ours("scale", 1.0, [0.0, 2.0]).tuned(0.5, 1.5),
        Parameter::ours("rate_nm_per_s", 0.05, [0.0, 1.0]),
    ],
    make: Make::Part(|_, v| {
        let base = Gains::PAPER.k_1;
        boxed(ByReliance::new(Rule::Table(v[0]), [base, MOST * base], v[1]))
    }),
};

pub(super) const COMPENSATING: Kind<dyn Law> = Kind {
    name: "compensating",
    source: "ours",
    origin: Origin::Ours,
    parameters: &[
        Parameter::ours("c_nm", 0.19, [0.0, 1.0]),
        Parameter::ours("least_nm", 0.25, [0.0, 4.0]),
        Parameter::ours("most_nm", 0.65, [0.0, 4.0]),
        Parameter::ours("rate_nm_per_s", 0.05, [0.0, 1.0]),
    ],
    make: Make::Part(|_, v| boxed(ByReliance::new(Rule::Compensating(v[0]), [v[1], v[2]], v[3]))),
};

pub(super) const LINEAR: Kind<dyn Law> = Kind {
    name: "linear",
    source: "ours",
    origin: Origin::Ours,
    parameters: &[
        Parameter::ours("k_1", 0.36, [0.0, 4.0]),
        Parameter::ours("slope_nm", -0.4, [-10.0, 10.0]),
        Parameter::ours("least_nm", 0.05, [0.0, 4.0]),
        Parameter::ours("most_nm", 0.65, [0.0, 4.0]),
        Parameter::ours("rate_nm_per_s", 0.05, [0.0, 1.0]),
    ],
    make: Make::Part(|_, v| boxed(ByReliance::new(Rule::Linear([v[0], v[1]]), [v[2], v[3]], v[4]))),
};
