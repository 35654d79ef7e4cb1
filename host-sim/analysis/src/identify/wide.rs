//! Blocks of rows and sums over long records, laid out for the widest registers that the processor has.
//!
//! The order of summation is the same on every processor, and products and sums are rounded apart, so that the result
//! is too.

pub(crate) use haptic_recording::median;
use multiversion::multiversion;

/// Partial sums: enough to keep an adder busy that takes four cycles.
const PARTS: usize = 16;

/// Rows that are read at once.
pub(crate) const BLOCK: usize = 64;

/// [`BLOCK`] values of `u` from `from` on, level beyond its end; the `spare` ones where it ends before.
#[inline(always)]
pub(crate) fn window<'a>(u: &'a [f64], from: usize, spare: &'a mut [f64; BLOCK]) -> &'a [f64; BLOCK] {
    let last = u.len() - 1;
    match u[from.min(last)..].first_chunk() {
        Some(values) => values,
        None => {
            for (i, x) in spare.iter_mut().enumerate() {
                *x = u[(from + i).min(last)];
            }
            spare
        }
    }
}

/// Sum of the products of `a` and `b`, over the shorter of the two; in the registers of whoever calls it.
#[inline(always)]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let ((a, rest_a), (b, rest_b)) = (a[..n].as_chunks::<PARTS>(), b[..n].as_chunks::<PARTS>());
    let mut parts = [0.0; PARTS];
    for (a, b) in a.iter().zip(b) {
        for i in 0..PARTS {
            parts[i] += a[i] * b[i];
        }
    }
    let rest: f64 = rest_a.iter().zip(rest_b).map(|(x, y)| x * y).sum();
    parts.iter().sum::<f64>() + rest
}

/// `u` through a first-order lag, from its first value.
pub(crate) fn lagged(u: &[f64], dt_s: f64, lag_s: f64) -> Vec<f64> {
    let share = 1.0 - (-dt_s / lag_s).exp();
    let mut y = u.first().copied().unwrap_or(0.0);
    u.iter()
        .map(|&x| {
            y += share * (x - y);
            y
        })
        .collect()
}

/// Running integral by the trapezoidal rule, from zero.
pub(crate) fn integral(u: &[f64], dt_s: f64) -> Vec<f64> {
    let mut sum = 0.0;
    std::iter::once(0.0)
        .chain(u.windows(2).map(|w| {
            sum += 0.5 * dt_s * (w[0] + w[1]);
            sum
        }))
        .collect()
}

/// The mean of each row of `u` and so many to both sides, as far as there are any.
pub(crate) fn running_mean(u: &[f64], half: usize) -> Vec<f64> {
    let mut sums = vec![0.0];
    for x in u {
        sums.push(sums[sums.len() - 1] + x);
    }
    (0..u.len())
        .map(|k| {
            let (from, to) = (k.saturating_sub(half), (k + half + 1).min(u.len()));
            (sums[to] - sums[from]) / (to - from) as f64
        })
        .collect()
}

/// Adds `factor` times `more` to `sum`, over the shorter of the two.
pub(crate) fn add_times(sum: &mut [f64], factor: f64, more: &[f64]) {
    for (s, x) in sum.iter_mut().zip(more) {
        *s += factor * x;
    }
}

/// Adds the products of the columns of a block with each other, in the lower triangle, and with `errors`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(crate) fn add_products_of_columns<const N: usize>(
    columns: &[[f64; BLOCK]; N],
    errors: &[f64; BLOCK],
    gram: &mut [[f64; N]; N],
    with_errors: &mut [f64; N],
) {
    for i in 0..N {
        with_errors[i] += dot(&columns[i], errors);
        for j in 0..=i {
            gram[i][j] += dot(&columns[i], &columns[j]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 1 + 2 + .. + n, and the squares: n (n + 1)/2 and n (n + 1) (2 n + 1)/6, all exact in a double.
    #[test]
    fn sums_are_those_of_gauss_whatever_the_length() {
        for n in [0, 1, 15, 16, 17, 100, 1003] {
            let counted: Vec<f64> = (1..=n).map(f64::from).collect();
            let ones = vec![1.0; counted.len() + 3];
            assert_eq!(dot(&counted, &ones), f64::from(n * (n + 1) / 2));
            assert_eq!(dot(&counted, &counted), f64::from(n * (n + 1) * (2 * n + 1) / 6));
            let mut sum = ones.clone();
            add_times(&mut sum, 2.0, &counted);
            assert_eq!(sum.iter().sum::<f64>(), f64::from(n * (n + 1) + n + 3));
        }
    }
}
