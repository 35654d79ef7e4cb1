//! Parameters out of range are named with their value and range; the edges of the range are in it.

use haptic_core::controller::config::{Config, Setup};
use haptic_core::controller::params::{PARAMETERS, Params};

type Set = fn(&mut Params, f64);

#[test]
fn each_parameter_is_checked_at_its_edges() {
    let fields: [(&str, f64, f64, Set); 11] = [
        ("k_1", 0.0, 4.0, |p, x| (p.k_1, p.a_3) = (x, 1.0)),
        ("a_1", 0.0, 100.0, |p, x| p.a_1 = x),
        ("a_2", 0.0, 100.0, |p, x| p.a_2 = x),
        ("a_3", 0.0, 100.0, |p, x| p.a_3 = x),
        ("a_4", 0.0, 100.0, |p, x| p.a_4 = x),
        ("rate_corner_hz", 0.5, 60.0, |p, x| p.rate_corner_hz = x),
        ("torque_limit_nm", 0.1, 5.0, |p, x| p.torque_limit_nm = x),
        ("probe_amplitude_nm", 0.0, 0.3, |p, x| {
            (p.probe_amplitude_nm, p.probe_frequency_hz) = (x, 1.5);
        }),
        ("probe_frequency_hz", 1.0, 5.0, |p, x| {
            (p.probe_amplitude_nm, p.probe_frequency_hz) = (0.1, x);
        }),
        ("t_nms_s", 0.01, 1.0, |p, x| p.t_nms_s = x),
        ("k_nms", 0.0, 10.0, |p, x| p.k_nms = x),
    ];
    for (name, min, max, set) in fields {
        let with = |x: f64| {
            let mut p = Params::PAPER;
            set(&mut p, x);
            Config::new(&p)
        };
        assert!(with(min).is_ok() && with(max).is_ok(), "{name}");
        // Beyond the nearest f32 of each, which is at most 1.2e-8 away.
        for bad in [min - 2e-8, max + 2e-8, f64::INFINITY, f64::NEG_INFINITY] {
            let error = with(bad).unwrap_err();
            assert_eq!(
                (error.name, error.value, error.min, error.max),
                (name, bad, min, max)
            );
        }
        assert_eq!(with(f64::NAN).unwrap_err().name, name);
    }
}

#[test]
fn a_product_out_of_range_is_named() {
    let error = Config::new(&Params {
        k_1: 1.0,
        a_3: 40.0,
        ..Params::PAPER
    })
    .unwrap_err();
    assert_eq!(error.to_string(), "k_1 * a_3 = 40 is outside [0, 32] N.m/rad");
}

#[test]
fn a_law_that_there_is_not_is_refused() {
    for (law, says) in [
        (0.0, None),
        (1.0, None),
        (0.5, Some("law = 0.5 is not a whole number from 0 to 1")),
        (1.5, Some("law = 1.5 is not a whole number from 0 to 1")),
        (2.0, Some("law = 2 is not a whole number from 0 to 1")),
        (-1.0, Some("law = -1 is not a whole number from 0 to 1")),
        (f64::NAN, Some("law = NaN is not a whole number from 0 to 1")),
    ] {
        let p = Params { law, ..Params::PAPER };
        let error = Setup::new(&p)
            .map(|_| ())
            .map_err(|error| error.to_string())
            .err();
        assert_eq!(error.as_deref(), says, "{law}");
    }
}

#[test]
fn a_probe_too_steep_for_the_wind_up_limit_is_refused() {
    let with = |amplitude, frequency| {
        Config::new(&Params {
            probe_amplitude_nm: amplitude,
            probe_frequency_hz: frequency,
            ..Params::PAPER
        })
    };
    // 2*pi*0.2*2.75 = 3.456 N.m/s, 2*pi*0.2*2.8 = 3.519 N.m/s.
    assert!(with(0.2, 2.75).is_ok());
    let error = with(0.2, 2.8).unwrap_err();
    assert_eq!(error.name, "2 * pi * probe_amplitude_nm * probe_frequency_hz");
    assert!((error.value - 3.5186).abs() < 1e-4 && error.max == 3.5, "{error}");
}

