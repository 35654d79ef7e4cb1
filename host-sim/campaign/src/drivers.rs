//! Who drives in the campaign: the participants of tables 5 and 6 and the nine drivers of tables 7 and 8.

use haptic_sim::models::driver::{ArmGains, DriverParameters};
use haptic_sim::scenario::Condition;

/// a1, a2, a3, t_p, K_d, K_hg of a participant.
type Participant = [f64; 6];

/// Table 5, manual driving: without guidance there was no K_hg to identify; 0 relies on the guidance.
pub const TABLE_5: [Participant; 14] = [
    [0.068, 0.029, 3.699, 0.090, 3.774, 0.0],
    [0.060, 0.015, 3.442, 0.169, 3.506, 0.0],
    [0.066, 0.019, 3.656, 0.014, 3.861, 0.0],
    [0.097, 0.019, 3.759, 0.041, 3.809, 0.0],
    [0.082, 0.011, 3.374, 0.297, 3.646, 0.0],
    [0.081, 0.009, 3.502, 0.300, 3.674, 0.0],
    [0.053, 0.023, 3.530, 0.027, 3.759, 0.0],
    [0.075, 0.026, 3.729, 0.023, 3.947, 0.0],
    [0.080, 0.016, 3.744, 0.120, 3.649, 0.0],
    [0.085, 0.014, 3.428, 0.090, 3.732, 0.0],
    [0.049, 0.029, 3.561, 0.057, 3.856, 0.0],
    [0.078, 0.029, 3.298, 0.086, 3.794, 0.0],
    [0.074, 0.015, 3.523, 0.038, 3.719, 0.0],
    [0.066, 0.020, 3.627, 0.010, 3.981, 0.0],
];

/// Table 6, driving with haptic guidance.
pub const TABLE_6: [Participant; 14] = [
    [0.100, 0.029, 3.781, 0.034, 3.249, 0.526],
    [0.120, 0.027, 3.650, 0.300, 2.888, 0.393],
    [0.047, 0.025, 3.601, 0.300, 2.781, 0.421],
    [0.085, 0.025, 3.803, 0.184, 3.260, 0.509],
    [0.060, 0.023, 3.637, 0.229, 4.056, 0.926],
    [0.111, 0.048, 3.711, 0.010, 2.300, 0.002],
    [0.053, 0.014, 3.672, 0.300, 3.859, 0.783],
    [0.049, 0.025, 3.692, 0.017, 3.992, 0.971],
    [0.058, 0.014, 3.694, 0.300, 2.492, 0.137],
    [0.067, 0.023, 3.517, 0.124, 3.227, 0.392],
    [0.061, 0.029, 3.566, 0.300, 3.593, 0.615],
    [0.066, 0.033, 3.490, 0.010, 2.387, 0.008],
    [0.086, 0.003, 3.476, 0.046, 2.125, 0.035],
    [0.047, 0.011, 3.620, 0.018, 3.945, 0.858],
];

/// A driver, by where he comes from.
#[derive(Debug, Clone, PartialEq)]
pub struct Driver {
    /// Table and participant, or delay and condition.
    pub name: String,
    /// Vision and delay.
    pub parameters: DriverParameters,
    /// Arm.
    pub gains: ArmGains,
}

/// Everyone: 28 participants, then t_p 0.1, 0.3, 0.5 with high, mid, low reliance.
pub fn everyone() -> Vec<Driver> {
    let tables = [(5, TABLE_5), (6, TABLE_6)];
    let participants = tables.into_iter().flat_map(|(table, rows)| {
        (1..)
            .zip(rows)
            .map(move |(n, [a1, a2, a3, t_p, k_d, k_hg])| Driver {
                name: format!("table {table}, participant {n}"),
                parameters: DriverParameters {
                    a1,
                    a2,
                    a3,
                    t_p,
                    ..Default::default()
                },
                gains: ArmGains { k_d, k_hg },
            })
    });
    let drivers = [0.1, 0.3, 0.5].into_iter().flat_map(|t_p| {
        [Condition::High, Condition::Mid, Condition::Low].map(|condition| Driver {
            name: format!("t_p {t_p} s, {condition} reliance"),
            parameters: DriverParameters {
                t_p,
                ..Default::default()
            },
            gains: condition.gains(),
        })
    });
    participants.chain(drivers).collect()
}
