//! Is the model refuted, by what, and what would cure it.
//!
//! A standard error holds only if the model does. So whatever was computed beside the estimate is held against the model's
//! assumptions, and one that is refuted takes the verdict "identified" from all that was estimated. Differences
//! that are certain but too small to move anything that matters refute nothing: no record is long enough for a model
//! of a driver to be exactly true.

use super::balance::Balance;
use super::change::{Change, E_Y, SHORTEST_S, T_D};
use super::result::{InputCorrelation, Parameter, Refutation, SAME_DRIVER, SAME_LINE, Torques, Whiteness};

/// Standard errors beyond which a difference is certain, with all the tests that are made of one record.
pub(crate) const CERTAIN: f64 = 5.0;
/// Explained share of T_d above which the column's balance of torques is seen to hold.
pub(crate) const BALANCE_SEEN: f64 = 0.8;
/// Differences of scale and of delay, s, that are too small to matter.
const SMALL_SCALE: f64 = 0.1;
/// How far a scale may be off beside so much dry friction, N.m, and more, and in proportion beside less: with 0.5 N.m that gives way over
/// 0.2 degrees, right logs come out at 0.82 to 0.87.
const SMALL_SCALE_BESIDE_FRICTION: f64 = 0.3;
const MUCH_FRICTION_NM: f64 = 0.25;
/// Share of its leeway that a scale may be off without friction where it counts as weighed: what coarse angles, a motor's ripple and
/// uneven rows leave unexplained makes up to 0.5 of it in right logs. Where it is not weighed, a scale is told beyond all of it, as
/// delays are: without a probe right logs come out at up to 0.9.
const LEEWAY: f64 = 0.5;
/// A driver has at least this gain on e_theta, N.m/rad: half of what table 4's least a_3 and K_d make.
const LEAST_GAIN_3: f64 = 3.0;
const SMALL_DELAY_S: f64 = 0.0045;
/// Steps of the wheel angle's sensor up to which that holds, rad; with coarser ones delays are told as much more coarsely.
const FINE_ANGLE_RAD: f64 = 0.1 / 180.0 * std::f64::consts::PI;
/// How late T_d may be against the wheel angle, which moves t_p alone: less is not told from the column's own lags.
const SMALL_DRIVER_DELAY_S: f64 = 0.015;
/// Largest autocorrelation of residuals, beyond that of resampling, that leaves the noise model standing: more is another
/// noise.
const WHITE_ENOUGH: f64 = 0.1;
/// Largest cross-correlation with an input, in standard deviations, that leaves the driver model standing.
const INDEPENDENT_ENOUGH: f64 = 7.0;

/// Above this fit, %, what is left over is the error of interpolation, which is neither white nor independent.
const ALL_BUT_PERFECT: f64 = 98.0;

/// The assumption that a swapped sign refutes.
pub(crate) const SIGNS: &str = "all torques and angles are positive to the left";

/// The assumption that a sensor that changed refutes.
const SAME_SENSORS: &str = "the sensors are the same throughout";
/// What the balance of torques on the column refutes.
pub(crate) fn of_balance(b: &Balance, assisted: bool) -> Vec<Refutation> {
    if b.explained < BALANCE_SEEN {
        return Vec::new();
    }
    let is_told = |r: &Refutation| r.assumption == SIGNS || b.is_close();
    let signs_and_scale = of_signs_and_scale(b, assisted).into_iter().filter(is_told);
    // Before it slides, friction gives way like a spring: that looks like a delay. So does an assist, which acts with T_d and is late.
    let instants = if b.friction_nm.is_some() || assisted || !b.is_close() {
        Vec::new()
    } else {
        of_instants(b)
    };
    signs_and_scale.chain(instants).collect()
}

/// Whether a value differs from zero beyond its error.
fn is_sure(value: f64, error: f64) -> bool {
    value.abs() > CERTAIN * error
}

