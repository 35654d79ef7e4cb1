//! The band of the monitor's own FDCA, `T = c*v*(g*(k_y*e_y' + k_psi*e_theta') + LoHS*(r + de_theta'/dt))` in f64: 0.3 N.m around what an
//! honest law may ask for until the next picture, and around zero. Frames are packed here by hand.

use haptic_core::controller::config::Setup;
use haptic_core::controller::params::Params;
use haptic_core::safety::monitor::{Evidence, Fdca, Frames, Monitor, MonitorState, New};
use haptic_core::safety::redundant::Redundant;

use crate::monitor::{ACTIVE, Bench, FADE, counts, guidance, lane};

/// Both speeds in 2^-8 m/s from bits 12 and 28, the yaw rate in 2^-12 rad/s from bit 44, valid bit 58.
fn vehicle(speeds: [f64; 2], yaw_rate: Option<f64>) -> [u8; 8] {
    let [one, other] = speeds.map(|speed| (speed * 256.0).round() as u64);
    let rate = yaw_rate.map_or(0, |rate| {
        ((rate * 4096.0).round() as i64 as u64 & 0x3FFF) << 44 | 1 << 58
    });
    (one << 12 | other << 28 | rate).to_le_bytes()
}

/// The wheel angle in 0.01 deg from bit 30.
fn wheel(rad: f64) -> [u8; 8] {
    let count = (rad.to_degrees() * 100.0).round() as i64 as u64;
    ((count & 0x3_FFFF) << 30).to_le_bytes()
}

/// What stands in the frames when a picture comes.
#[derive(Clone, Copy)]
struct Seen {
    e_y: f64,
    e_theta: f64,
    age_ms: u64,
    speeds: [f64; 2],
    yaw_rate: Option<f64>,
    /// The rate of turn that wheel and speed say, at the first of the speeds.
    by_wheel: f64,
    /// What the guidance frame says beside the torque.
    said: u64,
    /// Since the last picture.
    apart_ms: u32,
}

const STRAIGHT: Seen = Seen {
    e_y: 0.0,
    e_theta: 0.0,
    age_ms: 0,
    speeds: [20.0; 2],
    yaw_rate: Some(0.0),
    by_wheel: 0.0,
    said: 0,
    apart_ms: 8,
};

/// Only the path: without errors, `T = c*v*(r + de_theta'/dt)`.
const PATH: Params = Params {
    law: 2.0,
    fdca_k_y_rad_per_m: 0.0,
    fdca_k_psi: 0.0,
    ..Params::PAPER
};

/// g, 1/s.
fn turning_gain(speed: f64) -> f64 {
    let v = &Params::PAPER.vehicle;
    speed * v.curvature_gain_per_m / (1.0 + v.stability_factor_s2_per_m2 * speed * speed)
}

/// c*v, N.m per rad/s.
fn per_turning(speed: f64) -> f64 {
    Params::PAPER.vehicle.aligning_gain_nm_s2_per_m * speed
}

/// A monitor with what it remembers.
struct FdcaBench {
    monitor: Monitor,
    state: MonitorState,
    fdca: Redundant<Fdca>,
    torque: i64,
}

impl FdcaBench {
    fn show(&mut self, seen: Option<&Seen>, mode: u64, us: u32) -> bool {
        let said = seen.map_or(0, |seen| seen.said);
        let frame = u64::from_le_bytes(guidance(self.torque, mode)) | said;
        let mut frames = Frames::NONE;
        if let Some(seen) = seen {
            let counts = |value: f64, per: f64| (value * per).round() as i64;
            frames = Frames {
                lane: lane(
                    counts(seen.e_y, 8192.0),
                    counts(seen.e_theta, 65_536.0),
                    seen.age_ms * 10,
                ),
                column: wheel(seen.by_wheel / turning_gain(seen.speeds[0])),
                vehicle: vehicle(seen.speeds, seen.yaw_rate),
                new: New {
                    lane: true,
                    ..New::default()
                },
                ..Frames::NONE
            };
        }
        let evidence = Evidence {
            frames: &frames,
            guidance: &frame.to_le_bytes(),
            elapsed_us: us,
        };
        self.monitor.step(&mut self.state, &mut self.fdca, &evidence)
    }
}

/// Whether a torque is within the band for 21 ms after the last picture.
fn is_within(params: &Params, pictures: &[Seen], nm: f64) -> bool {
    let torque = counts((nm * 1e3).round() as i64).0;
    let setup = Setup::new(params).unwrap();
    let mut bench = FdcaBench {
        monitor: setup.monitor,
        // Brought to it by (9).
        state: Bench::at(5.0, torque).state,
        fdca: Redundant::new(setup.fdca),
        torque,
    };
    for seen in pictures {
        assert!(bench.show(Some(seen), FADE, seen.apart_ms * 1000));
    }
    let permitted = (0..21).take_while(|_| bench.show(None, ACTIVE, 1000)).count();
    assert!(permitted == 20 || permitted == 21, "{permitted}");
    permitted == 21
}

