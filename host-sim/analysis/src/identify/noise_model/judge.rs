//! The evidence of [`super::evidence`] and of the sensors held against the model: wider standard errors where they are
//! due, and a verdict taken back where an assumption is refuted.
//!
//! What counts as refuted is said in [`crate::identify::verdict`].

use nalgebra::{DMatrix, DVector};

use super::evidence::{Alternative, LEAST_PROBE_NM, Told};
use super::sums::Rows;
use super::uncertainty::{Doubts, TRIMMED_AT_MOST};
use super::{
    Assumed, COMPARED, D_LATE, DAMPING, H_LATE, K_HG, K_NMS, NAMES, OWN_BEND, OWN_OFFSET, Problem,
    SMALLEST_ERROR_NM, START, T_NMS, T_NMS_RANGE_S, T_P, VARIATION_WIDTHS, WHEEL, WHEEL_SHARE,
};
use crate::identify::balance::Balance;
use crate::identify::change::{BLIP_S, Change, Power, SWING_S, Shape};
use crate::identify::diagnostics;
use crate::identify::motion::of_motion;
use crate::identify::options::{Inertia, Options};
use crate::identify::result::{
    AtTNms, Identification, Parameter, Parameters, Refutation, STANDARD_NORMAL_95,
};
use crate::identify::search::{Bounds, Optimum, covariance, minimise};
use crate::identify::verdict;

/// Largest factor by which the scatter of the scores may widen a standard error: more is no noise.
const WIDEST: f64 = 3.0;
/// 95 % point of a chi-square with one degree of freedom.
const PROFILE_95: f64 = 3.841;
/// Share of what counts as right (10 %, 15 ms, 0.05) that another assumption has to move a parameter by to matter.
const MATTERS: f64 = 0.3;
/// Standard errors by which the record has to draw K_nms or t_nms from what is assumed before it is freed.
const DRAWN: f64 = 3.0;
/// Standard errors from 0 below which a gain_2 may be hidden by a line.
const HIDDEN: f64 = 2.0;
/// Twice the log likelihood ratio that the driver model has to gain over no driver at all, and how many times as much a usual driver
/// would gain in a record that tells whether there is one.
const LEAST_GAIN: f64 = 60.0;
const TELLING: f64 = 2.0;
/// A record with a larger standard error of K_hg, a quarter of its range, does not tell it: guidance without a probe is made of what the
/// driver sees, and straight lines between uneven rows are then taken for an answer to it.
const UNTOLD_K_HG: f64 = 0.25;
/// Guidance beyond this, N.m, is no offset of a sensor.
const GUIDED_NM: f64 = 0.03;
/// Rows that are further apart do not tell the driver's muscle, whose lag is 0.1 s: at 10 Hz K_hg's optimum is off by three times as
/// much as at 20 Hz (`cargo xtask validate --recordings`).
const SLOWEST_S: f64 = 0.055;

