//! Clocks that were set during a drive: a logger that gets the date, or one that was asleep for a day.
//!
//! A log lies on an even grid, and gaps are rows without a number. How many there may be does not depend on what a time
//! stamp says: where gaps would leave more rows empty than [`MOST_EMPTY_ROWS`], the longest of them is a jump. The record is
//! used up to it or from it on, if the stretches asked for lie on one side of it; else it is refused.

use std::ops::Range;

use haptic_log::recording::Lines;

use super::{LogError, refuse};

/// Rows that the gaps of a log may leave empty, all together: 2.3 hours at 120 Hz.
const MOST_EMPTY_ROWS: f64 = 1e6;

/// A place where the clock was set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Jump {
    /// The row before it.
    pub row: usize,
    pub before_s: f64,
    pub after_s: f64,
}

/// The longest of these gaps of rising stamps with usually `step_s` between them, if the gaps leave too many rows empty.
pub(crate) fn jump(gaps: impl Iterator<Item = Jump> + Clone, step_s: f64) -> Option<Jump> {
    let length_s = |gap: &Jump| gap.after_s - gap.before_s;
    let empty: f64 = gaps
        .clone()
        // Up to a step and a half it is no gap, as on the grid.
        .map(|gap| (length_s(&gap) / step_s - 1.5).max(0.0))
        .sum();
    if empty <= MOST_EMPTY_ROWS {
        return None;
    }
    gaps.max_by(|a, b| length_s(a).total_cmp(&length_s(b)))
}

impl Jump {
    /// Whether what lies after the jump is used rather than what lies before it; `stretches` are of a time that counts from
    /// `zero_s`, and all of the record if there is none.
    ///
    /// # Errors
    /// Stretches on both sides; the text says where.
    pub(crate) fn use_after(
        &self,
        place: &str,
        zero_s: f64,
        stretches: &[(f64, f64)],
    ) -> Result<bool, LogError> {
        let [before_s, after_s] = [self.before_s - zero_s, self.after_s - zero_s];
        let before = stretches.iter().any(|(from, _)| *from <= before_s);
        let after = stretches.iter().any(|(_, to)| *to >= after_s);
        if before != after {
            return Ok(after);
        }
        refuse(format!(
            "{place}: the time goes from {} to {} s: a clock that was set, or a logger that slept; use one side of it, with \
             --to {before_s} or --from {after_s} (between_s in Python), or cut the file there",
            self.before_s, self.after_s
        ))
    }
}

/// The rows of a table that are used.
///
/// # Errors
/// As [`Jump::use_after`]; the place is the line of the row after the jump.
pub(super) fn usable(
    time_s: &[f64],
    lines: &Lines,
    step_s: f64,
    stretches: &[(f64, f64)],
) -> Result<Range<usize>, LogError> {
    let mut rows = 0..time_s.len();
    let gap = |row| Jump {
        row,
        before_s: time_s[row],
        after_s: time_s[row + 1],
    };
    // A gap lies behind each row but the last; of no rows there is none.
    while let Some(jump) = jump((rows.start..rows.end.max(1) - 1).map(gap), step_s) {
        let next = jump.row + 1;
        if jump.use_after(&lines.place(next), 0.0, stretches)? {
            rows.start = next;
        } else {
            rows.end = next;
        }
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use crate::log::{COLUMNS, DriveLog};

    /// 25 s at 100 Hz; the clock is set by so much after row 1199.
    fn text(set_by: f64) -> String {
        let row = |k: u32| {
            let time_s = f64::from(k) / 100.0 + if k < 1200 { 0.0 } else { set_by };
            format!("\n{time_s},{},0,{},0,0.{}", e_y_m(k), 1e-3 * f64::from(k), k % 2)
        };
        COLUMNS.join(",") + &(0..2500).map(row).collect::<String>()
    }

    fn e_y_m(k: u32) -> f64 {
        1e-3 * f64::from(k % 7)
    }

    /// By a day or to the date: what no stretch decides is refused with the line of row 1200, and one side is read as if it were
    /// the file.
    #[test]
    fn a_clock_that_was_set_is_refused_or_cut_at_its_line() {
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        for set_by in [86_400.0, 1.7e9, 1e12] {
            let text = text(set_by);
            let within = |stretches: &[_]| DriveLog::read_within(text.as_bytes(), false, stretches);
            for stretches in [&[][..], &[(0.0, 5.0), (set_by + 1.0, all.1)], &[all]] {
                let e = within(stretches).unwrap_err().to_string();
                let says = format!("line 1202: the time goes from 11.99 to {} s", 12.0 + set_by);
                assert!(e.starts_with(&says) && e.contains("--to 11.99 or --from"), "{e}");
            }
            let before = within(&[(1.0, 3.0), (5.0, 11.0)]).unwrap();
            assert!(
                before.len() == 1200 && before.start_s.abs() < 1e-9,
                "{}",
                before.start_s
            );
            assert_eq!(before.e_y_m[1199], e_y_m(1199));
            if set_by < 1e12 {
                let after = within(&[(set_by, all.1)]).unwrap();
                assert!((after.start_s - set_by - 12.0).abs() < 1e-6, "{}", after.start_s);
                assert_eq!((after.len(), after.e_y_m[0]), (1300, e_y_m(1200)));
            }
        }
        // A quarter of an hour is a pause.
        let log = DriveLog::read(text(900.0).as_bytes(), false).unwrap();
        assert_eq!(log.len(), 2500 + 90_000);
    }
}
