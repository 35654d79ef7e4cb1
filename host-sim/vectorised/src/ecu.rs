//! The lean ECU of several runs: what the shipping one does while nothing is wrong, to the same bits.
//!
//! The rounding of sensors and bus, the law (9), the envelope, the rounding of the guidance frame, and a handover after
//! the loss of the lane preview. Every quantity is a count of 2^-24 of its unit, as in `haptic-core`, from which formulas
//! and constants are taken; the property test of this module holds the two together. What could end guidance, and is not
//! decided here, makes a run suspect ([`super::checks`]).

use haptic_core::bus::messages::TIMEOUT;
use haptic_core::controller::params::Params;
use haptic_core::law::{self, schedule};
use haptic_core::safety::{envelope, hands, plausibility, ramp};

use super::band::{Band, GUIDED, HANDOVER, OFF};
use super::coast::{Coast, GOES_ON_MS};
use super::counts::{
    MS, ONE, bits, chosen, flag, ms, on_the_bus, per_second, small_bits, speed_heard, truncated,
};
use super::lanes::lanes;
use super::probe::Probes;
use super::rejected::Reason;
use haptic_sim::models::sensors::TORQUE_RESOLUTION_NM;
use haptic_sim::scenario::{Condition, Scenario};

/// An LSB of a torque on the bus.
pub(super) const TORQUE_LSB: i32 = 1 << 12;
const WINDOW_GROWTH: i32 = bits(envelope::WINDOW_GROWTH.nm());
const WINDOW_STEPS: i32 = ms(envelope::WINDOW) as i32;
const OVERRIDE_FROM: i32 = bits(envelope::OVERRIDE_FROM.nm());
const OVERRIDE_SLOPE: i32 = envelope::OVERRIDE_SLOPE.si() as i32;
const MAX_RATE: i32 = (law::MAX_RATE << 20) as i32;
const LANE_STEP: i32 = bits(plausibility::LANE_STEP.m());
const YAW_STEP: i32 = bits(plausibility::YAW_STEP.rad());
/// Ends of a lane sample on the bus, 4 m and 0.5 rad, and a bit less.
const LARGEST_E_Y: f64 = 3.99;
const LARGEST_E_THETA: f64 = 0.499;
const FELT: i32 = bits(hands::FELT.nm());
const HELD: i32 = bits(hands::HELD.nm());
const ACTS: i32 = bits(hands::ACTS.nm());
/// A bit less than core's patience.
const HANDS_MS: i32 = ms(hands::END) as i32 - 10;
/// From here on the driver is asked for a hand.
const ASKED_MS: i32 = ms(hands::WARN) as i32 - 10;
/// Far inside what a column frame carries, N.m.
const LARGEST_DRIVER_NM: f64 = 10.0;
/// Between a loss of the lane preview and its time-out, ms; then the handover.
pub(super) const TIMEOUT_MS: u32 = ms(TIMEOUT) + 1;
const HANDOVER_MS: i32 = ms(ramp::GONE_ON) as i32;
const OPPOSES: i32 = bits(ramp::OPPOSES.nm());
/// Torques kept for a handover, one every 5 ms.
const PAST: usize = 16;