/// What a driver model that gains little says.
enum Beside {
    /// Nobody steers.
    Nothing(Refutation),
    /// A usual driver would gain as little.
    TooShort,
}

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
        doubts: &Doubts<'_>,
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
        let staying = change.as_ref().filter(|c| c.shape != Shape::Swing);
        let sensor = staying.and_then(|c| self.changed_sensor(c, options.manual));
        if sensor.is_none() {
            let balance = found.balance.iter();
            refuted.extend(balance.flat_map(|b| verdict::of_balance(b, options.assisted)));
        }
        let signs_are_told = refuted.iter().any(|r| r.assumption == verdict::SIGNS);
        // A swapped sign of the lane makes a driver who steers away from it.
        let may_be_swapped = !signs_are_told && doubts.active.bounds.iter().any(|&(i, _)| i < K_HG);
        refuted.extend(of_motion(self.log, &self.stretches, may_be_swapped));
        // Where a sensor is wrong, all that follows from it looks like another driver too.
        let change = change.filter(|_| refuted.is_empty());
        let mut others = self.other_evidence(found, optimum, doubts);
        let nothing = self.beside_nothing(optimum);
        if let Some(Beside::Nothing(refutation)) = &nothing {
            others.push((f64::INFINITY, refutation.clone()));
        }
        // What the change explains better is no cause of its own, and a change is none where something else explains more: a fit
        // with the cure of the first is judged again.
        let change = change.filter(|c| sensor.is_some() || others.iter().all(|o| o.0 <= c.deviance));
        if let Some(change) = &change {
            others.clear();
            refuted.push(
                sensor.unwrap_or_else(|| verdict::of_change(change, self.span_s(), self.moved_aside(change))),
            );
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
        if matches!(nothing, Some(Beside::TooShort)) {
            found.parameters.disown();
            found.notes.push(
                "The record is too short, or the disturbance too large, to tell whether anybody steers: nothing is called identified."
                    .to_owned(),
            );
        }
        // The search goes on to 2, so that an inertia that is sought meets no bound there.
        let k_hg = &mut found.parameters.k_hg;
        if self.is_inertia_sought && k_hg.estimate.is_some_and(|value| value > 1.0) {
            (k_hg.identified, k_hg.estimate) = (false, None);
        }
        let why = why_not_found(found, doubts.told);
        found.notes.extend(why);
        found.notes.extend(hidden_gain_2(&mut found.parameters.gain_2));
        found.assumed.extend(self.assumed_of_muscle(p));
        found.assumed.push(match options.wheel_inertia {
            Some(inertia) => of_wheel(inertia, options, found),
            None => "driver_torque_nm is the torque of the hands: no wheel turns between them and the sensor"
                .to_owned(),
        });
        if options.assisted || options.wheel_inertia.is_some() {
            found.assumed.push(
                "k_hg is the driver's answer to guidance_torque_nm: beside a power assist it is smaller than the answer to what comes up to \
                 the hands, by the factor 1 + slope of the assist"
                    .to_owned(),
            );
        }
        if options.assisted {
            found.assumed.push(
                "driver_torque_nm is recorded at no less than its value: beside a power assist the torques on the column do not tell"
                    .to_owned(),
            );
        }
        found.assumed.extend(power_of(found));
        found.notes.extend(found.balance.as_ref().and_then(friction));
    }

    /// What is held against the model beside sensors and changes, each with what it adds to twice the log likelihood.
    fn other_evidence(
        &self,
        found: &mut Identification,
        optimum: &Optimum,
        doubts: &Doubts<'_>,
    ) -> Vec<(f64, Refutation)> {
        let mut others = verdict::of_residuals(
            found.fit_percent,
            &found.whiteness,
            &found.input_correlation,
            [
                diagnostics::unexplained_autocorrelation(&found.traces.residual_nm, &self.log.resampling),
                self.bridged_share(found),
            ],
        );
        others.extend(self.of_bounds(doubts));
        others.extend(verdict::of_gain_3(&found.parameters.gain_3));
        others.extend(self.of_muscle(found, &optimum.point, doubts.alternatives, doubts.errors));
        others
    }

    /// Share of the rows whose torque was missing or wrong, and is made of the neighbours'.
    fn bridged_share(&self, found: &Identification) -> f64 {
        let columns = found.preflight.iter().flat_map(|p| &p.columns);
        let torque = columns.filter(|(name, _)| *name == "driver_torque_nm");
        let bridged: usize = torque.map(|(_, f)| f.missing + f.spikes).sum();
        let rows = found.preflight.as_ref().map_or(0, |p| p.recorded_rows);
        bridged as f64 / rows.max(1) as f64
    }

    /// By how much the vehicle is farther to the left after a change than before it, m.
    fn moved_aside(&self, change: &Change) -> f64 {
        let mean = |is_of: &dyn Fn(f64) -> bool| {
            let of_side = self
                .stretches
                .iter()
                .cloned()
                .flatten()
                .filter(|&k| is_of(self.log.time_s(k)));
            let (sum, count) = of_side.fold((0.0, 0.0), |(sum, n), k| (sum + self.log.e_y_m[k], n + 1.0));
            sum / f64::max(count, 1.0)
        };
        mean(&|t| t < change.at_s[0]) - mean(&|t| t > change.at_s[1])
    }

    /// Bounds of the driver's parameters that the data contradict, and what that may come from.
    fn of_bounds(&self, doubts: &Doubts<'_>) -> Vec<(f64, Refutation)> {
        let refutation = |&(i, unbounded): &(usize, f64)| {
            let error = doubts.errors[(i, i)].sqrt();
            let beyond = doubts.active.pull[i] / error;
            // These errors hold the arm, a line and the lane's noise too.
            if beyond.abs() < TRIMMED_AT_MOST || i == K_HG && error > UNTOLD_K_HG {
                return None;
            }
            let Bounds { low, high } = self.bounds[i];
            let name = NAMES[i]?;
            let (assumption, cause, cure) = match i {
                K_HG if unbounded > high => (
                    "k_hg lies between 0 (gives way) and 1 (resists)",
                    "the driver resists with more than the guidance's own torque, or guidance_torque_nm is recorded too small",
                    "check the scale of guidance_torque_nm; if it is right, this driver is beyond equation (8)",
                ),
                K_HG => (
                    "k_hg lies between 0 (gives way) and 1 (resists)",
                    "the driver turns with the guidance, or the sign of guidance_torque_nm or its delay is another one",
                    "check guidance_torque_nm against the torque on the column",
                ),
                OWN_OFFSET | OWN_BEND => (
                    "the driver keeps a line within 1.5 m beside the target line",
                    "the driver moved from line to line, or e_y_m is not the distance that the driver sees",
                    "one part of the drive: --from and --to; check e_y_m",
                ),
                _ => return None,
            };
            let refutation = Refutation {
                assumption,
                evidence: format!(
                    "without its bounds ({low:.2} to {high:.2}) {name} would be {unbounded:.2}, {:.1} standard errors beyond",
                    beyond.abs()
                ),
                cause: cause.to_owned(),
                cure: cure.to_owned(),
            };
            Some((beyond * beyond, refutation))
        };
        doubts.active.bounds.iter().filter_map(refutation).collect()
    }

    /// What was taken as known of the muscle.
    fn assumed_of_muscle(&self, p: &[f64]) -> Vec<String> {
        let [low, high] = T_NMS_RANGE_S;
        let about = |place: usize| self.assumed.iter().find(|a| a.place == place);
        let mut out = Vec::new();
        let of_arms = format!(" (arms have {low} to {high} s)");
        let muscle = [(T_NMS, "t_nms", "s", &*of_arms), (K_NMS, "K_nms", "N.m/rad", "")];
        for (place, name, unit, usual) in muscle.into_iter().filter(|m| !self.is_free(m.0)) {
            out.push(match about(place) {
                Some(Assumed { value, sd, .. }) => {
                    format!("{name} is {value} {unit}, give or take {sd} {unit}{usual}: the errors hold that")
                }
                None => format!("{name} is {} {unit}", p[place]),
            });
        }
        if let Some(a) = about(OWN_OFFSET) {
            let sd = a.sd;
            out.push(format!(
                "the driver's line is the target line, give or take {sd} m on a straight road and {sd} m in a bend of 300 m at 60 km/h: \
                 the errors hold that"
            ));
        }
        if let Some(a) = about(H_LATE) {
            let ms = 1e3 * a.sd;
            out.push(format!(
                "the probe switches anywhere between two rows, {ms:.1} ms about their middle: the errors hold that"
            ));
        }
        out
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

    /// What of the muscle the record alone would have as another one than was assumed, if that matters: the surer of K_nms and
    /// t_nms.
    pub(super) fn drawn(&self, optimum: &Optimum) -> Option<usize> {
        let p = &optimum.point;
        let free: Vec<usize> = (0..self.size())
            .filter(|&i| {
                // What holds K_hg at 1 may be another arm than the one assumed.
                self.is_free(i) && (i >= super::COUNT || i == K_HG || !self.bounds[i].touches(p[i]))
            })
            .collect();
        let variance = self.error_variance(optimum);
        let errors = covariance(&optimum.quadratic.hessian, &free) * variance;
        let all = self.alternatives(p, &free, variance * self.log.slow_noise());
        all.into_iter()
            // Beside a wheel's inertia neither is told.
            .filter(|a| !self.is_inertia_sought && [K_NMS, T_NMS].contains(&a.place))
            .filter(|a| self.assumed.iter().any(|known| known.place == a.place))
            .filter(|a| a.z.abs() > DRAWN && self.matters(a, p, &errors))
            .max_by(|a, b| a.z.abs().total_cmp(&b.z.abs()))
            .map(|a| a.place)
    }

    /// Widens the standard errors by what is not known of the muscle, and says where the record draws the parameters by it:
    /// K_nms and t_nms are those of drivers' arms, about what is assumed, and what the record says of each; to first order.
    /// What the record says of t_nms has the covariance `drawn_with` with the estimates.
    pub(super) fn widen_by_assumed(
        &self,
        errors: &mut DMatrix<f64>,
        alternatives: &[Alternative],
        drawn_with: Option<&DVector<f64>>,
    ) -> DVector<f64> {
        let mut drawn = DVector::zeros(errors.nrows());
        for known in &self.assumed {
            let Some(a) = alternatives.iter().find(|a| a.place == known.place) else {
                continue;
            };
            // Of a wheel the record says nothing: the steps of its angle make accelerations of their own.
            let seen = if [WHEEL, DAMPING].contains(&known.place) {
                f64::INFINITY
            } else {
                a.error.powi(2)
            };
            let before = known.sd.powi(2);
            let share = before / (before + seen);
            let variance = before * (1.0 - share);
            let step = a.step * share;
            let drawn_with = drawn_with.filter(|_| known.place == T_NMS);
            let with = |i: usize| drawn_with.map_or(0.0, |c| share * c[i]);
            if known.place == K_NMS {
                // K_d is what a gain leaves of K_nms, so their errors go together.
                drawn[K_NMS] += step;
                errors[(K_NMS, K_NMS)] += variance;
                for i in (0..super::DRIVER).filter(|&i| self.is_free(i)) {
                    errors[(i, K_NMS)] += variance * a.slopes[i];
                    errors[(K_NMS, i)] += variance * a.slopes[i];
                }
            }
            for i in (0..super::DRIVER).filter(|&i| self.is_free(i)) {
                drawn[i] += a.slopes[i] * step;
                for j in (0..super::DRIVER).filter(|&j| self.is_free(j)) {
                    errors[(i, j)] +=
                        variance * a.slopes[i] * a.slopes[j] + with(i) * a.slopes[j] + with(j) * a.slopes[i];
                }
            }
        }
        drawn
    }

    /// The 95 % intervals if K_nms and t_nms are what is assumed, from the standard errors that hold then; at a bound by the
    /// likelihood ratio, as the wider ones.
    pub(super) fn as_assumed(&self, p: &[f64], errors: &DMatrix<f64>, pull: &DVector<f64>) -> AtTNms {
        let errors = |i: usize| {
            let (bounds, width) = (self.bounds[i], VARIATION_WIDTHS[i]);
            let found = Parameter::estimated(p[i], pull[i], errors[(i, i)], 0.0, bounds, width);
            Some((NAMES[i]?, found.interval_95?, found.errors?))
        };
        let free = (0..=T_P).filter(|&i| self.is_free(i));
        let found: Vec<_> = free.filter_map(errors).collect();
        AtTNms {
            t_nms_s: p[T_NMS],
            intervals_95: found
                .iter()
                .map(|&(name, interval, _)| (name, interval))
                .collect(),
            errors: found.iter().map(|&(name, _, errors)| (name, errors)).collect(),
        }
    }

    /// A driver model that predicts the torque no better than a disturbance without any driver would.
    fn beside_nothing(&self, optimum: &Optimum) -> Option<Beside> {
        if (0..=T_P).all(|i| !self.is_free(i)) {
            return None;
        }
        let mut point = optimum.point.clone();
        point[..=K_HG].fill(0.0);
        point[K_NMS] = 0.0;
        let mut bounds = self.bounds.clone();
        for i in (0..=T_P).chain([OWN_OFFSET, OWN_BEND, K_NMS, T_NMS, H_LATE, D_LATE]) {
            bounds[i] = Bounds::new(point[i], point[i]);
        }
        let nothing = minimise(&point, &bounds, COMPARED, |p| self.core_sums(p));
        let variance = 2.0 * optimum.quadratic.loss / self.row_count().max(1) as f64;
        let gain =
            2.0 * (nothing.quadratic.loss - optimum.quadratic.loss) / variance.max(SMALLEST_ERROR_NM.powi(2));
        let free: Vec<usize> = (0..self.size()).filter(|&i| self.is_free(i)).collect();
        let error = covariance(&optimum.quadratic.hessian, &free)[(2, 2)] * variance;
        if gain < LEAST_GAIN && self.is_free(2) && START[2].powi(2) < TELLING * LEAST_GAIN * error {
            return Some(Beside::TooShort);
        }
        let refutation = || Refutation {
            assumption: "driver_torque_nm is a driver's answer to the inputs",
            evidence: format!(
                "the driver model predicts it no better than a disturbance alone (log likelihood ratio {:.1})",
                0.5 * gain
            ),
            cause: "driver_torque_nm is noise, of another drive, or of nobody's hands".to_owned(),
            cure: "check the sensor and the column of the log".to_owned(),
        };
        (gain < LEAST_GAIN).then(|| Beside::Nothing(refutation()))
    }
}

