//! Each rule of the independent monitor at its edge, with frames packed here by hand.
//!
//! Above 500 lines because each rule is tried at its edge on one bench: split, a reader could not see which rule lacks an
//! edge.

use haptic_core::controller::config::Setup;
use haptic_core::controller::params::Params;
use haptic_core::safety::monitor::{Evidence, Frames, Monitor, MonitorState, New, RULES};

const STANDBY: u64 = 1;
pub(crate) const ACTIVE: u64 = 2;
pub(crate) const FADE: u64 = 3;
const HANDOVER: u64 = 4;

/// Torque in 2^-12 N.m, from bit 12; mode from bit 32.
pub(crate) fn guidance(torque: i64, mode: u64) -> [u8; 8] {
    (((torque as u64) & 0xFFFF) << 12 | mode << 32).to_le_bytes()
}

/// e_y in 2^-13 m from bit 12, e_theta in 2^-16 rad from bit 29, age in 0.1 ms from bit 46, valid bit 55, and how often 512 come to
/// the age from bit 56.
pub(crate) fn lane(e_y: i64, e_theta: i64, age: u64) -> [u8; 8] {
    let word = ((e_y as u64) & 0x1_FFFF) << 12
        | ((e_theta as u64) & 0x1_FFFF) << 29
        | (age & 0x1FF) << 46
        | 1 << 55
        | (age >> 9) << 56;
    word.to_le_bytes()
}

/// Driver torque in 2^-12 N.m from bit 12, and other signals above that must not be mixed in.
fn column(driver: i64) -> [u8; 8] {
    column_at(driver, -1)
}

/// A column frame whose angle is in 0.01 deg.
fn column_at(driver: i64, angle: i64) -> [u8; 8] {
    let [driver, angle] = [driver, angle].map(|field| field as u64 & 0x3_FFFF);
    (driver << 12 | angle << 30 | 0xFFFF << 48).to_le_bytes()
}

fn monitor(limit_nm: f64) -> Monitor {
    let params = Params {
        torque_limit_nm: limit_nm,
        ..Params::PAPER
    };
    Setup::new(&params).unwrap().monitor
}

/// A monitor with what it remembers.
#[derive(Clone, Copy)]
pub(crate) struct Bench {
    monitor: Monitor,
    pub(crate) state: MonitorState,
}

impl Bench {
    fn new(limit_nm: f64) -> Self {
        Self {
            monitor: monitor(limit_nm),
            state: MonitorState::NEW,
        }
    }

    fn show(&mut self, lane: Option<[u8; 8]>, column: Option<[u8; 8]>, frame: [u8; 8], us: u32) -> bool {
        let frames = Frames {
            lane: lane.unwrap_or_default(),
            column: column.unwrap_or_default(),
            new: New {
                lane: lane.is_some(),
                column: column.is_some(),
                request: false,
            },
            ..Frames::NONE
        };
        let evidence = Evidence {
            frames: &frames,
            guidance: &frame,
            elapsed_us: us,
        };
        self.monitor.step(&mut self.state, &evidence)
    }

    fn torque(&mut self, torque: i64, mode: u64) -> bool {
        self.show(None, None, guidance(torque, mode), 1000)
    }

    /// A torque in Active, on a lane that asks for 7 N.m to its side: 4 m and 0.5 rad.
    fn active(&mut self, torque: i64, us: u32) -> bool {
        let most = torque.signum() * 32_768;
        self.show(Some(lane(most, most, 0)), None, guidance(torque, ACTIVE), us)
    }

    /// Brought to a torque, and then without a lane for long enough that it is forgotten.
    pub(crate) fn at(limit_nm: f64, torque: i64) -> Self {
        let mut bench = Self::new(limit_nm);
        let mut now = 0;
        while now != torque {
            // 20 counts of 2^-12 N.m are 4.9 mN.m.
            now += (torque - now).clamp(-20, 20);
            assert!(bench.active(now, 1000));
        }
        for _ in 0..50 {
            assert!(bench.torque(torque, FADE));
        }
        bench
    }
}

/// Counts of 2^-12 N.m that make so many mN.m when cut to whole ones: the smallest, and the largest.
pub(crate) fn counts(mnm: i64) -> (i64, i64) {
    let at_least = |mnm: i64| (mnm * 4096 + 999) / 1000;
    let (small, large) = (at_least(mnm.abs()), at_least(mnm.abs() + 1) - 1);
    (mnm.signum() * small, if mnm < 0 { -large } else { large })
}

#[test]
fn beyond_the_limit() {
    for (limit_nm, limit_mnm) in [(5.0, 5000), (3.0, 3000)] {
        for sign in [1, -1] {
            // 3 mN.m of tolerance.
            let last_good = counts(limit_mnm + 3).1;
            let first_bad = last_good + 1;
            let bench = Bench::at(limit_nm, sign * (last_good - 20));
            assert!({ bench }.active(sign * last_good, 1000));
            assert!(!{ bench }.active(sign * first_bad, 1000));
        }
    }
}