lanes! {
    /// The ECUs.
    pub(super) struct Ecus {
        /// Time constant of the rates' filter, 2^-8 us.
        tau: i32 = 1,
        /// Share of the law's torque at this speed.
        scheduled: i32 = 0,
        limit: i32 = 0,
        /// What a step may change: none in the first, which takes no time.
        growth: i32 = 0,
        fall: i32 = 0,
        growth_in_a_step: i32 = 0,
        fall_in_a_step: i32 = 0,
        /// -1 until the first picture came.
        first: i32 = -1,
        e_y: i32 = 0,
        e_theta: i32 = 0,
        e_y_rate: i32 = 0,
        e_theta_rate: i32 = 0,
        /// Age of the lane sample, as a share of a second in 2^-32.
        age: i32 = 0,
        /// The torque of the last step.
        pub(super) applied: i32 = 0,
        anchor: i32 = 0,
        anchor_step: i32 = 0,
        pub(super) driver: i32 = 0,
        felt: i32 = 0,
        without_ms: i32 = 0,
        /// For how long the driver has been asked for a hand, and when an answer comes.
        asked_ms: i32 = 0,
        answer_ms: i32 = 0,
        mode: i32 = OFF,
        /// -1 where what the ECU does matters: it guides, and its torque is applied.
        pub(super) matters: i32 = 0,
        /// -1 where the ECU hears the camera.
        pub(super) hears: i32 = 0,
        /// Not 0 where something could have ended guidance.
        pub(super) suspect: i32 = 0,
        ramp_from: i32 = 0,
        ramp_done: i32 = 0,
        /// Whether a limit held the torque of the last step. Not beside it: the compiler would take both for one vector.
        pub(super) limited: i32 = 0,
    } beside {
        /// Gains of the law, on e_y, its rate, e_theta and its rate.
        gains: [[i32; N]; 4] = [[0; N]; 4],
        motion_history: [[i32; N]; PAST] = [[0; N]; PAST],
        /// How many torques were kept so far.
        kept: usize = 0,
        band: Band<N> = Band::new(),
        probes: Probes<N> = Probes::new(),
        /// Runs whose lane preview fails, and whether there is one.
        coasts: [Option<Box<Coast>>; N] = [const { None }; N],
        pub(super) has_coasts: bool = false,
    }
}

/// One update of a filtered rate: core's rounded quotient. A quotient of doubles is off by one at most, which what is left
/// of the dividend shows: no machine divides integers for several lanes at once.
#[inline(always)]
fn filtered(tau: i32, rate: i32, change: i32, dt_us: i32) -> i32 {
    let change = i64::from(change).wrapping_mul(1_000_000 << 4);
    let sum = i64::from(tau).wrapping_mul(i64::from(rate)).wrapping_add(change);
    let span = tau.wrapping_add(dt_us << 8);
    let size = sum.wrapping_abs().wrapping_add(i64::from(span >> 1));
    let near = truncated((size as f64 / f64::from(span)).min(f64::from(MAX_RATE)));
    let rest = size.wrapping_sub(i64::from(near).wrapping_mul(i64::from(span)));
    let more = if rest >= i64::from(span) { 1 } else { 0 };
    let less = if rest < 0 { 1 } else { 0 };
    let size = near.wrapping_add(more).wrapping_sub(less).min(MAX_RATE);
    if sum < 0 { size.wrapping_neg() } else { size }
}

impl<const N: usize> Ecus<N> {
    /// A new run begins in a lane: engaged, as the paper's studies have it, or without guidance.
    pub(super) fn begin(&mut self, lane: usize, scenario: &Scenario) {
        self.clear(lane);
        let p = scenario.controller_params();
        let guided = scenario.condition() != Condition::Manual;
        let gains = [p.a_1, p.a_2, p.a_3, p.a_4].map(|a| p.k_1 * a);
        for (all, gain) in self.gains.iter_mut().zip(gains) {
            all[lane] = bits(gain);
        }
        self.tau[lane] = (256e6 / (2.0 * core::f64::consts::PI * p.rate_corner_hz) + 0.5) as i32;
        self.scheduled[lane] = scheduled(&p, speed_heard(scenario));
        self.limit[lane] = bits(p.torque_limit_nm);
        self.growth_in_a_step[lane] = per_second(bits(p.wind_up_nm_per_s), MS);
        let fall = per_second(bits(p.reduction_nm_per_s), MS);
        self.fall_in_a_step[lane] = (fall - TORQUE_LSB).max(0);
        self.mode[lane] = if guided { GUIDED } else { OFF };
        (self.matters[lane], self.hears[lane]) = (flag(guided), flag(guided));
        // Where it never comes, the largest number.
        self.answer_ms[lane] = (1e3 * scenario.driver().answers_hands_off_after_s) as i32;
        for torques in &mut self.motion_history {
            torques[lane] = 0;
        }
        let has_probe = scenario.guidance().probe;
        self.band
            .begin(lane, gains, if has_probe { p.probe_amplitude_nm } else { 0.0 });
        self.probes.begin(lane, &p, has_probe);
    }

