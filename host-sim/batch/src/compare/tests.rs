//! A comparison on a short road: its figures against drives by themselves and sums by hand, its files against what they say.

use std::ops::ControlFlow;
use std::sync::Mutex;

use haptic_sim::guidance::OwnLaw;
use haptic_sim::kind::{Kind, Make, Origin};
use haptic_sim::laws::LawView;
use haptic_sim::parts::{PaperDriver, PaperVehicle};
use haptic_sim::scenario::{Failure, FailureKind};
use haptic_sim::seeds::named;
use haptic_sim::{Scenario, Simulation};

use super::*;
use crate::engine::{Progress, Watch};
use crate::files::Source;
use crate::files::tests::check_refusals;

const ROAD: &str =
    "lane_width_m = 3.6\n[[segment]]\nlength_m = 200\n[[segment]]\nlength_m = 250\ncurvature_per_m = 0.003\n";
const FILE: &str = "
name = 'short'
seeds = 2
roads = ['road.toml']
speeds_m_per_s = [13.88888888888889, 16.666666666666668]
[scenario]
driver = { remnant_sd_nm = 0.1 }
[faults]
sudden_loss = 2
silent_lane = 1
lasts_s = 6
[[law]]
name = 'published'
kind = 'paper'
k_1 = 0.25
a_1 = 2
[[law]]
name = 'more'
kind = 'paper'
k_1 = 0.4
around = [{ kind = 'driver_limit', max_nm = 2 }]
[[driver]]
kind = 'paper'
[[driver]]
name = 'aside'
kind = 'paper'
k_hg = 0
around = [{ kind = 'own_line', offset_m = 0.3 }]
";
const TUNING: &str = "[tuning]\nbudget = 4\nfront = 0\nseeds = 1\nroads = ['road.toml']\nspeeds_m_per_s = [16.666666666666668]\nweights = { peak_lateral_error_m = 1 }\n";

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("road.toml"), ROAD).unwrap();
    folder
}

fn compare<'k>(text: &str, kinds: &'k Kinds) -> Result<Compare<'k>, InputError> {
    file::from_text(&Source::new("study.toml", folder().path()), text, kinds)
}

fn results(text: &str) -> CompareResults {
    let kinds = Kinds::default();
    compare(text, &kinds).unwrap().run(&Watch::nobody()).unwrap()
}

#[test]
fn any_number_of_threads_gives_the_same_results() {
    let text = FILE.replacen("[faults]", &format!("{TUNING}[faults]"), 1);
    let on = |threads| on_threads(Some(threads), || results(&text)).unwrap();
    let (one, three) = (on(1), on(3));
    assert_eq!(one, three);
    assert_eq!(one.rows, three.rows);
    // Two laws, two drivers, two speeds, two seeds, and a heading.
    assert_eq!(one.rows.len(), 16);
}

#[test]
fn speeds_in_kilometres_an_hour_are_the_same_drives() {
    let text = FILE.replacen(
        "speeds_m_per_s = [13.88888888888889, 16.666666666666668]",
        "speeds_kmh = [50, 60]",
        1,
    );
    let kinds = Kinds::default();
    let speeds = |text: &str| -> Vec<f64> {
        let places = compare(text, &kinds).unwrap().judged.places;
        places.into_iter().map(|(_, kmh, _)| kmh).collect()
    };
    assert_eq!(speeds(&text), [50.0, 60.0]);
    assert_eq!(speeds(&text), speeds(FILE));
}

