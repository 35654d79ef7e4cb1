//! Parameters out of range are named with their value and range; the edges of the range are in it.

use haptic_core::params::{Config, ParamError, Params};

type Set = fn(&mut Params, f64);

#[test]
fn each_parameter_is_checked_at_its_edges() {
    let fields: [(&str, f64, f64, Set); 7] = [
        ("k_1", 0.0, 4.0, |p, x| (p.k_1, p.a_3) = (x, 1.0)),
        ("a_1", 0.0, 100.0, |p, x| p.a_1 = x),
        ("a_2", 0.0, 100.0, |p, x| p.a_2 = x),
        ("a_3", 0.0, 100.0, |p, x| p.a_3 = x),
        ("a_4", 0.0, 100.0, |p, x| p.a_4 = x),
        ("rate_corner_hz", 0.5, 60.0, |p, x| p.rate_corner_hz = x),
        ("torque_limit_nm", 0.1, 5.0, |p, x| p.torque_limit_nm = x),
    ];
    for (name, min, max, set) in fields {
        let with = |x: f64| {
            let mut p = Params::PAPER;
            set(&mut p, x);
            Config::new(&p)
        };
        assert!(with(min).is_ok() && with(max).is_ok(), "{name}");
        for bad in [min - 1e-9, max + 1e-9, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(
                with(bad),
                Err(ParamError {
                    name,
                    value: bad,
                    min,
                    max
                })
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
    assert_eq!(error.to_string(), "k_1 * a_3 = 40 is outside [0, 32]");
}
