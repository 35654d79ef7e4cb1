//! Hands on the wheel: the ECU's own criterion ([`haptic_core::safety::hands`]) on every second of recordings that say who steers.
//!
//! Nothing says where the hands are. Driving by hand is a hand on the wheel for certain; shared driving is not known, and holds hands
//! too. So "false" here is "felt in shared driving": the area under the curve is how well the criterion tells the two kinds of
//! driving apart, not hands from none.

use haptic_core::quantity::{Micros, Torque};
use haptic_core::safety::envelope::OVERRIDE_FROM;
use haptic_core::safety::hands::{ACTS, HandsState};
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};
use serde::Serialize;

use super::fed::{Fed, together};
use super::rows::Rows;

/// Thresholds that are tried, each 2^(1/4) times the last one; which of them is the ECU's own.
const TRIED: usize = 37;
const OWN: usize = 12;
/// Draws of the recordings for the interval of the area, and their seed.
const DRAWS: usize = 2000;
const SEED: u64 = 26;
/// Pushes against the guidance of up to so many seconds are bumps or taps, and of up to so many short.
const PUSHES_S: [f64; 2] = [0.25, 1.05];

/// Seconds of a recording in which a hand was felt, by hand and shared.
pub(super) struct Felt {
    seconds: [usize; 2],
    /// By threshold.
    felt: [[usize; 2]; TRIED],
    /// Pushes against the guidance, by length.
    pushes: [usize; 3],
    /// The longest shared time without a hand by the ECU's threshold, s.
    longest_s: f64,
}

impl Felt {
    pub(super) fn new(rows: &Rows) -> Self {
        let mut found = Self {
            seconds: [0; 2],
            felt: [[0; 2]; TRIED],
            pushes: [0; 3],
            longest_s: 0.0,
        };
        for stretch in rows.stretches() {
            let time_s = &rows.time_s[stretch.clone()];
            let driver_nm = &rows.driver_nm[stretch.clone()];
            let part = usize::from(rows.shared[stretch.start]);
            let second = |k: usize| (time_s[k] - time_s[0]) as usize;
            // The last second is whole if the stretch goes on to its end.
            let whole = second(time_s.len() - 1);
            found.seconds[part] += whole;
            for (threshold, felt) in found.felt.iter_mut().enumerate() {
                let mut is_felt = vec![false; whole + 1];
                let (mut hands, mut last_s) = (HandsState::NEW, time_s[0]);
                for (k, torque) in driver_nm.iter().enumerate() {
                    // Whether the time goes back to zero is all that is asked, so one microsecond does.
                    hands.add_guided_time(ACTS, Micros::from_us(1));
                    // The ECU's thresholds are constants: a smaller torque stands for a larger threshold.
                    hands.update(Torque::from_nm(torque / factor(threshold)), Torque::ZERO);
                    if part == 1 && threshold == OWN {
                        found.longest_s = found.longest_s.max(time_s[k] - last_s);
                    }
                    if hands.time_hands_off().us() == 0 {
                        // The first row has none to compare it with.
                        is_felt[second(k)] |= k > 0;
                        last_s = time_s[k];
                    }
                }
                felt[part] += is_felt[..whole].iter().filter(|felt| **felt).count();
            }
            let opposes = |k: &usize| {
                rows.driver_nm[*k] * rows.guidance_nm[*k] < 0.0
                    && rows.driver_nm[*k].abs() > OVERRIDE_FROM.nm()
            };
            let all: Vec<usize> = stretch.collect();
            for push in all
                .chunk_by(|a, b| opposes(a) == opposes(b))
                .filter(|push| opposes(&push[0]))
            {
                let after = (push[push.len() - 1] + 1).min(rows.time_s.len() - 1);
                let lasts_s = rows.time_s[after] - rows.time_s[push[0]];
                found.pushes[PUSHES_S.iter().filter(|s| lasts_s > **s).count()] += 1;
            }
        }
        found
    }
}

/// What a threshold is of the ECU's.
fn factor(threshold: usize) -> f64 {
    ((threshold as f64 - OWN as f64) / 4.0).exp2()
}

