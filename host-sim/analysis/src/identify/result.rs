//! What an identification says, and when it says that it cannot say.
//!
//! **Identified**: the parameter's standard error is at most 0.102 of its variation interval (table 4 of the
//! paper for a_i, K_d and K_hg; the search interval for t_p; the variation interval of a_i times the default
//! K_d + K_nms = 4 for `gain_i`), i.e. a 95 % interval that no bound cuts is at most 40 % as wide; and no
//! bound contradicts it. A bound is *contradicted* if the optimum lies on it and the unbounded optimum lies
//! beyond it by more than three standard errors and a hundredth of the variation interval: then it does not
//! trim noise, the model does not hold, and so neither do the standard errors. Neither the parameter on that
//! bound nor any that the bound moves by more than three of its standard errors (with the first held) is then
//! identified, nor has it an interval. A parameter that is not identified has no `estimate`. What the search
//! ended on is kept in `optimum`, for those who want to see where a method would have put it.
//!
//! The 95 % interval belongs to the unbounded optimum; on the side where the optimum lies it reaches as far
//! as the likelihood ratio to that optimum allows, so it always holds the estimate.

use nalgebra::DMatrix;
use serde::Serialize;

use super::balance::Balance;
use super::change::{Change, Constancy};
use super::prepare::Preflight;
use super::search::{Bounds, Termination};
use super::signals::Muscle;

/// An assumption that the record refutes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Refutation {
    /// The assumption.
    pub assumption: &'static str,
    /// What in the record says so.
    pub evidence: String,
    /// The likeliest cause.
    pub cause: String,
    /// What would cure it.
    pub cure: String,
}

/// Whether scale and sign of the driver's torque against the guidance's were checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Torques {
    /// By their balance on the column.
    Weighed,
    /// Not at all: gusts, friction, an assist or coarse signals hide it. What is identified holds if they are right.
    AsRecorded,
}

/// The assumption that a driver who changed refutes.
pub(crate) const SAME_DRIVER: &str = "the driver is the same throughout";
/// The assumption that a line refutes that moves.
pub(crate) const SAME_LINE: &str = "the driver keeps one line, and e_y_m one offset";

/// One parameter of the driver.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Parameter {
    /// The estimate; none where the data do not identify the parameter, and of a t_p on a bound, where the search was stopped.
    pub estimate: Option<f64>,
    /// Standard error; none where the data put no bound on it at all, or contradict the model.
    pub standard_error: Option<f64>,
    /// 95 % interval, cut to the range that the parameter can have.
    pub interval_95: Option<[f64; 2]>,
    /// Whether the data identify it.
    pub identified: bool,
    /// Whether the optimum lies on a bound of the search.
    pub on_bound: bool,
    /// Whether it was given, not estimated.
    pub fixed: bool,
    /// Where the search ended; none if the parameter is not part of the method's model.
    pub optimum: Option<f64>,
    /// What an interval of any level is made of; none where there is no interval.
    #[serde(skip)]
    pub errors: Option<Errors>,
}

/// How an optimum errs: by its deviation about where the search would have ended without bounds, and about what else draws it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Errors {
    optimum: f64,
    pull: f64,
    deviation: f64,
    drawn: f64,
    bounds: Bounds,
    /// The deviation if t_nms is as assumed.
    as_assumed: Option<f64>,
    /// What optimum and interval are multiplied by.
    factor: f64,
}

impl Errors {
    /// The interval that reaches so many standard deviations of a normal distribution, and holds the one that is true if t_nms is as
    /// assumed.
    fn interval(&self, deviations: f64) -> [f64; 2] {
        let holding = |deviation: f64, drawn: f64| {
            let margin = deviations * deviation;
            let towards_optimum = margin.hypot(self.pull);
            let (below, above) = if self.pull > 0.0 {
                (towards_optimum, margin)
            } else {
                (margin, towards_optimum)
            };
            let unbounded = self.optimum + self.pull;
            let ends = [unbounded - below, unbounded + above].map(|end| end + drawn);
            let holding = [ends[0].min(self.optimum), ends[1].max(self.optimum)];
            holding.map(|end| end.clamp(self.bounds.low, self.bounds.high))
        };
        let [low, high] = holding(self.deviation, self.drawn);
        let narrow = self.as_assumed.map(|deviation| holding(deviation, 0.0));
        let held = narrow.map_or([low, high], |[least, most]| [low.min(least), high.max(most)]);
        held.map(|end| end * self.factor)
    }
}

