use haptic_sim::scenario::Speed;
use haptic_sim::worlds::WORLDS;

use super::*;
use haptic_batch::engine::{Watch, on_threads, run};

/// Exact limits of a Poisson count as tables print them (Garwood 1936; Ulm 1990): 0 to 3.689, 0.0253 to 5.572, 4.795 to
/// 18.39, 81.36 to 121.63; and three for the one-sided limit of none.
#[test]
fn intervals_are_those_of_the_tables() {
    for (count, low, high) in [
        (0, 0.0, 3.689),
        (1, 0.025, 5.572),
        (10, 4.795, 18.390),
        (100, 81.364, 121.627),
    ] {
        let [from, to] = Rate::new(count, 1.0, Confidence::USUAL).interval;
        assert!(
            (from - low).abs() < 6e-4 && (to - high).abs() < 6e-4,
            "{count}: {from} {to}"
        );
    }
    assert!((Rate::new(0, 1.0, Confidence::USUAL).upper - 2.9957).abs() < 1e-4);
    assert!((Rate::new(0, 300.0, Confidence::USUAL).upper - 0.009_986).abs() < 1e-6);
}

fn plan(hours: f64) -> AvailabilityPlan {
    let named = |name: &str| WORLDS.iter().find(|c| c.name == name).unwrap();
    AvailabilityPlan {
        worlds: vec![named("calibrated"), named("everything")],
        roads: vec![&ROADS[1]],
        hours,
        seed: 1,
        only: Vec::new(),
        level: Confidence::USUAL,
    }
}

#[test]
fn legs_fill_the_hours_and_the_first_ones_stay_when_there_are_more() {
    let [few, many] = [plan(0.25), plan(0.5)].map(|plan| plan.segments());
    assert_eq!((few.len(), many.len()), (6, 12));
    for segment in &few {
        let same = many.iter().find(|other| {
            other.number == segment.number && other.world == segment.world && other.road == segment.road
        });
        assert_eq!(same.unwrap().scenario(1), segment.scenario(1));
    }
}

/// What is compared must differ in the world alone.
#[test]
fn worlds_share_road_driver_and_noise() {
    let segments = plan(0.1).segments();
    let of = |world: &str| {
        let segment = segments
            .iter()
            .find(|segment| segment.world.name == world && segment.number == 1);
        segment.unwrap().scenario(3).unwrap()
    };
    let (paper, real) = (of("calibrated"), of("everything"));
    assert_eq!(paper.speed_kmh(), real.speed_kmh());
    assert_eq!((paper.driver(), paper.gains()), (real.driver(), real.gains()));
    assert_eq!(paper.seed(), real.seed());
    let curvatures = |scenario: &haptic_sim::Scenario| {
        let segments = scenario.course().segments().iter();
        segments.map(|s| s.curvature_end_1pm).collect::<Vec<_>>()
    };
    assert_eq!(curvatures(&paper), curvatures(&real));
    assert!(paper.course().is_level() && !real.course().is_level());
    assert_eq!(paper.car().vehicle, *paper.vehicle());
    assert_ne!(real.car().vehicle, *real.vehicle());
}

/// The road that was asked for: lateral acceleration within its limit, curves to both sides, and the outer edge of every
/// curve higher.
#[test]
fn roads_are_built_as_they_say() {
    let segment = plan(0.1)
        .segments()
        .into_iter()
        .find(|segment| segment.world.name == "everything")
        .unwrap();
    let scenario = segment.scenario(1).unwrap();
    let v = scenario.speed_m_per_s();
    let arcs = || {
        let segments = scenario.course().segments().iter();
        segments.filter(|s| s.curvature_start_1pm == s.curvature_end_1pm && s.curvature_start_1pm != 0.0)
    };
    assert!((12..22).contains(&arcs().count()), "{}", arcs().count());
    let mut sides = [0, 0];
    for arc in arcs() {
        let lateral = arc.curvature_start_1pm * v * v;
        assert!((0.3..=2.5).contains(&lateral.abs()), "{lateral}");
        assert!(arc.bank_rad[0] * lateral < 0.0 && (0.024..0.0601).contains(&arc.bank_rad[0].abs()));
        sides[usize::from(lateral < 0.0)] += 1;
    }
    assert!(sides.iter().all(|n| *n > 2), "{sides:?}");
}

