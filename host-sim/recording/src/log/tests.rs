use super::*;

const HEADER: &str = "time_s,e_y_m,e_theta_rad,wheel_angle_rad,guidance_torque_nm,driver_torque_nm";

/// 12 s at 100 Hz; `edit` may change the fields of data row `k` (line `k + 2`).
fn text(edit: impl Fn(usize, &mut [String; 6])) -> String {
    rows(1200, edit)
}

fn rows(count: usize, edit: impl Fn(usize, &mut [String; 6])) -> String {
    let mut out = HEADER.to_owned();
    for k in 0..count {
        let t = k as f64 / 100.0;
        let mut row = [
            format!("{t:.4}"),
            format!("{}", 0.01 * t),
            format!("{}", 0.002 * t),
            format!("{}", 0.01 * t),
            "0.1".to_owned(),
            if k == 0 { "-0.1" } else { "-0.2" }.to_owned(),
        ];
        edit(k, &mut row);
        out.push('\n');
        out.push_str(&row.join(","));
    }
    out
}

fn error(text: &str) -> String {
    DriveLog::read(text.as_bytes(), false).unwrap_err().to_string()
}

#[test]
fn a_good_log_is_read_whatever_the_order_of_its_columns() {
    let log = DriveLog::read(text(|_, _| {}).as_bytes(), false).unwrap();
    assert_eq!(log.len(), 1200);
    assert!((log.dt_s - 0.01).abs() < 1e-12);
    assert_eq!((log.guidance_torque_nm[7], log.driver_torque_nm[7]), (0.1, -0.2));
    assert!((log.time_s(1199) - 11.99).abs() < 1e-9);
    let mut shuffled =
        "\u{feff}driver_torque_nm, note ,time_s,e_y_m,e_theta_rad,wheel_angle_rad,guidance_torque_nm"
            .to_owned();
    for k in 0..1200 {
        shuffled.push_str(&format!(
            "\n{},word,{},0.5,0.05,0.1,0.2",
            -0.01 * f64::from(k),
            f64::from(k) / 100.0
        ));
    }
    let log = DriveLog::read(shuffled.as_bytes(), false).unwrap();
    assert_eq!((log.e_y_m[3], log.driver_torque_nm[20]), (0.5, -0.2));
}

#[test]
fn every_missing_column_is_named_with_its_likely_stand_in() {
    let e = error("time_s,e_y_m,wheel_angle_deg,driver_torque_nm\n0,0,0,0");
    assert!(
        e.contains("there are no channels e_theta_rad, wheel_angle_rad (there is wheel_angle_deg), guidance"),
        "{e}"
    );
    assert!(!e.contains("e_y_m"), "{e}");
    assert!(error("time_s,time_s,e_y_m").contains("time_s is there twice"));
}

#[test]
fn a_manual_log_may_lack_the_guidance_column() {
    let without: String = text(|_, _| {})
        .lines()
        .map(|l| {
            let mut f: Vec<&str> = l.split(',').collect();
            f.remove(4);
            f.join(",") + "\n"
        })
        .collect();
    let log = DriveLog::read(without.as_bytes(), true).unwrap();
    assert!(log.guidance_torque_nm.iter().all(|&t| t == 0.0));
    assert!(error(&without).contains("there is no channel guidance_torque_nm"));
    // Or the numbers in it.
    for nothing in ["", "NaN", "-"] {
        let empty = text(|_, r| r[4] = nothing.to_owned());
        let log = DriveLog::read(empty.as_bytes(), true).unwrap();
        assert!(log.guidance_torque_nm.iter().all(|&t| t == 0.0));
        assert_eq!(error(&empty), "guidance_torque_nm holds no number");
    }
}