/// A line of the driver's own hides gain_2, or takes its place: one that is told from 0 by less than this many standard errors is not
/// called identified.
fn hidden_gain_2(gain_2: &mut Parameter) -> Option<String> {
    let (gain, error) = gain_2.estimate.zip(gain_2.standard_error)?;
    (!gain_2.fixed && gain_2.identified && gain < HIDDEN * error).then(|| {
        gain_2.estimate = None;
        gain_2.identified = false;
        "gain_2 is not told from 0, as where a driver keeps another line than the target line: a longer drive, or --fix line_offset \
         tells more"
            .to_owned()
    })
}

/// What the tests of the driver's constancy and of the sensors see, and what they do not.
fn power_of(found: &Identification) -> Vec<String> {
    let mut out = Vec::new();
    if let Some(constancy) = &found.constancy {
        let of = |pick: fn(&Power) -> Option<f64>| -> String {
            let seen = constancy.power.iter().filter_map(|p| {
                let (name, most, scale, digits, unit) = match p.parameter {
                    "k_d" => ("gains", 1.0, 100.0, 0, " %"),
                    "gain_1" => ("gain_1 alone", 2.0, 1.0, 2, " N.m/m"),
                    "k_hg" => ("k_hg", 1.0, 1.0, 2, ""),
                    "t_p" => ("t_p", 0.6, 1.0, 2, " s"),
                    _ => return None,
                };
                let least = pick(p).filter(|x| *x < most);
                let shown = |x: f64| format!("{name} by {:.digits$}{unit}", scale * x);
                Some(least.map_or(format!("no {name}"), shown))
            });
            seen.collect::<Vec<_>>().join(", ")
        };
        let seen = |key: &str, most: f64| {
            let mut of_key = constancy.power.iter().filter(|p| p.parameter == key);
            of_key.any(|p| p.step.is_some_and(|x| x <= most))
        };
        let blind = !(seen("k_hg", 0.5) || seen("k_d", 0.5) || seen("t_p", 0.3));
        out.push(format!(
            "the driver is the same throughout{}: of nine changes in ten, one that stays is seen from here on ({}), one of {BLIP_S} \
             s ({}), and one to and fro each {SWING_S} s ({})",
            if blind { ", which this drive is too short to tell" } else { "" },
            of(|p| p.step),
            of(|p| p.blip),
            of(|p| p.swing),
        ));
    }
    let too_little = match &found.balance {
        None => Some("too short, or at more than one speed"),
        Some(b) if b.explained < verdict::BALANCE_SEEN => {
            Some("the column does not answer as one with a wheel alone, or hardly slides")
        }
        Some(b) if b.is_sparse => Some("beyond their signs: rows are uneven and far apart"),
        Some(b) if !b.is_close() => Some("beyond their signs: gusts or the road turn the wheel too"),
        Some(_) => None,
    };
    if found.balance.as_ref().is_some_and(|b| b.friction_nm.is_some()) {
        out.push(
            "torques and wheel angle were sampled at the same instants, and the scale of driver_torque_nm is right to 30 %: beside \
             friction the torques on the column tell no more"
                .to_owned(),
        );
    }
    out.extend(too_little.map(|why| {
        format!("torques and wheel angle have their signs, scales and instants: the torques on the column could not be weighed ({why})")
    }));
    out
}

