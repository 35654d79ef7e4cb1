//! The evidence of [`super::evidence`] and of the sensors held against the model: wider standard errors where they are
//! due, and a verdict taken back where an assumption is refuted.
//!
//! What counts as refuted is said in [`crate::identify::verdict`].

use nalgebra::{DMatrix, DVector};

use super::evidence::Alternative;
use super::sums::Rows;
use super::{
    COMPARED, D_LATE, H_LATE, K_HG, K_NMS, NAMES, Problem, SMALLEST_ERROR_NM, T_NMS, T_NMS_RANGE_S,
    T_NMS_SD_S, T_P, VARIATION_WIDTHS,
};
use crate::identify::diagnostics;
use crate::identify::options::Options;
use crate::identify::result::Refutation;
use crate::identify::result::{AtTNms, Identification, Parameter, Parameters, STANDARD_NORMAL_95};
use crate::identify::search::{Bounds, Optimum, covariance, minimise};
use crate::identify::verdict;

/// Largest factor by which the scatter of the scores may widen a standard error: more is no noise.
const WIDEST: f64 = 3.0;
/// 95 % point of a chi-square with one degree of freedom.
const PROFILE_95: f64 = 3.841;
/// Share of what counts as right (10 %, 15 ms, 0.05) that another assumption has to move a parameter by to matter.
const MATTERS: f64 = 0.3;
/// Standard errors by which the record has to draw t_nms from what is assumed before it is freed.
const DRAWN: f64 = 3.0;
/// Twice the log likelihood ratio that the driver model has to gain over no driver at all.
const LEAST_GAIN: f64 = 60.0;
/// Guidance beyond this, N.m, is no offset of a sensor.
const GUIDED_NM: f64 = 0.03;
/// Rows that are further apart do not tell the driver's muscle, whose lag is 0.1 s: at 10 Hz K_hg's optimum is off by three times as
/// much as at 20 Hz (`cargo xtask validate --recordings`).
const SLOWEST_S: f64 = 0.055;

/// Where the profile of the delay passes the 95 % level for the first and the last time, or ends below it. Between its points
/// its root is taken as straight, as it is of a parabola.
fn within_95(profile: &[[f64; 2]]) -> Option<[f64; 2]> {
    let first = profile.iter().position(|x| x[1] <= PROFILE_95)?;
    let last = profile.iter().rposition(|x| x[1] <= PROFILE_95)?;
    let passes = |inside: [f64; 2], outside: Option<&[f64; 2]>| {
        let Some(outside) = outside else { return inside[0] };
        let root = |x: f64| x.max(0.0).sqrt();
        let share = (root(PROFILE_95) - root(inside[1])) / (root(outside[1]) - root(inside[1]));
        inside[0] + share * (outside[0] - inside[0])
    };
    let before = first.checked_sub(1).and_then(|k| profile.get(k));
    Some([
        passes(profile[first], before),
        passes(profile[last], profile.get(last + 1)),
    ])
}

