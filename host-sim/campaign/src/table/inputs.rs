//! Faults of the inputs: values that are wrong before they are encoded, or raw values under a fitting CRC.
//!
//! Sigma of the lane errors is 5 mm and 0.5 mrad. A jerk of the wheel moves the vehicle where a fault can only
//! be seen by a movement that does not come.

use super::{BLIND_MS, ELSEWHERE_MS, FaultCase, SLIP_MS, STALE_MS};
use crate::bytes::{COLUMN, LANE, REQUEST, VEHICLE};
use crate::injection::{Change, Hand, Injection, RequestFault, Signal, Start, Wire};
use crate::residual::Detectability;

use Change::{Approaching, Drifting, Frozen, Growing, Jumping, Mirrored, Noisy, Plus, StuckAt, Times};
use Injection::{Invalid, Sensor};
use Signal::{DriverTorque, LateralError, Speed1, Speed2, WheelAngle, YawError, YawRate};

/// Moves the vehicle aside within a second: faults of the lane errors show.
const JERK: Injection = Injection::Hand(Hand::Jerk {
    peak_nm: 2.5,
    ms: 600,
    before_ms: 300,
});

/// A jerk half a second after the onset.
const SWERVE: Injection = Injection::Hand(Hand::Jerk {
    peak_nm: 2.5,
    ms: 600,
    before_ms: -500,
});

/// Both speeds grow within two seconds: no step, and no difference.
const fn speeds_times(to: f64) -> [Injection; 2] {
    [
        Sensor(Speed1, Growing { to, ms: 2000 }),
        Sensor(Speed2, Growing { to, ms: 2000 }),
    ]
}

/// A raw value in every frame from the onset on.
const fn always(id: u16, start: u32, bits: u32, value: i64) -> Injection {
    field(id, start, bits, value, None)
}

const fn once(id: u16, start: u32, bits: u32, value: i64) -> Injection {
    field(id, start, bits, value, Some(1))
}

const fn field(id: u16, start: u32, bits: u32, value: i64, frames: Option<u32>) -> Injection {
    Injection::Wire(Wire::Field {
        id,
        start,
        bits,
        value,
        frames,
    })
}

const fn opposing(torque_nm: f64, ms: i32) -> Injection {
    Injection::Hand(Hand::Opposes { torque_nm, ms })
}