/// The first drive, driven by itself by other means: its peaks without failure, and after each failure.
#[test]
fn a_drive_and_its_failures_are_those_of_the_simulator() {
    let kinds = Kinds::default();
    let compare = compare(FILE, &kinds).unwrap();
    let found = compare.run(&Watch::nobody()).unwrap();
    let (road, speed_kmh, scenario) = &compare.judged.places[0];
    let seed = named(named(1, "judged"), &format!("{road} {speed_kmh} 0")) >> 11;
    let scenario = scenario.to_builder().seed(seed).build().unwrap();
    // The peak from the failure on, and the mean from 5 s behind it on.
    let driven = |failure: Option<(FailureKind, f64)>| {
        let from_s = failure.map_or(0.0, |(_, time_s)| time_s);
        let until_s = failure.map_or(f64::INFINITY, |(_, time_s)| time_s + 6.0);
        let (kind, time_s) = failure.unwrap_or((FailureKind::None, 0.0));
        let scenario: Scenario = scenario
            .to_builder()
            .failure(Failure {
                kind,
                time_s,
                duration_s: None,
            })
            .build()
            .unwrap();
        let driver = PaperDriver::new(&scenario);
        let guidance = OwnLaw::new(&scenario, haptic_sim::laws::Gains::PAPER);
        let run = Simulation::of_parts(&scenario, driver, PaperVehicle::new(&scenario), guidance).run();
        let samples = run
            .trace
            .samples
            .iter()
            .filter(|s| s.time_s >= from_s && s.time_s < until_s);
        let errors: Vec<(f64, f64)> = samples
            .map(|s| (s.time_s - from_s, s.lateral_error_m.abs()))
            .collect();
        let behind = || {
            errors
                .iter()
                .filter(|(time_s, _)| *time_s > 5.0 - 1e-9)
                .map(|(_, m)| m)
        };
        let mean_m = behind().sum::<f64>() / behind().count() as f64;
        [errors.iter().map(|(_, m)| *m).fold(0.0, f64::max), mean_m]
    };
    let peak_m = |failure| driven(failure)[0];
    let values = found.rows[0].driven.values;
    assert_eq!(values[0], Some(peak_m(None)));
    // A quarter and three quarters of what is left of the drive before the last 6 s; half of it.
    let span_s = scenario.duration_s() - 6.0;
    let at = |share: f64| (share * span_s * 1000.0).floor() / 1000.0;
    let losses = [0.25, 0.75].map(|share| peak_m(Some((FailureKind::Torque, at(share)))));
    assert_eq!(values[7], Some(losses[0].max(losses[1])));
    assert_eq!(values[8], Some(0.5 * (losses[0] + losses[1])));
    assert_eq!(values[9], Some(peak_m(Some((FailureKind::Input, at(0.5))))));
    let behind = [0.25, 0.75].map(|share| driven(Some((FailureKind::Torque, at(share))))[1]);
    assert!((values[10].unwrap() - 0.5 * (behind[0] + behind[1])).abs() < 1e-12);
}

/// Means, and the interval of two values a and b by Student's t with one degree of freedom: 12.7062*abs(a - b)/2.
#[test]
fn means_and_intervals_are_those_of_the_rows() {
    let found = results(FILE);
    let peak = |law: usize, driver: usize, place: usize, seed: usize| {
        found.rows[((law * 2 + driver) * 2 + place) * 2 + seed]
            .driven
            .values[0]
            .unwrap()
    };
    for law in 0..2 {
        for driver in 0..2 {
            let cell = &found.cells[law * 2 + driver];
            assert_eq!((cell.law, cell.driver), (law, driver));
            let seeds = [0, 1].map(|seed| 0.5 * (peak(law, driver, 0, seed) + peak(law, driver, 1, seed)));
            let apart =
                [0, 1].map(|seed| seeds[seed] - 0.5 * (peak(0, driver, 0, seed) + peak(0, driver, 1, seed)));
            for (value, [a, b]) in [(cell.values[0], seeds), (cell.against_first[0], apart)] {
                let Mean { mean, interval, .. } = value.unwrap();
                let half = 0.5 * 12.706_204_7 * (a - b).abs();
                assert!((mean - 0.5 * (a + b)).abs() < 1e-12);
                // The first law's difference from itself does not scatter.
                let high = interval.map_or(0.0, |[_, high]| high);
                assert!((high - mean - half).abs() < 1e-6 && interval.is_some() == (a != b));
            }
        }
    }
}

