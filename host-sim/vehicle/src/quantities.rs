//! What is told of a vehicle, and when it counts as identified.
//!
//! A quantity is identified where its 95 % interval is narrow enough to be used ([`Width`]), and where that is the record's doing: what
//! is taken as known beforehand would leave it at least three times as wide.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::model::{Known, Physical, place as P};

/// What is taken as known of every road vehicle: mean and standard deviation of each parameter, in the order of `place`. Wide enough for
/// a small car and for a van; the paper's car, with rear tyres of 57 times their load, lies within 1.7 of them.
pub(super) const BEFOREHAND: [(f64, f64); P::ALL] = [
    // A ratio of 16, of 10 to 26.
    (-2.772_588_722_239_781, 0.25),
    // Axles of 16 times their load per radian, of 4 to 63.
    (2.772_588_722_239_781, 0.7),
    (2.890_371_757_896_165, 0.7),
    // 1.1 m*l_f*l_r, of 0.6 to 2.
    (0.095_310_179_804_325, 0.3),
    (0.45, 0.05),
    (0.0, 0.1),
    // A gyroscope that is set to zero where the vehicle stands.
    (0.0, 0.002),
    (0.0, 0.01),
    // 0.08 kg.m2, of 0.01 to 0.6.
    (-2.525_728_644_308_255, 1.0),
    // 0.5 N.m.s/rad, of 0.05 to 5.
    (-std::f64::consts::LN_2, 1.2),
    (0.2, 1.0),
    // 1 N.m per m/s2, of 0.14 to 7.
    (0.0, 1.0),
    (0.0, 0.5),
    (0.3, 0.4),
    (0.0, 0.005),
];

/// Distances of the derivatives.
pub(super) const STEPS: [f64; P::ALL] = [
    1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-5, 1e-4, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-2, 1e-4,
];

/// A known value is this sure.
const SURE: f64 = 1e-5;
/// The largest share of what was known beforehand that an identified quantity's error may be.
const MOST_OF_BEFOREHAND: f64 = 1.0 / 3.0;
/// How many standard deviations the interval of 95 % reaches, by which a quantity counts as identified: with the digits that figures are
/// published with; levels that are asked for are the engine's.
pub(super) const QUANTILE_95: f64 = 1.96;

/// Which of the two fits tells a quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// The yaw rate that the wheel angle makes.
    Vehicle,
    /// The wheel angle that the torques make.
    Column,
}

/// How wide half of a 95 % interval may be.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Width {
    /// A part of a value above zero, whose logarithm is normal.
    Share(f64),
    /// In the quantity's unit.
    Plain(f64),
    /// In the unit of a value that is never below zero, where an interval ends.
    NotNegative(f64),
}

/// What a quantity is made of: what is known, the parameters, a speed.
type Value = fn(&Known, &DVector<f64>, f64) -> f64;

/// One of [`QUANTITIES`].
pub(super) struct Definition {
    pub(super) name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    pub(super) part: Part,
    width: Width,
    value: Value,
}

const fn of(
    part: Part,
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    width: Width,
    value: Value,
) -> Definition {
    Definition {
        name,
        unit,
        meaning,
        part,
        width,
        value,
    }
}

use Part::{Column, Vehicle};
use Width::{NotNegative, Plain, Share};

