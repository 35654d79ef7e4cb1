//! Blocks of rows and sums over long records, laid out for the widest registers that the processor has.
//!
//! The order of summation is the same on every processor, and products and sums are rounded apart, so that the result
//! is too.

use multiversion::multiversion;

/// Partial sums: enough to keep an adder busy that takes four cycles.
const PARTS: usize = 16;
/// Partial sums where several sums are formed at once.
const FEW: usize = 8;

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

/// Sum of the products of `a` and `b`, over the shorter of the two.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let ((a, rest_a), (b, rest_b)) = (a[..n].as_chunks(), b[..n].as_chunks());
    let rest: f64 = rest_a.iter().zip(rest_b).map(|(x, y)| x * y).sum();
    products(a, b).iter().sum::<f64>() + rest
}

/// Adds `factor` times `more` to `sum`, over the shorter of the two.
pub(crate) fn add_times(sum: &mut [f64], factor: f64, more: &[f64]) {
    let n = sum.len().min(more.len());
    let ((sum, rest), (more, rest_more)) = (sum[..n].as_chunks_mut(), more[..n].as_chunks());
    add_products(sum, factor, more);
    for (s, x) in rest.iter_mut().zip(rest_more) {
        *s += factor * x;
    }
}

/// Products of the weighted sum of some columns with each of others, over the shortest of all.
pub(crate) fn dots_of_sum(weights: &[f64], columns: &[&[f64]], others: &[&[f64]]) -> Vec<f64> {
    let n = columns.iter().chain(others).map(|c| c.len()).min().unwrap_or(0);
    let mut sums = vec![[0.0; FEW]; others.len()];
    products_of_sum(weights, &chunks(columns, n), &chunks(others, n), &mut sums);
    let rest = (n - n % FEW)..n;
    let of_rest = |k: usize| weights.iter().zip(columns).map(|(w, c)| w * c[k]).sum::<f64>();
    let with_rest = |(parts, other): (&[f64; FEW], &&[f64])| {
        parts.iter().sum::<f64>() + rest.clone().map(|k| of_rest(k) * other[k]).sum::<f64>()
    };
    sums.iter().zip(others).map(with_rest).collect()
}

/// The first `n` values of each column, but for the last few.
fn chunks<'a>(columns: &[&'a [f64]], n: usize) -> Vec<&'a [[f64; FEW]]> {
    columns.iter().map(|c| c[..n].as_chunks().0).collect()
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
        with_errors[i] += dot_of_block(&columns[i], errors);
        for j in 0..=i {
            gram[i][j] += dot_of_block(&columns[i], &columns[j]);
        }
    }
}

#[inline(always)]
fn dot_of_block(a: &[f64; BLOCK], b: &[f64; BLOCK]) -> f64 {
    let mut parts = [0.0; PARTS];
    for k in 0..BLOCK / PARTS {
        for i in 0..PARTS {
            parts[i] += a[k * PARTS + i] * b[k * PARTS + i];
        }
    }
    let mut sum = 0.0;
    for part in parts {
        sum += part;
    }
    sum
}

// What is compiled for several processors has plain loops: iterators and closures would stay calls there.

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn products(a: &[[f64; PARTS]], b: &[[f64; PARTS]]) -> [f64; PARTS] {
    let mut parts = [0.0; PARTS];
    for k in 0..a.len().min(b.len()) {
        let (a, b) = (&a[k], &b[k]);
        for i in 0..PARTS {
            parts[i] += a[i] * b[i];
        }
    }
    parts
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn add_products(sum: &mut [[f64; PARTS]], factor: f64, more: &[[f64; PARTS]]) {
    for k in 0..sum.len().min(more.len()) {
        let (sum, more) = (&mut sum[k], &more[k]);
        for i in 0..PARTS {
            sum[i] += factor * more[i];
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn products_of_sum(
    weights: &[f64],
    columns: &[&[[f64; FEW]]],
    others: &[&[[f64; FEW]]],
    sums: &mut [[f64; FEW]],
) {
    for k in 0..others.first().map_or(0, |o| o.len()) {
        let mut weighted = [0.0; FEW];
        for c in 0..weights.len().min(columns.len()) {
            let (w, column) = (weights[c], &columns[c][k]);
            for i in 0..FEW {
                weighted[i] += w * column[i];
            }
        }
        for o in 0..others.len().min(sums.len()) {
            let (sum, other) = (&mut sums[o], &others[o][k]);
            for i in 0..FEW {
                sum[i] += weighted[i] * other[i];
            }
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
            // (2 k + 3) times 1, and times k.
            let both = dots_of_sum(&[2.0, 3.0], &[&counted, &ones], &[&ones, &counted]);
            let linear = n * (n + 1) + 3 * n;
            let square = n * (n + 1) * (2 * n + 1) / 3 + 3 * n * (n + 1) / 2;
            assert_eq!(both, [f64::from(linear), f64::from(square)]);
        }
    }
}
