//! The probe is a small, known sine that is added to the guidance torque. The driver's answer to it can be told from
//! what the driver does anyway, and shows how much the driver relies on the guidance (K_hg). Without a probe K_hg
//! cannot be identified while driving.
//!
//! It starts and ends without a jump: its amplitude grows linearly from zero over the first period, and falls
//! likewise over the period after its end. Its slope is at most `2*pi*frequency*amplitude`, and 1.3 % more while it
//! ends. The parameters allow 3.5 N.m/s ([`crate::controller::params`] checks it) so the slope stays below the
//! envelope's limit of 4 N.m/s.
//!
//! The error is at most 0.3 uN.m from a float64 sine of the same phase. A late step advances the phase by at most 2
//! ms, so that the torque does not jump.
//!
//! Not here: when a probe is allowed (the controller: in Active only), any limit (the envelope has the last
//! word on the sum), and what the answer tells ([`crate::estimator`]).

use fixed::types::I1F31;
use fixed::types::extra::U30;

use crate::law::sine::sine;
use crate::quantity::{Micros, Torque, rounded, saturate};
use crate::safety::redundant::words;

words! {
    /// Amplitude and frequency; immutable once validated by [`crate::controller::params`].
    pub struct Probe {
        /// Amplitude; zero means that there is no probe.
        pub(crate) amplitude: Torque,
        /// Phase per microsecond, in 2^-32 turns: at 1 Hz or more within 1.2e-4 of the frequency.
        pub(crate) phase_per_us: u32,
    }
}

words! {
    /// The phase of the sine and the share of its amplitude.
    pub struct ProbeState {
        phase: u32,
        /// Share of the amplitude, in 2^-32. It advances as the phase does, so that it grows over one period.
        gain: u32,
    }
}

impl ProbeState {
    /// There is no probe.
    pub const SILENT: Self = Self { phase: 0, gain: 0 };

    /// Whether the probe is silent, or within a thirty-second of a turn of a zero crossing. There the inertia of a
    /// free wheel answers with almost no torque. A hand answers late, so its torque has one sign where the probe
    /// rises through zero and the other where it falls.
    #[must_use]
    pub(crate) const fn is_passing_zero(&self) -> bool {
        self.gain == 0 || (self.phase.wrapping_add(SIXTEENTH >> 1) & (HALF - 1)) < SIXTEENTH
    }
}

/// A sixteenth of a turn: 25 ms at 2.5 Hz, in which the slowest sender of a driver torque sends at least once.
pub const SIXTEENTH: u32 = 1 << 28;

/// Half a turn.
const HALF: u32 = 1 << 31;

/// Longest time that one step counts: two ticks, as in the envelope's rate limits.
const MAX_ELAPSED_US: u32 = 2_000;

impl Probe {
    /// Advances by `elapsed` and returns the torque to add; `None` while the probe is silent.
    #[must_use]
    pub fn step(&self, state: &mut ProbeState, elapsed: Micros, wanted: bool) -> Option<Torque> {
        let advance = self.phase_per_us.wrapping_mul(elapsed.us().min(MAX_ELAPSED_US));
        state.gain = if wanted {
            state.gain.saturating_add(advance)
        } else {
            state.gain.saturating_sub(advance)
        };
        if state.gain == 0 || self.amplitude == Torque::ZERO {
            *state = ProbeState::SILENT;
            return None;
        }
        state.phase = state.phase.wrapping_add(advance);
        let gain = I1F31::from_bits((state.gain >> 1).cast_signed());
        // The product is at most one.
        let share = saturate(rounded::<_, U30>(gain.wide_mul(sine(state.phase))));
        let torque = self.amplitude.fixed().wide_mul(share);
        Some(Torque::from_wide(rounded(torque)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PROBE: Probe = Probe {
        amplitude: Torque::from_nm(0.2),
        phase_per_us: 10_737,
    };

    /// Torque after each millisecond, N.m; 0 where there is none.
    fn run(state: &mut ProbeState, steps: usize, wanted: bool) -> impl Iterator<Item = f64> {
        (0..steps).map(move |_| {
            PROBE
                .step(state, Micros::from_ms(1), wanted)
                .map_or(0.0, Torque::nm)
        })
    }

    #[test]
    fn is_a_sine_that_grows_over_its_first_period() {
        let mut state = ProbeState::SILENT;
        for (i, torque) in run(&mut state, 5_000, true).enumerate() {
            let turns = (i + 1) as f64 * 1000.0 * 10_737.0 / 4_294_967_296.0;
            let expected = 0.2 * turns.min(1.0) * (turns * core::f64::consts::TAU).sin();
            assert!((torque - expected).abs() < 3e-7, "{i}: {torque} {expected}");
        }
    }

    #[test]
    fn never_jumps_whenever_it_starts_and_ends() {
        // 2*pi*2.5 Hz*0.2 N.m is pi N.m/s, and 1.3 % more while it ends.
        use core::f64::consts::PI;
        let (mut state, mut last, mut steepest) = (ProbeState::SILENT, 0.0_f64, 0.0_f64);
        for steps in 1..900 {
            for wanted in [true, false] {
                for torque in run(&mut state, steps, wanted) {
                    steepest = steepest.max((torque - last).abs() / 1e-3);
                    last = torque;
                }
            }
        }
        assert!((0.99 * PI..1.013 * PI).contains(&steepest), "{steepest}");
    }

    #[test]
    fn is_silent_a_period_after_its_end_and_starts_from_zero_again() {
        let mut state = ProbeState::SILENT;
        run(&mut state, 1_234, true).for_each(drop);
        run(&mut state, 401, false).for_each(drop);
        assert_eq!(state, ProbeState::SILENT);
        assert_eq!(PROBE.step(&mut state, Micros::from_ms(1), false), None);
    }

    #[test]
    fn a_late_step_moves_it_no_further_than_two_ticks() {
        let (mut late, mut on_time) = (ProbeState::SILENT, ProbeState::SILENT);
        let jump = PROBE.step(&mut late, Micros::from_ms(90), true);
        assert_eq!(jump, PROBE.step(&mut on_time, Micros::from_ms(2), true));
    }

    #[test]
    fn passes_zero_where_it_is_small_on_both_sides_of_it() {
        let mut state = ProbeState::SILENT;
        assert!(state.is_passing_zero());
        run(&mut state, 400, true).for_each(drop);
        // The window is a thirty-second of a turn on either side of a zero crossing: there the sine is below this.
        let most = 0.2 * (core::f64::consts::TAU / 32.0).sin();
        let mut seen = [0; 2];
        for _ in 0..4000 {
            let torque = run(&mut state, 1, true).sum::<f64>();
            let is_near = (torque.abs() - most).abs() < 1e-3;
            assert!(
                is_near || state.is_passing_zero() == (torque.abs() < most),
                "{torque}"
            );
            seen[usize::from(state.is_passing_zero())] += 1;
        }
        // An eighth of the time.
        assert!((480..520).contains(&seen[1]), "{seen:?}");
    }

    #[test]
    fn no_amplitude_is_no_probe() {
        let none = Probe {
            amplitude: Torque::ZERO,
            ..PROBE
        };
        assert_eq!(
            none.step(&mut ProbeState::SILENT.clone(), Micros::from_ms(1), true),
            None
        );
    }
}
