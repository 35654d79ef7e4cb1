//! Figures of some values, and intervals that hold what is estimated as often as a level says.

use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal, StudentsT};

use crate::error::StudyError;
use haptic_sim::input::in_range;
use haptic_sim::share::{Z_95, wilson_of};

/// The mean; none of none.
pub fn mean(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut count = 0_usize;
    let sum: f64 = values.into_iter().inspect(|_| count += 1).sum();
    (count > 0).then(|| sum / count as f64)
}

/// Root of the mean square; none of none.
pub fn rms(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    mean(values.into_iter().map(|value| value * value)).map(f64::sqrt)
}

/// The smallest and the largest value.
pub fn extent(values: impl IntoIterator<Item = f64>) -> [f64; 2] {
    let none = [f64::INFINITY, f64::NEG_INFINITY];
    let values = values.into_iter();
    values.fold(none, |[low, high], value| [low.min(value), high.max(value)])
}

/// How often an interval holds what is estimated.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct Confidence(f64);

impl Default for Confidence {
    fn default() -> Self {
        Self::USUAL
    }
}

/// In percent, as words have it: `95`, `99.9`.
impl std::fmt::Display for Confidence {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // Twelve digits, so that 0.999 is no 99.90000000000001 %.
        write!(f, "{}", (1e14 * self.0).round() / 1e12)
    }
}

impl std::str::FromStr for Confidence {
    type Err = StudyError;

    fn from_str(text: &str) -> Result<Self, StudyError> {
        let share = text
            .parse()
            .map_err(|_| format!("{text:?} is no number, such as 0.99"))?;
        Self::new(share)
    }
}

impl Confidence {
    /// 95 %.
    pub const USUAL: Self = Self(0.95);

    /// A share of 0.5 to 0.9999.
    ///
    /// # Errors
    /// A share outside.
    pub fn new(share: f64) -> Result<Self, StudyError> {
        in_range("level", share, 0.5..=0.9999, "")?;
        Ok(Self(share))
    }

    /// The share.
    #[must_use]
    pub fn share(self) -> f64 {
        self.0
    }

    /// What is left out at the upper end, seen from below: 0.975 of 95 %.
    pub fn upper(self) -> f64 {
        0.5 + 0.5 * self.0
    }

    /// What is left out at the lower end: 0.025 of 95 %, and no 0.02500000000000002.
    pub fn lower(self) -> f64 {
        (1e12 * (1.0 - self.upper())).round() / 1e12
    }

    /// The level at which several intervals hold all that they are of as often as one of this level holds its own (Bonferroni), to four
    /// digits.
    pub fn of_several(self, count: usize) -> Self {
        let outside = (1.0 - self.0) / count.max(1) as f64;
        // Rounded up, so as to hold rather too often; 0.9999 is the largest level there is.
        Self((1e4 * (1.0 - outside)).ceil().min(9999.0) / 1e4)
    }

    /// How many standard deviations an interval of a normal distribution reaches.
    #[must_use]
    pub fn normal(self) -> f64 {
        // The digits of tables, to the last bit as the campaign has them.
        if self.0 == 0.95 {
            return Z_95;
        }
        Normal::standard().inverse_cdf(self.upper())
    }

    /// How many standard deviations an interval of Student's distribution reaches with so many degrees of freedom; infinite with none.
    pub fn student(self, freedom: f64) -> f64 {
        student(self.upper(), freedom)
    }

    /// Name of an interval's field in JSON: `interval_95`.
    #[must_use]
    pub fn field(self) -> String {
        format!("interval_{self}")
    }

    /// Whether it is 95 %, of which JSON says nothing more.
    #[must_use]
    pub fn is_usual(&self) -> bool {
        *self == Self::USUAL
    }
}

impl Serialize for Confidence {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}

/// An interval of a level, whose field in JSON has the level in its name: `interval_95`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Held {
    name: &'static str,
    level: Confidence,
    /// Its ends.
    pub ends: [f64; 2],
}