impl Parameter {
    /// Not part of the model.
    pub(crate) const ABSENT: Self = Self {
        estimate: None,
        standard_error: None,
        interval_95: None,
        identified: false,
        on_bound: false,
        fixed: false,
        optimum: None,
        errors: None,
    };

    /// The interval that reaches so many standard deviations of a normal distribution, cut as [`Self::interval_95`] is.
    #[must_use]
    pub fn interval(&self, deviations: f64) -> Option<[f64; 2]> {
        // What was given has an interval without width, whatever the level.
        self.errors
            .map_or(self.interval_95, |errors| Some(errors.interval(deviations)))
    }

    pub(crate) fn fixed(value: f64) -> Self {
        Self {
            estimate: Some(value),
            standard_error: Some(0.0),
            interval_95: Some([value, value]),
            identified: true,
            fixed: true,
            optimum: Some(value),
            ..Self::ABSENT
        }
    }

    /// From where the search ended, how much farther it would have gone without bounds (to first order), the variance
    /// there, and by how much what else the record says draws it.
    pub(crate) fn estimated(
        optimum: f64,
        pull: f64,
        variance: f64,
        drawn: f64,
        bounds: Bounds,
        variation_width: f64,
    ) -> Self {
        let not = Self::not_identified(optimum, bounds);
        if !variance.is_finite() || !pull.is_finite() {
            return not;
        }
        // The mean square of what the estimate misses: the variance about where the record draws it, and the way there.
        let standard_error = (variance.max(0.0) + drawn * drawn).sqrt();
        let identified = STANDARD_NORMAL_95 * standard_error <= 0.5 * WIDEST_INTERVAL_SHARE * variation_width;
        let errors = Errors {
            optimum,
            pull,
            deviation: variance.max(0.0).sqrt(),
            drawn,
            bounds,
            as_assumed: None,
            factor: 1.0,
        };
        Self {
            estimate: identified.then_some(optimum),
            standard_error: Some(standard_error),
            interval_95: Some(errors.interval(STANDARD_NORMAL_95)),
            identified,
            errors: Some(errors),
            ..not
        }
    }

    /// A parameter of which a search that ended at `optimum` says nothing.
    pub(crate) fn not_identified(optimum: f64, bounds: Bounds) -> Self {
        Self {
            on_bound: bounds.touches(optimum),
            optimum: Some(optimum),
            ..Self::ABSENT
        }
    }

    /// The parameter times a known `factor`.
    pub(crate) fn scaled(self, factor: f64) -> Self {
        Self {
            estimate: self.estimate.map(|x| x * factor),
            standard_error: self.standard_error.map(|x| x * factor.abs()),
            interval_95: self.interval_95.map(|i| i.map(|x| x * factor)),
            optimum: self.optimum.map(|x| x * factor),
            errors: self.errors.map(|errors| Errors {
                factor: errors.factor * factor,
                ..errors
            }),
            ..self
        }
    }
}

/// 97.5 % point of the standard normal distribution, with the digits that estimates are published with; levels that are asked for are the
/// engine's.
pub(crate) const STANDARD_NORMAL_95: f64 = 1.959_964;

/// Widest 95 % interval of an identified parameter, as a share of its variation interval.
const WIDEST_INTERVAL_SHARE: f64 = 0.4;

/// The driver's parameters, keyed as in table 4 (lower case), and the combinations that T_d alone carries.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Parameters {
    /// Gain on e_y, 1/m.
    pub a_1: Parameter,
    /// Gain on the integral of e_y, 1/(m.s).
    pub a_2: Parameter,
    /// Gain on e_theta.
    pub a_3: Parameter,
    /// Processing delay, s.
    pub t_p: Parameter,
    /// Gain from target angle to torque, N.m/rad.
    pub k_d: Parameter,
    /// Reaction to the guidance torque, 0 (relies on it) to 1.
    pub k_hg: Parameter,
    /// (K_d + K_nms)*a_1, N.m/m.
    pub gain_1: Parameter,
    /// (K_d + K_nms)*a_2, N.m/(m.s).
    pub gain_2: Parameter,
    /// (K_d + K_nms)*a_3, N.m/rad.
    pub gain_3: Parameter,
}

impl Parameters {
    /// Takes the verdict from all that was estimated: the model that it was estimated with does not hold.
    pub(crate) fn take_back(&mut self) {
        for p in self.list_mut().into_iter().filter(|p| !p.fixed) {
            *p = Parameter {
                on_bound: p.on_bound,
                optimum: p.optimum,
                ..Parameter::ABSENT
            };
        }
    }

