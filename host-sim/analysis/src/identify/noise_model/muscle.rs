//! What a record refutes of the muscle and of the sensors' delays, which are taken as given.

use nalgebra::DMatrix;

use super::evidence::Alternative;
use super::{NAMES, Problem, T_NMS, T_NMS_RANGE_S, T_NMS_SD_S};
use crate::identify::result::Identification;
use crate::identify::result::Refutation;
use crate::identify::verdict;

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
        if self.t_nms_prior_s.is_some() {
            let [low, high] = T_NMS_RANGE_S;
            let (assumed, drawn, error) = (self.assumed_t_nms_s, p[T_NMS], errors[(T_NMS, T_NMS)].sqrt());
            found.notes.push(format!(
                "the record draws t_nms from the {assumed} s that are assumed to {drawn:.3} +- {error:.3} s: it was \
                 estimated, held near {assumed} s by {T_NMS_SD_S} s. --fix t_nms={assumed} keeps it."
            ));
            let beyond = (low - drawn).max(drawn - high);
            if beyond > 0.01 + verdict::CERTAIN * error {
                let refutation = Refutation {
                    assumption: "t_nms is that of an arm",
                    evidence: format!(
                        "it would have to be {drawn:.3} +- {error:.3} s; arms have {low} to {high} s"
                    ),
                    cause: "a torque sensor is filtered or late, or the driver is another one".to_owned(),
                    cure: "--estimate t_d_late or t_h_late; --fix t_nms=VALUE if it is known".to_owned(),
                };
                out.push(((beyond / error).powi(2), refutation));
            }
        }
        out
    }
}
