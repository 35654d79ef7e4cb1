//! Faults whose harm is where the vehicle goes, and cars that are honest but not ideal: those are no faults, and guidance
//! has to go on.

use haptic_sim::models::nonlinear::Tyres;

use super::{FaultCase, PlaceOnRoad};
use crate::injection::{Change, Hand, Injection, Signal};

use Change::{Plus, Sliding, Times};
use Injection::Sensor;
use Signal::{DriverTorque, LateralError, WheelAngle, YawError, YawRate};

/// The driver overrides for a moment: the command drops at once, and a motor that lags follows.
const OVERRIDES: Injection = Injection::Hand(Hand::Opposes {
    torque_nm: 8.0,
    ms: 60,
});

const SLIDES: Injection = Sensor(LateralError, Sliding { by: 3.5, ms: 140 });

pub(super) const ROWS: &[FaultCase] = rows! {
    "camera-slides" "e_y' slides to the next lane's line: 3.5 m in 0.14 s"
        [SLIDES] .may_hand_over().torque(5.0);
    "camera-slides-back" "the same for 1 s, then back at once"
        [SLIDES] .may_hand_over().torque(5.0).lasts(1000);
    "camera-slides-slowly" "e_y' slides to the next lane's line: 3.5 m in 4.5 s"
        [Sensor(LateralError, Sliding { by: 3.5, ms: 4500 })] .may_hand_over().torque(5.0);
    "yaw-error-flipped-before-curve" "e_theta' with the wrong sign from before a curve"
        [Sensor(YawError, Times(-1.0))] .may_hand_over().torque(5.0).place(PlaceOnRoad::Before);
    "lateral-error-flipped-before-curve" "e_y' with the wrong sign from before a curve"
        [Sensor(LateralError, Times(-1.0))] .may_hand_over().torque(5.0).place(PlaceOnRoad::Before);
    "line-moves" "the camera's line moves by 0.29 m between two pictures"
        [Sensor(LateralError, Plus(0.29))] .may_hand_over();
    // 8 N.m for 0.2 s turn a wheel by 80 deg, and the vehicle far aside: guidance brings it back. What the tyres do
    // afterwards may be more than the column's model knows.
    "driver-overrides-8" "driver overrides with 8 N.m for 0.2 s"
        [Injection::Hand(Hand::Opposes { torque_nm: 8.0, ms: 200 })] .may_hand_over().torque(5.0);
    "motor-lags-2" "honest motor with 2 ms of lag, overridden by 8 N.m"
        [OVERRIDES] .opposed().on(|w| w.motor_lag_s = 0.002);
    "motor-lags-10" "honest motor with 10 ms of lag, overridden by 8 N.m"
        [OVERRIDES] .opposed().on(|w| w.motor_lag_s = 0.010);
    "motor-lags-20" "honest motor with 20 ms of lag, overridden by 8 N.m"
        [OVERRIDES] .opposed().on(|w| w.motor_lag_s = 0.020);
    "motor-errs" "honest motor with 10 % of error and 0.02 N.m of ripple"
        [] .on(|w| { w.motor_error = 0.1; w.motor_ripple_nm = 0.02; });
    "torque-offset" "driver torque 0.1 N.m off" [Sensor(DriverTorque, Plus(0.1))];
    "angle-offset" "wheel angle 1 deg off" [Sensor(WheelAngle, Plus(0.017_45))];
    "angle-offset-5" "wheel angle 5 deg off" [Sensor(WheelAngle, Plus(0.087_27))] .may_hand_over();
    "yaw-rate-offset" "yaw rate 3 mrad/s off" [Sensor(YawRate, Plus(0.003))];
    "friction" "column with 0.3 N.m of dry friction" [] .on(|w| w.friction_nm = 0.3);
    "assist" "power assist of 8 N.m at 3 N.m of driver torque, half of it at 60 km/h"
        [] .on(|w| w.assist_nm = 8.0);
    "bank" "the whole road banked by 6 %" [] .on(|w| w.bank_rad = 0.06);
    "slippery-yaw-error-flipped" "mu 0.4, and e_theta' with the wrong sign"
        [
            Sensor(YawError, Times(-1.0)),
        ] .may_hand_over().torque(5.0).on(|w| { w.tyres = Tyres::Saturating; w.mu = 0.4; });
    "slippery-camera-slides" "mu 0.4, and e_y' slides to the next lane's line"
        [SLIDES] .may_hand_over().torque(5.0).on(|w| { w.tyres = Tyres::Saturating; w.mu = 0.4; });
};