#[test]
fn growing_too_fast() {
    // 4 mN.m per ms and 3 of tolerance; at least for 1 ms, at most for 2.
    for (us, growth) in [
        (0, 7),
        (1000, 7),
        (1500, 9),
        (2000, 11),
        (5000, 11),
        (u32::MAX, 11),
    ] {
        for sign in [1, -1] {
            for start_mnm in [0, 1000] {
                let start = counts(start_mnm).0;
                let bench = Bench::at(5.0, sign * start);
                let (_, last_good) = counts(start_mnm + growth);
                let show = |count: i64| { bench }.active(sign * count, us);
                assert!(show(last_good), "{us} {start_mnm}");
                assert!(!show(last_good + 1), "{us} {start_mnm}");
                // What ends never grows: not by one milli-newton-metre.
                for mode in [FADE, HANDOVER] {
                    let last_good = counts(start_mnm).1;
                    let show = |count: i64| { bench }.show(None, None, guidance(sign * count, mode), us);
                    assert!(show(last_good), "{us} {start_mnm} {mode}");
                    assert!(!show(last_good + 1), "{us} {start_mnm} {mode}");
                }
            }
        }
    }
}

#[test]
fn a_sign_flip_counts_as_growth_from_zero() {
    for sign in [1, -1] {
        // 8 mN.m, which may fall in one step. 4 mN.m and 3 of tolerance may grow.
        let bench = Bench::at(5.0, sign * counts(8).0);
        let last_good = counts(7).1;
        assert!({ bench }.active(-sign * last_good, 1000));
        assert!(!{ bench }.active(-sign * (last_good + 1), 1000));
        assert!(!{ bench }.active(-sign * 4096, 1000));
        for mode in [FADE, HANDOVER] {
            assert!({ bench }.torque(0, mode));
            // -0.98 mN.m and -1.2 mN.m.
            assert!({ bench }.torque(-sign * 4, mode));
            assert!(!{ bench }.torque(-sign * 5, mode));
            assert!(!{ bench }.torque(-sign * 4096, mode));
        }
    }
}

#[test]
fn a_torque_in_a_mode_without() {
    for mode in 0..7 {
        let mut bench = Bench::at(5.0, 100);
        // A fresh lane that asks for it, so that Active has nothing else to refuse.
        let permitted = bench.show(Some(lane(0, 0, 0)), None, guidance(100, mode), 1000);
        assert_eq!(permitted, [ACTIVE, FADE, HANDOVER].contains(&mode), "{mode}");
        // Less than a milli-newton-metre is none.
        assert!(Bench::new(5.0).torque(4, mode) && Bench::new(5.0).torque(0, mode));
    }
}

#[test]
fn against_the_driver() {
    // (driver's opposing torque, bound) in mN.m: 5000 - 3*(opposing - 800), and 50 of slack.
    for (opposing, bound) in [
        (800, 5000),
        (1000, 4400),
        (2000, 1400),
        (2400, 200),
        (3000, 0),
        (20_000, 0),
    ] {
        for sign in [1, -1] {
            let first_bad = counts(bound + 50).1 + 1;
            let at = first_bad.min(counts(5000).0);
            let bench = Bench::at(5.0, sign * at);
            let driver = column(-sign * counts(opposing).0);
            let show = |torque: i64, column: [u8; 8]| {
                { bench }.show(None, Some(column), guidance(sign * torque, FADE), 1000)
            };
            assert!(show(first_bad.min(at) - 1, driver), "{opposing}");
            assert_eq!(show(at, driver), bound == 5000, "{opposing}");
            // The same torque with the guidance is no opposition.
            assert!(show(at, column(sign * counts(opposing).0)), "{opposing}");
        }
    }
    // The last column frame counts until the next one: 2.93 N.m leave nothing, and 50 of slack.
    let mut bench = Bench::new(5.0);
    assert!(bench.show(None, Some(column(-12_000)), guidance(0, FADE), 1000));
    let permitted = (1..100).take_while(|k| bench.active(counts(5 * k).0, 1000));
    assert_eq!(permitted.count(), 10, "times 5 mN.m");
}

#[test]
fn old_lane_data_in_active() {
    // 360 ms, and 1.4 s in which the lane goes on.
    for (age, last_good_ms) in [
        (0, 1760),
        (100, 1750),
        (400, 1720),
        (512, 1708),
        (1500, 1610),
        (2047, 1555),
    ] {
        let mut bench = Bench::at(5.0, 40);
        assert!(bench.show(Some(lane(0, 0, age)), None, guidance(40, ACTIVE), 1000));
        for _ in 0..last_good_ms {
            assert!(bench.torque(40, ACTIVE));
        }
        assert!({ bench }.torque(0, ACTIVE), "no torque, nothing to refuse");
        assert!({ bench }.torque(40, FADE), "a fade needs no lane");
        assert!(!bench.torque(40, ACTIVE), "{age}");
    }
}

