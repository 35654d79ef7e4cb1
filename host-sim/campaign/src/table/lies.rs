//! Lies that fit together: several values are false alike, so that what contradicts them is less, or nothing.

use super::FaultCase;
use crate::injection::{Change, Hand, Injection, Signal};

use Change::{Mirrored, Times};
use Injection::{BendsAway, Sensor};
use Signal::{LateralError, YawError, YawRate};

/// Moves the vehicle aside within a second.
const JERK: Injection = Injection::Hand(Hand::Jerk {
    peak_nm: 2.5,
    ms: 600,
    before_ms: 300,
});

pub(super) const ROWS: &[FaultCase] = rows! {
    "lane-flipped" "e_y' and e_theta' with the wrong sign"
        [JERK, Sensor(LateralError, Times(-1.0)), Sensor(YawError, Times(-1.0))] .may_hand_over().torque(5.0);
    "lane-mirrored" "e_y' and e_theta' mirrored: their rates have the wrong sign"
        [JERK, Sensor(LateralError, Mirrored), Sensor(YawError, Mirrored)] .may_hand_over().torque(5.0);
    "lane-and-yaw-rate-flipped" "e_y', e_theta' and the yaw rate with the wrong sign"
        [
            JERK,
            Sensor(LateralError, Times(-1.0)),
            Sensor(YawError, Times(-1.0)),
            Sensor(YawRate, Times(-1.0)),
        ] .may_hand_over_at_once().torque(5.0).takes_along(1.2, 4.5);
    "lane-bends-away" "the lane bends away by 3.5 m in 4 s, e_theta' as e_y'"
        [BendsAway { by_m: 3.5, ms: 4000 }] .may_hand_over().torque(5.0).takes_along(1.2, 3.6);
};