fn balance_evidence(b: &Balance, what: &str) -> String {
    format!(
        "column and guidance explain {:.1} % of driver_torque_nm, but {what}",
        100.0 * b.explained
    )
}

/// How far a scale has to be off to be told.
fn least_scale(b: &Balance) -> f64 {
    match b.friction_nm {
        Some([friction_nm, _]) => {
            // No more than that much friction is known to bias.
            let share = (friction_nm / MUCH_FRICTION_NM).clamp(0.0, 1.0);
            SMALL_SCALE + share * (SMALL_SCALE_BESIDE_FRICTION - SMALL_SCALE)
        }
        None if LEEWAY * b.scale_leeway <= SMALL_SCALE => SMALL_SCALE,
        None => b.scale_leeway,
    }
}

/// Whether a balance tells the scale of one torque against the other to what counts as right.
pub(crate) fn torques(b: Option<&Balance>, assisted: bool) -> Torques {
    let tells = |b: &Balance| b.scale.is_some() && b.is_close() && least_scale(b) <= SMALL_SCALE;
    if !assisted && b.is_some_and(tells) {
        Torques::Weighed
    } else {
        Torques::AsRecorded
    }
}

/// A channel with a swapped sign or another scale; at most one, in the order of precedence.
fn of_signs_and_scale(b: &Balance, assisted: bool) -> Option<Refutation> {
    let small = least_scale(b);
    let negative = b.stiffness[0] < 0.0 && is_sure(b.stiffness[0], b.stiffness[1]);
    let sign = |cause: &str, cure: &str, what: String| Refutation {
        assumption: SIGNS,
        evidence: balance_evidence(b, &what),
        cause: cause.to_owned(),
        cure: cure.to_owned(),
    };
    Some(match b.scale {
        // What is left unexplained may make a small negative scale of a right one.
        Some([s, e]) if is_sure(s, e) && s < -SMALL_SCALE && 1.0 - s > b.scale_leeway => {
            if negative {
                sign(
                    "the sign of driver_torque_nm is swapped",
                    "multiply driver_torque_nm by -1 in the log",
                    format!("with a scale of {s:.3} and a negative stiffness"),
                )
            } else {
                sign(
                    "the sign of guidance_torque_nm is swapped",
                    "multiply guidance_torque_nm by -1 in the log",
                    format!("with a scale of {s:.3} to guidance_torque_nm"),
                )
            }
        }
        _ if negative => sign(
            "the sign of wheel_angle_rad is swapped, or, in a drive without guidance, that of driver_torque_nm",
            "multiply wheel_angle_rad (or driver_torque_nm) by -1 in the log",
            format!("with a stiffness of {:.2} N.m/rad", b.stiffness[0]),
        ),
        Some([s, e]) if is_sure(1.0 - s, e) && s.abs() < SMALL_SCALE => Refutation {
            assumption: "driver_torque_nm is the driver's torque alone",
            evidence: balance_evidence(
                b,
                &format!("guidance_torque_nm has no part in it: scale {s:.3} for 1"),
            ),
            cause: "driver_torque_nm is the sum T_d + T_h (a sensor below the actuator)".to_owned(),
            cure: "subtract guidance_torque_nm from driver_torque_nm before".to_owned(),
        },
        // Beside an assist it acts at more than its scale.
        Some([s, _]) if assisted && s < 1.0 => return None,
        Some([s, e]) if is_sure(s - 1.0, e) && (s - 1.0).abs() > small => Refutation {
            assumption: "driver_torque_nm and guidance_torque_nm have one scale",
            evidence: balance_evidence(b, &format!("at {s:.3} +- {e:.3} times its scale")),
            cause: format!(
                "driver_torque_nm is recorded at {s:.3} times its value (or guidance_torque_nm at {:.3} times){}",
                1.0 / s,
                if s < 1.0 {
                    ", or a power assist turns the wheel with the driver"
                } else {
                    ""
                }
            ),
            cure: format!(
                "multiply driver_torque_nm by {:.3} in the log{}",
                1.0 / s,
                if s < 1.0 {
                    "; --assisted for a column with a power assist"
                } else {
                    ""
                }
            ),
        },
        _ => return None,
    })
}