/// The band has these edges, give or take 1 % and the roundings of the monitor's integers, 5 mN.m.
#[track_caller]
fn assert_band(params: &Params, pictures: &[Seen], [least, most]: [f64; 2]) {
    let edges = [(least.min(0.0) - 0.3, -1.0), (most.max(0.0) + 0.3, 1.0)];
    for (edge, outwards) in edges {
        let by = 0.005 + 0.01 * (f64::abs(edge) - 0.3);
        let inside = is_within(params, pictures, edge - outwards * by);
        let outside = is_within(params, pictures, edge + outwards * by);
        assert!(inside && !outside, "edge {edge}: {inside} {outside}");
    }
}

/// So many pictures that the lane passes at a constant rate of the yaw error; the last is at zero.
fn at_rate(rate: f64, last: Seen) -> Vec<Seen> {
    let mut pictures = vec![last; 41];
    for (k, seen) in pictures.iter_mut().rev().enumerate() {
        seen.e_theta = -rate * f64::from(last.apart_ms) * 1e-3 * k as f64;
    }
    pictures
}

#[test]
fn errors_and_path_make_the_torque() {
    let both = Params {
        law: 2.0,
        fdca_k_y_rad_per_m: 0.5,
        fdca_k_psi: 4.0,
        fdca_lohs: 0.5,
        ..Params::PAPER
    };
    for sign in [1.0, -1.0] {
        for (speed, e_y, e_theta, r) in [
            (20.0, 0.8, 0.0, 0.0),
            (20.0, 0.0, 0.05, 0.0),
            (20.0, 0.0, 0.0, 0.1),
            (40.0, 0.4, 0.02, 0.05),
            (8.0, -0.2, 0.05, 0.1),
        ] {
            let seen = Seen {
                e_y: sign * e_y,
                e_theta: sign * e_theta,
                speeds: [speed; 2],
                yaw_rate: Some(sign * r),
                by_wheel: sign * r,
                ..STRAIGHT
            };
            let back = 0.5 * e_y + 4.0 * e_theta;
            let asked = sign * per_turning(speed) * (turning_gain(speed) * back + 0.5 * r);
            assert_band(&both, &[seen; 40], [asked, asked]);
        }
    }
}

/// `rate[k] = (tau*rate[k-1] + e[k] - e[k-1])/(tau + dt)`: a step of 2 mrad after pictures that stood still, and pictures after it.
#[test]
fn the_rate_of_the_yaw_error_has_the_filter_of_the_law() {
    for (corner_hz, apart_ms) in [(10.0, 8), (10.0, 16), (3.0, 8), (30.0, 8)] {
        let params = Params {
            rate_corner_hz: corner_hz,
            ..PATH
        };
        let still = Seen { apart_ms, ..STRAIGHT };
        let stepped = Seen {
            e_theta: 0.002,
            ..still
        };
        let (tau, dt) = (
            1.0 / (std::f64::consts::TAU * corner_hz),
            f64::from(apart_ms) * 1e-3,
        );
        for after in [0, 2] {
            let pictures = [vec![still; 40], vec![stepped; 1 + after]].concat();
            // Counts of the bus: 131 of 2^-16 rad.
            let rate = 131.0 / 65_536.0 / (tau + dt) * (tau / (tau + dt)).powi(after as i32);
            let asked = per_turning(20.0) * rate;
            assert_band(&params, &pictures, [asked, asked]);
        }
    }
}

/// 0.2 rad/s with 20 pictures a second or more. The errors go on at their rates until the next picture; the rate of turn may change by 1
/// rad/s2 after the first 20 ms.
#[test]
fn errors_and_rate_of_turn_go_on_until_the_next_picture() {
    let params = Params {
        law: 2.0,
        fdca_lohs: 0.2,
        ..Params::PAPER
    };
    for (apart_ms, age_ms) in [(8, 0), (33, 0), (20, 0), (20, 14)] {
        let last = Seen {
            apart_ms,
            age_ms,
            ..STRAIGHT
        };
        let unseen = f64::from(apart_ms + age_ms as u32) * 1e-3;
        let doubt = 0.2 * (unseen - 0.02).max(0.0);
        let later = turning_gain(20.0) * 2.5 * 0.2 * unseen;
        let range = [0.2 * 0.2 - doubt, 0.2 * 0.2 + later + doubt];
        assert_band(
            &params,
            &at_rate(0.2, last),
            range.map(|urps| per_turning(20.0) * urps),
        );
    }
}