    /// The lane preview of a run fails, and its time-out is in a step.
    pub(super) fn will_lose(&mut self, lane: usize, coast: Option<Coast>) {
        self.coasts[lane] = coast.map(Box::new);
        self.has_coasts = self.coasts.iter().any(Option::is_some);
    }

    /// A speed that is another than before is heard.
    pub(super) fn hear_speed(&mut self, lane: usize, p: &Params, speed: i32) {
        self.scheduled[lane] = scheduled(p, speed);
    }

    /// From its second step on a run's steps take a millisecond each.
    #[inline(always)]
    pub(super) fn let_time_pass(&mut self) {
        (self.growth, self.fall) = (self.growth_in_a_step, self.fall_in_a_step);
        self.probes.let_time_pass();
    }

    /// The torque does not reach the column any more: what the ECU decides is nobody's matter.
    pub(super) fn lose_torque(&mut self, lane: usize) {
        (self.matters[lane], self.mode[lane]) = (0, OFF);
    }

    /// The lane preview is lost for too long: the last torque from before the lane went on last fades.
    pub(super) fn hand_over(&mut self, lane: usize, step: u32) {
        self.coasts[lane] = None;
        let before = (step - 1) / 5 - (step - GOES_ON_MS - 1) / 5;
        let trusted = self.motion_history[self.kept.wrapping_sub(1 + before as usize) % PAST][lane];
        let applied = self.applied[lane];
        // Half a wave of the probe does not stand for two seconds, and what the other half took does not come back.
        let applied = smaller_of_same_sign(applied, applied.wrapping_sub(self.probes.applied[lane]));
        self.mode[lane] = HANDOVER;
        self.ramp_from[lane] = smaller_of_same_sign(trusted, applied);
    }

    /// What reaches a run whose lane preview fails, in the step in which it does.
    #[cold]
    pub(super) fn watch(&mut self, lane: usize, step: u32, heard: Option<[f64; 2]>, looks: bool) {
        let Some(coast) = self.coasts[lane].as_mut().filter(|coast| coast.watches(step)) else {
            return;
        };
        if let Some(came) = heard {
            coast.vehicle(step, came);
        }
        if looks && self.hears[lane] != 0 {
            coast.picture(step, [self.e_y[lane], self.e_theta[lane]]);
        }
    }

    /// The lane goes on without a picture where there is none any more.
    #[cold]
    fn extrapolate(&mut self, lane: usize, step: u32) -> Option<u32> {
        let lost_ms = self.coasts[lane].as_ref()?.lost_ms(step)?;
        let demanded = self.demanded(lane).0;
        let coast = self.coasts[lane].as_mut()?;
        if lost_ms == 1 {
            coast.demanded = demanded;
            let has_probe = flag(self.probes.is_on(lane));
            self.suspect[lane] |= has_probe & self.matters[lane] & Reason::FailureWithProbe.bit();
        }
        self.band.grow(lane, lost_ms);
        if let Some(([e_y, e_theta], passed_ms)) = coast.extrapolate(step) {
            let (tau, dt_us) = (self.tau[lane], (passed_ms * 1000) as i32);
            let moved = e_y.wrapping_sub(self.e_y[lane]);
            let turned = e_theta.wrapping_sub(self.e_theta[lane]);
            self.e_y_rate[lane] = filtered(tau, self.e_y_rate[lane], moved, dt_us);
            self.e_theta_rate[lane] = filtered(tau, self.e_theta_rate[lane], turned, dt_us);
            (self.e_y[lane], self.e_theta[lane], self.age[lane]) = (e_y, e_theta, 0);
        }
        Some(lost_ms)
    }