/// Steps in Active with a torque before permission is withdrawn, at most 100; the lane repeats its errors.
fn permitted_steps(torque: i64, e_y: i64, e_theta: i64) -> u32 {
    let mut bench = Bench::at(5.0, torque);
    // Long enough at these errors that nothing changes any more.
    for _ in 0..200 {
        assert!(bench.show(Some(lane(e_y, e_theta, 0)), None, guidance(torque, FADE), 1000));
    }
    (0..100)
        .take_while(|_| bench.show(Some(lane(e_y, e_theta, 0)), None, guidance(torque, ACTIVE), 1000))
        .count() as u32
}

#[test]
fn away_from_the_lane_for_more_than_20_ms() {
    // Paper: 500 mN.m per m and 10 mN.m per mrad. A step of the torque away counts from the first.
    for sign in [1, -1] {
        for (e_y, e_theta, asked_mnm) in [
            (0, 0, 0),
            // 1 m.
            (8192, 0, 500),
            // 0.05 rad is 3276.8 counts.
            (0, 3277, 500),
            (8192, 3277, 1000),
        ] {
            let steps = |mnm: i64| permitted_steps(sign * counts(mnm).0, sign * e_y, sign * e_theta);
            // 1 mN.m for the roundings of the monitor's integers.
            assert_eq!(steps(asked_mnm + 299), 100, "{asked_mnm}");
            assert_eq!(steps(asked_mnm + 301), 20, "{asked_mnm}");
            // On the other side zero is always allowed, and 0.3 N.m around it.
            assert_eq!(steps(-299), 100);
            assert_eq!(steps(-301), 20);
            assert_eq!(steps(0), 100);
        }
    }
}

#[test]
fn rates_widen_the_band_on_their_side() {
    // Errors that pass zero at a constant rate, a sample every 8 ms, the last one at zero. K_1*a4' is 250 mN.m
    // per rad/s, K_1*a2' 12.5 mN.m per m/s.
    for sign in [1, -1] {
        for (per_sample_y, per_sample_theta, asked_mnm) in [
            // 8 m/s and 1 rad/s in counts per 8 ms, rounded.
            (524, 0, 100),
            (0, 524, 250),
            (524, 524, 350),
        ] {
            let steps = |mnm: i64| {
                let torque = sign * counts(mnm).0;
                let mut bench = Bench::at(5.0, torque);
                for k in -30..=0 {
                    let sample = lane(sign * k * per_sample_y, sign * k * per_sample_theta, 0);
                    assert!(bench.show(Some(sample), None, guidance(torque, FADE), 8000));
                }
                (0..30).take_while(|_| bench.torque(torque, ACTIVE)).count()
            };
            // 1 % for the rounded counts and the gain in whole mN.m, 4 % where the gain is 13 for 12.5.
            let error = if per_sample_y == 0 { 4 } else { 8 };
            assert_eq!(steps(asked_mnm + 299 - error), 30, "{asked_mnm}");
            assert_eq!(steps(asked_mnm + 301 + error), 20, "{asked_mnm}");
            assert_eq!(steps(-299), 30, "{asked_mnm}");
            assert_eq!(steps(-301), 20, "{asked_mnm}");
        }
    }
}

/// A lateral error that steps by 0.6 m between samples 10 ms apart, the seventh the last at zero. The older sample of
/// the rate is the first, then the first that is more than 50 ms after it, so it is of before the step until 50 ms
/// after the step. 0.66 N.m is beyond the 0.3 + 0.3 N.m of the position, within the 0.12 N.m more of the least rate.
#[test]
fn a_rate_is_taken_over_more_than_50_ms() {
    let torque = counts(660).0;
    let mut bench = Bench::at(5.0, torque);
    let mut permitted = 0;
    for ms in 0..200 {
        let sample = (ms % 10 == 0).then(|| lane(if ms < 80 { 0 } else { 4915 }, 0, 0));
        let mode = if ms < 80 { FADE } else { ACTIVE };
        if !bench.show(sample, None, guidance(torque, mode), 1000) {
            break;
        }
        permitted += u32::from(mode == ACTIVE);
    }
    assert_eq!(permitted, 50 + 20);
}

