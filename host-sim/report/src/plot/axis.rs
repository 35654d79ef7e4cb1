//! Limits and ticks of an axis.

/// Most ticks on a y axis and on an x axis.
pub(super) const Y_TICKS: usize = 9;
pub(super) const X_TICKS: usize = 11;

/// Smallest and largest finite value.
pub(super) fn extent(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values
        .filter(|v| v.is_finite())
        .fold(None, |extent, v| match extent {
            None => Some((v, v)),
            Some((low, high)) => Some((low.min(v), high.max(v))),
        })
}

/// Room left between a curve and the frame, as a share of the curve's extent.
const ROOM: f64 = 0.03;

/// Limits on ticks that hold `extent` and, except at zero, a little room; a single value gets half of itself
/// on both sides, no value or zero (-1, 1).
pub(super) fn rounded_outward(extent: Option<(f64, f64)>) -> (f64, f64) {
    let (low, high) = match extent {
        None | Some((0.0, 0.0)) => return (-1.0, 1.0),
        Some((low, high)) if low == high => (low - 0.5 * low.abs(), high + 0.5 * high.abs()),
        Some(extent) => extent,
    };
    // A curve that starts from zero may stand on the frame.
    let room = ROOM * (high - low);
    let low = if low == 0.0 { 0.0 } else { low - room };
    let high = if high == 0.0 { 0.0 } else { high + room };
    // Two steps less, because rounding can add up to one at each end.
    let step = tick_step(high - low, Y_TICKS - 2);
    ((low / step).floor() * step, (high / step).ceil() * step)
}

/// Ticks within the limits (at most `most`) and the number of decimals that tells them apart.
pub(super) fn ticks((low, high): (f64, f64), most: usize) -> (Vec<f64>, usize) {
    let step = tick_step(high - low, most);
    // A limit that lies on a tick but for rounding still gets it.
    let slack = 1e-6;
    let (first, last) = ((low / step - slack).ceil(), (high / step + slack).floor());
    let count = (last - first).max(0.0) as usize + 1;
    let decimals = (-(step * 1.000_001).log10().floor()).max(0.0) as usize;
    ((0..count).map(|i| (first + i as f64) * step).collect(), decimals)
}

/// The smallest of 1, 2, 5 times a power of ten that gives at most `most` ticks over `span`.
fn tick_step(span: f64, most: usize) -> f64 {
    let rough = span / (most - 1) as f64;
    let power = 10_f64.powf(rough.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .map(|m| m * power)
        .into_iter()
        .find(|step| *step >= rough * 0.999_999)
        .unwrap_or(rough)
}

/// A tick's label, with a true minus sign and no negative zero.
pub(super) fn label(value: f64, decimals: usize) -> String {
    let magnitude = format!("{:.decimals$}", value.abs());
    let is_zero = !magnitude.contains(|c: char| c.is_ascii_digit() && c != '0');
    if value < 0.0 && !is_zero {
        format!("\u{2212}{magnitude}")
    } else {
        magnitude
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(limits: (f64, f64), most: usize) -> Vec<String> {
        let (ticks, decimals) = ticks(limits, most);
        ticks.into_iter().map(|t| label(t, decimals)).collect()
    }

    #[test]
    fn ticks_are_round_and_few() {
        assert_eq!(labels((-0.2, 0.6), 7), ["−0.2", "0.0", "0.2", "0.4", "0.6"]);
        assert_eq!(
            labels((0.0, 1.0), 11),
            [
                "0.0", "0.1", "0.2", "0.3", "0.4", "0.5", "0.6", "0.7", "0.8", "0.9", "1.0"
            ]
        );
        assert_eq!(
            labels((1080.0, 1740.0), 11),
            ["1100", "1200", "1300", "1400", "1500", "1600", "1700"]
        );
        assert_eq!(
            labels((-0.02, 0.03), 7),
            ["−0.02", "−0.01", "0.00", "0.01", "0.02", "0.03"]
        );
        assert_eq!(labels((0.0, 70_000.0), 7), ["0", "20000", "40000", "60000"]);
    }

    #[test]
    fn limits_are_rounded_outward_and_hold_the_data() {
        assert_eq!(rounded_outward(Some((-0.13, 0.618))), (-0.2, 0.8));
        assert_eq!(rounded_outward(Some((0.0, 9.5))), (0.0, 10.0));
        assert_eq!(
            rounded_outward(Some((0.0, 10.0))),
            (0.0, 12.0),
            "a curve does not touch the frame"
        );
        assert_eq!(rounded_outward(Some((0.0, 0.0))), (-1.0, 1.0));
        assert_eq!(rounded_outward(Some((4.0, 4.0))), (1.0, 7.0));
        assert_eq!(rounded_outward(None), (-1.0, 1.0));
    }

    #[test]
    fn extent_ignores_what_is_not_a_number() {
        assert_eq!(
            extent([f64::NAN, 2.0, f64::INFINITY, -1.0].into_iter()),
            Some((-1.0, 2.0))
        );
        assert_eq!(extent([f64::NAN].into_iter()), None);
    }
}
