//! What `peers/peer.py` printed: margins by python-control, and the states of a drive by SciPy's DOP853. It writes its equations
//! itself and takes no more than the parameters from here.

use std::f64::consts::TAU;

use haptic_column::linear::{Hands, Linear, margins};
use haptic_sim::models::torsion_bar::{Assist, ColumnParameters, Curve};
use haptic_sim::parts::Vehicle;

use crate::physics::{V, acting, plant};

/// Slope, km/h, whether the wheel is held; gain margin, phase margin (degrees), its place (Hz), largest sensitivity.
const MARGINS: [(f64, f64, Hands, [f64; 4]); 6] = [
    (
        2.0,
        60.0,
        Hands::Free,
        [13.581888, 39.809397, 17.900367, 1.569773],
    ),
    (4.0, 60.0, Hands::Free, [6.790944, 38.815214, 24.090277, 1.640973]),
    (
        4.0,
        60.0,
        Hands::Fixed,
        [6.875869, 39.088483, 21.595523, 1.616822],
    ),
    (8.0, 30.0, Hands::Free, [3.395517, 33.373407, 36.502130, 2.041038]),
    (20.0, 5.0, Hands::Free, [1.358395, 10.774957, 67.826018, 6.467905]),
    (
        20.0,
        5.0,
        Hands::Fixed,
        [1.375380, 11.398760, 67.013539, 6.161219],
    ),
];

/// States after 2 s without guidance's part and psi: v_y, r; phi_w, phi_w', give; phi_c, phi_c', give; sensor, compensator; motor.
const DRIVE: [f64; 11] = [
    3.994761533e-1,
    2.840011154e-1,
    1.673945859,
    3.997353600,
    3.490658504e-3,
    1.653300371,
    4.025965523,
    3.490658504e-3,
    2.961278777,
    2.965214381,
    5.964669646,
];

#[test]
fn margins_are_those_of_python_control() {
    for (slope, kmh, hands, expected) in MARGINS {
        let linear = Linear::new(
            &plant(ColumnParameters::default(), Assist::Slope(slope)),
            kmh / 3.6,
            0.0,
        );
        assert!(linear.is_stable(hands));
        let found = margins(|hz| linear.assist_loop(hands, hz)).unwrap();
        let numbers = [
            found.gain.unwrap(),
            found.phase_deg.unwrap(),
            found.at_hz.unwrap(),
            found.sensitivity,
        ];
        for (name, (found, expected)) in ["gain", "phase", "place", "sensitivity"]
            .iter()
            .zip(numbers.iter().zip(expected))
        {
            assert!(
                (found / expected - 1.0).abs() < 2e-3,
                "slope {slope}, {hands:?}, {name}: {found} {expected}"
            );
        }
    }
}

/// Beyond the gain margin the closed loop's eigenvalues say so, and short of it.
#[test]
fn a_gain_beyond_the_margin_swings() {
    for (slope, is_stable) in [(20.0 * 1.35, true), (20.0 * 1.37, false)] {
        let linear = Linear::new(
            &plant(ColumnParameters::default(), Assist::Slope(slope)),
            5.0 / 3.6,
            0.0,
        );
        assert_eq!(linear.is_stable(Hands::Free), is_stable, "{slope}");
    }
}

#[test]
fn a_drive_with_friction_and_a_curve_is_that_of_scipy() {
    let bar = ColumnParameters {
        sensor_noise_nm: 0.0,
        ..ColumnParameters::default()
    };
    let mut plant = plant(bar, Assist::Points(Curve::usual(1.0)));
    for k in 0..2000 {
        let t = f64::from(k) * 1e-3;
        plant.step(&acting(3.0 * (TAU * 0.7 * t).sin(), 0.8 * (TAU * 1.9 * t).sin()));
    }
    assert!((V - 16.6667).abs() < 1e-4);
    for (state, (found, expected)) in plant.state().iter().zip(DRIVE).enumerate() {
        assert!(
            (found / expected - 1.0).abs() < 1e-3,
            "state {state}: {found} {expected}"
        );
    }
}
