//! A driver who answers when the ECU, which feels no hand, asks for one.

use super::STEP_S;
use super::driver::DriverParameters;

/// A driver who is asked for a hand moves the wheel to and fro, once: a sine of 1 s that takes the vehicle nowhere.
#[derive(Debug, Clone)]
pub struct HandsAnswer {
    /// Infinite: never.
    after_s: f64,
    /// Steps for which the driver has been asked, and the move's after those.
    step: u32,
}

impl HandsAnswer {
    /// Its size, N.m: well above the change that an ECU takes for a hand (`haptic_core::safety::hands::FELT`), and far below an
    /// override.
    const SIZE_NM: f64 = 0.2;
    const LASTS_S: f64 = 1.0;

    /// A driver who has not been asked.
    pub fn new(parameters: &DriverParameters) -> Self {
        Self {
            after_s: parameters.answers_hands_off_after_s,
            step: 0,
        }
    }

    /// Torque of the next step, N.m.
    #[inline]
    pub fn step(&mut self, is_asked: bool) -> f64 {
        if !is_asked && self.step == 0 {
            return 0.0;
        }
        let into_s = f64::from(self.step) * STEP_S - self.after_s;
        let moves = (0.0..Self::LASTS_S).contains(&into_s);
        self.step = if is_asked && into_s < 0.0 || moves {
            self.step + 1
        } else {
            0
        };
        if moves {
            Self::SIZE_NM * (std::f64::consts::TAU * into_s / Self::LASTS_S).sin()
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Asked from step 10 on, answered 2 s later: a whole sine of 1 s, then from the start. Whoever is asked no more before
    /// does nothing; whoever moves ends the move.
    #[test]
    fn a_hand_that_is_asked_for_moves_the_wheel_to_and_fro() {
        let with = |after_s| {
            HandsAnswer::new(&DriverParameters {
                answers_hands_off_after_s: after_s,
                ..DriverParameters::default()
            })
        };
        let torques = |after_s, asked: &dyn Fn(u32) -> bool| {
            let mut answer = with(after_s);
            (0..8000)
                .map(|step| answer.step(asked(step)))
                .collect::<Vec<f64>>()
        };
        let moved = |torques: &[f64]| torques.iter().filter(|nm| nm.abs() > 1e-9).count();
        let asked = torques(2.0, &|step| step >= 10);
        assert_eq!(moved(&asked[..2011]), 0);
        assert!((asked[2260] - 0.2).abs() < 1e-9 && (asked[2760] + 0.2).abs() < 1e-9);
        assert!(asked[2010..3010].iter().sum::<f64>().abs() < 1e-9);
        assert_eq!(moved(&asked[3010..5012]), 0);
        assert!(moved(&asked[5012..6012]) > 990);
        assert_eq!(moved(&torques(2.0, &|step| step < 1900)), 0);
        assert_eq!(moved(&torques(2.0, &|step| step < 2100)), moved(&asked[..3010]));
        assert_eq!(moved(&torques(f64::INFINITY, &|_| true)), 0);
    }
}