/// What is to be said of the column's friction.
fn friction(balance: &Balance) -> Option<String> {
    let [friction, error] = balance.friction_nm?;
    Some(format!(
        "The column has {friction:.3} +- {error:.3} N.m of dry friction: its torques were weighed over the {:.0} s in which the \
         wheel slides.",
        balance.seconds
    ))
}

/// Why an inertia that is sought is not identified. One without an interval leaves neither a driver nor a line.
fn why_not_found(found: &mut Identification, told: Option<&Told>) -> Option<String> {
    let is_refuted = !found.refuted.is_empty();
    let sought = found.beyond.iter_mut().find(|b| b.0 == "wheel_inertia");
    let wheel = sought
        .map(|b| &mut b.1)
        .filter(|wheel| !wheel.identified || is_refuted)?;
    let hidden = wheel.interval_95.is_some();
    if is_refuted {
        *wheel = Parameter::not_identified(wheel.optimum?, Bounds::FREE);
    } else if !hidden {
        found.parameters.take_back();
        (found.line, found.at_t_nms) = (None, None);
    }
    let probe_nm = told.map_or(0.0, |told| told.probe_nm);
    let why = match found.balance.as_ref().and_then(|b| b.friction_nm) {
        _ if probe_nm < LEAST_PROBE_NM => format!(
            "no probe, or one that is too weak: guidance_torque_nm has {probe_nm:.3} N.m beside what the driver's own inputs make, \
             {LEAST_PROBE_NM} N.m are wanted"
        ),
        Some([friction, _]) => {
            format!("the column's friction of {friction:.2} N.m holds the wheel against the probe")
        }
        None if is_refuted => return None,
        None if hidden => "what is not known of the arm hides it (--fix t_nms)".to_owned(),
        None if wheel.on_bound => {
            "it rests on a bound of 0.005 to 0.1 kg.m2: driver_torque_nm may be the hands' own, or the wheel is another".to_owned()
        }
        None => "the drive is too short, or its signals are too coarse".to_owned(),
    };
    Some(format!(
        "wheel_inertia is not identified: {why}. --wheel-inertia J tells it."
    ))
}