/// What recordings say of hands.
#[derive(Debug, Clone, Serialize)]
pub struct Hands {
    /// Recordings.
    pub recordings: usize,
    /// Whole seconds by hand, and shared.
    pub seconds: [usize; 2],
    /// By threshold, the lowest first.
    pub curve: Vec<Threshold>,
    /// The area under the curve, and its 95 % interval: of recordings drawn with replacement.
    pub area: f64,
    /// The interval.
    pub area_95: [f64; 2],
    /// The longest shared time in which no hand is felt by the ECU's threshold, s.
    pub longest_s: f64,
    /// Pushes of more than 0.8 N.m against the guidance: up to 0.2 s, up to 1 s, longer.
    pub pushes: [usize; 3],
    /// What the ECU did with them.
    pub feeds: Vec<Fed>,
}

impl Hands {
    /// At the ECU's own threshold.
    #[must_use]
    pub fn own(&self) -> &Threshold {
        &self.curve[OWN]
    }
}

/// A threshold of the criterion.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Threshold {
    /// Times the ECU's.
    pub factor: f64,
    /// The share of seconds by hand, and shared, in which a hand is felt.
    pub felt: [f64; 2],
}

impl Hands {
    /// Judges all recordings; none if there is none.
    pub(super) fn new(found: &[&(Felt, Vec<Fed>)]) -> Option<Self> {
        let felt: Vec<&Felt> = found.iter().map(|(felt, _)| felt).collect();
        let (seconds, shares) = shares(&felt)?;
        let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
        let mut areas: Vec<f64> = (0..DRAWS)
            .filter_map(|_| {
                let drawn: Vec<&Felt> = felt
                    .iter()
                    .map(|_| felt[random.random_range(0..felt.len())])
                    .collect();
                Some(area(&self::shares(&drawn)?.1))
            })
            .collect();
        areas.sort_by(f64::total_cmp);
        let quantile = |share: f64| areas[(share * (areas.len() - 1) as f64).round() as usize];
        let threshold = |(k, felt): (usize, &[f64; 2])| Threshold {
            factor: factor(k),
            felt: *felt,
        };
        Some(Self {
            recordings: felt.len(),
            seconds,
            curve: shares.iter().enumerate().map(threshold).collect(),
            area: area(&shares),
            area_95: [quantile(0.025), quantile(0.975)],
            longest_s: felt.iter().map(|felt| felt.longest_s).fold(0.0, f64::max),
            pushes: std::array::from_fn(|k| felt.iter().map(|felt| felt.pushes[k]).sum()),
            feeds: together(found.iter().map(|(_, fed)| fed.as_slice())),
        })
    }
}

/// Seconds, and the share of them in which a hand is felt by threshold; none where one kind of driving is missing.
fn shares(felt: &[&Felt]) -> Option<([usize; 2], [[f64; 2]; TRIED])> {
    let sum = |of: &dyn Fn(&Felt) -> usize| felt.iter().map(|felt| of(felt)).sum::<usize>();
    let seconds = [0, 1].map(|part| sum(&|felt| felt.seconds[part]));
    let share = |k: usize, part: usize| sum(&|felt| felt.felt[k][part]) as f64 / seconds[part] as f64;
    let shares = std::array::from_fn(|k| [0, 1].map(|part| share(k, part)));
    (!seconds.contains(&0)).then_some((seconds, shares))
}

/// The area under the curve of the first share over the second, from the lowest threshold on.
pub(super) fn area(shares: &[[f64; 2]]) -> f64 {
    let ends = |k: usize| match k.checked_sub(1) {
        None => [1.0; 2],
        Some(k) => shares.get(k).copied().unwrap_or([0.0; 2]),
    };
    let strip = |k: usize| {
        let ([hand, shared], [next_hand, next_shared]) = (ends(k), ends(k + 1));
        0.5 * (hand + next_hand) * (shared - next_shared)
    };
    (0..=shares.len()).map(strip).sum()
}