#[test]
fn what_is_missing_stays_missing_and_what_is_no_number_is_named() {
    for nothing in ["nan", "", "-", "inf"] {
        let log = DriveLog::read(
            text(|k, r| {
                if k == 40 {
                    r[2] = nothing.to_owned();
                }
            })
            .as_bytes(),
            false,
        )
        .unwrap();
        assert!(
            log.e_theta_rad[40].is_nan() && log.e_theta_rad[41].is_finite(),
            "{nothing}"
        );
    }
    let e = error(&text(|k, r| {
        if k == 0 {
            r[5] = "3;1".to_owned();
        }
    }));
    assert!(e.starts_with("line 2: driver_torque_nm is \"3;1\""), "{e}");
    let e = error(&text(|k, r| {
        if k == 9 {
            r[5] = "1,2".to_owned();
        }
    }));
    assert_eq!(e, "line 11: 7 fields where the header has 6");
    assert_eq!(
        error(&text(|_, r| r[1] = "NaN".to_owned())),
        "e_y_m holds no number"
    );
    // A row without a time has no place.
    let none = text(|k, r| {
        if k == 7 {
            r[0] = "nan".to_owned();
        }
    });
    let log = DriveLog::read(none.as_bytes(), false).unwrap();
    assert_eq!(log.findings[1], ["1 row", "no time, in line 9", "left out"]);
}

#[test]
fn time_that_stands_still_or_is_in_another_unit_is_named_with_its_line() {
    let e = error(&text(|k, r| {
        if k == 5 {
            r[0] = "0.04".to_owned();
        }
    }));
    assert!(
        e.starts_with("line 7: the time goes from 0.04 to 0.04 s, and must grow: two rows"),
        "{e}"
    );
    assert!(error(&text(|k, r| r[0] = format!("{}", 10 * k))).contains("is it in ms?"));
}

/// Rows 601 to 610 and 900 are lost: the others keep their instants, and those are missing.
#[test]
fn lost_rows_leave_their_places_empty() {
    let lost = |k: usize| (601..=610).contains(&k) || k == 900;
    let whole = text(|_, _| {});
    let some: String = whole
        .lines()
        .enumerate()
        .filter(|(line, _)| *line == 0 || !lost(line - 1))
        .map(|(_, l)| l.to_owned() + "\n")
        .collect();
    let log = DriveLog::read(some.as_bytes(), false).unwrap();
    assert_eq!(log.len(), 1200);
    assert!((log.dt_s - 0.01).abs() < 1e-9 && (log.time_s(1199) - 11.99).abs() < 1e-9);
    for k in 0..1200 {
        assert_eq!(log.e_y_m[k].is_nan(), lost(k), "{k}");
        assert!(lost(k) || (log.e_y_m[k] - 1e-4 * k as f64).abs() < 1e-12, "{k}");
    }
    assert_eq!(
        log.findings[0][1],
        "11 rows lost in 2 gaps, the longest of 0.10 s"
    );
}

/// Stamps that limp by up to 30 % of a step, with a sine sampled at them: read off at even instants it is the sine there.
/// The cubic's error is h^4 w^4/24 at most, 1e-6 here; taken as even, the sine would be off by 0.02.
#[test]
fn uneven_stamps_are_resampled_by_their_times() {
    let stamp = |k: usize| 0.01 * (k as f64 + 0.3 * (12.9898 * k as f64).sin());
    let sine = |t: f64| (6.0 * t).sin();
    let log = DriveLog::read(
        text(|k, r| {
            r[0] = format!("{:.9}", stamp(k));
            r[1] = format!("{:.9}", sine(stamp(k)));
        })
        .as_bytes(),
        false,
    )
    .unwrap();
    assert!(log.findings[0][1].starts_with("uneven"), "{:?}", log.findings);
    let worst = (2..log.len() - 3)
        .map(|k| (log.e_y_m[k] - sine(log.time_s(k))).abs())
        .fold(0.0, f64::max);
    assert!(worst < 3e-6, "{worst}");
    // 100 Hz for the first half, 95 Hz for the second: each step passes alone, the sum does not.
    let slower = |k: usize| k as f64 / 100.0 + k.saturating_sub(600) as f64 / 1900.0;
    let log = DriveLog::read(
        text(|k, r| {
            r[0] = format!("{:.9}", slower(k));
            r[1] = format!("{:.9}", sine(slower(k)));
        })
        .as_bytes(),
        false,
    )
    .unwrap();
    let worst = (2..log.len() - 3)
        .map(|k| (log.e_y_m[k] - sine(log.time_s(k))).abs())
        .fold(0.0, f64::max);
    assert!(worst < 3e-6, "{worst}");
}

