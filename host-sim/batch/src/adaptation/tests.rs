//! Slopes, swings and the linear loop against closed forms and a loop that is driven by hand; the study against drives by themselves.

use std::f64::consts::TAU;

use haptic_sim::guidance::OwnLaw;
use haptic_sim::laws::Gains;
use haptic_sim::parts::{Driver as _, PaperVehicle};
use haptic_sim::{Action, Simulation};

use super::*;
use crate::engine::{Watch, on_threads};
use crate::files::Source;
use crate::files::tests::check_refusals;
use crate::places::seed_of;

/// Equal lags share the phase: three of T swing at a product of 8 with a period of 2*pi*T/sqrt(3), four at 4 with 2*pi*T. One lag never
/// swings; a delay D alone does at 1 with 2*D.
#[test]
fn equal_lags_swing_where_the_closed_form_says() {
    let near = |found: Option<[f64; 2]>, expected: [f64; 2]| {
        let found = found.unwrap();
        for (found, expected) in found.iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
        }
    };
    near(swings(&[5.0; 3], 0.0), [8.0, TAU * 5.0 / 3.0_f64.sqrt()]);
    near(swings(&[30.0; 4], 0.0), [4.0, TAU * 30.0]);
    near(swings(&[], 12.0), [1.0, 24.0]);
    assert_eq!(swings(&[5.0, 30.0], 0.0), None);
}

/// A loop of two lags and a delay, stepped by Euler's rule: `x` follows the rule's `-product*y`, delayed, and `y` follows `x`.
fn looped(product: f64, [first_s, second_s]: [f64; 2], delay_s: usize) -> Vec<f64> {
    const STEPS: usize = 100;
    let (mut x, mut y, mut each) = (0.0, 1.0, Vec::new());
    let mut seen = std::collections::VecDeque::from(vec![1.0; delay_s * STEPS]);
    for step in 0..2000 * STEPS {
        let dt = 1.0 / STEPS as f64;
        seen.push_back(y);
        let late = seen.pop_front().unwrap();
        x += dt / first_s * (-product * late - x);
        y += dt / second_s * (x - y);
        if step % STEPS == 0 {
            each.push(y);
        }
    }
    each
}

/// 5 % below the product that `swings` gives, the loop comes to rest; 5 % above, its swings grow; between, they last as long as it says.
#[test]
fn a_loop_of_lags_and_a_delay_swings_from_that_product_on() {
    let (lags, delay_s) = ([5.0, 30.0], 20);
    let [product, period_s] = swings(&lags, delay_s as f64).unwrap();
    let size =
        |product: f64, from: usize| of_series(&looped(product, lags, delay_s)[from..from + 500]).deviation;
    assert!(size(0.95 * product, 1500) < 0.5 * size(0.95 * product, 500));
    assert!(size(1.05 * product, 1500) > 2.0 * size(1.05 * product, 500));
    let found = of_series(&looped(product, lags, delay_s)[500..]);
    assert!(
        (found.period_s.unwrap() / period_s - 1.0).abs() < 0.02,
        "{found:?} {period_s}"
    );
}

/// A sine of 40 s with a ripple of 7 s, a fifth as large: deviation sqrt((1 + 0.04)/2), period 40 s. A value that stays has neither.
#[test]
fn a_swing_is_told_from_a_ripple() {
    let at =
        |second: i32| (TAU * f64::from(second) / 40.0).sin() + 0.2 * (TAU * f64::from(second) / 7.0).sin();
    let found = of_series(&(0..280).map(at).collect::<Vec<_>>());
    assert!((found.deviation - 0.52_f64.sqrt()).abs() < 1e-9);
    assert!((found.period_s.unwrap() - 40.0).abs() < 1.0);
    let still = of_series(&[0.36; 100]);
    assert!(still.deviation < 1e-12 && still.period_s.is_none());
}

/// x^3 on a grid of 0.5: (1 - 0.125)/0.5 between 0.5 and 1, 0.25 between 0 and 0.5.
#[test]
fn the_steepest_slope_is_that_of_the_stretch() {
    let cube: Vec<(f64, f64)> = (0..=4)
        .map(|n| 0.5 * f64::from(n))
        .map(|x| (x, x.powi(3)))
        .collect();
    assert_eq!(steepest(&cube, [0.6, 0.7]), 1.75);
    assert_eq!(steepest(&cube, [0.1, 0.2]), 0.25);
    assert_eq!(steepest(&cube[..1], [0.0, 1.0]), 0.0);
}

fn points(branches: [[f64; 3]; 2]) -> Vec<DriverPoint> {
    let mean = |mean| {
        Some(Mean {
            mean,
            interval: None,
            level: Confidence::USUAL,
        })
    };
    (0..3)
        .map(|n| DriverPoint {
            k_1: 0.2 + 0.1 * n as f64,
            k_hg: branches.map(|branch| mean(branch[n])),
        })
        .collect()
}