pub(super) const ROWS: &[FaultCase] = rows! {
    "jerk" "driver jerks the wheel: no fault" [JERK];
    "lateral-error-frozen" "e_y' frozen" [JERK, Sensor(LateralError, Frozen)] .contradicts();
    "yaw-error-frozen" "e_theta' frozen" [JERK, Sensor(YawError, Frozen)] .contradicts();
    "all-frozen" "every input frozen, counters alive"
        [
            JERK,
            Sensor(LateralError, Frozen),
            Sensor(YawError, Frozen),
            Sensor(DriverTorque, Frozen),
            Sensor(WheelAngle, Frozen),
            Sensor(Speed1, Frozen),
            Sensor(Speed2, Frozen),
            Sensor(YawRate, Frozen),
        ] .contradicts();
    "lane-invalid" "lane preview marked invalid" [Invalid] .hands_over(BLIND_MS);
    "lane-invalid-blink" "lane preview marked invalid for 15 ms" [Invalid] .bridged().lasts(15);
    "camera-blinks" "lane preview marked invalid for 0.9 s" [Invalid] .bridged().lasts(900);
    "camera-blinks-and-jumps" "lane preview lost for 0.5 s, and e_y' 0.5 m off from then on"
        [Sensor(LateralError, Plus(0.5)), Injection::Wire(Wire::Lost(&[LANE], Some(60)))] .may_hand_over();
    "camera-blinks-and-speeds-drift" "lane preview lost, and second speed drifts away at 5 m/s2: 2 m/s apart after 400 ms"
        [
            Injection::Wire(Wire::Lost(&[LANE], None)),
            Sensor(Speed2, Drifting(5.0)),
        ] .hands_over(400 + SLIP_MS);
    // One LSB beyond the range, once and always.
    "lateral-error-beyond-once" "e_y' one LSB above 4 m, one frame" [once(LANE, 12, 17, 32_769)] .rejected();
    "lateral-error-beyond" "e_y' one LSB above 4 m" [always(LANE, 12, 17, 32_769)] .hands_over(BLIND_MS);
    "yaw-error-beyond-once" "e_theta' one LSB below -0.5 rad, one frame"
        [once(LANE, 29, 17, -32_769)] .rejected();
    "yaw-error-beyond" "e_theta' one LSB below -0.5 rad"
        [always(LANE, 29, 17, -32_769)] .hands_over(BLIND_MS);
    "driver-torque-beyond-once" "T_d one LSB above 20 N.m, one frame"
        [once(COLUMN, 12, 18, 81_921)] .rejected();
    "driver-torque-beyond" "T_d one LSB above 20 N.m" [always(COLUMN, 12, 18, 81_921)] .hands_over(STALE_MS);
    "wheel-angle-beyond-once" "phi one LSB below -720 deg, one frame"
        [once(COLUMN, 30, 18, -72_001)] .rejected();
    "wheel-angle-beyond" "phi one LSB below -720 deg" [always(COLUMN, 30, 18, -72_001)] .hands_over(STALE_MS);
    "speed-beyond-once" "speed one LSB above 90 m/s, one frame" [once(VEHICLE, 12, 16, 23_041)] .rejected();
    "speed-beyond" "speed one LSB above 90 m/s" [always(VEHICLE, 12, 16, 23_041)] .hands_over(STALE_MS);
    "authority-beyond-once" "authority one LSB above 1, one frame" [once(REQUEST, 13, 8, 129)] .rejected();
    "authority-beyond" "authority one LSB above 1" [always(REQUEST, 13, 8, 129)] .hands_over(STALE_MS);
    // The ends of each field, as a sender with a broken computation would send them.
    "lateral-error-raw-min" "e_y' at the least raw value"
        [always(LANE, 12, 17, -65_536)] .hands_over(BLIND_MS);
    "lateral-error-raw-max" "e_y' at the largest raw value"
        [always(LANE, 12, 17, 65_535)] .hands_over(BLIND_MS);
    "yaw-error-raw-min" "e_theta' at the least raw value"
        [always(LANE, 29, 17, -65_536)] .hands_over(BLIND_MS);
    "yaw-error-raw-max" "e_theta' at the largest raw value"
        [always(LANE, 29, 17, 65_535)] .hands_over(BLIND_MS);
    "driver-torque-raw-min" "T_d at the least raw value"
        [always(COLUMN, 12, 18, -131_072)] .hands_over(STALE_MS);
    "driver-torque-raw-max" "T_d at the largest raw value"
        [always(COLUMN, 12, 18, 131_071)] .hands_over(STALE_MS);
    "wheel-angle-raw-min" "phi at the least raw value"
        [always(COLUMN, 30, 18, -131_072)] .hands_over(STALE_MS);
    "wheel-angle-raw-max" "phi at the largest raw value"
        [always(COLUMN, 30, 18, 131_071)] .hands_over(STALE_MS);
    "speed-raw-min" "speed at the least raw value" [always(VEHICLE, 28, 16, -32_768)] .hands_over(STALE_MS);
    "speed-raw-max" "speed at the largest raw value" [always(VEHICLE, 28, 16, 32_767)] .hands_over(STALE_MS);
    "authority-raw-max" "authority at the largest raw value"
        [always(REQUEST, 13, 8, 255)] .hands_over(STALE_MS);
    // i32::MIN and MAX in the sender's own numbers: its encoder saturates at the signal's range.
    "lateral-error-min" "e_y' of i32::MIN in the sender"
        [Sensor(LateralError, StuckAt(-2_147_483_648.0))] .hands_over(ELSEWHERE_MS);
    "lateral-error-max" "e_y' of i32::MAX in the sender"
        [Sensor(LateralError, StuckAt(2_147_483_647.0))] .hands_over(ELSEWHERE_MS);
    "yaw-error-min" "e_theta' of i32::MIN in the sender"
        [Sensor(YawError, StuckAt(-2_147_483_648.0))] .hands_over(ELSEWHERE_MS);
    "yaw-error-max" "e_theta' of i32::MAX in the sender"
        [Sensor(YawError, StuckAt(2_147_483_647.0))] .hands_over(ELSEWHERE_MS);
    "wheel-angle-min" "phi of i32::MIN in the sender"
        [Sensor(WheelAngle, StuckAt(-2_147_483_648.0))] .contradicts();
    "wheel-angle-max" "phi of i32::MAX in the sender"
        [Sensor(WheelAngle, StuckAt(2_147_483_647.0))] .contradicts();
    "speed-max" "speeds of i32::MAX in the sender"
        [
            Sensor(Speed1, StuckAt(2_147_483_647.0)),
            Sensor(Speed2, StuckAt(2_147_483_647.0)),
        ] .hands_over(SLIP_MS);
    // Steps, signs, drifts, gains, noise.
    "lateral-error-step-once" "e_y' 0.5 m off in one sample"
        [Sensor(LateralError, Plus(0.5))] .bridged().lasts(8);
    "lateral-error-step" "e_y' 0.5 m off, as at road works"
        [Sensor(LateralError, Plus(0.5))] .may_hand_over();
    "lateral-error-step-far" "e_y' 3 m off" [Sensor(LateralError, Plus(3.0))] .contradicts();
    "lateral-error-flipped" "e_y' with the wrong sign"
        [JERK, Sensor(LateralError, Times(-1.0))] .contradicts();
    "yaw-error-flipped" "e_theta' with the wrong sign" [JERK, Sensor(YawError, Times(-1.0))] .contradicts();
    "lateral-rate-flipped" "e_y' mirrored: its rate has the wrong sign"
        [JERK, Sensor(LateralError, Mirrored)] .contradicts();
    "yaw-rate-flipped" "e_theta' mirrored: its rate has the wrong sign"
        [JERK, Sensor(YawError, Mirrored)] .contradicts();
    "yaw-rate-spiked" "yaw rate of 1.9 rad/s in two messages"
        [Sensor(YawRate, StuckAt(1.9))] .bridged().lasts(20);
    "yaw-rate-stuck" "yaw rate frozen" [JERK, Sensor(YawRate, Frozen)] .may_hand_over();
    "yaw-rate-inverted" "yaw rate with the wrong sign" [JERK, Sensor(YawRate, Times(-1.0))] .may_hand_over();
    "yaw-rate-zero" "yaw rate 0 and valid" [JERK, Sensor(YawRate, StuckAt(0.0))] .may_hand_over();
    "yaw-rate-offset-20" "yaw rate 20 mrad/s off" [Sensor(YawRate, Plus(0.02))];
    "yaw-rate-absent" "yaw rate marked as bad" [JERK, always(VEHICLE, 58, 1, 0)];
    "yaw-rate-stuck-and-blinks" "yaw rate frozen, and lane preview marked invalid for 0.9 s"
        [JERK, Sensor(YawRate, Frozen), Invalid] .may_hand_over().lasts(900);
    "yaw-rate-inverted-and-slip" "yaw rate with the wrong sign, and both speeds 4 m/s low for 60 ms"
        [Sensor(YawRate, Times(-1.0)), Sensor(Speed1, Plus(-4.0)), Sensor(Speed2, Plus(-4.0))] .lasts(60);
    "lateral-error-drifting" "e_y' drifts by 0.1 m/s" [Sensor(LateralError, Drifting(0.1))];
    "lateral-error-x0" "e_y' times 0" [JERK, Sensor(LateralError, Times(0.0))] .may_hand_over();
    "lateral-error-x0.5" "e_y' times 0.5" [JERK, Sensor(LateralError, Times(0.5))] .may_hand_over();
    "yaw-error-offset-10" "e_theta' 10 mrad off" [Sensor(YawError, Plus(0.01))] .may_hand_over();
    "lateral-error-x2" "e_y' times 2" [JERK, Sensor(LateralError, Times(2.0))] .may_hand_over().torque(5.0);
    // Ten times an error jumps: which line is taken then, the second opinion does not follow.
    "lateral-error-x10" "e_y' times 10"
        [JERK, Sensor(LateralError, Times(10.0))] .may_hand_over_at_once().torque(5.0);
    "yaw-error-x0" "e_theta' times 0" [JERK, Sensor(YawError, Times(0.0))] .may_hand_over();
    "yaw-error-x2" "e_theta' times 2" [JERK, Sensor(YawError, Times(2.0))] .may_hand_over().torque(5.0);
    "yaw-error-x10" "e_theta' times 10"
        [JERK, Sensor(YawError, Times(10.0))] .may_hand_over_at_once().torque(5.0);
    "noise-3-sigma" "noise of 15 mm and 1.5 mrad"
        [Sensor(LateralError, Noisy(0.015)), Sensor(YawError, Noisy(0.0015))];
    "noise-10-sigma" "noise of 50 mm and 5 mrad"
        [Sensor(LateralError, Noisy(0.05)), Sensor(YawError, Noisy(0.005))];
    // The driver and the torque sensor.
    "driver-torque-zero" "T_d stuck at 0" [Sensor(DriverTorque, StuckAt(0.0))] .may_hand_over_at_once();
    "driver-torque-frozen" "T_d frozen" [Sensor(DriverTorque, Frozen)] .may_hand_over_at_once();
    "driver-torque-zero-and-swerve" "T_d stuck at 0, and 0.5 s later the driver swerves"
        [SWERVE, Sensor(DriverTorque, StuckAt(0.0))] .may_hand_over_at_once();
    "wheel-angle-flipped" "wheel angle with the wrong sign"
        [JERK, Sensor(WheelAngle, Times(-1.0))] .may_hand_over_at_once();
    "driver-torque-full-left" "T_d stuck at 20 N.m" [Sensor(DriverTorque, StuckAt(20.0))] .contradicts();
    "driver-torque-full-right" "T_d stuck at -20 N.m" [Sensor(DriverTorque, StuckAt(-20.0))] .contradicts();
    "driver-torque-flipped" "T_d with the wrong sign" [Sensor(DriverTorque, Times(-1.0))] .contradicts();
    "driver-torque-scaled" "T_d times 1.26" [JERK, Sensor(DriverTorque, Times(1.26))] .may_hand_over();
    "driver-opposes-0.80" "driver opposes with 0.80 N.m for 0.3 s: no cut" [opposing(0.80, 300)] .uncut();
    "driver-opposes-0.81" "driver opposes with 0.81 N.m for 0.3 s" [opposing(0.81, 300)] .opposed();
    "driver-opposes-2.47" "driver opposes with 2.47 N.m for 0.15 s"
        [opposing(2.47, 150)] .yields(3).lasts(150);
    "driver-opposes-10" "driver opposes with 10 N.m for 50 ms" [opposing(10.0, 50)] .yields(3).lasts(50);
    "driver-taps" "driver taps against the guidance at 5 Hz with 3 N.m: no growing oscillation"
        [Injection::Hand(Hand::Taps { torque_nm: 3.0 })] .opposed();
    // Speed.
    "speed-falls-to-zero" "speeds fall to 0 at 10 m/s2 while the vehicle goes on, which may be seen to be impossible first"
        [
            Sensor(Speed1, Approaching { value: 0.0, per_s: 10.0 }),
            Sensor(Speed2, Approaching { value: 0.0, per_s: 10.0 }),
        ] .fades(20).seen(Detectability::Speed);
    "speed-zero" "speeds 0 at once"
        [Sensor(Speed1, StuckAt(0.0)), Sensor(Speed2, StuckAt(0.0))] .hands_over(SLIP_MS);
    "speed-negative" "a speed one LSB below 0" [always(VEHICLE, 28, 16, -1)] .hands_over(STALE_MS);
    "speed-jumping" "speeds jump by 5 m/s up and down"
        [Sensor(Speed1, Jumping(5.0)), Sensor(Speed2, Jumping(5.0))] .hands_over(SLIP_MS);
    "wheels-slip" "both speeds 4 m/s low for 60 ms, as brakes let go"
        [Sensor(Speed1, Plus(-4.0)), Sensor(Speed2, Plus(-4.0))] .bridged().lasts(60);
    "wheel-slips" "one speed 5 m/s low for 0.25 s" [Sensor(Speed1, Plus(-5.0))] .bridged().lasts(250);
    "speeds-x0.8" "both speeds 20 % low, within 2 s" (speeds_times(0.8)) .may_hand_over();
    "speeds-x1.2" "both speeds 20 % high, within 2 s" (speeds_times(1.2)) .may_hand_over();
    "speeds-apart" "second speed 2 m/s higher" [Sensor(Speed2, Plus(2.0))] .hands_over(SLIP_MS);
    "speeds-drift-apart" "second speed drifts away at 5 m/s2: 2 m/s apart after 400 ms"
        [Sensor(Speed2, Drifting(5.0))] .hands_over(400 + SLIP_MS);
    "heading-wraps" "the road's heading passes +-pi: no jump" [] .from(Start::HeadingWraps);
    // The host's request.
    "request-ends" "request ends" [Injection::Request(RequestFault::Ends)] .fades(12);
    "request-drops" "request low in one frame: no way around the rate limits"
        [Injection::Request(RequestFault::Drops(1))] .fades(12);
};
