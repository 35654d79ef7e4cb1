//! Sums of one signal, gathered sample by sample in one pass.

/// What one signal leaves behind: enough for its mean, spread, effective value and peak.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moments {
    sum: f64,
    sum_abs: f64,
    sum_of_squares: f64,
    peak_abs: f64,
}

impl Moments {
    pub(super) fn add(&mut self, x: f64) {
        self.sum += x;
        self.sum_abs += x.abs();
        self.sum_of_squares += x * x;
        self.peak_abs = self.peak_abs.max(x.abs());
    }

    pub(super) fn sum_abs(&self) -> f64 {
        self.sum_abs
    }

    pub(super) fn sum_of_squares(&self) -> f64 {
        self.sum_of_squares
    }

    pub(super) fn peak_abs(&self) -> f64 {
        self.peak_abs
    }

    pub(super) fn mean_abs(&self, count: f64) -> f64 {
        self.sum_abs / count
    }

    pub(super) fn rms(&self, count: f64) -> f64 {
        (self.sum_of_squares / count).sqrt()
    }

    /// Divisor N. The difference of sums costs about 1e-8 of the largest value, far below any signal here.
    pub(super) fn standard_deviation(&self, count: f64) -> f64 {
        let mean = self.sum / count;
        (self.sum_of_squares / count - mean * mean).max(0.0).sqrt()
    }
}