    /// Calls nothing identified that was estimated; the method's errors and intervals stay to be seen.
    pub(crate) fn disown(&mut self) {
        for p in self.list_mut().into_iter().filter(|p| !p.fixed) {
            (p.identified, p.estimate) = (false, None);
        }
    }

    /// Widens each interval so that it holds the one that is true if t_nms is as assumed.
    pub(crate) fn hold(&mut self, at_t_nms: &AtTNms) {
        let names = self.list().map(|(name, ..)| name);
        for (name, p) in names.into_iter().zip(self.list_mut()) {
            if let (Some(wide), Some(narrow)) = (&mut p.errors, at_t_nms.errors(name)) {
                wide.as_assumed = Some(narrow.deviation);
                p.interval_95 = Some(wide.interval(STANDARD_NORMAL_95));
            }
        }
    }

    /// In the order of [`Parameters::list`].
    fn list_mut(&mut self) -> [&mut Parameter; 9] {
        [
            &mut self.gain_1,
            &mut self.gain_2,
            &mut self.gain_3,
            &mut self.t_p,
            &mut self.k_hg,
            &mut self.k_d,
            &mut self.a_1,
            &mut self.a_2,
            &mut self.a_3,
        ]
    }

    /// Every parameter with its key and unit, in the order of print.
    pub fn list(&self) -> [(&'static str, &'static str, &Parameter); 9] {
        [
            ("gain_1", "N.m/m", &self.gain_1),
            ("gain_2", "N.m/(m.s)", &self.gain_2),
            ("gain_3", "N.m/rad", &self.gain_3),
            ("t_p", "s", &self.t_p),
            ("k_hg", "-", &self.k_hg),
            ("k_d", "N.m/rad", &self.k_d),
            ("a_1", "1/m", &self.a_1),
            ("a_2", "1/(m.s)", &self.a_2),
            ("a_3", "-", &self.a_3),
        ]
    }
}

/// A difference that the data determine although its parts they do not: along it, the loss is flat.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Combination {
    /// Such as `gain_3 - 7.08*k_hg`.
    pub name: String,
    /// Estimate of the combination.
    pub estimate: f64,
    /// Standard error of the combination.
    pub standard_error: f64,
}

/// What the intervals would be if K_nms and t_nms were known to be what is assumed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AtTNms {
    /// t_nms, s.
    pub t_nms_s: f64,
    /// By key.
    pub intervals_95: Vec<(&'static str, [f64; 2])>,
    /// What an interval of any level is made of, by key.
    #[serde(skip)]
    pub errors: Vec<(&'static str, Errors)>,
}

impl AtTNms {
    fn errors(&self, name: &str) -> Option<&Errors> {
        self.errors.iter().find(|own| own.0 == name).map(|own| &own.1)
    }

    /// The interval of a parameter that reaches so many standard deviations of a normal distribution.
    #[must_use]
    pub fn interval(&self, name: &str, deviations: f64) -> Option<[f64; 2]> {
        Some(self.errors(name)?.interval(deviations))
    }
}

/// The line that the driver takes beside the target line, to the left where positive. A camera whose e_y has an offset looks the
/// same in every column of the log.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OwnLine {
    /// On a straight road, m.
    pub offset: Parameter,
    /// What is added in a left bend of 300 m at 60 km/h, m; in proportion to the turn of the road, v/R, in others.
    pub bend: Parameter,
}

/// Correlation of the estimation errors.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Correlation {
    /// Keys of rows and columns.
    pub names: Vec<&'static str>,
    /// Symmetric, ones on the diagonal; none where a variance is zero or unbounded.
    pub matrix: Vec<Vec<Option<f64>>>,
}

