//! What was identified of a driver, beside the truth.

use haptic_analysis::identify::{Muscle, Parameter, Parameters};
use haptic_sim::participants::PublishedDriver;

/// What is compared with the truth: the parameters that a torque record can carry.
pub const COMPARED: usize = 5;

/// A parameter's key, what was found, and the truth.
pub type Compared = (&'static str, Parameter, f64);

/// Every parameter that is compared.
pub fn compared(truth: &PublishedDriver, found: &Parameters) -> [Compared; COMPARED] {
    let sum = truth.k_d + Muscle::default().k_nms;
    [
        ("gain_1", found.gain_1, sum * truth.a_1),
        ("gain_2", found.gain_2, sum * truth.a_2),
        ("gain_3", found.gain_3, sum * truth.a_3),
        ("t_p", found.t_p, truth.t_p),
        ("k_hg", found.k_hg, truth.k_hg.unwrap_or(0.0)),
    ]
}