impl Held {
    /// An interval of a level, whose field in JSON begins with `name`.
    pub fn new(name: &'static str, level: Confidence, ends: [f64; 2]) -> Self {
        Self { name, level, ends }
    }
}

impl Serialize for Held {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut fields = serializer.serialize_map(Some(1))?;
        fields.serialize_entry(&format!("{}_{}", self.name, self.level), &self.ends)?;
        fields.end()
    }
}

/// The value below which a share of Student's distribution lies; infinite without a degree of freedom.
pub fn student(share: f64, freedom: f64) -> f64 {
    StudentsT::new(0.0, 1.0, freedom).map_or(f64::INFINITY, |law| law.inverse_cdf(share))
}

/// A mean with its interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mean {
    /// The mean.
    pub mean: f64,
    /// Student's interval of it; none of a single value.
    pub interval: Option<[f64; 2]>,
    /// How often such an interval holds the mean of all.
    pub level: Confidence,
}

impl Mean {
    /// The mean of values that are independent of each other; none of none.
    #[must_use]
    pub fn new(values: &[f64], level: Confidence) -> Option<Self> {
        let mean = mean(values.iter().copied())?;
        let interval = deviation(values, mean).map(|deviation| {
            let freedom = values.len() as f64 - 1.0;
            let margin = level.student(freedom) * deviation / (freedom + 1.0).sqrt();
            [mean - margin, mean + margin]
        });
        Some(Self {
            mean,
            interval,
            level,
        })
    }

    /// The interval's ends; of a single value, itself.
    #[must_use]
    pub fn ends(&self) -> [f64; 2] {
        self.interval.unwrap_or([self.mean; 2])
    }

    /// A figure that is no mean of the draws' own, with Tukey's interval from the figures that are left without each draw in turn; none of
    /// fewer than two.
    pub fn tukey(whole: f64, left: &[f64], level: Confidence) -> Self {
        let others = left.len() as f64 - 1.0;
        let pseudo: Vec<f64> = left.iter().map(|left| whole + others * (whole - left)).collect();
        // The mean of the pseudo-values is corrected for bias; the interval lies about the figure that is shown.
        let centred = |[low, high]: [f64; 2]| {
            let half = 0.5 * (high - low);
            [whole - half, whole + half]
        };
        let found = Self::new(&pseudo, level).and_then(|found| found.interval);
        Self {
            mean: whole,
            interval: found.map(centred),
            level,
        }
    }
}

/// How probable a mean as far from zero as that of these values is, where the mean of all is zero: Student's test of pairs, both sides.
/// None of fewer than two values, or where nothing scatters.
pub fn p_of_zero(values: &[f64]) -> Option<f64> {
    let mean = mean(values.iter().copied())?;
    let deviation = deviation(values, mean).filter(|deviation| *deviation > 0.0)?;
    let count = values.len() as f64;
    let law = StudentsT::new(0.0, 1.0, count - 1.0).ok()?;
    Some(2.0 * law.sf(mean.abs() * count.sqrt() / deviation))
}

/// The mean with half its interval, if it has one.
impl std::fmt::Display for Mean {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.3}", self.mean)?;
        let Some([low, high]) = self.interval else {
            return Ok(());
        };
        write!(f, " \u{b1} {:.3}", 0.5 * (high - low))
    }
}

/// Two fields, whose second has the level in its name.
impl Serialize for Mean {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut fields = serializer.serialize_map(Some(2))?;
        fields.serialize_entry("mean", &self.mean)?;
        fields.serialize_entry(&self.level.field(), &self.interval)?;
        fields.end()
    }
}

/// Standard deviation about their mean, divisor n - 1; none of fewer than two. Equal values have none at all, though their mean is rounded.
pub fn deviation(values: &[f64], mean: f64) -> Option<f64> {
    let freedom = values.len() as f64 - 1.0;
    let mean = match values {
        [first, rest @ ..] if rest.iter().all(|value| value == first) => *first,
        _ => mean,
    };
    let square: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (values.len() > 1).then(|| (square / freedom).sqrt())
}

