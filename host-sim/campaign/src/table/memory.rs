//! Faults of memory, computation, output and power.

use haptic_core::ecu::injection::Region;

use super::{FaultCase, MOTOR_MS, PlaceOnRoad, WEAK_MS};
use crate::injection::{Hand, Injection, Inside, Motor, RequestFault, Start};
use crate::residual::Detectability;

const fn inside(inside: Inside) -> Injection {
    Injection::Inside(inside)
}

pub(super) const ROWS: &[FaultCase] = rows! {
    "hard-fault" "the processor faults" [] .restarts(2, 20).only_q();
    "panic" "a check fails outside the torque path" [] .restarts(3, 20).only_q();
    "stack-overflow" "the stack runs into its MPU guard" [] .restarts(4, 20).only_q();
    "flip-state" "one bit of torque, state or ramp flips"
        [inside(Inside::Flip(Region::Controller))] .stops(10).q();
    "flip-inputs" "one bit of inputs, applied torque or monitor state flips"
        [inside(Inside::Flip(Region::Ecu))] .stops(10).q();
    "flip-gains" "one bit of gains, limits or margins flips"
        [inside(Inside::Flip(Region::Config))] .stops(10).q();
    "flip-monitor" "one bit of the monitor's limits flips"
        [inside(Inside::Flip(Region::Monitor))] .stops(10).q();
    "parameters-bad" "one bit wrong in both copies of the parameters at boot"
        [] .locks().from(Start::NoParameters).q();
    "parameters-absurd" "every gain and the limit at the end of its range"
        [] .only_rules().from(Start::Absurd).torque(5.0);
    "page-half-written" "power fails while parameters are written: engages with the previous ones"
        [] .engages().from(Start::HalfWritten).q();
    "law-forced" "the law asks for 5 N.m the wrong way: monitor, then zero"
        [inside(Inside::LawForced)] .stops(500);
    "law-interrupted" "the law asks for 5 N.m to the left, but in one of 16 ms for none"
        [inside(Inside::LawInterrupted)] .stops(500);
    "law-random" "the law asks for a random torque every 200 ms" [inside(Inside::LawRandom)] .stops(2000);
    "monitor-agrees" "the monitor agrees with everything: self-test within 1 s"
        [inside(Inside::MonitorAgrees)] .stops(1000);
    "motor-ignores" "the motor goes on with its torque while the request ends"
        [
            Injection::Motor(Motor::Stuck),
            Injection::Request(RequestFault::Ends),
        ] .stops(MOTOR_MS).seen(Detectability::MotorAstray).after_fade();
    "motor-half" "the motor delivers half"
        [Injection::Motor(Motor::Times(0.5))] .hands_over(WEAK_MS).seen(Detectability::MotorWeak);
    "motor-dead" "the motor delivers nothing, as a limiter that zeroes in silence"
        [Injection::Motor(Motor::Times(0.0))] .hands_over(WEAK_MS).seen(Detectability::MotorWeak);
    // Below its own error of 0.1 N.m, as on a straight, it passes for a weak one.
    "motor-reversed" "the motor turns the wrong way"
        [
            Injection::Motor(Motor::Times(-1.0)),
        ] .place(PlaceOnRoad::In).stops(MOTOR_MS).seen(Detectability::MotorAstray);
    "brown-out" "the supply breaks down in the curve" [inside(Inside::BrownOut)] .restarts(5, 2);
    "three-resets" "third reset within 10 s" [] .locks().from(Start::ThirdReset).q();
    // The error that is left when guidance comes is larger than any of ordinary driving.
    "engage-in-curve" "request in mid-curve with a large error"
        [
            Injection::Hand(Hand::Jerk { peak_nm: 1.8, ms: 600, before_ms: 600 }),
        ] .engages().from(Start::Boot).torque(2.5).q();
};
