//! What a record refutes of the muscle and of the sensors' delays, which are taken as given.

use nalgebra::DMatrix;

use super::evidence::Alternative;
use super::{Assumed, K_NMS, NAMES, Problem, T_NMS, T_NMS_RANGE_S, WHEEL};
use crate::identify::result::{Identification, Refutation};
use crate::identify::verdict;

/// By so much t_nms may be outside of the range of arms all the same, s: the range is of rounded figures.
const ROUNDING_S: f64 = 0.002;
/// A standard error of t_nms, s, up to which the record tells it whatever is assumed, and how many of larger ones count.
const TOLD_S: f64 = 0.01;
const SURELY: f64 = 3.0;
/// What an arm that is none counts at least, in twice the log likelihood.
const REFUTES: f64 = 25.0;

impl Problem<'_> {
    /// What the record refutes of the muscle and of the sensors' delays, each with what it adds to twice the log likelihood.
    pub(super) fn of_muscle(
        &self,
        found: &mut Identification,
        p: &[f64],
        alternatives: &[Alternative],
        errors: &DMatrix<f64>,
    ) -> Vec<(f64, Refutation)> {
        let likeliest = alternatives
            .iter()
            .filter(|a| (K_NMS..WHEEL).contains(&a.place))
            .filter(|a| a.z.abs() > verdict::CERTAIN && self.matters(a, p, errors))
            .max_by(|a, b| a.z.abs().total_cmp(&b.z.abs()));
        let mut out = Vec::new();
        if let Some(a) = likeliest {
            let name = NAMES[a.place].unwrap_or_default();
            let (assumed, drawn) = (p[a.place], p[a.place] + a.step);
            let refutation = Refutation {
                assumption: "muscle and sensors are as given (k_nms, t_nms, t_h_late, t_d_late)",
                evidence: format!(
                    "freed, {name} would move from {assumed:.3} by {:.1} standard errors",
                    a.z
                ),
                cause: format!("{name} is near {drawn:.3}, not {assumed:.3}"),
                cure: format!("--estimate {name}, or --fix {name}=VALUE if it is known"),
            };
            out.push((a.z * a.z, refutation));
        }
        for a in self.held() {
            let (name, unit) = if a.place == T_NMS {
                ("t_nms", "s")
            } else {
                ("k_nms", "N.m/rad")
            };
            let (drawn, error) = (p[a.place], errors[(a.place, a.place)].sqrt());
            let Assumed { value, sd, .. } = *a;
            found.notes.push(format!(
                "the record draws {name} from the {value} {unit} that are assumed to {drawn:.3} +- {error:.3} {unit}: it was \
                 estimated, held near {value} {unit} by {sd} {unit}. --fix {name}={value} keeps it."
            ));
            let [low, high] = T_NMS_RANGE_S;
            let beyond = (low - drawn).max(drawn - high);
            // One that the record does not tell well is held by what is assumed, and must be surely beyond.
            let sure = if error < TOLD_S { error } else { SURELY * error };
            if a.place == T_NMS && beyond > ROUNDING_S.max(sure) {
                let (cause, cure) = if drawn < low && self.wheel.is_some() {
                    (
                        "the wheel above the bar has friction or another inertia, or the angle is that of the column below the bar",
                        "--fix bar_stiffness=K where it is the column's; friction of the wheel has no cure",
                    )
                } else if drawn < low {
                    (
                        "the steering wheel turns between the hands and the sensor (a torsion bar below the wheel), or a \
                         torque is late",
                        "--wheel-inertia J with the wheel's inertia, kg.m2 (0.03 to 0.05 is usual); --fix t_nms=VALUE if it \
                         is known",
                    )
                } else {
                    (
                        "a torque sensor is filtered or late, or the driver is another one",
                        "--estimate t_d_late or t_h_late; --fix t_nms=VALUE if it is known",
                    )
                };
                let refutation = Refutation {
                    assumption: "t_nms is that of an arm",
                    evidence: format!(
                        "it would have to be {drawn:.3} +- {error:.3} s; arms have {low} to {high} s"
                    ),
                    cause: cause.to_owned(),
                    cure: cure.to_owned(),
                };
                out.push(((beyond / error).powi(2).max(REFUTES), refutation));
            }
        }
        out
    }
}