/// Wilson's interval (1927) of a share of so many observations.
pub fn wilson(share: f64, count: f64, level: Confidence) -> [f64; 2] {
    wilson_of(share, count, level.normal())
}

/// Counts in a time, and what they say of the rate behind them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rate {
    /// Events.
    pub count: u64,
    /// Events in an hour.
    pub per_hour: f64,
    /// The exact interval of the rate (Garwood 1936), 1/h.
    pub interval: [f64; 2],
    /// The rate that is not exceeded with the confidence of the level, 1/h: at 95 % and for zero events three in the time.
    pub upper: f64,
    /// How often interval and bound hold the rate.
    pub level: Confidence,
}

impl Rate {
    /// The rate behind so many events of a Poisson process in so many hours.
    pub fn new(count: u64, hours: f64, level: Confidence) -> Self {
        let quantile = |share: f64, degrees: u64| {
            let law = ChiSquared::new(degrees as f64).expect("positive");
            0.5 * quantile(&law, share)
        };
        let low = if count == 0 {
            0.0
        } else {
            quantile(level.lower(), 2 * count)
        };
        // In no time nothing is known.
        let per = |events: f64| if hours > 0.0 { events / hours } else { f64::NAN };
        Self {
            count,
            per_hour: per(count as f64),
            interval: [per(low), per(quantile(level.upper(), 2 * count + 2))],
            upper: per(quantile(level.share(), 2 * count + 2)),
            level,
        }
    }
}

/// Four fields, whose last has the level in its name: `upper_95`.
impl Serialize for Rate {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut fields = serializer.serialize_map(Some(4))?;
        fields.serialize_entry("count", &self.count)?;
        fields.serialize_entry("per_hour", &self.per_hour)?;
        fields.serialize_entry("interval", &self.interval)?;
        fields.serialize_entry(&format!("upper_{}", self.level), &self.upper)?;
        fields.end()
    }
}

/// By halving: the library's own inverse stops early.
fn quantile(law: &ChiSquared, share: f64) -> f64 {
    let (low, mut high) = (0.0, 1.0);
    while law.cdf(high) < share {
        high *= 2.0;
    }
    // A hundred halvings are more than a float64 has digits.
    halved([low, high], 100, |x| law.cdf(x) < share)
}

/// Where something that holds below ends to hold, by so many halvings: the least value found at which it does not.
pub fn halved([mut low, mut high]: [f64; 2], times: usize, holds: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..times {
        let middle = 0.5 * (low + high);
        *if holds(middle) { &mut low } else { &mut high } = middle;
    }
    high
}

/// Where something that holds below ends to hold, by so many halvings of the span of the logarithms: the last value found at which it
/// holds, and the first at which it does not.
pub fn halved_by_ratio([mut low, mut high]: [f64; 2], times: usize, holds: impl Fn(f64) -> bool) -> [f64; 2] {
    for _ in 0..times {
        let middle = (low * high).sqrt();
        *if holds(middle) { &mut low } else { &mut high } = middle;
    }
    [low, high]
}

