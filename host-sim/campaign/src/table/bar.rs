//! Faults of a column with a torsion bar, for the world `bar`: what fails in it, and what its ECU is told wrong.
//!
//! Offset, drift and a runaway assist are to the left; the seed curves the road to the left or to the right.

use haptic_sim::models::torsion_bar::ColumnFault;

use super::FaultCase;
use crate::injection::{Hand, Injection};

use ColumnFault::{
    AssistLost, AssistRunaway, BrokenBar, SensorDoubled, SensorDrift, SensorOffset, SensorStuck,
};
use Injection::Column;

/// What the ECU is told wrong acts while a hand has to be told from the wheel.
const OPPOSED: Injection = Injection::Hand(Hand::Opposes {
    torque_nm: 3.0,
    ms: 300,
});

pub(super) const ROWS: &[FaultCase] = rows! {
    "bar-sensor-offset" "the bar's sensor reads 1 N.m more to the left, for assist and ECU"
        [Column(SensorOffset)] .only_rules().torque(5.0);
    "bar-sensor-drift" "the bar's sensor reads 0.05 N.m/s more to the left"
        [Column(SensorDrift)] .only_rules().torque(5.0);
    "bar-sensor-stuck" "the bar's sensor reads what it read last"
        [Column(SensorStuck)] .only_rules().torque(5.0);
    "bar-sensor-doubled" "the bar's sensor reads twice the torque"
        [Column(SensorDoubled)] .only_rules().torque(5.0);
    "bar-broken" "a tenth of K_tb is left, read as the twist of the whole bar"
        [Column(BrokenBar)] .only_rules().torque(5.0);
    "assist-lost" "the motor assists no longer; it still guides"
        [Column(AssistLost)] .only_rules().torque(5.0);
    "assist-runs-away" "the assist turns left with all that its motor may, 60 N.m"
        [Column(AssistRunaway)] .only_rules().torque(5.0);
    "bar-told-right" "the ECU is told right, beside the rows below; driver opposes with 3 N.m for 0.3 s"
        [OPPOSED] .only_rules().torque(5.0).told(|_| ());
    "bar-taken-for-hands" "the ECU is told of hands where a bar is; driver opposes with 3 N.m for 0.3 s"
        [OPPOSED] .only_rules().torque(5.0).told(|p| p.torque_sensor = 0.0);
    "wheel-inertia-x0.5" "the ECU is told half of J_w; driver opposes with 3 N.m for 0.3 s"
        [OPPOSED] .only_rules().torque(5.0).told(|p| p.wheel_inertia_kg_m2 *= 0.5);
    "wheel-inertia-x2" "the ECU is told twice J_w; driver opposes with 3 N.m for 0.3 s"
        [OPPOSED] .only_rules().torque(5.0).told(|p| p.wheel_inertia_kg_m2 *= 2.0);
    "bar-stiffness-x0.5" "the ECU is told half of K_tb; driver opposes with 3 N.m for 0.3 s"
        [OPPOSED] .only_rules().torque(5.0).told(|p| p.bar_stiffness_nm_per_rad *= 0.5);
    "bar-stiffness-x2" "the ECU is told twice K_tb; driver opposes with 3 N.m for 0.3 s"
        [OPPOSED] .only_rules().torque(5.0).told(|p| p.bar_stiffness_nm_per_rad *= 2.0);
};
