//! The probe of several runs, to the same bits as `haptic_core::law::probe` has it in a run that asks for it from its start.
//!
//! What its answer tells, the estimator's, moves nothing: a run's samples hold none of it, and the lanes leave it out.

use haptic_core::controller::params::Params;
use haptic_core::law::probe::SIXTEENTH;

use super::counts::bits;
use super::lanes::lanes;

/// A quarter turn, and the coefficients of core's sine on it in 2^-30.
const QUARTER: u32 = 1 << 30;
const SINE: [i32; 4] = [1_686_623_910, -693_521_754, 85_290_965, -4_651_906];
const ONE: i32 = 1 << 30;

lanes! {
    /// The probes.
    pub(super) struct Probes {
        /// 0 in a run without one.
        amplitude: i32 = 0,
        /// What a step advances phase and gain by: nothing in the first, which takes no time.
        advance: u32 = 0,
        advance_in_a_step: u32 = 0,
        phase: u32 = 0,
        gain: u32 = 0,
        /// The part of the torque applied that is the probe.
        pub(super) applied: i32 = 0,
    } beside {
        is_any: bool = false,
    }
}

impl<const N: usize> Probes<N> {
    /// A new run begins in a lane, with a probe or without.
    pub(super) fn begin(&mut self, lane: usize, p: &Params, is_wanted: bool) {
        self.clear(lane);
        self.amplitude[lane] = if is_wanted { bits(p.probe_amplitude_nm) } else { 0 };
        let per_us = (p.probe_frequency_hz * 4_294.967_296 + 0.5) as u32;
        self.advance_in_a_step[lane] = per_us.wrapping_mul(1000);
        self.is_any = self.amplitude.iter().any(|amplitude| *amplitude != 0);
    }

    /// Whether a run has one.
    pub(super) fn is_on(&self, lane: usize) -> bool {
        self.amplitude[lane] != 0
    }

    /// Where it stands at the place of its wave at which core compares driver torques, or there is none.
    #[inline(always)]
    pub(super) fn is_passing_zero(&self, lane: usize) -> bool {
        (self.gain[lane] == 0)
            | (self.amplitude[lane] == 0)
            | (self.phase[lane].wrapping_add(SIXTEENTH >> 1) < SIXTEENTH)
    }

    /// From its second step on a run's steps take a millisecond each.
    #[inline(always)]
    pub(super) fn let_time_pass(&mut self) {
        self.advance = self.advance_in_a_step;
    }

    /// Adds the probes to what the guidance wants where the mask `is_guided` has its bits set: nowhere else is there one.
    #[inline(always)]
    pub(super) fn add(&mut self, is_guided: &[i32; N], wanted: &mut [i32; N]) {
        if !self.is_any {
            return;
        }
        for l in 0..N {
            self.gain[l] = self.gain[l].saturating_add(self.advance[l]);
            self.phase[l] = self.phase[l].wrapping_add(self.advance[l]);
            let grown = i64::from(self.gain[l] >> 1).wrapping_mul(i64::from(sine(self.phase[l])));
            let share = (grown.wrapping_add(1 << 30) >> 31) as i32;
            let torque = i64::from(share).wrapping_mul(i64::from(self.amplitude[l]));
            self.applied[l] = (torque.wrapping_add(1 << 29) >> 30) as i32 & is_guided[l];
            // Far beyond every limit, so that the sum has room.
            let within = wanted[l].max(-(1 << 30)).min(1 << 30);
            wanted[l] = within.wrapping_add(self.applied[l]);
        }
    }

    /// Where a limit acted, no more counts as probe than there is in the torque.
    #[inline(always)]
    pub(super) fn hold(&mut self, torque: &[i32; N], limited: &[i32; N]) {
        if !self.is_any {
            return;
        }
        for l in 0..N {
            let common = self.applied[l].max(torque[l].min(0)).min(torque[l].max(0));
            self.applied[l] = if limited[l] != 0 { common } else { self.applied[l] };
        }
    }
}

/// The sine of a phase whose full range is a turn, in 2^-30.
#[inline(always)]
fn sine(phase: u32) -> i32 {
    let turn = phase as i32;
    let is_beyond = turn.unsigned_abs() > QUARTER;
    let x = if is_beyond {
        i32::MIN.wrapping_sub(turn)
    } else {
        turn
    };
    let times = |a: i32, b: i32| (i64::from(a).wrapping_mul(i64::from(b)) >> 30) as i32;
    let square = times(x, x);
    let tail = SINE[2].wrapping_add(times(square, SINE[3]));
    let tail = SINE[1].wrapping_add(times(square, tail));
    let sine = times(x, SINE[0].wrapping_add(times(square, tail)));
    sine.min(ONE).max(-ONE)
}