#[test]
fn rates_are_forgotten_in_a_gap() {
    let steps = |from: i64, torque_mnm: i64, gap_ms: u32| {
        let torque = counts(torque_mnm).0;
        let mut bench = Bench::at(5.0, torque);
        assert!(bench.show(Some(lane(from, 0, 0)), None, guidance(torque, FADE), 1000));
        for _ in 1..gap_ms {
            assert!(bench.torque(torque, FADE));
        }
        assert!(bench.show(Some(lane(0, 0, 0)), None, guidance(torque, FADE), 1000));
        (0..30).take_while(|_| bench.torque(torque, ACTIVE)).count()
    };
    // Two samples 1 m apart. Within 40 ms that is 25 m/s, worth 0.31 N.m more than the 0.3 of the band.
    assert_eq!(steps(-8192, 450, 40), 30);
    assert_eq!(steps(-8192, 450, 300), 20);
    assert_eq!(steps(-8192, 450, 361), 20);
    // 8 m in 360 ms are worth 0.28 N.m; a millisecond later nothing is known of the rate.
    assert_eq!(steps(-65_535, 500, 360), 30);
    assert_eq!(steps(-65_535, 500, 361), 20);
}

/// LaneTimeout and LaneStep in a guidance frame: the controller says that it leaves pictures aside.
const ASIDE: [u64; 2] = [1 << 37, 1 << 52];

/// A camera that sends a picture in so many milliseconds, each so many times, of a line that asks for 0.5 N.m to one side, and is
/// followed. Its last picture comes in the last step.
fn watching(sign: i64, age: u64, pictures: &[(u32, u32)]) -> Bench {
    let torque = sign * counts(500).0;
    let mut bench = Bench::at(5.0, torque);
    assert!(bench.show(
        Some(lane(sign * 8192, 0, age)),
        None,
        guidance(torque, FADE),
        1000
    ));
    for (period_ms, count) in pictures {
        for ms in 1..=period_ms * count {
            let picture = ms.is_multiple_of(*period_ms).then(|| lane(sign * 8192, 0, age));
            assert!(bench.show(picture, None, guidance(torque, ACTIVE), 1000), "{ms}");
        }
    }
    bench
}

/// For how many steps the same torque is permitted beside a claim, where the pictures after a gap ask for nothing.
fn claimed(mut bench: Bench, sign: i64, age: u64, said: u64, [gap_ms, period_ms]: [u32; 2]) -> u32 {
    let frame = u64::from_le_bytes(guidance(sign * counts(500).0, ACTIVE)) | said;
    (1..2000)
        .take_while(|ms| {
            let comes = *ms >= gap_ms && (ms - gap_ms).is_multiple_of(period_ms);
            bench.show(comes.then(|| lane(0, 0, age)), None, frame.to_le_bytes(), 1000)
        })
        .count() as u32
}

/// Pictures count from 20 steps on, whatever is said of them, unless the camera was silent for more than 25 ms and two and a half of its
/// periods; behind such a silence they may be left aside for 600 ms. Cameras of 125, 40, 30 and 15 Hz, however old their pictures are.
#[test]
fn pictures_that_come_in_time_count_whatever_is_said_of_them() {
    for (period_ms, longest_gap_ms, aside_ms) in [(8, 25, 600), (25, 62, 600), (33, 82, 627), (66, 165, 660)]
    {
        for (sign, age) in [(1, 0), (-1, 0), (1, 400), (-1, 400)] {
            let bench = watching(sign, age, &[(period_ms, 6)]);
            let steps =
                |said: u64, gap_ms: u32| claimed(bench, sign, age, said, [gap_ms, period_ms]) as i64 - 20;
            for said in ASIDE {
                // In time; one picture lost; at the edge of a silence.
                for gap_ms in [period_ms, 2 * period_ms, longest_gap_ms] {
                    assert_eq!(steps(said, gap_ms), i64::from(gap_ms) - 1, "{period_ms} ms");
                }
                // Until the first picture that comes after 600 ms.
                let silent_ms = longest_gap_ms + 1;
                let expected = i64::from(silent_ms + aside_ms) - 1;
                assert_eq!(steps(said, silent_ms), expected, "{period_ms} ms");
            }
            // LaneInvalid says nothing of a picture that is used.
            let silent_ms = longest_gap_ms + 1;
            assert_eq!(steps(1 << 38, silent_ms), i64::from(silent_ms) - 1);
        }
    }
}