/// What a file sets stays; what it leaves open is tuned, and the best of the budget is no worse than what it began with.
#[test]
fn tuning_varies_what_a_file_leaves_open() {
    let text = FILE.replacen("[faults]", &format!("{TUNING}[faults]"), 1);
    let kinds = Kinds::default();
    let compare = compare(&text, &kinds).unwrap();
    let last = Mutex::new(Progress::default());
    let hear = |progress| {
        *last.lock().unwrap() = progress;
        ControlFlow::Continue(())
    };
    let found = compare.run(&Watch::new(&hear)).unwrap();
    // 2 x 2 x 2 x 2 judged, 4 sets of the second law with 2 drivers.
    let last = last.into_inner().unwrap();
    assert_eq!((last.done, last.all), (24, 24));
    assert_eq!(found.laws[0].tuning, None);
    let tuning = found.laws[1].tuning.unwrap();
    let [before, after] = tuning.objective.map(|objective| objective.mean);
    assert!(after < before, "{before} {after}");
    assert_eq!((tuning.sets, tuning.settled), (4, false));
    assert_eq!(found.laws[1].values[0], ("k_1", 0.4));
    assert!((2.0..=6.0).contains(&found.laws[1].values[1].1) && found.laws[1].values[1].1 != 2.0);
    assert_eq!(found.laws[1].kind, "driver_limit(paper)");
}

/// Two worlds, the second with another muscle: half of the drives are those of a file without worlds, the ratio is that of the sums.
#[test]
fn worlds_are_places_with_the_same_seeds_and_ratios_are_those_of_the_rows() {
    let worlds = "[[world]]\nname = 'as-it-is'\n[[world]]\nname = 'slow'\nscenario = { driver = { t_nms_s = 0.15 } }\n";
    let found = results(&FILE.replacen("[faults]", &format!("{worlds}[faults]"), 1));
    let plain = results(FILE);
    let of_world =
        |world: &str| -> Vec<&DriveRow> { found.rows.iter().filter(|row| row.names[2] == world).collect() };
    let (own, slow) = (of_world("as-it-is"), of_world("slow"));
    assert_eq!((own.len(), slow.len()), (16, 16));
    for (own, plain) in own.iter().zip(&plain.rows) {
        assert_eq!(own.driven, plain.driven);
    }
    assert_ne!(own[0].driven, slow[0].driven);
    // By law, driver, place, seed: eight rows for each law, of which every second has the same seed.
    let ratios = |rows: &[&DriveRow], own: std::ops::Range<usize>, first: std::ops::Range<usize>| -> f64 {
        let sum = |of: std::ops::Range<usize>, seed: usize| -> f64 {
            let values = of
                .filter(|row| row % 2 == seed)
                .map(|row| rows[row].driven.values[0].unwrap());
            values.sum()
        };
        let of_seeds = [0, 1].map(|seed| sum(own.clone(), seed) / sum(first.clone(), seed));
        0.5 * (of_seeds[0] + of_seeds[1])
    };
    for (world, rows) in [own, slow].iter().enumerate() {
        let ratio = found
            .ratios
            .iter()
            .find(|ratio| (ratio.law, ratio.world, ratio.metric) == (1, world, 0));
        let ratio = ratio.unwrap();
        assert!((ratio.mean.mean - ratios(rows, 8..16, 0..8)).abs() < 1e-12);
        let each = [0, 4].map(|from| ratios(rows, 8 + from..12 + from, from..4 + from));
        let (largest, driver) = ratio.largest;
        assert!((largest.mean - each[driver]).abs() < 1e-12 && each[driver] >= each[1 - driver]);
        // One of two drivers: 97.5 % for 95 %, t of one degree of freedom 25.4517.
        assert_eq!(largest.level.to_string(), "97.5");
    }
}

/// An oracle's objective with each driver is that of a file with this driver alone.
#[test]
fn an_oracle_is_tuned_for_each_driver_by_itself() {
    let text = FILE.replacen("[faults]", &format!("{TUNING}[faults]"), 1);
    let both = text.replacen("k_1 = 0.4\n", "oracle = true\n", 1);
    let drivers: Vec<&str> = both.split("[[driver]]").collect();
    let alone = |driver: usize| {
        let found = results(&format!("{}[[driver]]{}", drivers[0], drivers[1 + driver]));
        (
            found.laws[1].tuning.unwrap().objective[1].mean,
            found.rows[4..].to_vec(),
        )
    };
    let (first, second) = (alone(0), alone(1));
    let found = results(&both);
    let tuned = found.laws[1].tuning.unwrap().objective[1].mean;
    assert!((tuned - 0.5 * (first.0 + second.0)).abs() < 1e-12);
    assert_eq!(found.rows[8..], [first.1, second.1].concat());
    assert!(found.laws[1].oracle && !found.laws[0].oracle);
}