/// Half of the segments on record: the rest is driven, nothing twice, and the results are those of one sitting.
#[test]
fn an_interrupted_study_goes_on_where_it_was() {
    let plan = plan(0.05);
    let driven = std::sync::Mutex::new(Vec::new());
    let keep = |segment: &DriveSegment| {
        driven.lock().unwrap().push(segment.clone());
        Ok(())
    };
    let drive = |on_record: &[DriveSegment],
                 keep: &(dyn Fn(&DriveSegment) -> Result<(), StudyError> + Sync)| {
        run(&plan, &resumed(on_record, keep), &Watch::nobody())
    };
    let whole = drive(&[], &keep).unwrap();
    let mut segments = driven.into_inner().unwrap();
    assert_eq!(segments.len(), 2);
    let kept = segments.split_off(1);
    let again = std::sync::Mutex::new(0);
    let found = drive(&kept, &|_| {
        *again.lock().unwrap() += 1;
        Ok(())
    });
    assert_eq!((found, again.into_inner().unwrap()), (Ok(whole.clone()), 1));

    // A competent driver: wanders as people do, and stays in a lane of 3.6 m.
    for cell in &whole.cells {
        assert!(
            (0.1..0.5).contains(&cell.sdlp_m),
            "{}: {} m",
            cell.world,
            cell.sdlp_m
        );
        assert_eq!(cell.diverged, 0);
    }
    // On paper nothing is declared.
    assert_eq!(whole.cells[0].declarations.count, 0, "{:?}", whole.cells[0]);
}

/// Three drives made up: a whole one, one that is lost with guidance and by hand, one that is lost with guidance alone.
#[test]
fn a_drive_that_is_lost_by_hand_is_counted_apart() {
    let plan = AvailabilityPlan {
        worlds: vec![WORLDS.iter().find(|world| world.name == "everything").unwrap()],
        ..plan(0.25)
    };
    let drive = |number: u32, [ended, by_hand]: [Ended; 2]| DriveSegment {
        world: "everything".into(),
        road: "country".into(),
        number,
        car: number.into(),
        speed_kmh: 90.0,
        driven_s: 72.0,
        active_s: 36.0,
        sdlp_m: 0.3,
        largest_error_m: 1.0,
        ended,
        declarations: (ended == Ended::Diverged)
            .then(|| Declaration {
                time_s: 60.0,
                faults: "LaneImplausible".into(),
                lateral_m_per_s2: 0.5,
            })
            .into_iter()
            .collect(),
        by_hand: ByHand {
            ended: by_hand,
            largest_error_m: 2.0,
        },
    };
    let (whole, lost) = (Ended::Whole, Ended::Diverged);
    let segments = [
        drive(0, [whole, whole]),
        drive(1, [lost, lost]),
        drive(2, [lost, whole]),
    ];
    let found = summary(&plan, &segments.iter().collect::<Vec<_>>());
    let cell = &found.cells[0];
    assert_eq!((cell.declarations.count, cell.diverged, cell.cars), (1, 1, 2));
    assert!((cell.hours - 0.04).abs() < 1e-12 && (cell.available - 0.5).abs() < 1e-12);
    let apart = &cell.lost_by_hand;
    assert_eq!((apart.segments, apart.declarations), (1, 1));
    assert!((apart.hours - 0.02).abs() < 1e-12);
    // What can be driven alone is named, the whole drive is not.
    assert_eq!(
        found
            .segments
            .iter()
            .map(|segment| segment.number)
            .collect::<Vec<_>>(),
        [1, 2]
    );
    assert!(found.together.is_empty() && found.judged().count() == 1);
    // Both roads together: two declarations in twice the time, and judged in place of each alone.
    let both = AvailabilityPlan {
        roads: ROADS.iter().collect(),
        ..plan
    };
    let on = |road: &str, segment: &DriveSegment| DriveSegment {
        road: road.into(),
        ..segment.clone()
    };
    let all: Vec<DriveSegment> = ROADS
        .iter()
        .flat_map(|r| segments.iter().map(|segment| on(r.name, segment)))
        .collect();
    let found = summary(&both, &all.iter().collect::<Vec<_>>());
    let [together] = found.judged().collect::<Vec<_>>()[..] else {
        panic!("{:?}", found.together)
    };
    assert_eq!((together.road, together.declarations.count), ("all", 2));
    assert!((together.hours - 0.08).abs() < 1e-12 && (together.available - 0.5).abs() < 1e-12);
    assert_eq!(
        (together.cars, together.lost_by_hand.segments, found.cells.len()),
        (2, 2, 2)
    );
    // Nothing is known of a rate where every drive is lost by hand.
    let none = summary(&both, &[&segments[1]]);
    assert!(
        none.cells
            .iter()
            .all(|cell| cell.declarations.upper.is_nan() && cell.hours == 0.0)
    );
}