/// A camera that becomes slower is silent once, and a picture that is used ends what a silence allows; one that becomes faster again is
/// known to within 64 pictures.
#[test]
fn the_monitor_learns_the_period_of_the_camera() {
    for (sign, said) in [(1, ASIDE[0]), (-1, ASIDE[1])] {
        let slower = watching(sign, 0, &[(8, 6), (33, 2)]);
        assert_eq!(claimed(slower, sign, 0, said, [33, 33]), 32 + 20);
        assert_eq!(claimed(slower, sign, 0, said, [82, 33]), 81 + 20);
        // A lost picture of the slowest camera makes no slower one.
        let slowest = watching(sign, 0, &[(66, 6), (132, 1), (66, 1)]);
        assert_eq!(claimed(slowest, sign, 0, said, [166, 66]), 165 + 20);
        assert!(claimed(slowest, sign, 0, said, [168, 66]) > 600);
        let back = watching(sign, 0, &[(8, 6), (1000, 1), (8, 1)]);
        assert_eq!(claimed(back, sign, 0, said, [8, 8]), 7 + 20);
        // 33 ms, of which 8 + 25/e are left after 64 pictures, and next to nothing after 400.
        let faster = |count: u32| watching(sign, 0, &[(33, 6), (8, count)]);
        assert_eq!(claimed(faster(64), sign, 0, said, [42, 8]), 41 + 20);
        assert!(claimed(faster(64), sign, 0, said, [45, 8]) > 600);
        assert!(claimed(faster(400), sign, 0, said, [26, 8]) > 600);
    }
}

/// Errors that passed zero at a constant rate with the last picture, and no picture since. From 40 ms of age on the
/// position goes on at its rate and the band grows by 1 mN.m/ms, so a torque beyond the band of the last picture comes to be
/// within it.
#[test]
fn an_old_sample_is_carried_at_its_rates() {
    for sign in [1, -1] {
        for (per_sample_y, per_sample_theta, at_once_mnm, per_ms) in [
            // 8 m/s: 100 mN.m for the rate, and 500 mN.m per m.
            (524, 0, 100, 4),
            // 1 rad/s: 250 mN.m for the rate, and 10 mN.m per mrad.
            (0, 524, 250, 10),
        ] {
            // Within the band 65 ms after the last picture; judged from an age of so many ms on.
            let torque = sign * counts(300 + at_once_mnm + 25 * (per_ms + 1)).0;
            let permitted = |from_ms: i64| {
                let mut bench = Bench::at(5.0, torque);
                for k in -30..=0 {
                    let sample = lane(sign * k * per_sample_y, sign * k * per_sample_theta, 0);
                    assert!(bench.show(Some(sample), None, guidance(torque, FADE), 8000));
                }
                for _ in 1..from_ms {
                    assert!(bench.torque(torque, FADE));
                }
                (0..60).take_while(|_| bench.torque(torque, ACTIVE)).count()
            };
            // Give or take 2 ms for the rounded counts and gains: 20 ms outside are allowed, 21 are not.
            assert_eq!(permitted(65 - 18), 60, "{per_sample_y}");
            assert_eq!(permitted(65 - 23), 20, "{per_sample_y}");
        }
    }
}

#[test]
fn a_torque_on_its_way_back_is_not_astray() {
    // 2 N.m on a lane that asks for nothing, falling by one milli-newton-metre per step.
    let mut bench = Bench::at(5.0, counts(2000).0);
    for mnm in (500..2000).rev() {
        assert!(
            bench.show(Some(lane(0, 0, 0)), None, guidance(counts(mnm).0, ACTIVE), 1000),
            "{mnm}"
        );
    }
    // Then held: 20 ms.
    for _ in 0..20 {
        assert!(bench.show(Some(lane(0, 0, 0)), None, guidance(counts(500).0, ACTIVE), 1000));
    }
    let mut back = bench;
    assert!(!bench.show(Some(lane(0, 0, 0)), None, guidance(counts(500).0, ACTIVE), 1000));
    // One step inside begins the count anew.
    for mnm in (1..=25).map(|k| 500 - 8 * k) {
        assert!(back.show(Some(lane(0, 0, 0)), None, guidance(counts(mnm).0, ACTIVE), 1000));
    }
}

/// However often, 20 steps outside are allowed again after one inside.
#[test]
fn steps_outside_are_counted_since_the_last_inside() {
    for sign in [1, -1] {
        let (outside, inside) = (sign * counts(301).0, sign * counts(299).0);
        let mut bench = Bench::at(5.0, inside);
        for _ in 0..5 {
            for torque in [inside].into_iter().chain([outside; 20]) {
                assert!(bench.show(Some(lane(0, 0, 0)), None, guidance(torque, ACTIVE), 1000));
            }
        }
        assert!(!bench.show(Some(lane(0, 0, 0)), None, guidance(outside, ACTIVE), 1000));
    }
}

/// 8 m/s towards the line of 0.54 s ago. For 0.32 s beyond 40 ms the position goes on: 2.56 m are 1280 mN.m, with 100 for the
/// rate and a band of 300 and of 500 for the time.
#[test]
fn a_sample_is_carried_for_320_ms_at_most() {
    for sign in [1, -1] {
        let permitted = |mnm: i64| {
            let torque = sign * counts(mnm).0;
            let mut bench = Bench::at(5.0, torque);
            for k in -30..=0 {
                let sample = lane(sign * k * 524, 0, 0);
                assert!(bench.show(Some(sample), None, guidance(torque, FADE), 8000));
            }
            for _ in 0..540 {
                assert!(bench.torque(torque, FADE));
            }
            (0..60).take_while(|_| bench.torque(torque, ACTIVE)).count()
        };
        assert_eq!(permitted(2180 - 10), 60);
        assert_eq!(permitted(2180 + 30), 20);
    }
}

