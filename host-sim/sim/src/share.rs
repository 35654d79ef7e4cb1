//! How sure a share is.

/// How many standard deviations an interval of 95 % of a normal distribution reaches.
pub const Z_95: f64 = 1.959_963_984_540_054;

/// Wilson's interval (1927) of a share of so many observations, 95 %.
pub fn wilson(share: f64, count: f64) -> [f64; 2] {
    wilson_of(share, count, Z_95)
}

/// Wilson's interval that reaches so many standard deviations.
pub fn wilson_of(share: f64, count: f64, z: f64) -> [f64; 2] {
    let (square, whole) = (z * z / count, 1.0 + z * z / count);
    let half = z * (share * (1.0 - share) / count + square / (4.0 * count)).sqrt();
    [-half, half].map(|half| ((share + 0.5 * square + half) / whole).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The interval of none in 10 ends at 27.75 %, that of 5 in 10 is 23.66 to 76.34 % (Newcombe 1998's formula by hand).
    #[test]
    fn an_interval_is_that_of_the_tables() {
        let [low, high] = wilson(0.0, 10.0);
        assert!(low == 0.0 && (high - 0.277_53).abs() < 1e-5, "{low} {high}");
        let [low, high] = wilson(0.5, 10.0);
        assert!(
            (low - 0.236_59).abs() < 1e-5 && (high - 0.763_41).abs() < 1e-5,
            "{low} {high}"
        );
    }
}
