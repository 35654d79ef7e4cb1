//! The smoother against dense matrices.

use nalgebra::{DMatrix, DVector};

use super::smooth;
use super::trend::{COLUMNS, Filter, Row, factorial};

/// The best linear estimate of a cubic with unknown coefficients plus an integrated walk under white noise, by dense
/// matrices: x = B c + z with cov(z) = q K, K(s, t) = int (s - u)^(N-1) (t - u)^(N-1) du / (N-1)!^2 from 0 to the
/// lesser of both. Generalised least squares gives c, and then z = q K V^-1 (y - B c) with V = q K + 1.
fn dense<const N: usize>(dt: f64, ratio: f64, y: &[f64], part: &[bool]) -> Vec<f64> {
    let kernel = |s: f64, t: f64| -> f64 {
        let steps = 20_000;
        let h = s.min(t) / f64::from(steps);
        let at = |u: f64| ((s - u) * (t - u)).powi(N as i32 - 1);
        let sum: f64 = (0..steps).map(|i| at((f64::from(i) + 0.5) * h)).sum();
        sum * h / factorial(N - 1).powi(2)
    };
    let all: Vec<f64> = (0..y.len()).map(|k| k as f64 * dt).collect();
    let used: Vec<usize> = (0..y.len()).filter(|&k| part[k]).collect();
    let n = used.len();
    let v = DMatrix::from_fn(n, n, |i, j| {
        ratio * kernel(all[used[i]], all[used[j]]) + if i == j { 1.0 } else { 0.0 }
    });
    let b = DMatrix::from_fn(n, N, |i, j| all[used[i]].powi(j as i32));
    let right = DVector::from_fn(n, |i, _| y[used[i]]);
    let inverse = v.try_inverse().unwrap();
    let c = (b.transpose() * &inverse * &b).try_inverse().unwrap() * b.transpose() * &inverse * &right;
    let weights = inverse * (right - &b * &c);
    let course = |t: f64| -> f64 {
        let cubic: f64 = (0..N).map(|j| c[j] * t.powi(j as i32)).sum();
        cubic
            + (0..n)
                .map(|i| ratio * kernel(t, all[used[i]]) * weights[i])
                .sum::<f64>()
    };
    all.iter().map(|&t| course(t)).collect()
}

fn agrees_with_dense<const N: usize>(ratio: f64) {
    let dt = 0.5;
    let y = [0.3, 1.2, 0.7, 2.0, -0.4, 1.1, 3.0, 2.2, 0.1, -1.0, 0.4, 1.9];
    let part: Vec<bool> = (0..y.len()).map(|k| k != 5 && k != 6).collect();
    let weight: Vec<f64> = part.iter().map(|&p| if p { 1.0 } else { 0.0 }).collect();
    let rows: Vec<Row> = y.iter().map(|&y| [y; COLUMNS]).collect();
    let found = Filter::<N>::new(dt, ratio, &weight).smoothed(&rows);
    for (k, (found, dense)) in found.iter().zip(dense::<N>(dt, ratio, &y, &part)).enumerate() {
        assert!((found[0] - dense).abs() < 1e-3, "{N} {k}: {} {dense}", found[0]);
    }
}

#[test]
fn the_course_is_the_best_linear_estimate() {
    agrees_with_dense::<2>(0.7);
    agrees_with_dense::<4>(5.0);
}

/// A signal without noise, 20 s of 100 rows a second, that is level up to 10 s and rises by 0.02 a second from there; one sample is
/// missing, and so many from 6 s on are off by 0.05.
fn bend(off: usize) -> super::Smoothed {
    let mut signal: Vec<f64> = (0..2000).map(|k| 2e-4 * f64::from((k - 1000).max(0))).collect();
    signal[600..600 + off].iter_mut().for_each(|x| *x += 0.05);
    let mut weight = vec![1.0; 2000];
    weight[300] = 0.0;
    smooth(&signal, &[0.0; 2000], 0.01, (1, false), &weight, [0.0, 5e-4])
}

#[test]
fn the_entry_of_a_bend_is_not_out_of_line() {
    let found = bend(0);
    assert_eq!(found.noise.outliers, 0);
    assert!(!found.bursts.contains(&true));
    assert!(found.signal[300].abs() < 1e-6 && found.signal[1500] == 0.1);
}

#[test]
fn a_burst_is_out_of_line_without_noise_too() {
    let found = bend(4);
    assert!((600..604).all(|k| found.bursts[k]));
    assert!(!found.bursts[..590].contains(&true) && !found.bursts[1300..].contains(&true));
}
