use super::*;
use haptic_batch::engine::Watch;

/// Four instants of the paper's curve: the peaks of both sides, driver by driver.
#[test]
fn a_mirrored_bend_costs_the_same() {
    let found = instants_of(&[Bend::PAPERS], 8.0, &Watch::nobody()).unwrap();
    let of = |side| found.iter().filter(move |instant| instant.driver.side == side);
    // Before the bend, and 8, 16 and 24 s later, for three drivers of two reliances who take over after four times.
    assert_eq!(of(Side::Left).count(), 4 * 3 * 2 * 4);
    assert_eq!(of(Side::Right).count(), 4 * 3 * 2 * 4);
    for (left, right) in of(Side::Left).zip(of(Side::Right)) {
        assert_eq!(
            (left.driver.t_p, left.condition, left.at_s),
            (right.driver.t_p, right.condition, right.at_s)
        );
        for (a, b) in left.peaks_m.iter().zip(right.peaks_m) {
            // Fixed point rounds toward zero on both sides, sensors to the nearest step.
            assert!((a - b).abs() < 2e-3, "{left:?}\n{right:?}");
        }
    }
}

/// v^2/R by hand: 60 km/h on 300 m is 0.926 m/s2, on 100 m 2.78; 40 km/h on 200 m 0.617, on 300 m 0.412.
#[test]
fn bends_that_nobody_drives_are_left_out() {
    let bends = Bend::all();
    let has = |kmh: f64, radius_m: f64| {
        let is_it = |bend: &&Bend| (bend.speed_kmh, bend.radius_m) == (kmh, radius_m) && !bend.is_papers;
        bends.iter().filter(is_it).count()
    };
    assert_eq!((has(60.0, 300.0), has(60.0, 100.0)), (1, 0));
    assert_eq!((has(40.0, 200.0), has(40.0, 300.0)), (1, 0));
    assert_eq!((has(130.0, 800.0), has(130.0, 500.0)), (1, 0));
    assert_eq!(bends.len(), 17);
    assert!((bends[0].lateral_m_per_s2() - 0.9259).abs() < 1e-4);
    // 6 s straight, 6 s of arc, and twice 26.67 m on 100 m at 40 km/h (2.4 s).
    assert!((Bend::PAPERS.ends_s() - 34.8).abs() < 1e-9 && (bends[1].ends_s() - 16.8).abs() < 1e-9);
}

/// The paper's curve begins after 7.2 s; its clothoids last 4.8 s, its arc 18 s.
#[test]
fn an_instant_is_told_by_the_part_of_the_bend() {
    for (at_s, told) in [
        (5.2, "2.00 s before the bend"),
        (7.2, "0.00 s into the entry"),
        (12.5, "0.50 s into the arc"),
        (30.25, "0.25 s into the exit"),
        (35.8, "1.00 s behind the bend"),
    ] {
        assert_eq!(Bend::PAPERS.place(at_s), told);
    }
    let instants: Vec<f64> = Bend::PAPERS.instants_s(0.25).collect();
    // From 2 s before to 2 s behind: 27.6 + 4 s.
    assert_eq!((instants[0], instants.len()), (5.2, 127));
    assert!((instants[126] - 36.7).abs() < 1e-9);
}

fn drive(peak_m: f64) -> Peaks {
    Peaks {
        peak_m,
        settles: true,
        left_by_itself: false,
    }
}

/// By hand 0.2 m; without a failure 0.1 m; the two instants cost 0.5 and 0.3 m handed over, 0.4 and 0.1 m dropped.
fn drives() -> Vec<Peaks> {
    let of_instant = |handover, dropped| {
        let both = [drive(handover), drive(dropped)];
        [both; 4].concat()
    };
    let reliance = [vec![drive(0.1)], of_instant(0.5, 0.4), of_instant(0.3, 0.1)].concat();
    [vec![drive(0.2)], reliance.clone(), reliance].concat()
}

/// Instants 2 s before the bend, and behind it.
const APART_S: f64 = 31.6;

fn found(peaks: &[Peaks]) -> Vec<Instant> {
    let cases = drives_of(Bend::PAPERS, APART_S).unwrap().into_iter();
    let own = cases.filter(|case| case.driver.side == Side::Right && case.driver.t_p == 0.3);
    instants(&own.collect::<Vec<_>>(), peaks)
}

#[test]
fn the_larger_peak_without_a_failure_or_by_hand_is_what_counts() {
    let instants = found(&drives());
    assert_eq!(instants.len(), 2 * 2 * 4);
    let row = row(&instants, Some(Bend::PAPERS), Condition::Mid, 1.5);
    let worst = |figure: &Option<Figure>| figure.as_ref().unwrap().worst;
    assert_eq!(row.instants, 2);
    assert!((worst(&row.handover) - 2.5).abs() < 1e-12);
    assert!((worst(&row.drop) - 2.0).abs() < 1e-12);
    // 0.3 over 0.2 m, which the drop stays below; at the other instant 0.5 over 0.4.
    let beside = row.beside_drop.as_ref().unwrap();
    assert!((beside.worst - 1.5).abs() < 1e-12);
    assert_eq!(beside.worst_peak_m, 0.3);
    assert_eq!(row.drop.as_ref().unwrap().worst_peak_m, 0.4);
    assert_eq!(beside.at.place, "2.00 s behind the bend");
    assert!(row.is_judged() && row.is_broken());
    let none = super::row(&instants, None, Condition::Mid, 1.5);
    assert_eq!((none.instants, none.handover), (0, None));
}

#[test]
fn a_row_is_broken_well_beyond_a_drop_or_by_a_drive_that_was_not_guided() {
    for (handover_m, takes_over_after_s, is_broken) in [
        (0.4799, 1.0, false),
        (0.4801, 1.0, true),
        (0.4801, 0.5, false),
        (0.1, 2.0, false),
    ] {
        let mut peaks = drives();
        for peak in peaks[1..]
            .iter_mut()
            .filter(|peak| [0.5, 0.3].contains(&peak.peak_m))
        {
            peak.peak_m = handover_m;
        }
        for peak in peaks[1..].iter_mut().filter(|peak| peak.peak_m == 0.1) {
            peak.peak_m = 0.4;
        }
        let broken = |peaks: &[Peaks]| {
            let instants = found(peaks);
            row(&instants, Some(Bend::PAPERS), Condition::High, takes_over_after_s).is_broken()
        };
        assert_eq!(broken(&peaks), is_broken, "{handover_m} {takes_over_after_s}");
        // The drive without a failure, on which every instant rests.
        peaks[1].left_by_itself = true;
        assert!(broken(&peaks));
    }
}

#[test]
fn who_cannot_drive_the_bend_by_hand_is_not_judged() {
    let by_hand = |peak_m, settles| {
        let mut peaks = drives();
        (peaks[0].peak_m, peaks[0].settles) = (peak_m, settles);
        found(&peaks).len()
    };
    assert_eq!(by_hand(0.949, true), 16);
    assert_eq!(by_hand(0.951, true), 0);
    assert_eq!(by_hand(0.2, false), 0);
}