/// In the order of the table.
#[rustfmt::skip]
pub(super) const QUANTITIES: [Definition; 15] = [
    of(Vehicle, "yaw_rate_gain", "1/s", "yaw rate per wheel angle in a steady turn, at the mean speed", Share(0.1), |k, x, v| Physical::of(k, x).yaw_rate_gain(v)),
    of(Vehicle, "steering_ratio", "", "wheel angle per angle of the front wheels, 1/K_t", Share(0.1), |_, x, _| (-x[P::K_T]).exp()),
    of(Vehicle, "wheel_angle_offset", "rad", "what the angle sensor shows when the wheels stand straight", Plain(0.02), |_, x, _| x[P::ANGLE_OFFSET]),
    of(Vehicle, "understeer_gradient", "rad.s2/m", "angle of the front wheels per lateral acceleration beside that of a crawl", Plain(0.001), |k, x, _| Physical::of(k, x).understeer_gradient()),
    of(Vehicle, "yaw_time", "s", "I*v/(2*L*l_f*K_f) at the mean speed: how fast the yaw rate of a neutral vehicle follows the wheel", Share(0.2), |k, x, v| v * Physical::of(k, x).yaw_time()),
    of(Vehicle, "k_f", "N/rad", "cornering stiffness of one front tyre", Share(0.2), |k, x, _| Physical::of(k, x).k_f),
    of(Vehicle, "k_r", "N/rad", "cornering stiffness of one rear tyre", Share(0.2), |k, x, _| Physical::of(k, x).k_r),
    of(Vehicle, "i", "kg.m2", "yaw inertia", Share(0.2), |k, x, _| Physical::of(k, x).i),
    of(Vehicle, "l_f", "m", "centre of gravity to the front axle", Share(0.1), |k, x, _| Physical::of(k, x).l_f),
    of(Column, "j_s", "kg.m2", "inertia of the column", Share(0.2), |_, x, _| x[P::J_S].exp()),
    of(Column, "b_s", "N.m.s/rad", "damping of the column", Share(0.2), |_, x, _| x[P::B_S].exp()),
    of(Column, "friction", "N.m", "dry friction of the column", NotNegative(0.1), |_, x, _| x[P::FRICTION]),
    of(Column, "aligning_gain", "N.m.s2/m", "aligning torque per lateral acceleration in a steady turn", Share(0.1), |_, x, _| x[P::ALIGNING].exp()),
    of(Column, "k_aln", "N.m/rad", "aligning torque per side-slip angle of the front wheels, K_aln of equation (4)", Share(0.2), |k, x, _| Physical::of(k, x).aligning_stiffness()),
    of(Column, "torque_offset", "N.m", "what the torque sensors show where no torque acts", Plain(0.1), |_, x, _| -x[P::TORQUE_OFFSET]),
];

/// How a quantity came out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The record tells it.
    Identified,
    /// The record does not tell it.
    NotIdentified,
    /// It was given.
    Given,
}

/// A quantity as it came out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quantity {
    /// Its name; in a scenario's `[vehicle]` too, where that has it.
    pub name: &'static str,
    /// Its unit; empty if it has none.
    pub unit: &'static str,
    /// What it is.
    pub meaning: &'static str,
    /// Which fit tells it.
    pub part: Part,
    /// Whether the record tells it.
    pub verdict: Verdict,
    /// Its value; none where it is not identified.
    pub estimate: Option<f64>,
    /// Standard error; none where there was no fit, or where a check refutes it.
    pub standard_error: Option<f64>,
    /// 95 % interval; none where there was no fit, or where a check refutes it.
    pub interval_95: Option<[f64; 2]>,
    /// Why it is not identified; empty otherwise.
    pub why: String,
    /// What an interval of any level is made of; none where there is no interval.
    #[serde(skip)]
    errors: Option<Errors>,
}

impl Quantity {
    /// The interval that reaches so many standard deviations of a normal distribution.
    #[must_use]
    pub fn interval(&self, deviations: f64) -> Option<[f64; 2]> {
        self.errors.map(|errors| errors.interval(deviations))
    }
}

/// A value with its error, on the scale on which it is normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Errors {
    value: f64,
    error: f64,
    beforehand: f64,
    width: Width,
    unit: &'static str,
}

impl Errors {
    /// The interval that reaches so many standard deviations of a normal distribution.
    fn interval(&self, deviations: f64) -> [f64; 2] {
        let half = deviations * self.error;
        match self.width {
            Share(_) => [self.value * (-half).exp(), self.value * half.exp()],
            Plain(_) | NotNegative(_) => [self.value - half, self.value + half].map(|end| self.allowed(end)),
        }
    }

    /// A value, or zero where the quantity cannot be below it.
    fn allowed(&self, value: f64) -> f64 {
        match self.width {
            NotNegative(_) => value.max(0.0),
            Share(_) | Plain(_) => value,
        }
    }

    /// Half of that interval, as a share or in the unit.
    fn half_width(&self, deviations: f64) -> f64 {
        let half = deviations * self.error;
        match self.width {
            Share(_) => half.exp_m1(),
            Plain(_) | NotNegative(_) => half,
        }
    }

    /// That half as text.
    pub(super) fn half_as_text(&self, deviations: f64) -> String {
        self.shown(self.half_width(deviations))
    }

    /// Half of an interval as text.
    fn shown(&self, half: f64) -> String {
        match self.width {
            Share(_) => format!("+-{:.0} %", 100.0 * half),
            Plain(_) | NotNegative(_) => format!("+-{half:.2e} {}", self.unit),
        }
    }
}