/// 2 N.m to the wrong side of a lane that asks for 0.5 N.m, falling by a milli-newton-metre in one step of 16.
#[test]
fn a_dither_does_not_hide_a_torque_that_is_astray() {
    for sign in [1, -1] {
        let mut bench = Bench::at(5.0, -sign * counts(2000).0);
        let permitted = (0..200)
            .take_while(|ms| {
                let torque = guidance(-sign * counts(2000 - (ms + 1) / 16).0, ACTIVE);
                bench.show(Some(lane(sign * 8192, 0, 0)), None, torque, 1000)
            })
            .count();
        // 20 steps that do not fall, and the one between that does.
        assert_eq!(permitted, 21);
    }
}

/// What the self-test offers, and the one thing that is wrong with it: put right, it is permitted.
#[test]
fn each_rule_is_tried_by_itself() {
    for limit_nm in [5.0, 3.0, 0.5] {
        let monitor = monitor(limit_nm);
        for turn in 0..2 * RULES {
            let (state, self_test_vector) = monitor.self_test_vector(turn);
            let limit_mnm = (limit_nm * 1e3) as i64;
            let (mnm, mode) = [
                (limit_mnm + 20, FADE),
                (100, ACTIVE),
                (100, STANDBY),
                (100, ACTIVE),
                (100, ACTIVE),
                (0, ACTIVE),
                (400, ACTIVE),
            ][turn as usize % 7];
            assert_eq!(self_test_vector, guidance(counts(mnm).0, mode));
            let show = |lane: Option<[u8; 8]>, column: Option<[u8; 8]>, guidance: [u8; 8]| {
                let mut bench = Bench { monitor, state };
                bench.show(lane, column, guidance, 1000)
            };
            assert!(!show(None, None, self_test_vector), "{turn}");
            if turn % 7 == 1 {
                // In the band and below every limit: only growth is wrong with it.
                assert!(!show(None, None, guidance(counts(50).0, ACTIVE)));
            }
            let remedied = match turn % 7 {
                0 => show(None, None, guidance((limit_nm * 4096.0) as i64, FADE)),
                // As much growth as 4 N.m/s allow.
                1 => show(None, None, guidance(counts(4).0, ACTIVE)),
                2 => show(None, None, guidance(counts(100).0, FADE)),
                3 => show(None, Some(column(0)), self_test_vector),
                4 => show(Some(lane(0, 0, 0)), None, self_test_vector),
                // As much of a fall as 8 N.m/s allow, or a driver who overrides to the last.
                5 if limit_nm > 0.5 => show(None, None, guidance(counts(392).0, ACTIVE)),
                5 => show(None, Some(column(-20 * 4096)), self_test_vector),
                // 1 m asks for 0.5 N.m.
                _ => show(Some(lane(8192, 0, 0)), None, self_test_vector),
            };
            assert!(remedied, "{turn}");
        }
    }
}

/// 8 mN.m per ms and 3 of tolerance, in a handover 32, for 2 ms of a late step at most; across zero all of the old torque
/// falls.
#[test]
fn falling_too_fast() {
    for (us, fall, in_handover) in [
        (0, 11, 35),
        (1000, 11, 35),
        (1500, 15, 51),
        (2000, 19, 67),
        (5000, 19, 67),
    ] {
        for sign in [1, -1] {
            let bench = Bench::at(5.0, sign * counts(1000).0);
            let to = |mnm: i64, mode| { bench }.show(None, None, guidance(sign * counts(mnm).0, mode), us);
            for (mode, fall) in [(FADE, fall), (HANDOVER, in_handover)] {
                assert!(to(1000 - fall, mode) && !to(1000 - fall - 1, mode), "{us}");
            }
            assert!(!to(0, STANDBY) && !to(-4, FADE) && !to(-4, HANDOVER));
            // Fault and Locked end at once.
            assert!(to(0, 5) && to(0, 6));
            // A driver who leaves 0.5 N.m of 5: down to that at once, and 50 mN.m of what two frames may differ.
            let opposed = |mnm: i64| {
                let driver = -sign * counts(800 + 1500).0;
                { bench }.show(
                    None,
                    Some(column(driver)),
                    guidance(sign * counts(mnm).0, FADE),
                    us,
                )
            };
            assert!(opposed(500) && opposed(450) && !opposed(440), "{us}");
        }
    }
}