#[test]
fn a_driver_with_two_equilibria_has_no_slope_there() {
    let map = points([[0.2, 0.25, 0.3], [0.2, 0.25, 0.9]]);
    assert!((driver_slope(&map, [0.2, 0.25]).unwrap() - 0.5).abs() < 1e-9);
    assert_eq!(driver_slope(&map, [0.2, 0.45]), None);
}

const ROAD: &str = "[[segment]]\nlength_m = 100\n[[segment]]\nlength_m = 150\ncurvature_per_m = 0.002\n[[segment]]\nlength_m = 150\ncurvature_per_m = -0.002\n";
const FILE: &str = include_str!("short.toml");

fn study<'k>(text: &str, kinds: &'k Kinds) -> Result<Adaptation<'k>, InputError> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("road.toml"), ROAD).unwrap();
    file::from_text(&Source::new("study.toml", folder.path()), text, kinds)
}

/// The loop under the first law, driven by itself by other means: K_hg before the loss and behind it, and at the first step of the loss,
/// when trust has a shock of 0.4.
#[test]
fn the_study_s_loop_is_the_simulator_s() {
    let kinds = Kinds::default();
    let study = study(FILE, &kinds).unwrap();
    let found = study.run(&Watch::nobody()).unwrap();
    let (road, kmh, scenario) = &study.place;
    let mut means = [[0.0; 2]; 2];
    for (seed, means) in means.iter_mut().enumerate() {
        let failure = haptic_sim::scenario::Failure {
            kind: haptic_sim::scenario::FailureKind::Torque,
            time_s: 40.0,
            duration_s: Some(2.0),
        };
        let seed = seed_of(1, "adaptation", road, *kmh, seed as u32);
        let scenario = scenario.to_builder().seed(seed).failure(failure).build().unwrap();
        let driver = study.drivers[0].with_habit("trust", &[]);
        let driver = driver.make(&scenario, &driver.untuned()).unwrap();
        let guidance = OwnLaw::new(&scenario, Gains::PAPER);
        let mut run = Simulation::of_parts(&scenario, driver, PaperVehicle::new(&scenario), guidance);
        let mut k_hg = Vec::new();
        while run.steps() < 72_000 && run.step(&Action::default()).is_some() {
            k_hg.push(run.driver_vehicle().driver.k_hg().unwrap());
        }
        assert!((k_hg[40_000] - k_hg[39_999] - 0.4).abs() < 1e-3);
        let mean = |steps: std::ops::Range<usize>| k_hg[steps].iter().sum::<f64>() / 20_000.0;
        *means = [mean(20_000..40_000), mean(52_000..72_000)];
    }
    let pair = &found.pairs[0];
    for (which, found) in pair.k_hg.iter().enumerate() {
        let expected = 0.5 * (means[0][which] + means[1][which]);
        assert!((found.unwrap().mean - expected).abs() < 1e-9);
    }
    let still = Mean::new(&[0.0; 2], Confidence::USUAL);
    assert_eq!((Some(pair.law_slope), pair.product), (still, still));
    assert_eq!(pair.small_gain(), SmallGain::Holds);
    assert_eq!(pair.against_first.unwrap().mean, 0.0);
    assert_eq!(pair.series.len(), 72);
}

/// The table of the law by reliance: 0.322 at K_hg 0.1 and 0.396 at 0.6, a slope of 0.148; the ECU's estimate is right to some hundredths.
#[test]
fn a_law_s_map_is_its_table_as_the_ecu_estimates_k_hg() {
    let kinds = Kinds::default();
    let text = FILE
        .replace("settles_s = 10", "settles_s = 40")
        .replace("at_s = 40", "at_s = 60");
    let found = study(&text, &kinds).unwrap().run(&Watch::nobody()).unwrap();
    let pair = &found.pairs[1];
    for (point, expected) in pair.map.iter().zip([0.322, 0.396]) {
        assert!((point.k_1.unwrap().mean - expected).abs() < 0.02, "{point:?}");
    }
    assert!((pair.law_slope.mean - 0.148).abs() < 0.06, "{}", pair.law_slope);
    // Trust reaches both ends in some time constants of 5 s: the driver's map forgets where it began.
    for point in &found.maps[0] {
        let [low, high] = point.k_hg.map(|k_hg| k_hg.unwrap().mean);
        assert!((low - high).abs() < 0.05, "{point:?}");
    }
}