#[test]
fn columns_in_memory_are_read_as_a_file_is() {
    let whole = text(|_, _| {});
    let file = DriveLog::read(whole.as_bytes(), false).unwrap();
    let mut columns: [Vec<f64>; 6] = Default::default();
    for line in whole.lines().skip(1) {
        for (column, field) in columns.iter_mut().zip(line.split(',')) {
            column.push(field.parse().unwrap());
        }
    }
    assert_eq!(DriveLog::from_columns(columns.clone(), false).unwrap(), file);
    columns[3].pop();
    let e = DriveLog::from_columns(columns, false).unwrap_err().to_string();
    assert_eq!(e, "wheel_angle_rad has 1199 rows where time_s has 1200");
}

#[test]
fn stamps_rounded_to_a_millisecond_are_read_as_the_even_grid_that_they_are() {
    for rate_hz in [60.0, 120.0, 144.0, 240.0, 250.0] {
        let time_s = |k: usize| 1000.0 + k as f64 / rate_hz;
        let rounded = rows(2600, |k, r| {
            r[0] = format!("{:.3}", time_s(k));
            r[1] = "0".to_owned();
            r[2] = "0".to_owned();
        });
        let log = DriveLog::read(rounded.as_bytes(), false).unwrap();
        for k in [0, 1300, 2599] {
            assert!((log.time_s(k) - time_s(k)).abs() < 5e-5, "{rate_hz} Hz, row {k}");
        }
    }
    // A lost sample among them leaves its place empty; a clock that was set makes the stamps uneven.
    let stamp = |k: usize, late: f64| format!("{:.3}", k as f64 / 120.0 + late);
    let read = |t: String| DriveLog::read(t.as_bytes(), false).unwrap();
    let log = read(rows(2600, |k, r| r[0] = stamp(k + usize::from(k >= 700), 0.0)));
    assert!(log.len() == 2601 && log.e_y_m[700].is_nan() && log.e_y_m[701].is_finite());
    let log = read(rows(2600, |k, r| {
        r[0] = stamp(k, if k < 700 { 0.0 } else { 0.0033 })
    }));
    assert!(log.findings[0][1].starts_with("uneven"), "{:?}", log.findings);
}

#[test]
fn comments_capitals_and_windows_line_ends_are_read_and_lines_counted_with_them() {
    let plain = DriveLog::read(text(|_, _| {}).as_bytes(), false).unwrap();
    let dressed = |t: &str| {
        let t = t.replace(
            HEADER,
            &format!("# drive 7\n# by hand\n{}", HEADER.to_uppercase()),
        );
        t.replace("\n0.0500,", "\n# overtaken\n0.0500,")
            .replace('\n', "\r\n")
    };
    let read = DriveLog::read(dressed(&text(|_, _| {})).as_bytes(), false).unwrap();
    assert_eq!(read, plain);
    // Row 40 is line 42 of the plain file; three comments stand before it.
    let e = error(&dressed(&text(|k, r| {
        if k == 40 {
            r[5] = "x".to_owned();
        }
    })));
    assert!(e.starts_with("line 45: DRIVER_TORQUE_NM is \"x\""), "{e}");
    let e = error(&dressed(&text(|_, _| {})).replace("E_Y_M", "E_Y_MM"));
    assert!(
        e.starts_with("there is no channel e_y_m; near are E_Y_MM; --map e_y_m=CHANNEL"),
        "{e}"
    );
    assert!(error("# only a comment").contains("there is no channel time_s"));
}

#[test]
fn semicolons_and_tabs_are_read_and_a_decimal_comma_is_named() {
    let plain = DriveLog::read(text(|_, _| {}).as_bytes(), false).unwrap();
    for separator in [";", "\t"] {
        let other = text(|_, _| {}).replace(',', separator);
        assert_eq!(DriveLog::read(other.as_bytes(), false).unwrap(), plain);
        let e = error(&other.replace("0.1", "0,1"));
        assert!(
            e.starts_with("line 12: time_s is \"0,1000\"")
                && e.ends_with("which is not a number: the decimal sign is a point"),
            "{e}"
        );
    }
}