/// What the torque of the hands was made of.
fn of_wheel(inertia: f64, options: &Options, found: &Identification) -> String {
    const FALSE: &str =
        "with an inertia that is much too small k_hg is false, and nothing in the log shows it";
    let (leeway, beside) = match options.wheel_inertia_is {
        Inertia::About => (format!(" (give or take {} %)", 100.0 * WHEEL_SHARE), FALSE),
        Inertia::Exact => (String::new(), FALSE),
        Inertia::Sought => {
            let wheel = found.beyond.iter().find(|b| b.0 == "wheel_inertia");
            if wheel.is_some_and(|(_, wheel)| wheel.interval_95.is_some()) {
                (
                    " (estimated)".to_owned(),
                    "what the inertia may err by is in the errors of the others",
                )
            } else {
                (
                    " (where the search ended)".to_owned(),
                    "the inertia is not identified, and nothing else is",
                )
            }
        }
    };
    let damping = options.wheel_damping();
    let about = match options.wheel_damping {
        Some(_) => String::new(),
        None => format!(" (give or take {damping})"),
    };
    format!(
        "driver_torque_nm is that of a torsion bar below a wheel without friction, of {} kg.m2{leeway} and {damping} N.m.s/rad{about}; {}. The torque of the \
         hands was made of these; {beside}",
        (1e4 * inertia).round() / 1e4,
        match options.bar_stiffness {
            Some(stiffness) =>
                format!("wheel_angle_rad is that of the column below a bar of {stiffness} N.m/rad"),
            None => "wheel_angle_rad is that of the wheel".to_owned(),
        }
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::prepare::prepare;
    use haptic_recording::DriveLog;

    /// A gain_2 of 0.001 +- 0.002 is not called identified, whether a line is estimated beside it or not; one of 0.005, a given one and one
    /// that was not identified stay as they are.
    #[test]
    fn a_gain_2_that_is_not_told_from_0_is_hidden() {
        let found = |gain: f64, fixed, identified| Parameter {
            estimate: Some(gain),
            standard_error: Some(0.002),
            identified,
            fixed,
            ..Parameter::ABSENT
        };
        for (mut gain_2, hidden) in [
            (found(0.001, false, true), true),
            (found(0.005, false, true), false),
            (found(0.001, true, true), false),
            (found(0.001, false, false), false),
        ] {
            let was = gain_2;
            assert_eq!(hidden_gain_2(&mut gain_2).is_some(), hidden);
            assert_eq!(
                gain_2.identified && gain_2.estimate.is_some(),
                !hidden && was.identified
            );
        }
    }

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
        let at = problem.as_assumed(&vec![0.0; problem.size()], &errors, &pull);
        let (_, [low, high]) = at.intervals_95.iter().find(|i| i.0 == "t_p").unwrap();
        assert!(*low == 0.0 && (high - 0.02917).abs() < 1e-4, "{low} {high}");
    }
}