/// Nobody steers by where the road goes: a gain on e_theta that is surely none of a driver's.
pub(crate) fn of_gain_3(gain_3: &Parameter) -> Option<(f64, Refutation)> {
    let (gain, error) = gain_3.optimum.zip(gain_3.standard_error)?;
    let below = (LEAST_GAIN_3 - gain) / error;
    (below > CERTAIN).then(|| {
        let refutation = Refutation {
            assumption: "the driver steers by e_theta_rad",
            evidence: format!(
                "gain_3 is {gain:.2} +- {error:.2} N.m/rad, and that of drivers {LEAST_GAIN_3} N.m/rad at least"
            ),
            cause: "e_theta_rad is another signal (e_y_m, say), or is not what the driver sees".to_owned(),
            cure: "check the columns e_y_m and e_theta_rad".to_owned(),
        };
        (below * below, refutation)
    })
}

/// Columns that were not sampled at the same instant.
fn of_instants(b: &Balance) -> Vec<Refutation> {
    let mut out = Vec::new();
    let mut late = |name: &str, than: &str, option: &str, [value, error]: [f64; 2]| {
        let (size, word) = (1e3 * value.abs(), if value > 0.0 { "late" } else { "early" });
        out.push(Refutation {
            assumption: "all columns were sampled at the same instant",
            evidence: balance_evidence(
                b,
                &format!("{name} {size:.1} +- {:.1} ms {word} against {than}", 1e3 * error),
            ),
            cause: format!("{name} is {size:.0} ms {word}"),
            cure: format!("--fix {option}={value:.4}, or --estimate {option}"),
        });
    };
    let coarse = (b.angle_step_rad / FINE_ANGLE_RAD).max(1.0);
    let [driver, error] = b.driver_late_s;
    let least = |small_s: f64| (small_s * coarse).max(b.row_leeway_s);
    let least_driver_s = least(SMALL_DRIVER_DELAY_S).max(b.late_leeway_s);
    let driver_is = is_sure(driver, error) && driver.abs() > least_driver_s;
    if driver_is {
        late("driver_torque_nm", "wheel_angle_rad", "t_d_late", b.driver_late_s);
    }
    if let Some([value, error]) = b.between_s.filter(|_| !driver_is)
        && is_sure(value, error)
        && value.abs() > least(SMALL_DELAY_S)
    {
        // A sensor is never early: of the two, the other one is late.
        if value > 0.0 {
            late(
                "guidance_torque_nm",
                "driver_torque_nm",
                "t_h_late",
                [value, error],
            );
        } else {
            late(
                "driver_torque_nm",
                "guidance_torque_nm",
                "t_d_late",
                [-value, error],
            );
        }
    }
    out
}