/// Participant 13 under a law and without: the values of table 5, written here, under `none` alone; his habits stay.
#[test]
fn without_guidance_drivers_have_their_gains_by_hand() {
    let text = FILE.replacen(
        "[[driver]]\nkind = 'paper'\n",
        "[[driver]]\nkind = 'participant'\nnumber = 13\n",
        1,
    );
    let text = text.replacen(
        "name = 'published'\nkind = 'paper'\nk_1 = 0.25\na_1 = 2",
        "kind = 'none'",
        1,
    );
    let kinds = Kinds::default();
    let own = compare(&text, &kinds).unwrap();
    let (by_hand, table) = own.by_hand[0].as_ref().unwrap();
    assert_eq!(*table, "table 5");
    assert_eq!(by_hand.untuned(), [0.074, 0.015, 3.523, 0.038, 3.719, 0.0]);
    let (aside, table) = own.by_hand[1].as_ref().unwrap();
    assert_eq!(
        (aside.untuned()[4], *table, aside.around.len()),
        (4.0, "table 4", 1)
    );
    let same = text.replacen(
        "kind = 'participant'\nnumber = 13",
        "name = 'participant'\nkind = 'paper'\na_1 = 0.086\na_2 = 0.003\na_3 = 3.476\nt_p_s = 0.046\nk_d_nm_per_rad = 2.125\nk_hg = 0.035",
        1,
    );
    // Under the law both are the guided participant; by hand the second has table 4's arm.
    let (own, same) = (results(&text), results(&same));
    assert_eq!(own.rows[8..12], same.rows[8..12]);
    assert_ne!(own.rows[..4], same.rows[..4]);
}

/// Six days without a torque leave exp(-6/3) of a share of 1, days with the published law all of it. He is judged with the gains between
/// tables 5 and 6 that his share has, written here for participant 13; without days he is the participant.
#[test]
fn who_adapts_is_judged_where_his_days_left_him() {
    let adapting = FILE.replacen(
        "[[driver]]\nkind = 'paper'\n",
        "[[driver]]\nname = 'he'\nkind = 'adapting'\nnumber = 13\n",
        1,
    );
    let adapting = adapting.replacen(
        "k_1 = 0.4\naround = [{ kind = 'driver_limit', max_nm = 2 }]",
        "k_1 = 0",
        1,
    );
    let worlds = "[[world]]\nname = 'before'\ndays = 0\n[[world]]\nname = 'behind'\ndays = 6\n";
    let found = results(&adapting.replacen("[faults]", &format!("{worlds}[faults]"), 1));
    let shares: Vec<(usize, usize, usize)> = (found.adapted.iter())
        .map(|adapted| (adapted.law, adapted.driver, adapted.world))
        .collect();
    assert_eq!(shares, [(0, 0, 1), (1, 0, 1)]);
    let [all, little] = [0, 1].map(|place| found.adapted[place].share);
    assert!(
        (all - 1.0).abs() < 1e-12 && (little - (-2.0_f64).exp()).abs() < 1e-12,
        "{all} {little}"
    );
    let between = |manual: f64, guided: f64| manual + little * (guided - manual);
    let same = format!(
        "kind = 'paper'\na_1 = {}\na_2 = {}\na_3 = {}\nt_p_s = {}\nk_d_nm_per_rad = {}\nk_hg = {}\n",
        between(0.074, 0.086),
        between(0.015, 0.003),
        between(3.523, 3.476),
        between(0.038, 0.046),
        between(3.719, 2.125),
        between(0.0, 0.035)
    );
    let named = |driver: &str| results(&adapting.replacen("kind = 'adapting'\nnumber = 13\n", driver, 1));
    let (before, behind) = (named("kind = 'participant'\nnumber = 13\n"), named(&same));
    // By law, driver, place with both worlds, seed.
    for (law, rows) in [(0, &before), (1, &behind)] {
        for (own, same) in found.rows[law * 16 + 4..][..4].iter().zip(&rows.rows[law * 8..]) {
            let [own, same] = [own, same].map(|row| row.driven.values[0].unwrap());
            assert!((own - same).abs() < 1e-9, "{law}: {own} {same}");
        }
    }
    for (own, same) in found.rows[16..][..4].iter().zip(&before.rows[8..]) {
        assert_eq!(own.driven, same.driven);
    }
}