/// A population is of thirty cars, and drives can be asked for by number.
#[test]
fn thirty_cars_drive() {
    let mut all = plan(5.0);
    let cars = |plan: &AvailabilityPlan| {
        let scenarios = plan
            .segments()
            .into_iter()
            .map(|segment| segment.scenario(1).unwrap());
        let cars = scenarios.filter_map(|scenario| scenario.tolerances().car);
        cars.collect::<std::collections::BTreeSet<_>>()
    };
    assert_eq!(cars(&all).len(), 30);
    all.only = vec![7, 31];
    assert_eq!(
        all.segments()
            .iter()
            .map(|segment| segment.number)
            .collect::<Vec<_>>(),
        [7, 31, 7, 31]
    );
}

/// The lateral acceleration of the road at a declaration is v^2 times its curvature; here nobody declares anything: cars that
/// brake and accelerate as people do, in the world in which all else is real too.
#[test]
fn braking_in_a_real_world_is_no_fault() {
    let world = WORLDS.iter().find(|world| world.name == "braking").unwrap();
    let mut active_s = 0.0;
    for road in &ROADS {
        for number in 0..3 {
            let number = SegmentNumber { world, road, number };
            let scenario = number.scenario(1).unwrap();
            let Speed::ByTime { speed_m_per_s, .. } = scenario.speed() else {
                panic!("one speed");
            };
            let first = speed_m_per_s[0];
            let least = speed_m_per_s.iter().copied().fold(f64::INFINITY, f64::min);
            assert!(speed_m_per_s.len() > 40 && least < 0.7 * first);
            assert!(speed_m_per_s.iter().all(|v| *v <= first));
            let segment = number.drive(1).unwrap();
            assert_eq!(
                (segment.ended, &segment.declarations),
                (Ended::Whole, &vec![]),
                "{segment:?}"
            );
            active_s += segment.active_s;
        }
    }
    assert!(active_s > 1790.0, "{active_s}");
}

/// Every field of every segment: side by side as alone with the shipping ECU, where all can be vectorised, where a motor ripples
/// though nobody guides, where no guided drive can for the camera, and where some drives are rejected. One thread drives: a part
/// of one drive is not driven side by side.
#[test]
fn legs_are_the_same_side_by_side() {
    for name in ["calibrated", "everything", "motor", "camera", "slippery"] {
        let world = WORLDS.iter().find(|world| world.name == name).unwrap();
        let plan = AvailabilityPlan {
            worlds: vec![world],
            roads: ROADS.iter().collect(),
            only: vec![7],
            ..plan(1.0)
        };
        let found = std::sync::Mutex::new(Vec::new());
        let keep = |segment: &DriveSegment| {
            found.lock().unwrap().push(segment.clone());
            Ok(())
        };
        let study = || run(&plan, &resumed(&[], keep), &Watch::nobody());
        on_threads(Some(1), study).unwrap().unwrap();
        let found = found.into_inner().unwrap();
        assert_eq!(found.len(), 2, "{name}");
        for segment in &found {
            let number = plan
                .segments()
                .into_iter()
                .find(|number| segment.is(number))
                .unwrap();
            // As the file has it, which tells 0 from -0.
            let text = |segment: &DriveSegment| serde_json::to_string(segment).unwrap();
            assert_eq!(text(segment), text(&number.drive(1).unwrap()), "{name}");
        }
    }
}