#[test]
fn a_law_that_the_monitor_cannot_follow_is_refused() {
    // Each gain is within its range and so is its product with K_1, but noise of 1.5 mrad alone moves a law with so
    // quick a filter by more than the 5 N.m that the monitor tolerates at most.
    let with = |a_4, rate_corner_hz| {
        let params = Params {
            a_4,
            rate_corner_hz,
            ..Params::PAPER
        };
        Setup::new(&params).map(|_| ())
    };
    assert_eq!(with(1.0, 10.0), Ok(()));
    let error = with(100.0, 60.0).unwrap_err();
    assert!(error.name.contains("band"), "{error}");
    assert!(error.value > error.max && error.max == 5.0, "{error}");
}

/// Half of it is what law and monitor differ by: rates of 4 m/s2 and 1 rad/s2 times the difference of their delays (the filter's
/// tau against 20 to 60 ms), noise of 15 mm and 1.5 mrad, and a sample of 30 ms that goes on at rates of as much; 1.5 m/s and
/// 0.3 rad/s for those 30 ms come once. Worked out apart from this program.
#[test]
fn the_band_of_the_monitor_is_that_of_its_reasons() {
    for ([k_1, a_1, a_2, a_3, a_4], rate_corner_hz, band_nm) in [
        ([0.5, 60.0, 20.0, 50.0, 30.0], 10.0, 28.149_068_745),
        ([0.4, 70.0, 30.0, 20.0, 60.0], 60.0, 68.987_543_719),
        ([2.0, 15.0, 4.0, 10.0, 14.0], 0.5, 41.320_851_282),
        ([0.8, 10.0, 12.0, 35.0, 20.0], 3.0, 12.537_482_610),
    ] {
        let params = Params {
            k_1,
            a_1,
            a_2,
            a_3,
            a_4,
            rate_corner_hz,
            ..Params::PAPER
        };
        let error = Setup::new(&params).map(|_| ()).unwrap_err();
        assert!(
            (error.value / band_nm - 1.0).abs() < 1e-8,
            "{error}, not {band_nm}"
        );
    }
}

#[test]
fn the_default_is_the_paper() {
    // Table 8 and section 3.2.
    let p = Params::default();
    assert_eq!([p.k_1, p.a_1, p.a_2, p.a_3, p.a_4], [0.25, 2.0, 0.05, 40.0, 1.0]);
    assert_eq!(p.torque_limit_nm, 5.0);
}

/// The table in docs/parameters.md, of which this prints what it should be.
#[test]
fn the_documents_list_every_parameter() {
    let mut table =
        String::from("| number | name | unit | range | default | what |\n|---|---|---|---|---|---|\n");
    for (number, p) in PARAMETERS.iter().enumerate() {
        table += &format!(
            "| {number} | `{}` | {} | {} to {} | {} | {} |\n",
            p.name,
            p.unit,
            p.min,
            p.max,
            p.default,
            p.meaning.trim()
        );
    }
    let document = include_str!("../../docs/parameters.md");
    assert!(
        document.contains(&table),
        "docs/parameters.md should hold\n{table}"
    );
}

/// The names in the header for C, of which this prints what they should be.
#[test]
fn the_header_for_c_names_every_parameter() {
    let enumerators: Vec<String> = PARAMETERS
        .iter()
        .enumerate()
        .map(|(number, p)| format!("    HG_{} = {number}", p.name.to_uppercase().replace('.', "_")))
        .collect();
    let names = format!("typedef enum hg_parameter {{\n{}\n}}", enumerators.join(",\n"));
    let count = format!("#define HG_PARAMETERS {}\n", PARAMETERS.len());
    let header = include_str!("../../bindings/c/include/haptic_guidance.h");
    assert!(
        header.contains(&names) && header.contains(&count),
        "bindings/c/include/haptic_guidance.h should hold\n{count}{names}"
    );
}

/// A value in each place of a set comes out of the same place.
#[test]
fn values_and_fields_are_in_the_order_of_the_list() {
    let numbered = core::array::from_fn(|i| i as f64);
    let params = Params::from_values(&numbered);
    assert_eq!(params.to_values(), numbered);
    assert_eq!(
        (params.k_1, params.k_nms, params.vehicle.far_time_s),
        (0.0, 13.0, 20.0)
    );
}