/// The places of points that no other point beats: none is at most as large in everything, and smaller in something.
pub fn front<const N: usize>(points: &[[f64; N]]) -> Vec<usize> {
    let beats = |a: &[f64; N], b: &[f64; N]| a.iter().zip(b).all(|(a, b)| a <= b) && a != b;
    let is_on = |place: &usize| !points.iter().any(|other| beats(other, &points[*place]));
    (0..points.len()).filter(is_on).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// SciPy 1.17.1: `stats.ttest_1samp([0.2, -0.1, 0.4, 0.2, 0.1], 0).pvalue`, which with four degrees of freedom has a closed form too.
    #[test]
    fn a_mean_is_tested_against_zero_on_both_sides() {
        let values = [0.2, -0.1, 0.4, 0.2, 0.1];
        for sign in [1.0, -1.0] {
            let p = p_of_zero(&values.map(|value| sign * value)).unwrap();
            assert!((p - 0.120_243_340_6).abs() < 1e-9, "{p}");
        }
        assert_eq!((p_of_zero(&[0.3]), p_of_zero(&[0.3, 0.3])), (None, None));
        // Their sum over three is not 0.1 in float64.
        assert_eq!(p_of_zero(&[0.1, 0.1, 0.1]), None);
    }

    /// A twentieth shared among 14 is 0.00357; of one it stays.
    #[test]
    fn several_intervals_share_what_one_leaves_out() {
        let of = |count| Confidence::USUAL.of_several(count).to_string();
        assert_eq!([of(1), of(2), of(14)], ["95", "97.5", "99.65"]);
    }

    /// Student's quantiles as tables print them: 95 % with 4 degrees of freedom 2.776, 99 % 4.604; the normal ones 1.960 and 2.576.
    #[test]
    fn an_interval_is_as_wide_as_its_level_says() {
        let values = [1.0, 2.0, 3.0, 4.0, 5.0];
        // The standard deviation is the root of 2.5, that of the mean the root of a half.
        for (share, quantile, normal) in [(0.95, 2.776, 1.960), (0.99, 4.604, 2.576)] {
            let level = Confidence::new(share).unwrap();
            let mean = Mean::new(&values, level).unwrap();
            let [low, high] = mean.interval.unwrap();
            assert_eq!((mean.mean, mean.level), (3.0, level));
            for half in [3.0 - low, high - 3.0] {
                assert!((half - quantile * 0.5_f64.sqrt()).abs() < 1e-3, "{half}");
            }
            assert!((level.normal() - normal).abs() < 1e-3);
        }
        assert_eq!(Confidence::USUAL.upper(), 0.975);
        assert!((Z_95 - Normal::standard().inverse_cdf(0.975)).abs() < 1e-9);
        assert_eq!(Mean::new(&[2.0], Confidence::USUAL).unwrap().interval, None);
        assert_eq!(Mean::new(&[], Confidence::USUAL), None);
    }

    /// Tukey's interval of a mean is Student's: 1 to 5 have 3 +- 2.776*sqrt(0.5). Of the ratio of the sums 6 and 4 of (1, 2, 3) and (1, 1, 2)
    /// what is left is 5/3, 4/3 and 3/2, so the pseudo-values are 7/6, 11/6 and 3/2 with a deviation of 1/3: 1.5 +- 4.303/3/sqrt(3).
    #[test]
    fn each_draw_is_left_out_in_turn() {
        let half = |left: &[f64], whole: f64| {
            let found = Mean::tukey(whole, left, Confidence::USUAL);
            let [low, high] = found.interval.unwrap();
            assert!((low + high - 2.0 * whole).abs() < 1e-12);
            0.5 * (high - low)
        };
        let of_mean = half(&[3.5, 3.25, 3.0, 2.75, 2.5], 3.0);
        assert!((of_mean - 2.776 * 0.5_f64.sqrt()).abs() < 1e-3, "{of_mean}");
        let of_ratio = half(&[5.0 / 3.0, 4.0 / 3.0, 1.5], 1.5);
        assert!(
            (of_ratio - 4.303 / 3.0 / 3.0_f64.sqrt()).abs() < 1e-3,
            "{of_ratio}"
        );
        assert_eq!(Mean::tukey(1.0, &[], Confidence::USUAL).interval, None);
    }

    #[test]
    fn a_level_is_said_in_percent_and_bounded() {
        let said = |text: &str| text.parse::<Confidence>().map(|level| level.to_string());
        assert_eq!(said("0.999"), Ok("99.9".into()));
        assert_eq!(said("0.95"), Ok("95".into()));
        assert!(said("0.9999").is_ok() && said("0.5").is_ok());
        for text in ["0.4999", "0.99991", "95", "nan", "x"] {
            assert!(said(text).is_err(), "{text}");
        }
    }
}
