//! No hand on the wheel: what the sensor then tells is its offset, its noise, and the rim that the column turns. The column is
//! stepped here in f64, with the paper's table 9.

use haptic_core::safety::faults::Fault;
use haptic_core::safety::modes::Mode;

use crate::rig::Rig;

/// Inertia of column and wheel, and of the rim beyond the sensor, kg.m2; damping, N.m.s/rad.
const COLUMN: f64 = 0.11;
const RIM: f64 = 0.035;
const DAMPING: f64 = 0.57;

/// A wheel that nobody holds.
struct Free {
    angle: f64,
    rate: f64,
    straight: f64,
    steady: f64,
    noise: u32,
}

impl Free {
    fn new(rig: &Rig) -> Self {
        Self {
            angle: 0.0,
            rate: 0.0,
            straight: rig.wheel,
            steady: rig.applied,
            noise: 1,
        }
    }

    /// A millisecond under the guidance's torque; what the sensors tell.
    fn step(&mut self, rig: &mut Rig, offset: f64, stiffness: f64) {
        let acceleration =
            (rig.applied - self.steady - DAMPING * self.rate - stiffness * self.angle) / COLUMN;
        self.rate += acceleration * 1e-3;
        self.angle += self.rate * 1e-3;
        self.noise = self.noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = 0.01 * (f64::from(self.noise >> 8) / f64::from(1 << 23) - 1.0);
        rig.wheel = self.straight + self.angle;
        rig.driver = Some(offset - RIM * acceleration + noise);
    }
}

#[test]
fn hands_off_is_found_at_any_offset_in_a_curve_and_beside_the_probe() {
    for tenths in -3..=3 {
        // Where the guidance does next to nothing, as on a banked straight, and in a bend.
        for torque in [-0.6, 0.1, 0.6] {
            for probe in [false, true] {
                let offset = 0.1 * f64::from(tenths);
                let mut rig = Rig::active_in_curve(torque);
                rig.probe = probe;
                let mut wheel = Free::new(&rig);
                let (mut warned, mut ended) = (None, None);
                for ms in 0..32_000_u32 {
                    wheel.step(&mut rig, offset, 2.0);
                    let step = rig.tick();
                    if step.command.faults.contains(Fault::HandsOff) {
                        warned.get_or_insert(ms);
                    }
                    if step.command.mode != Mode::Active {
                        assert_eq!(step.command.mode, Mode::Fade, "{offset} {torque} {probe}");
                        ended = Some(ms);
                        break;
                    }
                }
                let said = format!("{offset} N.m, {torque} N.m, probe {probe}: {warned:?}, {ended:?}");
                // Up to 1.5 s of guidance without a hand were before.
                assert!(warned.is_some_and(|ms| (13_400..=15_900).contains(&ms)), "{said}");
                assert!(ended.is_some_and(|ms| (28_400..=30_900).contains(&ms)), "{said}");
            }
        }
    }
}

/// A hand that does what a lane asks for, by 0.1 N.m to and fro every 3 s, is felt beside the probe too.
#[test]
fn a_hand_is_felt_beside_the_probe() {
    let mut rig = Rig::active_in_curve(0.6);
    rig.probe = true;
    let mut wheel = Free::new(&rig);
    for ms in 0..40_000_u32 {
        let seconds = 1e-3 * f64::from(ms);
        let hand = 0.1 * (std::f64::consts::TAU * seconds / 3.0).sin();
        wheel.step(&mut rig, hand, 2.0);
        assert!(!rig.tick().command.warning, "{ms}");
    }
}

/// A driver who relies on the guidance and holds still in a bend of three minutes: asked every time, and there. One who is not
/// there loses the guidance.
#[test]
fn who_holds_still_in_a_long_bend_keeps_guidance_by_answering() {
    for answers in [true, false] {
        let mut rig = Rig::active_in_curve(0.5);
        let (mut asked_ms, mut warnings, mut left) = (0, 0, None);
        for ms in 0..180_000_u32 {
            let move_ms = asked_ms - 14_000;
            // Once to and fro with 0.2 N.m, from 14 s after the warning on.
            let phase = f64::from(move_ms) * 1e-3 * std::f64::consts::TAU;
            let moves = answers && (0..1000).contains(&move_ms);
            rig.driver = Some(0.25 + if moves { 0.2 * phase.sin() } else { 0.0 });
            let step = rig.tick();
            warnings += u32::from(step.command.warning && asked_ms == 0);
            asked_ms = if step.command.warning || moves {
                asked_ms + 1
            } else {
                0
            };
            if step.command.mode != Mode::Active {
                left = Some(ms);
                break;
            }
        }
        if answers {
            assert_eq!(left, None);
            assert!((5..=7).contains(&warnings), "{warnings}");
        } else {
            assert!(left.is_some_and(|ms| (29_000..=30_010).contains(&ms)), "{left:?}");
        }
    }
}