impl Correlation {
    /// What ties the `free` parameters that have a name, from the covariance of the errors.
    pub(crate) fn new(names: &[Option<&'static str>], errors: &DMatrix<f64>, free: &[usize]) -> Self {
        let shown: Vec<(usize, &'static str)> = free
            .iter()
            .filter_map(|&i| names.get(i).copied().flatten().map(|n| (i, n)))
            .collect();
        let entry = |i: usize, j: usize| {
            let c = errors[(i, j)] / (errors[(i, i)] * errors[(j, j)]).sqrt();
            c.is_finite()
                .then(|| if i == j { 1.0 } else { c.clamp(-1.0, 1.0) })
        };
        Self {
            names: shown.iter().map(|s| s.1).collect(),
            matrix: shown
                .iter()
                .map(|&(i, _)| shown.iter().map(|&(j, _)| entry(i, j)).collect())
                .collect(),
        }
    }
}

/// The disturbance that the noise model estimated beside the driver: a first-order low-passed remnant and white
/// sensor noise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Remnant {
    /// Corner of the low-pass, Hz; none if the disturbance is no low-passed one.
    pub corner_hz: Option<f64>,
    /// Standard deviation of the low-passed part, N.m.
    pub sd_nm: Option<f64>,
    /// Standard deviation of the white part, N.m.
    pub white_sd_nm: f64,
    /// Standard deviation of the one-step prediction error, N.m.
    pub innovation_sd_nm: f64,
}

/// Whether the residuals are white, as they must be for the standard errors to hold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Whiteness {
    /// Largest autocorrelation over the lags tested.
    pub largest_autocorrelation: f64,
    /// Lags tested.
    pub lags: usize,
    /// Ljung-Box statistic over those lags.
    pub statistic: f64,
    /// Probability of a larger statistic if the residuals are white.
    pub p_value: f64,
    /// `p_value` at least 0.01.
    pub white: bool,
}

/// Whether the residuals are independent of an input's past: if not, the model misses something of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct InputCorrelation {
    /// Column of the log.
    pub input: &'static str,
    /// Largest cross-correlation with the input of 0 to 1 s before, in standard deviations of what independence
    /// gives.
    pub largest_z: f64,
    /// `largest_z` at most 3.3 (0.1 % for one lag).
    pub independent: bool,
}

/// One start of the search.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Start {
    /// Delay that it began from, s.
    pub from_t_p_s: f64,
    /// Delay that it ended at, s.
    pub to_t_p_s: f64,
    /// Loss that it ended at.
    pub loss: f64,
}

/// Signals to plot: measured and explained torque over the rows used, and what was measured in the others.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Traces {
    /// Time, s.
    pub time_s: Vec<f64>,
    /// Measured driver torque, N.m.
    pub measured_nm: Vec<f64>,
    /// Driver torque simulated from the inputs alone, N.m.
    pub simulated_nm: Vec<f64>,
    /// Residuals that the loss is made of, N.m: prediction errors of the noise model, measured minus simulated
    /// of the paper's method.
    pub residual_nm: Vec<f64>,
    /// Time of the rows that were not used, s.
    pub unused_s: Vec<f64>,
    /// Measured driver torque of those, N.m.
    pub unused_nm: Vec<f64>,
}

/// Result of one identification.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Identification {
    /// `noise-model` or `paper`.
    pub method: &'static str,
    /// Fit of the simulated driver torque, 100*(1 - |y - yhat|/|y - mean y|), %.
    pub fit_percent: f64,
    /// Same, of the one-step prediction; none for the paper's method, which has no predictor.
    pub fit_percent_predicted: Option<f64>,
    /// Same, of the second output phi_target against the wheel angle; none for the noise model, which has none.
    pub fit_percent_wheel_angle: Option<f64>,
    /// The driver.
    pub parameters: Parameters,
    /// The narrower intervals that hold if K_nms and t_nms are what is assumed; none if both were given or estimated.
    pub at_t_nms: Option<AtTNms>,
    /// What is determined where single parameters are not.
    pub combinations: Vec<Combination>,
    /// Correlation of the errors of the free parameters.
    pub correlation: Correlation,
    /// The disturbance; none for the paper's method, which assumes white noise.
    pub remnant: Option<Remnant>,
    /// Test of the residuals.
    pub whiteness: Whiteness,
    /// Test of the residuals against each input.
    pub input_correlation: Vec<InputCorrelation>,
    /// What was found in the log and done about it; none for the published method, which takes it as it is.
    pub preflight: Option<Preflight>,
    /// The torques on the column against its motion.
    pub balance: Option<Balance>,
    /// What that says of how the torques of a guided drive were recorded; none of a drive by hand, in which nothing tells a scale.
    pub torques: Option<Torques>,
    /// Whether the driver was the same throughout; none for the published method, which does not ask.
    pub constancy: Option<Constancy>,
    /// The loss over t_p with all else at its best, as minus twice the log likelihood above the optimum.
    pub delay_profile: Vec<[f64; 2]>,
    /// The line that the driver takes; none for the published method, in which it is the target line, and where a wheel's inertia is sought
    /// and not found.
    pub line: Option<OwnLine>,
    /// What is usually taken as known and was estimated: k_nms, t_nms, t_h_late, t_d_late, wheel_inertia.
    pub beyond: Vec<(&'static str, Parameter)>,
    /// Assumptions that the record refutes: with any, nothing is identified.
    pub refuted: Vec<Refutation>,
    /// What was taken as true and cannot be seen in the record.
    pub assumed: Vec<String>,
    /// Starts of the search; the first is the one reported.
    pub starts: Vec<Start>,
    /// Loss at the start and after every accepted step.
    pub loss_history: Vec<f64>,
    /// Why the search ended.
    pub termination: Termination,
    /// Rows of the log that the loss is taken over.
    pub rows: usize,
    /// Sentences on what the data or the log could not give.
    pub notes: Vec<String>,
    /// Signals to plot.
    #[serde(skip)]
    pub traces: Traces,
}

