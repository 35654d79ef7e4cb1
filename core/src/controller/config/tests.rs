use super::*;

/// Worked out apart from this program: times to the nearest microsecond, 1/(2*pi*corner) to the nearest 2^-8 us.
#[test]
fn times_are_rounded_to_the_nearest_count() {
    for (far_time_s, near_time_s, between_us, rate_corner_hz, tau) in [
        (0.7, 0.3, 400_000, 10.0, 4_074_367),
        (1.234_567_6, 0.1, 1_134_568, 0.5, 81_487_331),
        (1.0, 0.25, 750_000, 7.3, 5_581_324),
        (0.3, 0.7, 0, 60.0, 679_061),
    ] {
        let mut params = Params {
            rate_corner_hz,
            ..Params::PAPER
        };
        (params.vehicle.far_time_s, params.vehicle.near_time_s) = (far_time_s, near_time_s);
        let config = Config::new(&params).unwrap();
        assert_eq!(config.plausibility.between, Micros::from_us(between_us));
        assert_eq!(config.law().unwrap().coefficients().tau, tau, "{rate_corner_hz}");
    }
}

/// Only driver activity has a lambda_min.
#[test]
fn the_number_of_a_law_chooses_its_variant() {
    for (law, least_share) in [(0.0, None), (1.0, Some(Ratio::from_si(0.05)))] {
        let params = Params {
            law,
            activity_lambda_min: 0.05,
            ..Params::PAPER
        };
        let found = match Config::new(&params).unwrap().law() {
            Some(Law::DriverActivity { least_share, .. }) => Some(least_share),
            Some(Law::Paper(_)) => None,
            None => panic!("{law} is a law"),
        };
        assert_eq!(found, least_share, "{law}");
    }
}

/// Worked out apart from this program. No two parameters that could take each other's place are alike.
#[test]
fn each_parameter_reaches_monitor_and_estimator() {
    let params = Params {
        k_1: 0.5,
        a_1: 1.5,
        a_2: 0.1,
        a_3: 20.0,
        a_4: 0.7,
        torque_limit_nm: 4.2,
        wind_up_nm_per_s: 3.2,
        reduction_nm_per_s: 6.2,
        probe_amplitude_nm: 0.123_4,
        probe_frequency_hz: 2.3,
        t_nms_s: 0.08,
        k_nms: 0.7,
        ..Params::PAPER
    };
    let Setup {
        monitor, estimator, ..
    } = Setup::new(&params).unwrap();
    let expected = Monitor {
        limit_mnm: 4200,
        // Up to whole mN.m.
        growth_mnm_per_ms: 4,
        fall_mnm_per_ms: 7,
        handover_fall_mnm_per_ms: 28,
        band_mnm: 364,
        probe_mnm: 124,
        gains_mnm: [750, 10_000, 50, 350],
        // Without a bar every reading is the hands' own.
        window_us: 0,
        margin_mnm: 0,
        wheel_mnm_per_mrad: 0,
    };
    assert_eq!(monitor, expected);
    assert_eq!((estimator.phase_per_us, estimator.periods), (9878, 5));
    assert_eq!((estimator.amplitude_nm, estimator.k_nms), (0.123_4, 0.7));
    assert!(estimator.arm.re == 1.0 && (estimator.arm.im - 1.156_11).abs() < 1e-5);
    assert!(estimator.slower.re == 0.0 && (estimator.slower.im - 0.433_54).abs() < 1e-5);
}