/// What the residuals refute, each with what it adds to twice the log likelihood. Of a torque of which a share was `bridged`, the
/// prediction errors of as many rows are made of their neighbours'.
pub(crate) fn of_residuals(
    fit_percent: f64,
    white: &Whiteness,
    inputs: &[InputCorrelation],
    [unexplained_autocorrelation, bridged]: [f64; 2],
) -> Vec<(f64, Refutation)> {
    let mut out = Vec::new();
    if fit_percent > ALL_BUT_PERFECT {
        return out;
    }
    if white.p_value < 1e-6 && unexplained_autocorrelation.abs() > WHITE_ENOUGH + bridged {
        let refutation = Refutation {
            assumption: "the disturbance is a low-passed remnant and white sensor noise",
            evidence: format!(
                "the prediction errors are not white: autocorrelation {unexplained_autocorrelation:.3}{}",
                if white.largest_autocorrelation == unexplained_autocorrelation {
                    ""
                } else {
                    " beyond that of resampling"
                }
            ),
            cause: "a part of the drive is no driving, a sensor filters, or the driver is another one"
                .to_owned(),
            cure: "look at the residuals over time; leave out stretches with --from and --to".to_owned(),
        };
        out.push((white.statistic, refutation));
    }
    for test in inputs.iter().filter(|i| i.largest_z.abs() > INDEPENDENT_ENOUGH) {
        let refutation = Refutation {
            assumption: "the driver reacts to the inputs as equations (7) and (8) say",
            evidence: format!(
                "the prediction errors hold more of {}: {:.1} standard deviations",
                test.input, test.largest_z
            ),
            cause: format!(
                "{} is late, filtered or at another scale, or the driver is another one",
                test.input
            ),
            cure: "--estimate t_nms, k_nms, t_h_late or t_d_late".to_owned(),
        };
        out.push((test.largest_z.powi(2), refutation));
    }
    out
}

/// What a change refutes, in a record from and to an instant, s; the vehicle is farther to the left by `moved` m after it.
pub(crate) fn of_change(change: &Change, record: [f64; 2], moved: f64) -> Refutation {
    let when = change.when();
    let cause = match change.parameter {
        "k_d" => format!("the driver changed {when}, or the scale of the lane signals did"),
        T_D => format!("the torque sensor's offset changed {when}"),
        E_Y => format!(
            "the driver moved to another line {when}, in the mean {:.2} m farther to the {}, or the offset of e_y_m changed: \
             without another signal (a second camera, a place on a map) no log tells one from the other",
            moved.abs(),
            if moved > 0.0 { "left" } else { "right" },
        ),
        _ => format!("the driver changed {when}"),
    };
    let assumption = match change.parameter {
        T_D => SAME_SENSORS,
        E_Y => SAME_LINE,
        _ => SAME_DRIVER,
    };
    let is_driver = assumption != SAME_SENSORS;
    Refutation {
        assumption,
        evidence: evidence_of(change),
        cause,
        cure: cure_of(change, record, is_driver),
    }
}

fn evidence_of(change: &Change) -> String {
    format!(
        "{change}; that adds {:.0} to twice the log likelihood",
        change.deviance
    )
}

/// The parts of the record that the change leaves, if they are long enough to be fitted.
fn cure_of(change: &Change, [start, end]: [f64; 2], is_driver: bool) -> String {
    let [from, to] = change.within_s();
    let parts = [
        (from - start, format!("--to {from:.0}")),
        (end - to, format!("--from {to:.0}")),
    ];
    let left: Vec<String> = parts
        .into_iter()
        .filter(|p| p.0 >= SHORTEST_S)
        .map(|p| p.1)
        .collect();
    if left.is_empty() {
        return "another record: the change may lie anywhere in this one".to_owned();
    }
    let pieces = if is_driver { "--pieces, or " } else { "" };
    format!("{pieces}one part alone: {}", left.join(", or "))
}

/// A change that the balance of torques shows in the sensors, from the one before and the one after it.
pub(crate) fn of_changed_sensor(
    change: &Change,
    record: [f64; 2],
    [before, after]: [&Balance; 2],
) -> Option<Refutation> {
    if before.explained.min(after.explained) < BALANCE_SEEN {
        return None;
    }
    let moved = |[was, error_was]: [f64; 2], [is, error]: [f64; 2]| {
        let sure = (is - was).abs() > CERTAIN * error.hypot(error_was);
        (sure && (is / was - 1.0).abs() > SMALL_SCALE).then(|| is / was)
    };
    let refutation = |what: &str, how: String| Refutation {
        assumption: SAME_SENSORS,
        evidence: format!("{}, and there {how}", evidence_of(change)),
        cause: format!("{what} changed at {:.0} s", change.at_s[0]),
        cure: cure_of(change, record, false),
    };
    if let Some((was, is)) = before.scale.zip(after.scale)
        && let Some(factor) = moved(was, is)
    {
        let how = format!("driver_torque_nm goes to {factor:.3} times its scale against guidance_torque_nm");
        return Some(refutation(
            "the scale of driver_torque_nm or guidance_torque_nm",
            how,
        ));
    }
    let are_close = before.is_close() && after.is_close();
    let factor = moved(before.stiffness, after.stiffness).filter(|_| are_close)?;
    let how = format!("the column's torque goes to {factor:.3} times that of the same wheel angle");
    Some(refutation(
        "the scale of wheel_angle_rad or driver_torque_nm",
        how,
    ))
}