const DRAWN: &str = "[drawn]\nbends = 2\nspeeds_m_per_s = [14, 20]\nlateral_m_per_s2 = [0.5, 1.5]\n";

fn drawn(seeds: u32) -> String {
    let text = FILE.replacen(
        "seeds = 2\nroads = ['road.toml']\nspeeds_m_per_s = [13.88888888888889, 16.666666666666668]\n",
        &format!("seeds = {seeds}\n"),
        1,
    );
    text.replacen("[faults]", &format!("{DRAWN}[faults]"), 1)
}

/// Sixty roads: bends to both sides, as sharp as their speed allows, none twice, and tuning has others.
#[test]
fn roads_and_speeds_are_drawn_within_what_the_file_says() {
    let kinds = Kinds::default();
    let text = drawn(60).replacen("[faults]", "[tuning]\nbudget = 4\nseeds = 60\n[faults]", 1);
    let compare = compare(&text, &kinds).unwrap();
    let (judged, tuning) = (&compare.judged, &compare.tuning.as_ref().unwrap().drives);
    assert_eq!((judged.places.len(), judged.seeds, compare.units()), (60, 1, 60));
    let (mut left, mut right) = (0, 0);
    let mut lengths = std::collections::BTreeSet::new();
    for (_, kmh, scenario) in judged.places.iter().chain(&tuning.places) {
        let v = kmh / 3.6;
        assert!((14.0..20.0).contains(&v));
        for segment in scenario.course().segments() {
            let lateral = v * v * segment.curvature_end_1pm;
            assert!(
                lateral == 0.0 || (0.5 - 1e-9..1.5 + 1e-9).contains(&lateral.abs()),
                "{lateral}"
            );
            left += u32::from(lateral > 0.0);
            right += u32::from(lateral < 0.0);
        }
        lengths.insert(scenario.course().length_m().to_bits());
    }
    // Two ends of each bend; a quarter to either side at least.
    assert_eq!((left + right, lengths.len()), (480, 120));
    assert!(left.min(right) > 120, "{left} {right}");
}

/// The unit is the draw: the mean and interval of a cell are those of its three rows.
#[test]
fn a_drawn_road_is_a_unit() {
    let found = results(&drawn(3));
    assert_eq!((found.rows.len(), found.draws), (12, 3));
    let peaks: Vec<f64> = found.rows[..3]
        .iter()
        .map(|row| row.driven.values[0].unwrap())
        .collect();
    let mean = peaks.iter().sum::<f64>() / 3.0;
    let deviation = (peaks.iter().map(|peak| (peak - mean).powi(2)).sum::<f64>() / 2.0).sqrt();
    let value = found.cells[0].values[0].unwrap();
    assert!((value.mean - mean).abs() < 1e-12);
    // t of two degrees of freedom.
    let half = 4.302_652_7 * deviation / 3.0_f64.sqrt();
    assert!((value.interval.unwrap()[1] - mean - half).abs() < 1e-6);
    assert_eq!(found.rows[0].names[3], found.rows[9].names[3]);
}

/// Where nothing is drawn by chance, no interval is claimed and nothing is called clear.
#[test]
fn what_does_not_scatter_has_no_interval() {
    let found = results(&FILE.replacen("remnant_sd_nm = 0.1", "remnant_sd_nm = 0", 1));
    for cell in &found.cells {
        assert!(cell.values.iter().flatten().all(|mean| mean.interval.is_none()));
        assert!(cell.p_holm.iter().all(Option::is_none));
    }
}

/// One drive of four without a value is counted, a metric that no drive has is not.
#[test]
fn drives_without_a_value_are_counted() {
    let kinds = Kinds::default();
    let compare = compare(FILE, &kinds).unwrap();
    let drive = |tlc_s| {
        let mut values = [Some(1.0); METRICS.len()];
        (values[3], values[9]) = (tlc_s, None);
        Driven {
            values,
            off_road: false,
            left_by_itself: false,
            failed_off_road: 0,
        }
    };
    let mut driven = vec![drive(Some(2.0)); 16];
    driven[5] = drive(None);
    let cells = results::cells(&compare, &driven);
    let missing: Vec<[usize; 3]> = (cells.iter())
        .map(|cell| [0, 3, 9].map(|metric| cell.missing[metric]))
        .collect();
    assert_eq!(missing, [[0, 0, 0], [0, 1, 0], [0, 0, 0], [0, 0, 0]]);
    assert_eq!(cells[1].drives, 4);
}