    /// Takes the driver's torque from the column's sensor, N.m.
    #[inline(always)]
    pub(super) fn column(&mut self, torque_nm: &[f64; N]) {
        for l in 0..N {
            let sensed = (torque_nm[l] / TORQUE_RESOLUTION_NM).round() * TORQUE_RESOLUTION_NM;
            let driver = on_the_bus(small_bits(sensed), 12);
            // What is no number is too large too.
            let is_small = sensed.abs() <= LARGEST_DRIVER_NM;
            self.suspect[l] |= !flag(is_small) & self.matters[l] & Reason::SensorRange.bit();
            self.driver[l] = driver;
            let is_felt = self.probes.is_passing_zero(l)
                & ((driver.wrapping_abs() > HELD)
                    | (driver.wrapping_sub(self.felt[l]).wrapping_abs() > FELT));
            let is_felt = flag(is_felt) & self.matters[l];
            self.felt[l] = chosen(is_felt, driver, self.felt[l]);
            self.without_ms[l] &= !is_felt;
        }
    }

    /// Takes a picture, `dt_ms` after the one before. Returns the errors as the bus has them, m and rad.
    #[inline(always)]
    pub(super) fn picture(
        &mut self,
        e_y_m: &[f64; N],
        e_theta_rad: &[f64; N],
        dt_ms: u32,
        own: &[i32; N],
    ) -> [[f64; N]; 2] {
        let mut seen = [[0.0; N]; 2];
        for l in 0..N {
            let (e_y, e_theta) = (
                on_the_bus(small_bits(e_y_m[l]), 11),
                on_the_bus(small_bits(e_theta_rad[l]), 8),
            );
            let is_near = (e_y_m[l].abs() <= LARGEST_E_Y) & (e_theta_rad[l].abs() <= LARGEST_E_THETA);
            let moved = e_y.wrapping_sub(self.e_y[l]).wrapping_abs();
            let turned = e_theta.wrapping_sub(self.e_theta[l]).wrapping_abs();
            let jumps = flag((moved > LANE_STEP) | (turned > YAW_STEP)) & !self.first[l];
            let doubts = (!flag(is_near) & Reason::SensorRange.bit()) | (jumps & Reason::LaneStep.bit());
            self.suspect[l] |= doubts & self.matters[l] & self.hears[l];
            seen[0][l] = f64::from(e_y) * (1.0 / ONE);
            seen[1][l] = f64::from(e_theta) * (1.0 / ONE);
        }
        let dt_us = (dt_ms * 1000) as i32;
        for l in 0..N {
            let (e_y, e_theta) = (truncated(seen[0][l] * ONE), truncated(seen[1][l] * ONE));
            let (moved, turned) = (
                e_y.wrapping_sub(self.e_y[l]),
                e_theta.wrapping_sub(self.e_theta[l]),
            );
            let e_y_rate = filtered(self.tau[l], self.e_y_rate[l], moved, dt_us);
            let e_theta_rate = filtered(self.tau[l], self.e_theta_rate[l], turned, dt_us);
            let hears = self.hears[l];
            // The first picture tells of no rate.
            let has_rate = hears & !self.first[l];
            self.e_y_rate[l] = chosen(has_rate, e_y_rate, self.e_y_rate[l]);
            self.e_theta_rate[l] = chosen(has_rate, e_theta_rate, self.e_theta_rate[l]);
            self.e_y[l] = chosen(hears, e_y, self.e_y[l]);
            self.e_theta[l] = chosen(hears, e_theta, self.e_theta[l]);
            self.first[l] &= !hears;
            self.age[l] &= !hears;
        }
        self.band.picture(&seen, own, &self.hears);
        seen
    }