/// What no record of these columns can show.
pub(crate) const ASSUMED: [&str; 5] = [
    "a constant offset of e_y_m is the driver's line: without another signal no log tells one from the other",
    "e_y_m and e_theta_rad are not late: a late camera adds to t_p",
    "e_y_m and e_theta_rad are at scale: another scale divides gain_1, gain_2 or gain_3",
    "driver_torque_nm, guidance_torque_nm and the column have one scale: a scale that all share is not seen",
    "e_y_m and e_theta_rad are those at the driver's own points (0.3 s and 1.0 s ahead)",
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_driver_looks_ahead() {
        let gain = |gain, error| Parameter {
            optimum: Some(gain),
            standard_error: Some(error),
            ..Parameter::ABSENT
        };
        for (of, told) in [
            ((0.16, 0.14), true),
            ((0.16, 0.7), false),
            ((9.0, 0.5), false),
            ((-20.0, 3.0), true),
        ] {
            assert_eq!(of_gain_3(&gain(of.0, of.1)).is_some(), told, "{of:?}");
        }
    }

    /// A scale of 0.8 in a calm balance is told, but beside an assist, which makes one, and a delay of 8 ms too, which an assist makes too; a scale of 1.2 is told with an assist too. Of a
    /// balance that explains 90 % a swapped sign is told, and neither scale nor delay; a delay of 8 ms is within what steps of 0.2
    /// degrees leave open.
    #[test]
    fn a_balance_tells_as_much_as_it_explains() {
        let balance = |explained, scale, step_deg: f64| Balance {
            explained,
            scale: Some([scale, 0.01]),
            between_s: Some([0.008, 0.0005]),
            stiffness: [3.0, 0.1],
            angle_step_rad: step_deg.to_radians(),
            ..Balance::default()
        };
        let told = |b: Balance, assisted| of_balance(&b, assisted).len();
        assert_eq!(
            [
                told(balance(0.995, 0.8, 0.1), false),
                told(balance(0.995, 0.8, 0.1), true)
            ],
            [2, 0]
        );
        assert_eq!(
            [
                told(balance(0.995, 1.2, 0.2), false),
                told(balance(0.995, 1.2, 0.2), true)
            ],
            [1, 1]
        );
        assert_eq!(
            [
                told(balance(0.9, 0.8, 0.1), false),
                told(balance(0.9, -0.8, 0.1), true)
            ],
            [0, 1]
        );
    }

    /// Where what is left unexplained could make a scale of 0.5 or 1.5, one of 0.7 or 1.3 is not told, and one of 0.45 or 1.55 is. Rows 20 ms
    /// apart tell no delay of 8 ms, to neither side, and one of 12 ms; uneven ones tell that not either.
    #[test]
    fn what_is_unexplained_and_between_rows_is_left_open() {
        let told = |scale, between_s, [scale_leeway, row_leeway_s]: [f64; 2]| {
            let b = Balance {
                explained: 0.995,
                scale: Some([scale, 0.01]),
                between_s: Some([between_s, 0.0005]),
                stiffness: [3.0, 0.1],
                scale_leeway,
                row_leeway_s,
                ..Balance::default()
            };
            of_balance(&b, false).len()
        };
        assert_eq!([0.7, 1.3].map(|s| told(s, 0.0, [0.5, 0.004])), [0, 0]);
        assert_eq!([0.45, 1.55].map(|s| told(s, 0.0, [0.5, 0.004])), [1, 1]);
        assert_eq!([0.88, 1.12].map(|s| told(s, 0.0, [0.19, 0.004])), [1, 1]);
        assert_eq!([-0.008, 0.008].map(|s| told(1.0, s, [0.02, 0.01])), [0, 0]);
        assert_eq!([-0.012, 0.012].map(|s| told(1.0, s, [0.02, 0.01])), [1, 1]);
        assert_eq!([-0.012, 0.012].map(|s| told(1.0, s, [0.02, 0.02])), [0, 0]);
    }

    /// T_d is told late or early beyond what is left unexplained could make, and beyond 15 ms.
    #[test]
    fn a_torque_is_late_beyond_what_is_unexplained() {
        let told = |late_s, late_leeway_s| {
            let b = Balance {
                explained: 0.999,
                scale: Some([1.0, 0.01]),
                driver_late_s: [late_s, 0.001],
                stiffness: [3.0, 0.1],
                late_leeway_s,
                ..Balance::default()
            };
            of_balance(&b, false).len()
        };
        assert_eq!([-0.017, 0.017].map(|s| told(s, 0.01)), [1, 1]);
        assert_eq!([-0.017, 0.017].map(|s| told(s, 0.02)), [0, 0]);
        assert_eq!([-0.014, 0.014].map(|s| told(s, 0.01)), [0, 0]);
    }

    /// A sign is swapped where no right scale of 1 could look so: with a leeway of 1.15 -0.12 tells none, and -0.2 does. Scales are
    /// weighed to 10 %: not in gusts, beside an assist, where rows are sparse or where the leeway is more than a fifth.
    #[test]
    fn a_scale_is_told_from_what_a_right_one_may_look_like() {
        let b = |scale: f64, scale_leeway| Balance {
            explained: 0.995,
            scale: Some([scale, 0.01]),
            stiffness: [3.0, 0.1],
            scale_leeway,
            ..Balance::default()
        };
        let is_sign = |b: Balance| of_balance(&b, false).iter().any(|r| r.assumption == SIGNS);
        assert!(!is_sign(b(-0.12, 1.15)) && is_sign(b(-0.2, 1.15)) && is_sign(b(-1.0, 0.1)));
        let weighed = |b: Balance, assisted| torques(Some(&b), assisted) == Torques::Weighed;
        assert!(weighed(b(1.0, 0.19), false));
        assert!(!weighed(b(1.0, 0.21), false) && !weighed(b(1.0, 0.1), true));
        let gusts = Balance {
            explained: 0.985,
            ..b(1.0, 0.1)
        };
        let sparse = Balance {
            is_sparse: true,
            ..b(1.0, 0.1)
        };
        assert!(
            !weighed(gusts, false) && !weighed(sparse, false) && torques(None, false) == Torques::AsRecorded
        );
    }

    /// A part of 10 s at least of a record of 200 s can be fitted.
    #[test]
    fn a_cure_leaves_something() {
        let change = |from: f64, to: f64| Change {
            parameter: "k_hg",
            shape: super::super::change::Shape::Step,
            at_s: [0.5 * (from + to); 2],
            at_95_s: [[from, to]; 2],
            by: 0.5,
            deviance: 100.0,
        };
        let cure = |from, to| of_change(&change(from, to), [0.0, 200.0], 0.0).cure;
        assert_eq!(
            cure(50.0, 60.0),
            "--pieces, or one part alone: --to 50, or --from 60"
        );
        assert_eq!(cure(4.0, 60.0), "--pieces, or one part alone: --from 60");
        assert_eq!(
            cure(4.0, 195.0),
            "another record: the change may lie anywhere in this one"
        );
    }
}
