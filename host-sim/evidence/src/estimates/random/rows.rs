//! The rows of a recording while it is spoilt.

use std::fmt::Write as _;

use haptic_analysis::identify::{COLUMNS, DriveLog, LogError};
use rand::RngExt;
use rand::rngs::Xoshiro256PlusPlus;

/// Places of the signals behind the time.
pub(super) const E_Y: usize = 0;
pub(super) const E_THETA: usize = 1;
pub(super) const PHI: usize = 2;
pub(super) const T_H: usize = 3;
pub(super) const T_D: usize = 4;

/// Nothing that lasts happens within so long of an end, s.
const MARGIN_S: f64 = 8.0;

/// A recording as a table: stamps, and the signals in the order of a log.
#[derive(Debug, Clone)]
pub(super) struct Rows {
    pub(super) time_s: Vec<f64>,
    pub(super) signals: [Vec<f64>; 5],
}

impl Rows {
    pub(super) fn new(log: &DriveLog) -> Self {
        Self {
            time_s: (0..log.len()).map(|k| log.time_s(k)).collect(),
            signals: log.signals().map(Clone::clone),
        }
    }

    /// The log that these rows are read as.
    ///
    /// # Errors
    /// What the reader refuses.
    pub(super) fn log(self, manual: bool) -> Result<DriveLog, LogError> {
        let [a, b, c, d, e] = self.signals;
        DriveLog::from_columns([self.time_s, a, b, c, d, e], manual)
    }

    /// The file of a log; a value that is missing is left empty.
    pub(super) fn to_csv(&self) -> String {
        let mut text = COLUMNS.join(",") + "\n";
        for (k, time_s) in self.time_s.iter().enumerate() {
            let _ = write!(text, "{time_s:.6}");
            for signal in &self.signals {
                let _ = match signal[k] {
                    x if x.is_finite() => write!(text, ",{x:.9}"),
                    _ => write!(text, ","),
                };
            }
            text.push('\n');
        }
        text
    }

    pub(super) fn len(&self) -> usize {
        self.time_s.len()
    }

    fn dt_s(&self) -> f64 {
        (self.time_s[self.len() - 1] - self.time_s[0]) / (self.len() - 1) as f64
    }

    /// So many seconds in rows.
    pub(super) fn in_rows(&self, seconds: f64) -> f64 {
        seconds / self.dt_s()
    }

    /// Some rows that last so long, s; the whole record where it is shorter.
    pub(super) fn somewhere(&self, seconds: f64, random: &mut Xoshiro256PlusPlus) -> std::ops::Range<usize> {
        let [margin, rows] = [MARGIN_S, seconds].map(|s| self.in_rows(s).ceil() as usize);
        let last = self.len().saturating_sub(margin + rows);
        if last <= margin {
            return 0..self.len();
        }
        let from = random.random_range(margin..last);
        from..from + rows
    }

    /// Rounds a signal to whole steps.
    pub(super) fn round(&mut self, signal: usize, step: f64) {
        for x in &mut self.signals[signal] {
            *x = (*x / step).round() * step;
        }
    }

    pub(super) fn scale(&mut self, signal: usize, factor: f64) {
        self.signals[signal].iter_mut().for_each(|x| *x *= factor);
    }

    pub(super) fn shift(&mut self, signal: usize, offset: f64) {
        self.signals[signal].iter_mut().for_each(|x| *x += offset);
    }

    /// A first-order lag of a signal.
    pub(super) fn lag(&mut self, signal: usize, lag_s: f64) {
        let share = 1.0 - (-self.dt_s() / lag_s).exp();
        let mut y = self.signals[signal][0];
        for x in &mut self.signals[signal] {
            y += share * (*x - y);
            *x = y;
        }
    }

    /// Keeps the rows of which `keep` says so.
    pub(super) fn retain(&mut self, mut keep: impl FnMut(usize) -> bool) {
        let kept: Vec<bool> = (0..self.len()).map(&mut keep).collect();
        for column in self.signals.iter_mut().chain([&mut self.time_s]) {
            let mut kept = kept.iter();
            column.retain(|_| kept.next().copied().unwrap_or(false));
        }
    }

    /// The car stands for so long, s, with the wheel askew: rows are put in, and what comes behind is as much later.
    pub(super) fn stand(&mut self, seconds: f64, random: &mut Xoshiro256PlusPlus) {
        let k = self.somewhere(0.0, random).start;
        let rows = self.in_rows(seconds) as usize;
        let dt_s = self.dt_s();
        let still = [self.signals[E_Y][k], self.signals[E_THETA][k], 0.3, 0.0, 0.0];
        for (signal, value) in self.signals.iter_mut().zip(still) {
            drop(signal.splice(k..k, std::iter::repeat_n(value, rows)));
        }
        let begin_s = self.time_s[0];
        self.time_s = (0..self.signals[T_D].len())
            .map(|k| begin_s + k as f64 * dt_s)
            .collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    fn rows() -> Rows {
        let count = 6000;
        Rows {
            time_s: (0..count).map(|k| f64::from(k) / 100.0).collect(),
            signals: [1.0, 2.0, 3.0, 4.0, 5.0].map(|x| (0..count).map(|k| x + f64::from(k)).collect()),
        }
    }

    #[test]
    fn columns_stay_beside_each_other() {
        let mut rows = rows();
        rows.retain(|k| k % 3 == 1);
        assert_eq!(rows.len(), 2000);
        for k in [0, 700, 1999] {
            let row = (3 * k + 1) as f64;
            assert_eq!(rows.time_s[k], row / 100.0);
            assert_eq!(
                [rows.signals[E_Y][k], rows.signals[T_D][k]],
                [1.0 + row, 5.0 + row]
            );
        }
    }

    /// 5 s at 100 rows a second: 500 rows more in each column, and stamps that go on evenly.
    #[test]
    fn a_stop_makes_the_record_longer() {
        let (mut rows, mut random) = (rows(), Xoshiro256PlusPlus::seed_from_u64(1));
        rows.stand(5.0, &mut random);
        assert_eq!(rows.len(), 6500);
        assert!(rows.signals.iter().all(|s| s.len() == 6500));
        assert!((rows.time_s[6499] - 64.99).abs() < 1e-9);
        assert_eq!(rows.signals[PHI].iter().filter(|x| **x == 0.3).count(), 500);
    }
}