    /// The torque of this step.
    #[inline(always)]
    pub(super) fn decide(&mut self, own: &[i32; N], is_window_due: bool, is_kept: bool) {
        for l in 0..N {
            // Hands: the torque of the last step acted for a millisecond. The probe does not count.
            let guidance = self.applied[l].wrapping_sub(self.probes.applied[l]);
            let acts = (guidance.wrapping_abs() >= ACTS) & (self.mode[l] == GUIDED);
            self.without_ms[l] = self.without_ms[l].wrapping_add(if acts { 1 } else { 0 });
            let is_asked = self.without_ms[l] >= ASKED_MS;
            self.asked_ms[l] = if is_asked {
                self.asked_ms[l].wrapping_add(1)
            } else {
                0
            };
            let is_over = (self.without_ms[l] >= HANDS_MS) | (self.asked_ms[l] > self.answer_ms[l]);
            self.suspect[l] |= flag(is_over) & self.matters[l] & Reason::HandsOff.bit();
        }
        if is_window_due {
            for l in 0..N {
                let is_due = own[l].wrapping_sub(self.anchor_step[l]) >= WINDOW_STEPS;
                self.anchor[l] = if is_due { self.applied[l] } else { self.anchor[l] };
                self.anchor_step[l] = if is_due { own[l] } else { self.anchor_step[l] };
            }
        }
        let mut wanted = [0; N];
        self.law(&mut wanted, own);
        let mut hands_over = 0;
        for l in 0..N {
            hands_over |= self.mode[l] & HANDOVER;
        }
        if hands_over != 0 {
            self.ramps(&mut wanted);
        }
        let mut is_guided = [0; N];
        for l in 0..N {
            is_guided[l] = flag(self.mode[l] == GUIDED);
        }
        self.probes.add(&is_guided, &mut wanted);
        let (mut torque, mut limited) = ([0; N], [0; N]);
        self.envelope(&wanted, &mut torque, &mut limited);
        self.probes.hold(&torque, &limited);
        if is_kept {
            let kept = &mut self.motion_history[self.kept % PAST];
            for l in 0..N {
                kept[l] = torque[l].wrapping_sub(self.probes.applied[l]);
            }
            self.kept = self.kept.wrapping_add(1);
        }
        for l in 0..N {
            // Toward zero.
            let rounded = (torque[l].wrapping_add((torque[l] >> 31) & (TORQUE_LSB - 1)) >> 12) << 12;
            let is_on = flag(self.mode[l] != OFF);
            self.applied[l] = rounded & is_on;
            self.limited[l] = limited[l] & is_on;
        }
        self.band
            .judge(&self.applied, &self.mode, &self.matters, &mut self.suspect);
    }

    /// Equation (9): the torque that it demands, and whether it needs more than 32 bits, where core saturates.
    #[inline(always)]
    fn demanded(&self, l: usize) -> (i32, bool) {
        let [on_e_y, on_e_y_rate, on_e_theta, on_e_theta_rate] = &self.gains;
        let now = |error: i32, rate: i32| {
            ((error >> 3).wrapping_add(1) >> 1).wrapping_add(per_second(rate, i64::from(self.age[l])))
        };
        let sum = term(on_e_y[l], now(self.e_y[l], self.e_y_rate[l]))
            .wrapping_add(term(on_e_y_rate[l], self.e_y_rate[l]))
            .wrapping_add(term(on_e_theta[l], now(self.e_theta[l], self.e_theta_rate[l])))
            .wrapping_add(term(on_e_theta_rate[l], self.e_theta_rate[l]));
        let rounded = sum.wrapping_add(1 << 19);
        let is_wide = (rounded.wrapping_add(1 << 51) as u64) >> 52 != 0;
        (((rounded as u64) >> 20) as i32, is_wide)
    }

    /// Its share.
    #[inline(always)]
    fn law(&mut self, wanted: &mut [i32; N], own: &[i32; N]) {
        let mut lost = [None; N];
        if self.has_coasts {
            for l in 0..N {
                lost[l] = self.extrapolate(l, own[l] as u32);
            }
        }
        for l in 0..N {
            let (demanded, is_wide) = self.demanded(l);
            self.suspect[l] |= flag(is_wide) & self.matters[l] & Reason::Law.bit();
            let shared = term(self.scheduled[l], demanded).wrapping_add(1 << 23);
            wanted[l] = ((shared as u64) >> 24) as i32;
        }
        if self.has_coasts {
            for l in 0..N {
                if let (Some(coast), Some(lost_ms)) = (&self.coasts[l], lost[l]) {
                    let (demanded, share) = coast.left(lost_ms, self.demanded(l).0, self.scheduled[l]);
                    let shared = term(share, demanded).wrapping_add(1 << 23);
                    wanted[l] = ((shared as u64) >> 24) as i32;
                }
            }
        }
        for age in &mut self.age {
            *age = age.wrapping_add(MS as i32);
        }
    }