#[test]
fn degrees_and_millinewtons_are_seen() {
    let e = error(&text(|k, r| r[3] = format!("{}", 0.01 * k as f64)));
    assert!(e.starts_with("line 317: wheel_angle_rad is 3.15"), "{e}");
    assert!(e.ends_with("is it in degrees?"), "{e}");
    let e = error(&text(|k, r| r[3] = format!("{:.1}", 0.002 * k as f64)));
    assert!(e.contains("wheel_angle_rad moves by 0.100 at least"), "{e}");
    let e = error(&text(|k, r| r[2] = format!("{}", 0.01 * k as f64)));
    assert!(e.starts_with("line 53: e_theta_rad is 0.51"), "{e}");
    assert!(error(&text(|_, r| r[5] = "-200".to_owned())).contains("line 2: driver_torque_nm is -200"));
    assert!(error(&text(|_, r| r[1] = "120".to_owned())).contains("is it in mm?"));
}

#[test]
fn a_torque_that_never_changes_is_refused() {
    let error = error(&text(|_, r| r[5] = "0.5".to_owned()));
    assert_eq!(
        error,
        "driver_torque_nm is 0.5 throughout: the sensor measures nothing"
    );
}

#[test]
fn a_short_log_is_refused() {
    let short: String = text(|_, _| {})
        .lines()
        .take(500)
        .map(|l| l.to_owned() + "\n")
        .collect();
    assert!(error(&short).contains("covers 4.980 s"));
    assert_eq!(error(HEADER), "there is no channel with a number in it");
}

#[test]
fn a_log_that_was_written_is_read_again() {
    let log = DriveLog::read(text(|_, _| ()).as_bytes(), false).unwrap();
    let mut bytes = Vec::new();
    log.write(&mut bytes).unwrap();
    let again = DriveLog::read(&bytes[..], false).unwrap();
    assert_eq!((again.len(), again.e_y_m[7]), (1200, 0.0007));
    assert_eq!(again.driver_torque_nm, log.driver_torque_nm);
    assert!((again.dt_s - 0.01).abs() < 1e-9);
}

/// Row k is k: what is left says which rows were taken. The limit of the rate counts where rows are many and slow.
#[test]
fn of_more_rows_than_a_fit_gains_from_every_so_many_th_is_used() {
    let log = |rows: usize, rate_hz: f64| {
        let signal: Vec<f64> = (0..rows).map(|k| k as f64).collect();
        let log = DriveLog {
            start_s: 5.0,
            dt_s: 1.0 / rate_hz,
            e_y_m: signal.clone(),
            e_theta_rad: signal.clone(),
            wheel_angle_rad: signal.clone(),
            guidance_torque_nm: signal.clone(),
            driver_torque_nm: signal,
            resampling: vec![0.6, 0.5, 0.4, 0.3],
            ..DriveLog::default()
        };
        log.thinned()
    };
    // 4 h are 561,600 rows at 39 Hz and 288,000 at 20 Hz.
    for (rows, rate_hz, every, left) in [
        (300_000, 120.0, 1, 300_000),
        (300_001, 120.0, 2, 150_001),
        (600_000, 120.0, 2, 300_000),
        (600_001, 120.0, 3, 200_001),
        (300_000, 12.0, 1, 300_000),
        (561_600, 39.0, 1, 561_600),
        (561_601, 39.0, 1, 561_600),
        (600_000, 40.0, 2, 300_000),
        (900_000, 40.0, 2, 288_000),
        (900_000, 39.0, 1, 561_600),
    ] {
        let thin = log(rows, rate_hz);
        assert_eq!(thin.len(), left, "{rows} {rate_hz}");
        for signal in thin.signals() {
            assert_eq!(signal[..3], [0.0, every as f64, 2.0 * every as f64]);
        }
        assert_eq!(thin.start_s, 5.0);
        assert!((thin.dt_s * rate_hz - every as f64).abs() < 1e-12);
        let is_cut = left < rows.div_ceil(every);
        assert_eq!(thin.findings.len(), usize::from(every > 1) + usize::from(is_cut));
    }
    let said = ["rows", "5.6 h", "the first 4 h used; --from and --to take others"].map(String::from);
    assert_eq!(log(800_000, 40.0).findings[1], said);
    assert_eq!(log(600_000, 120.0).resampling, [0.5, 0.3]);
    let found = log(600_000, 120.0).findings;
    assert_eq!(
        found,
        [["rows", "600000 at 120 Hz", "one of 2 used"].map(String::from)]
    );
}