/// A law that no list has, and one that asks for no number.
#[test]
fn a_law_of_one_s_own_joins() {
    #[derive(Clone)]
    struct Silent;
    impl Law for Silent {
        fn ask(&mut self, _: &LawView) -> f64 {
            f64::NAN
        }
    }
    let mut kinds = Kinds::default();
    kinds.laws.push(Kind {
        name: "silent",
        source: "this test",
        origin: Origin::Ours,
        parameters: &[],
        make: Make::Part(|_, _| Ok(Box::new(Silent))),
    });
    let text = FILE.replacen(
        "name = 'more'\nkind = 'paper'\nk_1 = 0.4\naround = [{ kind = 'driver_limit', max_nm = 2 }]",
        "kind = 'silent'",
        1,
    );
    let text = text.replacen("k_1 = 0.25\na_1 = 2\n", "", 1).replacen(
        "name = 'published'\nkind = 'paper'",
        "kind = 'none'",
        1,
    );
    // Drivers who have no other gains by hand.
    let at = text.find("[[driver]]").unwrap();
    let drivers = text[at..].replace("kind = 'paper'", "kind = 'cybernetic'");
    let text = text[..at].to_owned() + &drivers;
    let found = compare(&text, &kinds).unwrap().run(&Watch::nobody()).unwrap();
    // Two drivers, two speeds, two seeds for each law.
    for (none, silent) in found.rows[..8].iter().zip(&found.rows[8..]) {
        assert_eq!(none.driven, silent.driven);
    }
}

