//! How many runs were driven side by side, and why the others were not.

use std::sync::atomic::{AtomicU64, Ordering};

use haptic_vectorised::Reason;

/// Runs since the program began that were driven side by side, and behind them those that were rejected, by reason.
static COUNTS: [AtomicU64; 1 + Reason::ALL.len()] = [const { AtomicU64::new(0) }; 1 + Reason::ALL.len()];

pub(super) fn count(rejected: Option<Reason>) {
    let place = rejected.map_or(0, |reason| 1 + reason as usize);
    COUNTS[place].fetch_add(1, Ordering::Relaxed);
}

/// How many runs since the program began were driven side by side, and why the others were not; `None` if there was none.
#[must_use]
pub fn shares() -> Option<String> {
    let counts = COUNTS.each_ref().map(|count| count.load(Ordering::Relaxed));
    said(&counts)
}

fn said(counts: &[u64]) -> Option<String> {
    let all: u64 = counts.iter().sum();
    let (driven, rejected) = counts.split_first().filter(|_| all > 0)?;
    let percent = |count: u64| format!("{:.1} %", 100.0 * count as f64 / all as f64);
    let mut said = format!("{} of {all} runs", percent(*driven));
    let mut reasons: Vec<_> = rejected
        .iter()
        .zip(Reason::ALL)
        .filter(|(count, _)| **count > 0)
        .collect();
    reasons.sort_by_key(|(count, _)| std::cmp::Reverse(**count));
    for (place, (count, (_, text))) in reasons.into_iter().enumerate() {
        let before = if place == 0 { "; rejected: " } else { ", " };
        said += &format!("{before}{} {text}", percent(*count));
    }
    Some(said)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_name_the_commonest_reason_first() {
        let mut counts = [0; 1 + Reason::ALL.len()];
        assert_eq!(said(&counts), None);
        counts[0] = 6;
        (
            counts[1 + Reason::HandsOff as usize],
            counts[1 + Reason::Camera as usize],
        ) = (1, 3);
        let expected = "60.0 % of 10 runs; rejected: 30.0 % a camera that is late, blind at times, or on another line, \
                        10.0 % no hand at the wheel";
        assert_eq!(said(&counts).as_deref(), Some(expected));
    }
}