/// Means and variances of what is known beforehand, with what was given.
pub(super) fn beforehand(known: &Known) -> [(f64, f64); P::ALL] {
    let mut all = BEFOREHAND;
    let l = known.wheelbase_m;
    if let Some(l_f) = known.l_f_m {
        all[P::L_F] = (l_f / l, SURE);
    }
    if let Some(ratio) = known.steering_ratio {
        all[P::K_T] = (-ratio.ln(), SURE);
    }
    if let Some(i) = known.yaw_inertia_kg_m2 {
        let l_f = all[P::L_F].0 * l;
        all[P::INERTIA] = ((i / (known.mass_kg * l_f * (l - l_f))).ln(), SURE);
    }
    all
}

impl Definition {
    fn on_scale(&self, value: f64) -> f64 {
        match self.width {
            Share(_) => value.ln(),
            Plain(_) | NotNegative(_) => value,
        }
    }

    /// Value and error for parameters of a covariance, at a speed.
    pub(super) fn known(
        &self,
        known: &Known,
        at: &DVector<f64>,
        covariance: &DMatrix<f64>,
        v: f64,
    ) -> Errors {
        let value = |x: &DVector<f64>| self.on_scale((self.value)(known, x, v));
        let gradient = DVector::from_fn(at.len(), |i, _| {
            let [mut up, mut down] = [at.clone(), at.clone()];
            up[i] += STEPS[i];
            down[i] -= STEPS[i];
            (value(&up) - value(&down)) / (2.0 * STEPS[i])
        });
        let before = beforehand(known);
        let prior: f64 = (0..at.len()).map(|i| (gradient[i] * before[i].1).powi(2)).sum();
        Errors {
            value: (self.value)(known, at, v),
            error: gradient.dot(&(covariance * &gradient)).max(0.0).sqrt(),
            beforehand: prior.sqrt(),
            width: self.width,
            unit: self.unit,
        }
    }

    fn limit(&self) -> f64 {
        match self.width {
            Share(limit) | Plain(limit) | NotNegative(limit) => limit,
        }
    }

    /// Why it is not identified; nothing if it is.
    pub(super) fn lacks(&self, known: &Errors) -> Option<String> {
        if known.error > MOST_OF_BEFOREHAND * known.beforehand {
            let why = match self.name {
                "k_f" | "k_r" | "i" | "l_f" => {
                    "the yaw rate tells yaw_time, of which stiffness and yaw inertia are a ratio: what is assumed of them decides"
                }
                _ => "the drive hardly tells it: what is assumed beforehand decides",
            };
            return Some(why.into());
        }
        let half = known.half_width(QUANTILE_95);
        let wanted = || known.shown(self.limit());
        (half > self.limit()).then(|| format!("{} where {} is wanted", known.shown(half), wanted()))
    }

    fn is_given(&self, known: &Known) -> bool {
        match self.name {
            "steering_ratio" => known.steering_ratio.is_some(),
            "i" => known.yaw_inertia_kg_m2.is_some() && known.l_f_m.is_some(),
            "l_f" => known.l_f_m.is_some(),
            _ => false,
        }
    }

    /// The result of a fit; `refuted` says what refutes it.
    pub(super) fn quantity(&self, known: &Known, found: &Errors, refuted: Option<&str>) -> Quantity {
        let error = match self.width {
            Share(_) => found.value * found.error,
            Plain(_) | NotNegative(_) => found.error,
        };
        let given = self.is_given(known);
        let errors = Some(*found).filter(|_| refuted.is_none() && !given);
        let why = refuted
            .map(String::from)
            .or_else(|| self.lacks(found))
            .filter(|_| !given);
        Quantity {
            verdict: match (given, &why) {
                (true, _) => Verdict::Given,
                (_, None) => Verdict::Identified,
                _ => Verdict::NotIdentified,
            },
            estimate: why.is_none().then_some(found.allowed(found.value)),
            standard_error: errors.map(|_| error),
            interval_95: errors.map(|errors| errors.interval(QUANTILE_95)),
            errors,
            ..self.without_fit(why.unwrap_or_default())
        }
    }

    /// The result where there was no fit.
    pub(super) fn without_fit(&self, why: String) -> Quantity {
        Quantity {
            name: self.name,
            unit: self.unit,
            meaning: self.meaning,
            part: self.part,
            verdict: Verdict::NotIdentified,
            estimate: None,
            standard_error: None,
            interval_95: None,
            why,
            errors: None,
        }
    }
}