/// What stands in the file, what stands there instead, and what is said of it.
const WRONG: [(&str, &str, &str); 35] = [
    (
        "k_1 = 0.25",
        "oracle = 1",
        "law.oracle = 1: true or false is wanted",
    ),
    (
        "[faults]",
        "[[world]]\nname = 'w'\nscenario = { speed = 5 }\n[faults]",
        "study.toml: world w: scenario.speed: this file has its own seeds",
    ),
    (
        "k_1 = 0.25",
        "k_1 = 5",
        "study.toml: law published.k_1 = 5 is outside 0 to 4",
    ),
    (
        "k_1 = 0.25",
        "k_1 = nan",
        "law published.k_1 = NaN is outside 0 to 4",
    ),
    (
        "k_1 = 0.25",
        "k_1 = 'much'",
        "law published: k_1 = \"much\": a number is wanted",
    ),
    (
        "k_1 = 0.25",
        "gain = 1",
        "law published: there is no \"gain\", only k_1, a_1, a_2, a_3, a_4",
    ),
    (
        "kind = 'paper'",
        "kind = 'papper'",
        "law.kind: there is no \"papper\", only none, paper, fdca",
    ),
    (
        "kind = 'paper'",
        "kind = 'driver_limit'",
        "law.kind: there is no \"driver_limit\"",
    ),
    (
        "max_nm = 2",
        "max_nm = -1",
        "law more: driver_limit.max_nm = -1 is outside 0 to 10",
    ),
    (
        "kind = 'own_line'",
        "kind = 'paper'",
        "driver aside: around.kind: there is no \"paper\", only own_line, trust",
    ),
    (
        "around = [{ kind = 'own_line', offset_m = 0.3 }]",
        "around = 1",
        "driver aside: around = 1: a list of tables is wanted",
    ),
    (
        "name = 'aside'",
        "name = 'paper'",
        "driver \"paper\" is there twice",
    ),
    ("name = 'short'", "name = 'a/b'", "a name is 1 to 40 letters"),
    (
        "seeds = 2",
        "seeds = 2\ndays = 1001",
        "days = 1001 is outside 0 to 1000",
    ),
    ("seeds = 2", "seeds = 0", "seeds = 0 is outside 1 to 1000"),
    ("seeds = 2", "seeds = -2", "expected a whole number, 0 or more"),
    ("seeds = 2", "seedz = 2", "unknown field `seedz`"),
    (
        "speeds_m_per_s = [13.88888888888889, 16.666666666666668]",
        "speeds_m_per_s = []",
        "speeds_m_per_s = []: one at least is wanted",
    ),
    (
        "speeds_m_per_s = [13.88888888888889, 16.666666666666668]",
        "speeds_m_per_s = [83.33333333333333]",
        "speed_m_per_s = 83.33333333333333 m/s is outside 5.5 to 70 m/s",
    ),
    (
        "speeds_m_per_s = [13.88888888888889, 16.666666666666668]",
        "speeds_kmh = []",
        "speeds_kmh = []: one at least is wanted",
    ),
    (
        "speeds_m_per_s = [13.88888888888889, 16.666666666666668]",
        "speeds_kmh = [60, 300]",
        "speeds_kmh = 300 km/h is outside 19.8 to 252 km/h",
    ),
    (
        "seeds = 2",
        "seeds = 2\nspeeds_kmh = [60]",
        "speeds_m_per_s, speeds_kmh: one of them is wanted",
    ),
    (
        "speeds_m_per_s = [13.88888888888889, 16.666666666666668]",
        "",
        "speeds_m_per_s, speeds_kmh: one of them is wanted",
    ),
    (
        "[scenario]\n",
        "[scenario]\nspeed_kmh = 60\n",
        "scenario.speed_kmh: this file has its own seeds",
    ),
    ("['road.toml']", "['lost.toml']", "lost.toml"),
    (
        "lasts_s = 6",
        "lasts_s = 0",
        "faults.lasts_s = 0 s is outside 1 to 600 s",
    ),
    (
        "[scenario]\n",
        "[scenario]\nseed = 4\n",
        "scenario.seed: this file has its own seeds",
    ),
    (
        "[scenario]\n",
        "[scenario]\ncondition = 'manual'\n",
        "a law of kind \"none\" is no guidance",
    ),
    ("[scenario]\n", "[scenario]\nsped = 4\n", "sped"),
    (
        "[scenario]\n",
        "[tuning]\nbudget = 0\nseeds = 1\nroads = ['road.toml']\nspeeds_m_per_s = [16.666666666666668]\n[scenario]\n",
        "tuning.budget = 0 is outside 1 to 10000",
    ),
    (
        "[scenario]\n",
        "[tuning]\nbudget = 1\nseeds = 1\nroads = ['road.toml']\nspeeds_m_per_s = [16.666666666666668]\nweights = { luck = 1 }\n[scenario]\n",
        "tuning.weights: there is no \"luck\", only peak_lateral_error_m",
    ),
    (
        "[faults]",
        "[drawn]\nbends = 2\nspeeds_kmh = [50, 70]\nlateral_m_per_s2 = [0.5, 1.5]\n[faults]",
        "drawn: roads and speeds are drawn, or named",
    ),
    (
        "roads = ['road.toml']\nspeeds_m_per_s = [13.88888888888889, 16.666666666666668]\n",
        "[drawn]\nbends = 9\nspeeds_kmh = [50, 70]\nlateral_m_per_s2 = [0.5, 1.5]\n",
        "drawn.bends = 9 is outside 1 to 8",
    ),
    (
        "roads = ['road.toml']\nspeeds_m_per_s = [13.88888888888889, 16.666666666666668]\n",
        "[drawn]\nbends = 2\nspeeds_kmh = [50, 70]\nlateral_m_per_s2 = [1.5, 0.5]\n",
        "drawn.lateral_m_per_s2: the least and the largest are wanted, rising",
    ),
    (
        "seeds = 2",
        "seeds = 1000\nroads = ['road.toml']\nseed = 'x",
        "study.toml: ",
    ),
];

/// In this place it would be driven by laws that it does not name.
#[test]
fn a_law_of_the_ecu_is_refused_beside_laws_of_the_file() {
    let text = FILE.replacen("[scenario]\n", "[scenario]\nguidance = { law = 1 }\n", 1);
    assert_ne!(text, FILE);
    let error = compare(&text, &Kinds::default()).err().unwrap().to_string();
    assert!(
        error.contains("scenario.guidance.law = 1: this file has its own laws"),
        "{error}"
    );
}

#[test]
fn a_wrong_file_is_refused_by_field_value_and_range() {
    let kinds = Kinds::default();
    check_refusals(FILE, &WRONG, |text| compare(text, &kinds).err());
}