/// A hand that leaves nothing of a torque may end it at once, but one against the torque that follows on the other side may not.
#[test]
fn the_hand_that_ends_a_torque_at_once_is_against_that_torque() {
    for sign in [1, -1] {
        let bench = Bench::at(5.0, sign * counts(1000).0);
        let turns = |driver_nm: i64| {
            let driver = column(sign * driver_nm * 4096);
            { bench }.show(
                Some(lane(0, 0, 0)),
                Some(driver),
                guidance(-sign * counts(4).0, ACTIVE),
                1000,
            )
        };
        assert!(turns(-20) && !turns(20) && !turns(0));
    }
}

#[test]
fn once_withdrawn_it_stays_withdrawn() {
    let mut bench = Bench::new(5.0);
    assert!(bench.torque(0, STANDBY));
    assert!(!bench.torque(100, STANDBY));
    for _ in 0..1000 {
        assert!(!bench.torque(0, STANDBY));
    }
}

/// Steps of 1 ms and of far more: the age of a picture and the second after the probe was asked for are times of the clock. What is outside the
/// band is counted in steps.
#[test]
fn times_are_those_of_the_clock_whatever_a_step_takes() {
    for us in [1000, 1250, 1600, 2000, 50_000, 500_000] {
        let aged = Bench::at(5.0, 40);
        let shown =
            |bench: &mut Bench, lane: Option<[u8; 8]>| bench.show(lane, None, guidance(40, ACTIVE), us);
        let mut bench = aged;
        assert!(shown(&mut bench, Some(lane(0, 0, 0))));
        let steps = (0..3000).take_while(|_| shown(&mut bench, None)).count() as u32;
        assert_eq!(steps, 1_760_000 / us, "{us} us");

        // 0.45 N.m on a lane that asks for nothing: 0.3 are allowed, and 0.2 beside the probe.
        let torque = counts(450).0;
        let mut bench = Bench::at(5.0, torque);
        let request = (1_u64 << 21).to_le_bytes();
        let mut asks = |is_asked: bool| {
            let frames = Frames {
                lane: lane(0, 0, 0),
                request,
                new: New {
                    lane: true,
                    column: false,
                    request: is_asked,
                },
                ..Frames::NONE
            };
            let evidence = Evidence {
                frames: &frames,
                guidance: &guidance(torque, ACTIVE),
                elapsed_us: us,
            };
            bench.monitor.step(&mut bench.state, &evidence)
        };
        assert!((0..50).all(|_| asks(true)));
        let steps = (0..3000).take_while(|_| asks(false)).count() as u32;
        // While there is time left.
        assert_eq!(steps, (1_075_000 - 1) / us + 20, "{us} us");
    }
}

/// Behind a bar a torque counts that has lasted for one to two windows of 0.1 s, less 1.67 N.m for the wheel: 0.2 of friction, 3 rad/s of 0.05
/// N.m.s/rad, 30 rad/s2 of 0.044 kg.m2. What swings to and fro, as the wheel's inertia does, lasts for none.
#[test]
fn behind_a_bar_what_lasts_has_to_be_yielded_to() {
    for sign in [1, -1] {
        // 4 N.m against the bar: 5 - 3*(opposing - 1.67 - 0.8) is 4 N.m less the slack of 0.05 at 2.82.
        for (bar_mnm, swings, refused) in [
            (2_790, false, None),
            (2_840, false, Some(100..=204)),
            (6_000, false, Some(100..=204)),
            (6_000, true, None),
        ] {
            let mut bench = Bench::at(5.0, sign * 16_384);
            bench.monitor = behind_a_bar(100.0);
            assert!(bench.show(None, Some(column(0)), guidance(sign * 16_384, ACTIVE), 1000));
            let found = (1..1000).find(|ms| {
                let side = if swings && ms / 90 % 2 == 0 { sign } else { -sign };
                let new = (ms % 2 == 0).then(|| column(side * counts(bar_mnm).0));
                let lane = lane(sign * 32_768, sign * 32_768, 0);
                !bench.show(Some(lane), new, guidance(sign * 16_384, ACTIVE), 1000)
            });
            match refused {
                Some(within) => assert!(
                    found.is_some_and(|ms| within.contains(&ms)),
                    "{bar_mnm}: {found:?}"
                ),
                None => assert_eq!(found, None, "{bar_mnm} {swings}"),
            }
        }
    }
}

