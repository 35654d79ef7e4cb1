//! Records, starts and costs of a lock-step run, byte by byte as the module's header gives them.

use haptic_core::bus::Frame;
use haptic_core::bus::messages::ResetCause;
use haptic_core::controller::params::Params;
use haptic_core::ecu::Boot;
use haptic_core::quantity::{Instant, Micros};
use haptic_core::safety::faults::Fault;
use haptic_core::safety::modes::Mode;
use haptic_lockstep::{
    Authenticated, PARAMETERS, SimTime, StackUse, Start, StartState, StepCost, from_record, parameter_frames,
    set_parameter, to_record,
};
use haptic_secoc::fresh::Algorithm;

fn frame(id: u16, bytes: &[u8]) -> Frame {
    Frame::new(id, bytes).unwrap()
}

#[test]
fn records() {
    let three = frame(0x123, &[9, 8, 7]);
    let record = [0x23, 0x01, 3, 9, 8, 7, 0, 0, 0, 0, 0];
    assert_eq!(to_record(&three), record);
    assert_eq!(from_record(&record), Some(three));
    assert_eq!(
        from_record(&[0, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0]),
        None,
        "identifier 0x800"
    );
    assert_eq!(
        from_record(&[0, 0, 9, 0, 0, 0, 0, 0, 0, 0, 0]),
        None,
        "nine bytes"
    );
}

#[test]
fn parameters_one_by_one() {
    let sent = Params {
        k_1: 0.125,
        torque_limit_nm: 3.0,
        ..Params::PAPER
    };
    let frames = parameter_frames(&sent);
    assert_eq!(frames[0], frame(0x7C0, &0.125_f64.to_le_bytes()));
    let mut heard = Params::PAPER;
    for frame in frames {
        assert!(set_parameter(&mut heard, &frame));
    }
    assert_eq!(heard, sent);
    let behind_the_last = 0x7C0 + PARAMETERS as u16;
    for other in [
        frame(0x7BF, &[0; 8]),
        frame(behind_the_last, &[0; 8]),
        frame(0x7C0, &[0; 7]),
    ] {
        assert!(!set_parameter(&mut heard, &other));
    }
    assert_eq!(heard, sent);
}

#[test]
fn starts() {
    let at = Instant::from_us(0x0403_0201);
    let boot = Boot {
        reset: ResetCause::Watchdog,
        recent_resets: 2,
        ..Boot::default()
    };
    let mut latched = boot;
    latched.latched.insert(Fault::Monitor);
    for (state, bytes, mode) in [
        (StartState::Boot(boot), [0x44, 0, 0, 0, 1, 2, 3, 4], Mode::Standby),
        (
            StartState::WithoutParameters(boot),
            [0x45, 0, 0, 0, 1, 2, 3, 4],
            Mode::Locked,
        ),
        // The monitor's bit is 9.
        (
            StartState::Boot(latched),
            [0x44, 0, 2, 0, 1, 2, 3, 4],
            Mode::Fault,
        ),
        // Engaged without any input hands over in its first step.
        (StartState::Engaged, [2, 0, 0, 0, 1, 2, 3, 4], Mode::Handover),
        (StartState::Product, [3, 0, 0, 0, 1, 2, 3, 4], Mode::Standby),
    ] {
        let start = Start { state, at };
        assert_eq!(start.encode(), frame(0x7EF, &bytes));
        assert_eq!(Start::decode(&start.encode()), Some(start));
        let mut ecu = start.ecu(&Params::PAPER).unwrap();
        let step = ecu.step(at.after(Micros::from_ms(1)));
        assert_eq!(step.command.mode, mode);
        assert!(
            !step.command.faults.contains(Fault::Deadline),
            "the clock starts there"
        );
    }
    let bad = Params {
        k_1: -1.0,
        ..Params::PAPER
    };
    let start = Start {
        state: StartState::Engaged,
        at,
    };
    assert_eq!(start.ecu(&bad).map(|_| ()).unwrap_err().name, "k_1");
    for none in [
        frame(0x7EF, &[0; 7]),
        frame(0x7EE, &[0; 8]),
        frame(0x7EF, &[7 << 2, 0, 0, 0, 0, 0, 0, 0]),
    ] {
        assert_eq!(Start::decode(&none), None, "{none:?}");
    }
}

#[test]
fn simulated_time() {
    let time = SimTime(Instant::from_us(0xFEDC_BA98));
    assert_eq!(time.encode(), frame(0x7F0, &[0x98, 0xBA, 0xDC, 0xFE, 0, 0, 0, 0]));
    assert_eq!(SimTime::decode(&time.encode()), Some(time));
    assert_eq!(SimTime::decode(&frame(0x7F1, time.encode().data())), None);
    assert_eq!(SimTime::decode(&frame(0x7F0, &[0; 7])), None);
}

#[test]
fn costs() {
    let cost = StepCost {
        cycles: 0x0403_0201,
        background_cycles: 0x0807_0605,
    };
    assert_eq!(cost.encode(), frame(0x7F1, &[1, 2, 3, 4, 5, 6, 7, 8]));
    assert_eq!(StepCost::decode(&cost.encode()), Some(cost));
    assert_eq!(StepCost::decode(&frame(0x7F0, &[0; 8])), None);
    assert_eq!(StepCost::decode(&frame(0x7F1, &[0; 4])), None);
}

#[test]
fn use_of_the_stack() {
    let used = StackUse { bytes: 0x0102_0304 };
    assert_eq!(used.encode(), frame(0x7F2, &[4, 3, 2, 1, 0, 0, 0, 0]));
    assert_eq!(StackUse::decode(&used.encode()), Some(used));
    assert_eq!(StackUse::decode(&frame(0x7F1, &[0; 8])), None);
    assert_eq!(StackUse::decode(&frame(0x7F2, &[0; 7])), None);
}

#[test]
fn which_mac() {
    for (algorithm, code) in [(Algorithm::SipHash, 1), (Algorithm::AesCmac, 2)] {
        let expected = frame(0x7F3, &[code, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(Authenticated(algorithm).encode(), expected);
        assert_eq!(Authenticated::decode(&expected), Some(Authenticated(algorithm)));
    }
    for other in [frame(0x7F3, &[0; 8]), frame(0x7F3, &[1]), frame(0x7F2, &[1; 8])] {
        assert_eq!(Authenticated::decode(&other), None);
    }
}