    /// The torques of the handovers.
    #[cold]
    #[inline(never)]
    fn ramps(&mut self, wanted: &mut [i32; N]) {
        for (l, wanted) in wanted.iter_mut().enumerate() {
            if self.mode[l] != HANDOVER {
                continue;
            }
            if self.ramp_done[l] >= HANDOVER_MS && self.applied[l] == 0 {
                (self.mode[l], self.matters[l]) = (OFF, 0);
                continue;
            }
            // Where the driver pushes against it, three times as fast.
            let (applied, driver) = (self.applied[l], self.driver[l]);
            let is_opposed = ((applied > 0) & (driver < -OPPOSES)) | ((applied < 0) & (driver > OPPOSES));
            self.ramp_done[l] += if is_opposed { ramp::OPPOSED as i32 } else { 1 };
            let left = i64::from(HANDOVER_MS - self.ramp_done[l]).max(0) * 1000;
            let torque = i64::from(self.ramp_from[l]) * left / i64::from(HANDOVER_MS * 1000);
            *wanted = smaller_of_same_sign(torque as i32, self.applied[l]);
        }
    }

    /// The nearest torque within the limits, and whether one of them acted.
    #[inline(always)]
    fn envelope(&mut self, wanted: &[i32; N], torque: &mut [i32; N], limited: &mut [i32; N]) {
        for l in 0..N {
            let (limit, applied) = (self.limit[l], self.applied[l]);
            let mut is_limited = 0;
            let mut hold = |command: i32, low: i32, high: i32| {
                let held = command.max(low).min(high);
                is_limited |= held ^ command;
                held
            };
            let command = hold(wanted[l], limit.wrapping_neg(), limit);
            let window = self.anchor[l].wrapping_abs().wrapping_add(WINDOW_GROWTH);
            let command = hold(command, window.wrapping_neg(), window);
            // In the frame where the applied torque is positive.
            let mirror = applied >> 31;
            let turn = |torque: i32| (torque ^ mirror).wrapping_sub(mirror);
            let (growth, fall, size) = (self.growth[l], self.fall[l], applied.wrapping_abs());
            let turned = hold(turn(command), i32::MIN, size.wrapping_add(growth));
            let low = if size > fall {
                size.wrapping_sub(fall)
            } else {
                growth.wrapping_neg()
            };
            let command = turn(hold(turned, low, i32::MAX));
            let bound = |toward: i32| {
                let margin = toward.wrapping_add(OVERRIDE_FROM).min(0);
                limit.wrapping_add(margin.wrapping_mul(OVERRIDE_SLOPE)).max(0)
            };
            let driver = self.driver[l];
            let (low, high) = (bound(driver.wrapping_neg()).wrapping_neg(), bound(driver));
            let held = command.max(low).min(high);
            // A driver who overrides: the monitor has its own bound for that.
            self.suspect[l] |= flag(held != command) & self.matters[l] & Reason::Override.bit();
            torque[l] = held;
            limited[l] = is_limited;
        }
    }
}

#[inline(always)]
fn term(gain: i32, value: i32) -> i64 {
    i64::from(gain).wrapping_mul(i64::from(value))
}

/// Share of the torque at a speed.
fn scheduled(p: &Params, speed: i32) -> i32 {
    let middle = 60.0 / 3.6;
    let slower = speed < bits(middle);
    let (per, least) = if slower {
        (
            (1.0 - p.low_speed_share) / (middle - schedule::SLOW_M_PER_S),
            p.low_speed_share,
        )
    } else {
        (
            (1.0 - p.high_speed_share) / (schedule::FAST_M_PER_S - middle),
            p.high_speed_share,
        )
    };
    let away = (speed - bits(middle)).abs();
    let taken = (i64::from(bits(per)) * i64::from(away) + (1 << 23)) >> 24;
    ((1_i64 << 24) - taken)
        .clamp(i64::from(i32::MIN), i64::from(i32::MAX))
        .max(i64::from(bits(least))) as i32
}

fn smaller_of_same_sign(a: i32, b: i32) -> i32 {
    if (a > 0) != (b > 0) {
        0
    } else if a.abs() < b.abs() {
        a
    } else {
        b
    }
}