/// A map of two points has one slope, linear in its means: with two seeds the interval is Student's of their slopes, 12.706 times half their
/// difference, and the first seed's is known from a study of one.
#[test]
fn a_slope_s_interval_is_over_the_seeds() {
    let kinds = Kinds::default();
    let run = |text: &str| study(text, &kinds).unwrap().run(&Watch::nobody()).unwrap();
    let (both, first) = (run(FILE), run(&FILE.replace("seeds = 2", "seeds = 1")));
    let [both, first] = [both, first].map(|results| results.pairs[1].clone());
    let slopes = [
        (both.law_slope, first.law_slope),
        (both.driver_slope.unwrap(), first.driver_slope.unwrap()),
    ];
    for (both, first) in slopes {
        let [low, high] = both.interval.unwrap();
        let expected = 12.706 * (both.mean - first.mean).abs();
        assert!(
            (0.5 * (high - low) - expected).abs() < 1e-3 * expected,
            "{both} {first}"
        );
        assert_eq!(first.interval, None);
    }
    let product = both.product.unwrap();
    assert!((product.mean - slopes[0].0.mean * slopes[1].0.mean).abs() < 1e-12);
    assert_eq!(first.small_gain(), SmallGain::Untold);
}

/// A product is judged by its interval, at 0.5 and at 1 on both sides.
#[test]
fn small_gain_is_told_by_the_interval() {
    let kinds = Kinds::default();
    let found = study(FILE, &kinds).unwrap().run(&Watch::nobody()).unwrap();
    let of = |low: f64, high: f64| {
        let interval = Some([low, high]);
        let product = Mean {
            mean: 0.5 * (low + high),
            interval,
            level: Confidence::USUAL,
        };
        let pair = Pair {
            product: Some(product),
            ..found.pairs[1].clone()
        };
        pair.small_gain()
    };
    assert_eq!(of(0.1, 0.5), SmallGain::Holds);
    assert_eq!(of(-0.1, 0.501), SmallGain::Untold);
    assert_eq!(of(0.501, 0.999), SmallGain::WithoutMargin);
    assert_eq!(of(0.501, 1.0), SmallGain::Untold);
    assert_eq!(of(0.999, 3.0), SmallGain::Untold);
    assert_eq!(of(1.0, 3.0), SmallGain::Fails);
    let none = Pair {
        product: None,
        ..found.pairs[1].clone()
    };
    assert_eq!(none.small_gain(), SmallGain::TwoEquilibria);
}

#[test]
fn any_number_of_threads_gives_the_same_results() {
    let kinds = Kinds::default();
    let study = study(FILE, &kinds).unwrap();
    // 2 gains from 2 ends, 2 laws at 2 K_hg, 2 loops, each with 2 seeds.
    assert_eq!(study.jobs().len(), 20);
    let on = |threads| on_threads(Some(threads), || study.run(&Watch::nobody()).unwrap()).unwrap();
    let (one, three) = (on(1), on(3));
    assert_eq!(one, three);
    assert_eq!(one.to_csv(), three.to_csv());
    assert_eq!(one.to_csv().lines().count(), 1 + 2 * 72);
}

/// What stands in the file, what stands there instead, and what is said of it.
const WRONG: [(&str, &str, &str); 10] = [
    (
        "at_s = 40",
        "at_s = 20",
        "study.toml: loss.at_s = 20 s is outside 30 to 3000 s",
    ),
    (
        "lasts_s = 2",
        "lasts_s = 0",
        "loss.lasts_s = 0 s is outside 0.1 to 3000 s",
    ),
    (
        "settles_s = 10",
        "settles_s = 1",
        "map.settles_s = 1 s is outside 10 to 3000 s",
    ),
    (
        "k_1 = [0.25, 0.45]",
        "k_1 = [0.25]",
        "map.k_1 = [0.25]: two or more rising values are wanted",
    ),
    (
        "k_hg = [0.1, 0.6]",
        "k_hg = [0.6, 0.1]",
        "map.k_hg = [0.6, 0.1]: two or more rising values are wanted",
    ),
    (
        "k_hg = [0.1, 0.6]",
        "k_hg = [0.1, 1.6]",
        "map.k_hg = 1.6 is outside 0 to 1",
    ),
    (
        "kind = 'by_reliance'",
        "kind = 'fdca'",
        "law fdca: it is not (9) with a gain K_1",
    ),
    (
        "around = [{ kind = 'trust', tau_s = 5 }]",
        "",
        "driver paper: around ends with no habit \"trust\", which moves K_hg",
    ),
    (
        "speed_m_per_s = 16.666666666666668",
        "speed_m_per_s = 83",
        "speed_m_per_s = 83 m/s is outside 5.5 to 70 m/s",
    ),
    ("road = 'road.toml'", "road = 'lost.toml'", "lost.toml"),
];

#[test]
fn a_wrong_file_is_refused_by_field_value_and_range() {
    let kinds = Kinds::default();
    check_refusals(FILE, &WRONG, |text| study(text, &kinds).err());
}