/// A wheel that slows presses on its bar without hands. By hand: 0.044 kg.m2 at 60 rad/s2 take 2.64 N.m, so that beside 4 N.m of guidance
/// the bar may have 2.82 + 2.64 N.m; where the wheel is turned faster, at the other sign, no more than 2.82. Angles of 0.01 deg, and of 0.1.
#[test]
fn behind_a_bar_a_wheel_that_slows_is_no_hand() {
    for sign in [1, -1] {
        for step_deg in [0.01, 0.1] {
            for period_ms in [1, 2, 10] {
                for (rad_per_s2, bar_mnm, is_permitted) in [
                    (-60.0, 5_100, true),
                    (-60.0, 5_800, false),
                    (0.0, 2_740, true),
                    (0.0, 2_900, false),
                    (60.0, 2_740, true),
                    (60.0, 2_900, false),
                ] {
                    let mut bench = Bench::at(5.0, sign * 16_384);
                    bench.monitor = behind_a_bar(100.0);
                    assert!(bench.show(None, Some(column_at(0, 0)), guidance(sign * 16_384, ACTIVE), 1000));
                    // The guidance turns against the hands, to the side of `sign`.
                    let shown = |ms: i64| {
                        let time_s = ms as f64 * 1e-3;
                        let towards_rad = (12.0 + 0.5 * rad_per_s2 * time_s) * time_s;
                        let steps = (-(sign as f64) * towards_rad.to_degrees() / step_deg).round();
                        let angle = (steps * step_deg * 100.0).round() as i64;
                        column_at(-sign * counts(bar_mnm).0, angle)
                    };
                    let refused = (0..350).find(|ms| {
                        let new = (ms % period_ms == 0).then(|| shown(*ms));
                        let lane = lane(sign * 32_768, sign * 32_768, 0);
                        !bench.show(Some(lane), new, guidance(sign * 16_384, ACTIVE), 1000)
                    });
                    let case = (sign, step_deg, period_ms, rad_per_s2, bar_mnm);
                    assert_eq!(refused.is_none(), is_permitted, "{case:?}: {refused:?}");
                }
            }
        }
    }
}

/// A torque has to be yielded to when it has lasted for one window, or for almost two where it began with one. A window is two lags of
/// the observer and eight more, 0.25 s at 40 rad/s; or two and what 5 N.m take at 64 N.m/s, 0.088 s at 200 rad/s.
#[test]
fn behind_a_bar_the_window_is_that_of_its_observer() {
    for (rad_per_s, window_ms) in [(40.0, 250_u32), (200.0, 88)] {
        for sign in [1, -1] {
            let mut bench = Bench::at(5.0, sign * 16_384);
            bench.monitor = behind_a_bar(rad_per_s);
            let shown = |bench: &mut Bench, bar_mnm: i64| {
                let lane = lane(sign * 32_768, sign * 32_768, 0);
                let column = column(-sign * counts(bar_mnm).0);
                bench.show(Some(lane), Some(column), guidance(sign * 16_384, ACTIVE), 2000)
            };
            let lasted = (0..=window_ms).step_by(2).map(|begins_ms| {
                let mut bench = bench;
                assert!((0..=begins_ms).step_by(2).all(|_| shown(&mut bench, 0)));
                2 * (0..1000).take_while(|_| shown(&mut bench, 6_000)).count() as u32
            });
            let lasted: Vec<u32> = lasted.collect();
            let (least, most) = (lasted.iter().min().unwrap(), lasted.iter().max().unwrap());
            assert!(least.abs_diff(window_ms) <= 4, "{rad_per_s}: {least} ms");
            assert!(most.abs_diff(2 * window_ms) <= 6, "{rad_per_s}: {most} ms");
        }
    }
}

/// By hand: 64 N.m/s and 3 mN.m for rounding, whatever the bar shows, in each mode with torque; 8 N.m/s where the sensor measures the hands.
#[test]
fn behind_a_bar_a_torque_may_fall_as_fast_as_it_yields() {
    for sign in [1, -1] {
        for (is_bar, bar_mnm, fall_mnm, mode, permitted) in [
            (true, 3_000, 66, ACTIVE, true),
            (true, -2_000, 66, ACTIVE, true),
            (true, 0, 66, FADE, true),
            (true, 0, 66, HANDOVER, true),
            (true, 3_000, 70, ACTIVE, false),
            (true, -1_000, 70, ACTIVE, false),
            (true, 0, 70, HANDOVER, false),
            (false, 0, 10, ACTIVE, true),
            (false, 0, 13, ACTIVE, false),
        ] {
            let mut bench = Bench::at(5.0, sign * 16_384);
            if is_bar {
                bench.monitor = behind_a_bar(100.0);
            }
            let lane = lane(sign * 32_768, sign * 32_768, 0);
            let shown = column(sign * counts(bar_mnm).0);
            assert!(bench.show(Some(lane), Some(shown), guidance(sign * 16_384, ACTIVE), 1000));
            let left = guidance(sign * counts(4_000 - fall_mnm).0, mode);
            let case = (sign, is_bar, bar_mnm, fall_mnm, mode);
            assert_eq!(bench.show(None, None, left, 1000), permitted, "{case:?}");
        }
    }
}

fn behind_a_bar(observer_bandwidth_rad_per_s: f64) -> Monitor {
    let params = Params {
        torque_sensor: 1.0,
        observer_bandwidth_rad_per_s,
        ..Params::PAPER
    };
    Setup::new(&params).unwrap().monitor
}
