//! The linear form of the plant, and its exact step.
//!
//! Its matrix is not written down a second time: the derivatives of [`BarPlant`] are linear where nothing bends, so that they are
//! asked for one state after the other.

use nalgebra::SMatrix;

use super::plant::{BarPlant, Held, INPUTS, STATES};
use crate::models::STEP_S;

/// A torque so small that nothing is cut off.
const SMALL: f64 = 1e-3;

/// A and B of `x' = A x + B u` at a speed: what each state and each held input adds to each state's rate. The plant has to be one
/// without friction, and its assist a slope or none.
pub fn matrices(
    plant: &BarPlant,
    v_m_per_s: f64,
) -> (SMatrix<f64, STATES, STATES>, SMatrix<f64, STATES, INPUTS>) {
    let still = Held {
        v_m_per_s,
        ..Held::default()
    };
    let unit = |at: usize| std::array::from_fn(|j| if j == at { SMALL } else { 0.0 });
    let a = SMatrix::from_fn(|row, column| plant.rates(&unit(column), &still)[row] / SMALL);
    let inputs = [
        Held {
            hands_nm: SMALL,
            ..still
        },
        Held {
            guidance_nm: SMALL,
            ..still
        },
        Held {
            sensor_adds_nm: SMALL,
            ..still
        },
    ];
    let b = SMatrix::from_fn(|row, column| plant.rates(&[0.0; STATES], &inputs[column])[row] / SMALL);
    (a, b)
}

/// The exact step of 1 ms: what each state and each held input adds to each state.
pub(super) fn transition(plant: &BarPlant, v_m_per_s: f64) -> SMatrix<f64, STATES, { STATES + INPUTS }> {
    let (a, b) = matrices(plant, v_m_per_s);
    let mut all = SMatrix::<f64, { STATES + INPUTS }, { STATES + INPUTS }>::zeros();
    all.fixed_view_mut::<STATES, STATES>(0, 0).copy_from(&a);
    all.fixed_view_mut::<STATES, INPUTS>(0, STATES).copy_from(&b);
    (all * STEP_S).exp().fixed_rows::<STATES>(0).into_owned()
}
