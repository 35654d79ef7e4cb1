//! Where a handover starts: the outputs that its fault may have spoilt are trusted no more. The torque grows all the time, so
//! that an output tells when it left.

use crate::rig::{Rig, SPEED};
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;

/// A torque to one side that grows by so much a step, within the 4 N.m/s of the envelope and the 1.2 N.m in 250 ms of its
/// window, and the torques applied.
struct Growing {
    rig: Rig,
    sign: f64,
    slope: f64,
    faults: FaultSet,
    outputs: Vec<f64>,
}

impl Growing {
    fn new(sign: f64, slope: f64) -> Self {
        let mut rig = Rig::active_in_curve(sign * 0.4);
        rig.run(300);
        Self {
            rig,
            sign,
            slope,
            faults: FaultSet::NONE,
            outputs: Vec::new(),
        }
    }

    /// A step; whether it hands over.
    fn tick(&mut self) -> bool {
        let torque = 0.4 + self.slope * self.outputs.len() as f64;
        self.rig.curve(self.sign * torque);
        self.outputs.push(self.rig.applied);
        let command = self.rig.tick().command;
        self.faults = command.faults;
        command.mode == Mode::Handover
    }

    /// Asserts that the handover, which has just begun and lasts `length_ms`, is on the line from the torque of `ago_ms` before
    /// as soon as the reduction limit of 8 N.m/s has brought it there, and that others lie apart.
    fn assert_start(mut self, ago_ms: usize, length_ms: u32, fault: Fault) {
        assert!(self.faults.contains(fault));
        let now = *self.outputs.last().unwrap();
        let trusted = self.outputs[self.outputs.len() - ago_ms];
        assert!((now - trusted).abs() > 0.06, "{now} {trusted}");
        // Two outputs that are remembered lie up to 5 ms apart, and 40 where they are of more than 0.3 s ago.
        let apart = if ago_ms < 300 { 5.0 } else { 40.0 } * self.slope + 0.005;
        let reached = (2..length_ms).find_map(|k| {
            let got = self.rig.tick().command.torque.nm();
            let line = trusted * (1.0 - f64::from(k) / f64::from(length_ms));
            let is_there = now.abs() - 0.008 * f64::from(k) < line.abs() - apart;
            is_there.then_some((got, line))
        });
        let (got, line) = reached.unwrap();
        assert!((got - line).abs() <= apart, "{got}, not {line} from {trusted}");
    }
}

/// A hand of 3 N.m that turns nothing: the sum that says so takes up to 1.5 s. Beside a column that contradicts itself a
/// handover goes four times as fast.
#[test]
fn an_implausible_column_may_have_been_wrong_for_1500_ms() {
    for sign in [1.0, -1.0] {
        let mut growing = Growing::new(sign, 0.0012);
        for _ in 0..1300 {
            assert!(!growing.tick());
        }
        loop {
            let rig = &mut growing.rig;
            rig.driver = Some(rig.aligning - rig.applied + sign * 3.0);
            if growing.tick() {
                break;
            }
            assert!(growing.outputs.len() < 2000);
        }
        growing.assert_start(1500, 500, Fault::ColumnImplausible);
    }
}

/// Both speeds jump by 20 m/s. They are held for 0.3 s, of 31 messages; then none is used any more, and after 30 ms it is
/// said so, while the lane still comes.
#[test]
fn a_refused_speed_spoils_what_left_since_the_last_that_was_used() {
    for sign in [1.0, -1.0] {
        let mut growing = Growing::new(sign, 0.0024);
        for _ in 0..100 {
            assert!(!growing.tick());
        }
        growing.rig.speeds = [SPEED + 20.0; 2];
        growing.rig.rejects.clear();
        while growing.rig.rejects.is_empty() {
            assert!(!growing.tick());
        }
        // The message before that one came 10 ms earlier.
        let mut since = 10;
        while !growing.tick() {
            since += 1;
            assert!(since < 40);
        }
        assert!(since >= 28, "{since}");
        growing.assert_start(since + 1, 2000, Fault::SpeedStep);
    }
}
