//! The controller's parameters in the words of a scenario file.
//!
//! The controller refuses a parameter by its own name. Whoever wrote the file has to read the file's field, and,
//! where the controller's parameter follows from several fields, the formula and the table that they are in.

use haptic_core::params::ParamError;

use crate::input::RangeError;

/// Name in the controller, name in the file, unit.
const NAMES: [(&str, &str, &str); 22] = [
    ("k_1", "guidance.K_1", "N.m"),
    ("a_1", "guidance.a_1", "1/m"),
    ("a_2", "guidance.a_2", "s/m"),
    ("a_3", "guidance.a_3", "1/rad"),
    ("a_4", "guidance.a_4", "s/rad"),
    ("rate_corner_hz", "guidance.rate_corner_hz", "Hz"),
    ("torque_limit_nm", "guidance.torque_limit_nm", "N.m"),
    ("wind_up_nm_per_s", "guidance.wind_up_nm_per_s", "N.m/s"),
    ("reduction_nm_per_s", "guidance.reduction_nm_per_s", "N.m/s"),
    ("least_speed_m_per_s", "guidance.least_speed_m_per_s", "m/s"),
    ("probe_amplitude_nm", "guidance.probe_amplitude_nm", "N.m"),
    ("probe_frequency_hz", "guidance.probe_frequency_hz", "Hz"),
    (
        "2 * pi * probe_amplitude_nm * probe_frequency_hz",
        "guidance: the probe's slope 2*pi*probe_amplitude_nm*probe_frequency_hz",
        "N.m/s",
    ),
    ("k_1 * a_1", "guidance: K_1*a_1", "N.m/m"),
    ("k_1 * a_2", "guidance: K_1*a_2", "N.m.s/m"),
    ("k_1 * a_3", "guidance: K_1*a_3", "N.m/rad"),
    ("k_1 * a_4", "guidance: K_1*a_4", "N.m.s/rad"),
    ("vehicle.curvature_gain_per_m", "vehicle: K_t/(l_f + l_r)", "1/m"),
    (
        "vehicle.stability_factor_s2_per_m2",
        "vehicle: the stability factor m*(l_r*K_r - l_f*K_f)/(2*(l_f + l_r)^2*K_f*K_r)",
        "s2/m2",
    ),
    (
        "vehicle.aligning_gain_nm_s2_per_m",
        "vehicle: the aligning torque per lateral acceleration m*l_r*E_t*K_t/(l_f + l_r)/(1 + 2*E_t*K_f/K_s)",
        "N.m.s2/m",
    ),
    ("vehicle.column_damping_nm_s", "vehicle.B_s", "N.m.s/rad"),
    ("vehicle.far_time_s", "guidance.t_f", "s"),
];

/// A refusal by the controller's parameters: the file's field or formula, its value and its range.
pub(super) fn in_words_of_the_file(error: &ParamError) -> RangeError {
    let known = NAMES.iter().find(|(name, ..)| *name == error.name);
    let (field, unit) = known.map_or((error.name, ""), |&(_, field, unit)| (field, unit));
    RangeError {
        field: field.into(),
        value: error.value,
        min: error.min,
        max: error.max,
        unit,
    }
}