impl Problem<'_> {
    /// Standard errors that hold where the prediction errors are not quite white, and where the likelihood of the
    /// delay is flatter than its curvature at the optimum says.
    pub(super) fn widen(
        &self,
        errors: &mut DMatrix<f64>,
        p: &[f64],
        hessian: &DMatrix<f64>,
        free: &[usize],
        profile: &[[f64; 2]],
        rows: &Rows,
    ) {
        let scattered = self.scattered(rows, hessian, free);
        let mut wider: Vec<f64> = (0..errors.nrows())
            .map(|i| {
                let (usual, other) = (errors[(i, i)], scattered[(i, i)]);
                if usual > 0.0 && usual.is_finite() && other.is_finite() {
                    (other / usual).sqrt().clamp(1.0, WIDEST)
                } else {
                    1.0
                }
            })
            .collect();
        if let Some([first, last]) = within_95(profile) {
            let usual = errors[(T_P, T_P)].sqrt();
            let half = (p[T_P] - first).max(last - p[T_P]) / STANDARD_NORMAL_95;
            if usual > 0.0 && usual.is_finite() {
                wider[T_P] = wider[T_P].max(half / usual);
            }
        }
        for i in 0..errors.nrows() {
            for j in 0..errors.nrows() {
                errors[(i, j)] *= wider[i] * wider[j];
            }
        }
    }

    /// Holds all evidence against the model and takes back what does not stand.
    pub(super) fn judge(
        &self,
        found: &mut Identification,
        options: &Options,
        optimum: &Optimum,
        alternatives: &[Alternative],
        errors: &DMatrix<f64>,
    ) {
        let mut refuted: Vec<Refutation> = Vec::new();
        if options.manual && self.log.guidance_torque_nm.iter().any(|t| t.abs() > GUIDED_NM) {
            // All else that is wrong follows from it.
            found.balance = None;
            refuted.push(Refutation {
                assumption: "the drive was a manual one",
                evidence: "guidance_torque_nm is not zero".to_owned(),
                cause: "--manual was given for a guided drive".to_owned(),
                cure: "leave --manual out".to_owned(),
            });
        }
        let change = found.constancy.as_ref().and_then(|c| c.change.clone());
        let sensor = change
            .as_ref()
            .and_then(|c| self.changed_sensor(c, options.manual));
        if sensor.is_none() {
            refuted.extend(found.balance.iter().flat_map(verdict::of_balance));
        }
        // Where a sensor is wrong, all that follows from it looks like another driver too.
        let change = change.filter(|_| refuted.is_empty());
        let mut others = verdict::of_residuals(
            found.fit_percent,
            &found.whiteness,
            &found.input_correlation,
            diagnostics::unexplained_autocorrelation(&found.traces.residual_nm, &self.log.resampling),
        );
        others.extend(self.beside_nothing(optimum).map(|r| (f64::INFINITY, r)));
        others.extend(self.of_muscle(found, &optimum.point, alternatives, errors));
        // What the change explains better is no cause of its own, and a change is none where something else explains more: a fit
        // with the cure of the first is judged again.
        let change = change.filter(|c| sensor.is_some() || others.iter().all(|o| o.0 <= c.deviance));
        if let Some(change) = &change {
            others.clear();
            refuted.push(sensor.unwrap_or_else(|| verdict::of_change(change, self.span_s())));
        }
        others.sort_by(|a, b| b.0.total_cmp(&a.0));
        refuted.extend(others.into_iter().map(|o| o.1));
        if refuted.iter().any(|r| r.assumption == verdict::SIGNS) {
            // All else that is wrong follows from it.
            refuted.retain(|r| r.assumption == verdict::SIGNS);
        }
        if !refuted.is_empty() {
            found.parameters.take_back();
        }
        found.refuted = refuted;
        let p = &optimum.point;
        found.assumed = verdict::ASSUMED.iter().map(|&a| a.to_owned()).collect();
        found.assumed.extend(self.withhold(&mut found.parameters));
        if !self.is_free(T_NMS) {
            let [low, high] = T_NMS_RANGE_S;
            found.assumed.push(if options.t_nms_known {
                format!("t_nms is {} s", p[T_NMS])
            } else {
                format!(
                    "t_nms is {} s, give or take {T_NMS_SD_S} s (arms have {low} to {high} s): the errors hold that",
                    p[T_NMS]
                )
            });
        }
        if !self.is_free(K_NMS) {
            found.assumed.push(format!("K_nms is {} N.m/rad", p[K_NMS]));
        }
    }

    /// Calls nothing identified that this kind of record does not tell, and says why.
    fn withhold(&self, parameters: &mut Parameters) -> Option<String> {
        let k_hg = parameters.k_hg;
        if self.log.dt_s > SLOWEST_S {
            parameters.disown();
            return Some(format!(
                "rows are {SLOWEST_S} s apart or less; these are {:.3} s apart, so nothing is called identified",
                self.log.dt_s
            ));
        }
        if self.log.approximate_points {
            parameters.disown();
            parameters.k_hg = k_hg;
            return Some(
                "e_y and e_theta are the driver's; these are made of lane lines and a curvature, so only K_hg is called identified"
                    .to_owned(),
            );
        }
        None
    }

    /// Whether freeing an assumption would move a parameter by its standard error and by a share of what counts as right.
    pub(super) fn matters(&self, a: &Alternative, p: &[f64], errors: &DMatrix<f64>) -> bool {
        let tolerance = |i: usize| match i {
            T_P => 0.015,
            K_HG => 0.05,
            _ => 0.1 * p[i].abs(),
        };
        (0..=T_P)
            .any(|i| self.is_free(i) && a.moves(i).abs() > errors[(i, i)].sqrt().max(MATTERS * tolerance(i)))
    }

    /// t_nms as the record alone would have it, if that is another than was assumed and matters.
    pub(super) fn drawn_t_nms(&self, optimum: &Optimum) -> Option<f64> {
        if self.is_free(T_NMS) {
            return None;
        }
        let p = &optimum.point;
        let free: Vec<usize> = (0..self.size())
            .filter(|&i| self.is_free(i) && (i >= super::COUNT || !self.bounds[i].touches(p[i])))
            .collect();
        let variance =
            (2.0 * optimum.quadratic.loss / self.row_count().max(1) as f64).max(SMALLEST_ERROR_NM.powi(2));
        let errors = covariance(&optimum.quadratic.hessian, &free) * variance;
        let all = self.alternatives(p, &free, variance);
        let a = all.into_iter().find(|a| a.place == T_NMS)?;
        (a.z.abs() > DRAWN && self.matters(&a, p, &errors)).then_some(p[T_NMS] + a.step)
    }

    /// Widens the standard errors by what is not known of t_nms, and says where the record draws the parameters by it: t_nms
    /// is that of drivers' arms, about what is assumed, and what the record says of it; to first order. What the record says
    /// has the covariance `drawn_with` with the estimates.
    pub(super) fn widen_by_t_nms(
        &self,
        errors: &mut DMatrix<f64>,
        alternatives: &[Alternative],
        drawn_with: Option<&DVector<f64>>,
    ) -> DVector<f64> {
        let mut drawn = DVector::zeros(errors.nrows());
        let Some(a) = alternatives.iter().find(|a| a.place == T_NMS) else {
            return drawn;
        };
        let (known, seen) = (T_NMS_SD_S.powi(2), a.error.powi(2));
        let variance = known * seen / (known + seen);
        let share = known / (known + seen);
        let step = a.step * share;
        let with = |i: usize| drawn_with.map_or(0.0, |c| share * c[i]);
        for i in (0..=T_P).filter(|&i| self.is_free(i)) {
            drawn[i] = a.slopes[i] * step;
            for j in (0..=T_P).filter(|&j| self.is_free(j)) {
                errors[(i, j)] +=
                    variance * a.slopes[i] * a.slopes[j] + with(i) * a.slopes[j] + with(j) * a.slopes[i];
            }
        }
        drawn
    }

    /// The 95 % intervals if t_nms is what is assumed, from the standard errors that hold then; at a bound by the likelihood
    /// ratio, as the wider ones.
    pub(super) fn at_t_nms(&self, p: &[f64], errors: &DMatrix<f64>, pull: &DVector<f64>) -> AtTNms {
        let interval = |i: usize| {
            let (bounds, width) = (self.bounds[i], VARIATION_WIDTHS[i]);
            Parameter::estimated(p[i], pull[i], errors[(i, i)], 0.0, bounds, width).interval_95
        };
        AtTNms {
            t_nms_s: p[T_NMS],
            intervals_95: (0..=T_P)
                .filter(|&i| self.is_free(i))
                .filter_map(|i| Some((NAMES[i]?, interval(i)?)))
                .collect(),
        }
    }

    /// Whether the driver model predicts the torque better than a disturbance without any driver would.
    fn beside_nothing(&self, optimum: &Optimum) -> Option<Refutation> {
        if (0..=T_P).all(|i| !self.is_free(i)) {
            return None;
        }
        let mut point = optimum.point.clone();
        point[..=K_HG].fill(0.0);
        point[K_NMS] = 0.0;
        let mut bounds = self.bounds.clone();
        for i in (0..=T_P).chain([K_NMS, T_NMS, H_LATE, D_LATE]) {
            bounds[i] = Bounds::new(point[i], point[i]);
        }
        let nothing = minimise(&point, &bounds, COMPARED, |p| self.core_sums(p));
        let variance = 2.0 * optimum.quadratic.loss / self.row_count().max(1) as f64;
        let gain =
            2.0 * (nothing.quadratic.loss - optimum.quadratic.loss) / variance.max(SMALLEST_ERROR_NM.powi(2));
        (gain < LEAST_GAIN).then(|| Refutation {
            assumption: "driver_torque_nm is a driver's answer to the inputs",
            evidence: format!(
                "the driver model predicts it no better than a disturbance alone (log likelihood ratio {:.1})",
                0.5 * gain
            ),
            cause: "driver_torque_nm is noise, of another drive, or of nobody's hands".to_owned(),
            cure: "check the sensor and the column of the log".to_owned(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::log::DriveLog;
    use crate::identify::prepare::prepare;

    /// A parabola of standard error 0.05 about 0.2 passes 3.841 at 0.2 -+ 1.96 * 0.05, whatever the points; cut off at 0.15, it
    /// ends there.
    #[test]
    fn the_profile_passes_its_level_between_its_points() {
        let points = |from: f64| -> Vec<[f64; 2]> {
            let at = |i: u32| from + 0.03 * f64::from(i);
            (0..13).map(at).map(|t| [t, ((t - 0.2) / 0.05).powi(2)]).collect()
        };
        let [low, high] = within_95(&points(0.02)).unwrap();
        assert!(
            (low - 0.102).abs() < 1e-4 && (high - 0.298).abs() < 1e-4,
            "{low} {high}"
        );
        assert_eq!(within_95(&points(0.15)).unwrap()[0], 0.15);
    }

    /// t_p on its bound 0, where the likelihood would have its top at -0.15 s with a standard error of 0.05 s: 95 % is where the
    /// deviance above that of the bound is 1.96^2, at -0.15 + sqrt(0.15^2 + (1.96 * 0.05)^2) = 0.02917. What is 1.96
    /// standard errors from the top would be no more than the bound itself.
    #[test]
    fn the_interval_at_t_nms_reaches_from_a_bound_by_the_likelihood_ratio() {
        let none = vec![0.0; 2400];
        let log = DriveLog {
            start_s: 0.0,
            dt_s: 1.0 / 120.0,
            e_y_m: none.clone(),
            e_theta_rad: none.clone(),
            wheel_angle_rad: none.clone(),
            guidance_torque_nm: none.clone(),
            driver_torque_nm: none,
            speeds_m_per_s: None,
            approximate_points: false,
            resampling: Vec::new(),
            findings: Vec::new(),
        };
        let options = Options::default();
        let prepared = prepare(&log, &options);
        let problem = Problem::new(&prepared, &options);
        let mut errors = DMatrix::zeros(problem.size(), problem.size());
        errors[(T_P, T_P)] = 0.05 * 0.05;
        let mut pull = DVector::zeros(problem.size());
        pull[T_P] = -0.15;
        let at = problem.at_t_nms(&vec![0.0; problem.size()], &errors, &pull);
        let (_, [low, high]) = at.intervals_95.iter().find(|i| i.0 == "t_p").unwrap();
        assert!(*low == 0.0 && (high - 0.02917).abs() < 1e-4, "{low} {high}");
    }
}