/// Measured, or by wheel and speed. Where it is not measured, or said not to be believed (YawRate, bit 57), it is the latter, which may be
/// wrong by 25 mrad/s in the long run.
#[test]
fn the_rate_of_turn_is_measured_or_by_the_wheel() {
    let turns = |yaw_rate: Option<f64>, by_wheel: f64, said: u64, range: [f64; 2]| {
        for sign in [1.0, -1.0] {
            let seen = Seen {
                yaw_rate: yaw_rate.map(|rate| sign * rate),
                by_wheel: sign * by_wheel,
                said,
                ..STRAIGHT
            };
            let [one, other] = range.map(|rate| sign * per_turning(20.0) * rate);
            assert_band(&PATH, &[seen; 40], [one.min(other), one.max(other)]);
        }
    };
    turns(Some(0.1), 0.02, 0, [0.02, 0.1]);
    turns(Some(-0.1), 0.06, 0, [-0.1, 0.06]);
    turns(None, 0.06, 0, [0.035, 0.085]);
    turns(None, 0.01, 0, [-0.015, 0.035]);
    turns(Some(0.15), 0.06, 1 << 57, [0.035, 0.085]);
    // The bit beside it says nothing of the yaw rate.
    turns(Some(0.15), 0.06, 1 << 56, [0.06, 0.15]);
}

/// Less than 2 m/s apart, the first of two speeds counts; otherwise the last that did.
#[test]
fn of_two_speeds_that_disagree_neither_counts() {
    for (speeds, used) in [
        ([21.9, 20.0], 21.9),
        ([22.1, 20.0], 20.0),
        ([18.1, 20.0], 18.1),
        ([17.9, 20.0], 20.0),
        ([30.0, 30.0], 30.0),
    ] {
        let seen = Seen {
            yaw_rate: Some(0.1),
            ..STRAIGHT
        };
        let pictures = [vec![seen; 40], vec![Seen { speeds, ..seen }; 2]].concat();
        let asked = per_turning(used) * 0.1;
        assert_band(&PATH, &pictures, [0.0, asked]);
    }
}

/// After a silence, or while a picture is left aside (LaneTimeout, bit 37; LaneStep, 52), the rate of the yaw error may be wrong by 0.1 rad/s
/// for 200 ms. A slow camera is no silence, and each picture of it tells the rate.
#[test]
fn a_rate_after_a_silence_is_doubted_for_200_ms() {
    let doubted = [-0.1, 0.1].map(|rate| per_turning(20.0) * rate);
    let next = |apart_ms: u32, said: u64| Seen {
        apart_ms,
        said,
        ..STRAIGHT
    };
    for (apart_ms, said) in [(48, 0), (8, 1 << 37), (8, 1 << 52)] {
        let so_many_later = |later: usize| {
            let pictures = [
                vec![STRAIGHT; 60],
                vec![next(apart_ms, said)],
                vec![STRAIGHT; later],
            ];
            pictures.concat()
        };
        assert_band(&PATH, &so_many_later(24), doubted);
        assert_band(&PATH, &so_many_later(25), [0.0; 2]);
    }
    // Beside what the rate of turn may be.
    let turning = Seen {
        yaw_rate: Some(0.05),
        by_wheel: 0.01,
        ..STRAIGHT
    };
    let pictures = [
        vec![turning; 60],
        vec![Seen {
            apart_ms: 48,
            ..turning
        }],
        vec![turning; 9],
    ]
    .concat();
    assert_band(
        &PATH,
        &pictures,
        [-0.09, 0.15].map(|rate| per_turning(20.0) * rate),
    );
    // LaneInvalid says nothing of a picture that is used.
    assert_band(&PATH, &[next(8, 1 << 38); 60], [0.0; 2]);
    // 13 mrad/s is what may change in the time beyond 20 ms.
    let unseen = [-0.013, 0.013].map(|rate| per_turning(20.0) * rate);
    assert_band(&PATH, &[next(33, 0); 20], unseen);
}

/// Two pictures 100 ms apart share a rate, of 0.2 rad/s here; a millisecond more, and there is none. Beside it, a rate may be wrong by 0.1
/// rad/s after a silence, and the rate of turn by 1 rad/s2 beyond 20 ms.
#[test]
fn over_a_gap_of_100_ms_the_yaw_error_has_no_rate() {
    let params = Params {
        fdca_lohs: 0.5,
        ..PATH
    };
    for (apart_ms, rate) in [(100, 0.2), (101, 0.0)] {
        let mut pictures = at_rate(0.2, STRAIGHT);
        pictures.push(Seen {
            e_theta: 0.2 * f64::from(apart_ms) * 1e-3,
            apart_ms,
            ..STRAIGHT
        });
        let doubt = 0.1 + f64::from(apart_ms) * 1e-3 - 0.02;
        let range = [rate - doubt, rate + doubt].map(|rate| 0.5 * per_turning(20.0) * rate);
        assert_band(&params, &pictures, range);
    }
}
