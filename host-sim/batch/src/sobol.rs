//! The sequence of Sobol with the direction numbers of Joe and Kuo (2008, SIAM J. Sci. Comput. 30:2635-2654), in the
//! order of Gray codes. Any point is computed by itself, so that a shard needs none of the points before its own.
//!
//! The crates that there are stop at 65,536 points or go only from one point to the next.

/// Dimensions that there are numbers for.
pub(crate) const DIMENSIONS: usize = 40;

/// For each dimension after the first: the inner coefficients of its primitive polynomial, and its first numbers.
const DIRECTIONS: [(u32, &[u32]); DIMENSIONS - 1] = [
    (0, &[1]),
    (1, &[1, 3]),
    (1, &[1, 3, 1]),
    (2, &[1, 1, 1]),
    (1, &[1, 1, 3, 3]),
    (4, &[1, 3, 5, 13]),
    (2, &[1, 1, 5, 5, 17]),
    (4, &[1, 1, 5, 5, 5]),
    (7, &[1, 1, 7, 11, 19]),
    (11, &[1, 1, 5, 1, 1]),
    (13, &[1, 1, 1, 3, 11]),
    (14, &[1, 3, 5, 5, 31]),
    (1, &[1, 3, 3, 9, 7, 49]),
    (13, &[1, 1, 1, 15, 21, 21]),
    (16, &[1, 3, 1, 13, 27, 49]),
    (19, &[1, 1, 1, 15, 7, 5]),
    (22, &[1, 3, 1, 15, 13, 25]),
    (25, &[1, 1, 5, 5, 19, 61]),
    (1, &[1, 3, 7, 11, 23, 15, 103]),
    (4, &[1, 3, 7, 13, 13, 15, 69]),
    (7, &[1, 1, 3, 13, 7, 35, 63]),
    (8, &[1, 3, 5, 9, 1, 25, 53]),
    (14, &[1, 3, 1, 13, 9, 35, 107]),
    (19, &[1, 3, 1, 5, 27, 61, 31]),
    (21, &[1, 1, 5, 11, 19, 41, 61]),
    (28, &[1, 3, 5, 3, 3, 13, 69]),
    (31, &[1, 1, 7, 13, 1, 19, 1]),
    (32, &[1, 3, 7, 5, 13, 19, 59]),
    (37, &[1, 1, 3, 9, 25, 29, 41]),
    (41, &[1, 3, 5, 13, 23, 1, 55]),
    (42, &[1, 3, 7, 3, 13, 59, 17]),
    (50, &[1, 3, 1, 3, 5, 53, 69]),
    (55, &[1, 1, 5, 5, 23, 33, 13]),
    (56, &[1, 1, 7, 7, 1, 61, 123]),
    (59, &[1, 1, 7, 9, 13, 61, 49]),
    (62, &[1, 3, 3, 5, 3, 55, 33]),
    (14, &[1, 3, 1, 15, 31, 13, 49, 245]),
    (21, &[1, 3, 5, 15, 31, 59, 63, 97]),
    (22, &[1, 3, 1, 11, 11, 11, 77, 249]),
];

/// One dimension of the sequence.
#[derive(Debug, Clone)]
pub(crate) struct Dimension([u32; 32]);

impl Dimension {
    /// From 0 to `DIMENSIONS - 1`; beyond it the last.
    pub(crate) fn new(number: usize) -> Self {
        let mut v = [0_u32; 32];
        let Some(&(inner, first)) = number.min(DIMENSIONS - 1).checked_sub(1).map(|i| &DIRECTIONS[i]) else {
            for (bit, v) in v.iter_mut().enumerate() {
                *v = 1 << (31 - bit);
            }
            return Self(v);
        };
        let degree = first.len();
        for (bit, m) in first.iter().enumerate() {
            v[bit] = m << (31 - bit);
        }
        for bit in degree..32 {
            v[bit] = v[bit - degree] ^ (v[bit - degree] >> degree);
            for k in 1..degree {
                if (inner >> (degree - 1 - k)) & 1 == 1 {
                    v[bit] ^= v[bit - k];
                }
            }
        }
        Self(v)
    }

    /// The `n`-th number, as 32 bits behind the point.
    pub(crate) fn at(&self, n: u32) -> u32 {
        let gray = n ^ (n >> 1);
        let bits = (0..32).filter(|bit| (gray >> bit) & 1 == 1);
        bits.fold(0, |x, bit| x ^ self.0[bit])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Point, dimension and value of `scipy.stats.qmc.Sobol(40, scramble=False, bits=32).random(1024)`, SciPy 1.
    #[test]
    fn the_numbers_are_those_of_another_program() {
        for (point, dimension, value) in [
            (1, 0, 0.5),
            (1, 39, 0.5),
            (2, 1, 0.25),
            (3, 2, 0.75),
            (5, 7, 0.375),
            (100, 11, 0.679_687_5),
            (100, 39, 0.132_812_5),
            (777, 20, 0.237_304_687_5),
            (1023, 33, 0.874_023_437_5),
        ] {
            let x = f64::from(Dimension::new(dimension).at(point)) / f64::from(u32::MAX);
            assert!((x - value).abs() < 1e-9, "{point} {dimension}: {x}");
        }
    }
}