impl Identification {
    /// How the driver changed, if that is what refutes one driver.
    pub fn changed(&self) -> Option<&Change> {
        let refuted = self
            .refuted
            .iter()
            .any(|r| [SAME_DRIVER, SAME_LINE].contains(&r.assumption));
        self.constancy.as_ref()?.change.as_ref().filter(|_| refuted)
    }

    /// The muscle that the estimate rests on: `assumed`, with what was estimated of it in its place.
    pub fn muscle(&self, assumed: Muscle) -> Muscle {
        let found = |name: &str| {
            let (_, parameter) = self.beyond.iter().find(|b| b.0 == name)?;
            parameter.optimum
        };
        Muscle {
            k_nms: found("k_nms").unwrap_or(assumed.k_nms),
            t_nms_s: found("t_nms").unwrap_or(assumed.t_nms_s),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Unbounded optimum 1.2 with standard error 0.1, bound 1. The log likelihood at the bound is (0.2/0.1)^2/2 = 2
    /// below the peak; 95 % is 1.96^2/2 farther down, at 1.2 -+ 0.1 sqrt(4 + 1.96^2) = 1.2 - 0.28002 downwards.
    #[test]
    fn the_interval_of_a_parameter_on_its_bound_reaches_down_by_the_likelihood_ratio() {
        let p = Parameter::estimated(1.0, 0.2, 0.01, 0.0, Bounds::new(0.0, 1.0), 1.0);
        let [low, high] = p.interval_95.unwrap();
        assert!((low - 0.919_98).abs() < 1e-4 && high == 1.0, "{low} {high}");
        assert!(p.on_bound && p.identified && p.estimate == Some(1.0));
        // Off any bound: 1.96 standard errors to both sides.
        let p = Parameter::estimated(0.5, 0.0, 0.01, 0.0, Bounds::new(0.0, 1.0), 1.0);
        let [low, high] = p.interval_95.unwrap();
        assert!((low - 0.304).abs() < 1e-4 && (high - 0.696).abs() < 1e-4);
    }

    /// Like the last, with the 2.5758 of tables for 99 %: 1.2 - 0.1 sqrt(4 + 2.5758^2) = 1.2 - 0.32612, and 0.5 -+ 0.25758. What is true if
    /// t_nms is as assumed stays inside: 0.5 -+ 2 * 0.2, cut at 1.
    #[test]
    fn an_interval_of_another_level_reaches_as_many_deviations() {
        let p = Parameter::estimated(1.0, 0.2, 0.01, 0.0, Bounds::new(0.0, 1.0), 1.0);
        let [low, high] = p.interval(2.5758).unwrap();
        assert!((low - 0.873_88).abs() < 1e-4 && high == 1.0, "{low} {high}");
        let mut p = Parameter::estimated(0.5, 0.0, 0.01, 0.0, Bounds::new(0.0, 1.0), 1.0);
        let [low, high] = p.scaled(2.0).interval(2.5758).unwrap();
        assert!((low - 0.484_84).abs() < 1e-4 && (high - 1.515_16).abs() < 1e-4);
        p.errors.as_mut().unwrap().as_assumed = Some(0.2);
        assert_eq!(p.interval(2.0), Some([0.5 - 0.4, 0.5 + 0.4]));
        assert_eq!(Parameter::fixed(0.3).interval(2.5758), Some([0.3, 0.3]));
        assert_eq!(
            Parameter::not_identified(0.3, Bounds::FREE).interval(2.5758),
            None
        );
    }
}
