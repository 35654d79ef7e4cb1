//! From when to when the signals of a trace go, how they pause, and which side of a clock that was set is used: what a first
//! reading keeps.

use std::ops::RangeInclusive;

use super::heard::Value;
use super::{ALWAYS, LONGEST_PAUSE_S, NEEDED, RATE_HZ, SLOWEST_M_PER_S, SPEED};
use crate::log::jumps::{Jump, jump};
use crate::log::{LogError, refuse};

/// Shorter gaps are no clock that was set, s: where they fill hours there are many of them.
const SHORTEST_JUMP_S: f64 = 60.0;

/// What is known of a signal.
pub(super) struct Course {
    count: usize,
    pub(super) first_s: f64,
    last_s: f64,
    sum: f64,
    /// The least and the largest value.
    pub(super) range: [f64; 2],
    pauses: usize,
    longest_s: f64,
    /// Line behind the first pause.
    line: u32,
}

impl Default for Course {
    fn default() -> Self {
        Self {
            count: 0,
            first_s: f64::INFINITY,
            last_s: f64::NEG_INFINITY,
            sum: 0.0,
            range: [f64::INFINITY, f64::NEG_INFINITY],
            pauses: 0,
            longest_s: 0.0,
            line: 0,
        }
    }
}

/// A time in which no signal has a value.
struct Gap {
    before_s: f64,
    after_s: f64,
    /// Where it ends.
    line: u32,
}

/// What is known of all signals.
pub(super) struct Survey {
    /// At the places of [`NEEDED`].
    pub(super) courses: [Course; 8],
    /// Times without a value that are longer than a row of the grid and a half, in their order.
    gaps: Vec<Gap>,
    latest_s: f64,
}

impl Default for Survey {
    fn default() -> Self {
        Self {
            courses: Default::default(),
            gaps: Vec::new(),
            latest_s: f64::NAN,
        }
    }
}

impl Survey {
    /// Takes the next value.
    pub(super) fn take(&mut self, value: &Value) {
        let time_s = value.time_s;
        self.courses[value.signal].take(value);
        // The speed is held where the others pause, and must not fill their gap.
        if value.signal == SPEED {
            return;
        }
        if (time_s - self.latest_s) * RATE_HZ > 1.5 {
            self.gaps.push(Gap {
                before_s: self.latest_s,
                after_s: time_s,
                line: value.line,
            });
        }
        self.latest_s = self.latest_s.max(time_s);
    }

    /// When the last of these signals begins.
    pub(super) fn begin(&self, places: &[usize]) -> Result<f64, LogError> {
        if let Some(&place) = places.iter().find(|&&place| self.courses[place].count < 2) {
            return no_frame(NEEDED[place]);
        }
        let starts_s = places.iter().map(|&place| self.courses[place].first_s);
        Ok(starts_s.fold(f64::NEG_INFINITY, f64::max))
    }

    /// When the first of these signals ends.
    pub(super) fn end(&self, places: &[usize]) -> f64 {
        let ends_s = places.iter().map(|&place| self.courses[place].last_s);
        ends_s.fold(f64::INFINITY, f64::min)
    }

    /// From when to when the signals are used: to a jump of the clock, or from it on.
    pub(super) fn used(
        &self,
        zero_s: f64,
        stretches: &[(f64, f64)],
    ) -> Result<RangeInclusive<f64>, LogError> {
        let (mut from_s, mut to_s) = ALWAYS.into_inner();
        let mut gaps = &self.gaps[..];
        let of = |(row, gap): (usize, &Gap)| Jump {
            row,
            before_s: gap.before_s,
            after_s: gap.after_s,
        };
        while let Some(jump) = jump(gaps.iter().enumerate().map(of), 1.0 / RATE_HZ) {
            let place = format!("line {}", gaps[jump.row].line);
            let longest_s = jump.after_s - jump.before_s;
            if longest_s < SHORTEST_JUMP_S {
                return refuse(format!(
                    "{place}: the signals pause {} times, by {longest_s:.3} s at most: too slow for an identification, or time stamps \
                     in another unit than s",
                    gaps.len()
                ));
            }
            if jump.use_after(&place, zero_s, stretches)? {
                from_s = jump.after_s;
                gaps = &gaps[jump.row + 1..];
            } else {
                to_s = jump.before_s;
                gaps = &gaps[..jump.row];
            }
        }
        Ok(from_s..=to_s)
    }
}

impl Course {
    fn take(&mut self, value: &Value) {
        let pause_s = value.time_s - self.last_s;
        if self.count > 0 && pause_s > LONGEST_PAUSE_S {
            self.pauses += 1;
            self.longest_s = self.longest_s.max(pause_s);
            if self.pauses == 1 {
                self.line = value.line;
            }
        }
        self.count += 1;
        self.first_s = self.first_s.min(value.time_s);
        self.last_s = value.time_s;
        self.sum += value.value;
        let [least, most] = self.range;
        self.range = [least.min(value.value), most.max(value.value)];
    }

    /// How often the signal pauses, in words.
    pub(super) fn pauses(&self, name: &str) -> Option<[String; 3]> {
        let plural = if self.pauses == 1 { "" } else { "s" };
        (self.pauses > 0).then(|| {
            [
                name.to_owned(),
                format!(
                    "{} pause{plural}, the longest of {:.3} s, the first before line {}",
                    self.pauses, self.longest_s, self.line
                ),
                "bridged if short, else cut".to_owned(),
            ]
        })
    }

    /// # Errors
    /// It is no speed at which there is guidance, in the mean.
    pub(super) fn check_speed(&self, name: &str) -> Result<(), LogError> {
        if self.count == 0 {
            return no_frame(name);
        }
        let mean = self.sum / self.count as f64;
        if mean < SLOWEST_M_PER_S {
            return refuse(format!(
                "{name} is {mean:.2} m/s in the mean, below {SLOWEST_M_PER_S}: there is no guidance"
            ));
        }
        Ok(())
    }
}

fn no_frame<T>(name: &str) -> Result<T, LogError> {
    refuse(format!("no frame of {name} can be used"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A signal every 20 s for hours: its pauses are counted, and no clock was set.
    #[test]
    fn a_trace_that_pauses_all_the_time_is_too_slow() {
        let mut survey = Survey::default();
        for k in 0..1000_u32 {
            survey.take(&Value {
                line: k + 1,
                time_s: 20.0 * f64::from(k),
                signal: 0,
                value: 0.0,
            });
        }
        let error = survey.used(0.0, &[]).unwrap_err().to_string();
        let says = "the signals pause 999 times, by 20.000 s at most: too slow for an identification";
        assert!(error.contains(says), "{error}");
    }
}
