//! A sweep as a person writes it: what is driven, what is refused, and that nothing but the file decides the table.

use std::collections::BTreeSet;
use std::path::Path;

use haptic_sim::scenario::Scenario;
use haptic_sim::simulation::simulate;

use super::*;
use crate::engine::{Watch, number, on_threads, text};
use crate::statistics::Confidence;

/// A straight and a curve, 18 s at 60 km/h: drives that take a millisecond.
const ROAD: &str = "
[scenario.course]
name = \"one curve\"
lane_width_m = 3.6
segment = [
    { length_m = 100.0, curvature_start_per_m = 0.0, curvature_end_per_m = 0.0 },
    { length_m = 200.0, curvature_start_per_m = 0.003, curvature_end_per_m = 0.003 },
]
";

fn sweep(text: &str) -> Result<Sweep, String> {
    let text = resolve::resolve("sweep.toml", text, Path::new("")).map_err(|e| e.to_string())?;
    Sweep::from_text("sweep.toml", &text).map_err(|e| e.to_string())
}

pub(super) fn with_road(text: &str, vary: &str) -> Sweep {
    sweep(&format!("{text}{ROAD}{vary}")).unwrap()
}

fn refused(text: &str) -> String {
    sweep(text).unwrap_err()
}

fn driven(store: &Store, sweep: &Sweep, shard: Shard, threads: u32) {
    let drive = || run_all(store, sweep, shard, &Watch::nobody());
    on_threads(Some(threads), drive).unwrap().unwrap();
}

#[test]
fn lists_and_ranges_meet_each_other_and_every_sample() {
    let sweep = with_road(
        "samples = 3\nrepeats = 2\n",
        "[vary]\nspeed_m_per_s = [14, 17]\ndriver.t_n_s = { from = 0.1, to = 0.3, count = 3 }\n\"driver.k_hg\" = { uniform = [0, 1] }\n",
    );
    assert_eq!(sweep.drives(), 3 * 2 * 2 * 3);
    assert_eq!(
        sweep.columns().collect::<Vec<_>>(),
        ["driver.t_n_s", "speed_m_per_s", "driver.k_hg"]
    );
    let points: Vec<DesignPoint> = (0..sweep.drives()).map(|drive| sweep.point(drive)).collect();
    let of = |point: &DesignPoint| [0, 1].map(|i| text(&point.values[i]));
    let grid: BTreeSet<[String; 2]> = points.iter().map(of).collect();
    assert_eq!(grid.len(), 6);
    assert!(grid.contains(&["0.2".to_string(), "17".into()]), "{grid:?}");
    // Within a sample K_hg stays, and repeats differ by their seed, which is the same on all of the grid.
    for sample in points.chunks(12) {
        assert!(sample.iter().all(|point| point.values[2] == sample[0].values[2]));
        assert_eq!(
            sample
                .iter()
                .map(|point| point.seed)
                .collect::<BTreeSet<_>>()
                .len(),
            2
        );
    }
    assert_eq!(
        points
            .iter()
            .map(|point| point.seed)
            .collect::<BTreeSet<_>>()
            .len(),
        6
    );
}

/// What a row says is what the scenario gives that a person would write.
#[test]
fn a_row_is_the_drive_of_the_scenario_that_it_names() {
    let sweep = with_road(
        "samples = 2\n",
        "[scenario.failure]\nkind = \"torque\"\n[vary]\n\"driver.t_p_s\" = { uniform = [0.1, 0.5] }\n\"failure.time_s\" = { uniform = [6, 12] }\n",
    );
    let point = sweep.point(1);
    let [t_p, time] = [0, 1].map(|i| number(&point.values[i]).unwrap());
    let course = "[course]\nname = \"one curve\"\nlane_width_m = 3.6\n[[course.segment]]\nlength_m = 100.0\ncurvature_start_per_m = 0.0\n\
                  curvature_end_per_m = 0.0\n[[course.segment]]\nlength_m = 200.0\ncurvature_start_per_m = 0.003\ncurvature_end_per_m = 0.003\n";
    let text = format!(
        "seed = {}\n[driver]\nt_p_s = {t_p}\n[failure]\nkind = \"torque\"\ntime_s = {time}\n{course}",
        point.seed
    );
    let scenario = Scenario::from_toml("by hand", &text, |_, _| unreachable!()).unwrap();
    assert_eq!(sweep.scenario(&point).unwrap(), scenario);
    let peak = simulate(&scenario)
        .trace
        .samples
        .iter()
        .map(|s| s.lateral_error_m.abs())
        .fold(0.0, f64::max);
    let driven = sweep.drive(&point).unwrap();
    let place = sweep
        .metrics()
        .iter()
        .position(|d| d.name == "peak_lateral_error_m")
        .unwrap();
    assert_eq!(driven.metrics[place], Some(peak));
    assert!(!driven.diverged && peak > 0.01);
}

#[test]
fn one_value_may_set_several_fields() {
    let fields =
        "fields = [\"course.segment.0.curvature_end_per_m\", \"course.segment.1.curvature_start_per_m\"]";
    let sweep = with_road(
        "samples = 5\n",
        &format!("[vary]\ncurvature = {{ uniform = [0.001, 0.002], {fields} }}\n"),
    );
    let point = sweep.point(3);
    let drawn = number(&point.values[0]).unwrap();
    let scenario = sweep.scenario(&point).unwrap();
    let segments = scenario.course().segments();
    assert_eq!(
        [segments[0].curvature_end_1pm, segments[1].curvature_start_1pm],
        [drawn; 2]
    );
    assert!((0.001..=0.002).contains(&drawn));
}

/// A place on the road in place of an instant: at 20 m/s 100 m are 5 s.
#[test]
fn a_value_may_go_over_another() {
    let place = "place = { list = [100], fields = [\"failure.time_s\"], over = \"speed_m_per_s\" }";
    let kind = "[scenario.failure]\nkind = \"torque\"\n";
    let sweep = with_road(kind, &format!("[vary]\nspeed_m_per_s = [10, 20]\n{place}\n"));
    let times = [0, 1].map(|drive| {
        let scenario = sweep.scenario(&sweep.point(drive)).unwrap();
        scenario.failure().at_s().unwrap()
    });
    assert_eq!(times, [10.0, 5.0]);
    assert!(
        refused(&format!("{kind}[vary]\n{place}\n"))
            .contains("over = \"speed_m_per_s\" is no other varied field")
    );
}

/// The sum is equal however the drives are cut; and a kill costs no more than the chunk under way.
#[test]
fn the_table_does_not_depend_on_threads_shards_and_restarts() {
    let sweep = with_road(
        "samples = 40\ndesign = \"latin-hypercube\"\n",
        "[vary]\n\"driver.t_p_s\" = { uniform = [0.1, 0.5] }\n",
    );
    let table = |work: &dyn Fn(&Store)| {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&sweep, "test 1", folder.path()).unwrap();
        work(&store);
        let summary = store.finish(Confidence::USUAL).unwrap();
        let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap_or_default();
        (read("drives.csv"), read("drives.parquet"), summary)
    };
    let drive = |store: &Store, shard: &str, threads| driven(store, &sweep, shard.parse().unwrap(), threads);
    let whole = table(&|store| drive(store, "1/1", 1));
    assert_eq!(whole.0.iter().filter(|byte| **byte == b'\n').count(), 41);
    assert_eq!(whole, table(&|store| drive(store, "1/1", 3)));
    assert_eq!(
        whole,
        table(&|store| ["3/3", "1/3", "2/3"]
            .into_iter()
            .for_each(|shard| drive(store, shard, 2)))
    );
    assert_eq!(
        whole,
        table(&|store| {
            // Killed before, while it wrote, and spoiled by the disk.
            drive(store, "1/2", 1);
            let chunks = store.directory().join("chunks");
            std::fs::write(chunks.join("00000003.9.unfinished"), b"half").unwrap();
            std::fs::write(chunks.join("00000002"), b"HSWEEP1\nspoiled").unwrap();
            drive(store, "1/1", 2);
        })
    );
}

#[test]
fn a_directory_of_another_sweep_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let of = |samples: u32| {
        with_road(
            &format!("samples = {samples}\n"),
            "[vary]\n\"driver.t_p_s\" = { uniform = [0.1, 0.5] }\n",
        )
    };
    let (one, other) = (of(4), of(5));
    Store::open(&one, "test 1", folder.path()).unwrap();
    Store::open(&one, "test 1", folder.path()).unwrap();
    assert!(matches!(
        Store::open(&other, "test 1", folder.path()),
        Err(StoreError::Another(_))
    ));
    assert!(matches!(
        Store::open(&one, "test 2", folder.path()),
        Err(StoreError::Another(_))
    ));
    let store = Store::open(&one, "test 1", folder.path()).unwrap();
    assert!(matches!(
        store.finish(Confidence::USUAL),
        Err(StoreError::Missing(1, 1))
    ));
    assert!(matches!(store.put(0, b"bytes"), Err(StoreError::Corrupted(0))));
}

/// The peak varies while K_hg goes from 0 to 1; its mean is known to 20 mm before all 1,000 are driven, at the same
/// drive for any number of threads. That the interval is that narrow is computed here from the table.
#[test]
fn an_early_stop_stops_where_the_mean_is_known() {
    let sweep = with_road(
        "samples = 1000\nmetrics = [\"peak_lateral_error_m\"]\n",
        "[stop]\nmetric = \"peak_lateral_error_m\"\nhalf_width = 0.02\nleast = 50\n[vary]\n\"driver.k_hg\" = { uniform = [0, 1] }\n",
    );
    let table = |threads| {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&sweep, "test 1", folder.path()).unwrap();
        driven(&store, &sweep, Shard::WHOLE, threads);
        let summary = store.finish(Confidence::USUAL).unwrap();
        (
            std::fs::read_to_string(folder.path().join("drives.csv")).unwrap(),
            summary,
        )
    };
    let (csv, summary) = table(1);
    assert_eq!((csv.clone(), summary.clone()), table(2));
    assert!((50..1000).contains(&summary.drives), "{}", summary.drives);
    let peaks: Vec<f64> = csv
        .lines()
        .skip(1)
        .map(|row| row.rsplit(',').next().unwrap().parse().unwrap())
        .collect();
    let n = peaks.len() as f64;
    let mean = peaks.iter().sum::<f64>() / n;
    let sd = (peaks.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
    assert!(sd > 0.0 && 1.959_964 * sd / n.sqrt() <= 0.02 + 1e-9, "{sd} {n}");
}

#[test]
fn a_table_of_drivers_varies_its_fields_together() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("drivers.csv"),
        "driver.t_p_s,condition\n0.1,high\n0.3,low\n",
    )
    .unwrap();
    let text = format!("[[table]]\nfile = \"drivers.csv\"\n{ROAD}[vary]\nspeed_m_per_s = [14, 17]\n");
    std::fs::write(folder.path().join("sweep.toml"), text).unwrap();
    let sweep = Sweep::load(&folder.path().join("sweep.toml")).unwrap();
    assert_eq!(sweep.drives(), 4);
    let seen: Vec<(f64, String)> = (0..4)
        .map(|drive| {
            let scenario = sweep.scenario(&sweep.point(drive)).unwrap();
            (scenario.driver().t_p, scenario.condition().to_string())
        })
        .collect();
    let [high, low] = [(0.1, "high".to_string()), (0.3, "low".to_string())];
    assert_eq!(seen, [high.clone(), low.clone(), high, low]);
    // A worker needs the text alone.
    let again = Sweep::from_text("elsewhere", sweep.text()).unwrap();
    assert_eq!(again.point(3), sweep.point(3));
}

#[test]
fn what_is_wrong_is_named_with_file_field_value_and_range() {
    let vary = |line: &str| refused(&format!("samples = 10\n[vary]\n{line}\n"));
    let has = |message: String, parts: &[&str]| {
        assert!(parts.iter().all(|part| message.contains(part)), "{message}");
    };
    has(
        vary("speed_m_per_s = { uniform = [14, 80] }"),
        &["sweep.toml: ", "speed_m_per_s = ", "5.5 to 70 m/s"],
    );
    has(
        vary("\"driver.t_x\" = { uniform = [0, 1] }"),
        &["sweep.toml: ", "unknown field `t_x`"],
    );
    has(
        vary("speed_m_per_s = { uniform = [70, 50] }"),
        &["vary.speed_m_per_s: uniform = 70, 50"],
    );
    has(
        vary("speed_m_per_s = { uniform = [50, 70], list = [1] }"),
        &["vary.speed_m_per_s: exactly one of"],
    );
    has(
        vary("speed_m_per_s = { normal = [50, 5], truncated = [1, 2] }"),
        &["vary.speed_m_per_s: unknown field `truncated`"],
    );
    has(vary("speed_m_per_s = 50"), &["vary.speed_m_per_s: takes a list"]);
    has(
        vary("speed_m_per_s = { from = 50, to = 70, count = 1 }"),
        &["vary.speed_m_per_s: count = 1 is outside 2 to"],
    );
    has(
        vary("\"failure.time_s\" = { uniform = [10, 900] }\n[scenario.failure]\nkind = \"torque\""),
        &["failure.time_s = ", "the run ends there"],
    );
    has(
        vary("\"course.segment.7.length_m\" = { uniform = [10, 900] }"),
        &["vary.course.segment.7.length_m"],
    );
    has(
        refused("[vary]\nspeed_m_per_s = { uniform = [50, 70] }\n"),
        &["samples: how many"],
    );
    has(
        refused("samples = 3\n[vary]\nspeed_m_per_s = [14]\n"),
        &["samples: nothing is sampled"],
    );
    has(
        refused("metrics = [\"speed\"]\n"),
        &["metrics: no metric \"speed\"", "peak_lateral_error_m"],
    );
    has(
        refused("judge = \"sdlp_m\"\nmetrics = [\"duration_s\"]\n"),
        &["judge = \"sdlp_m\" is not among the metrics"],
    );
    has(
        refused("desing = \"sobol\"\n"),
        &["sweep.toml: ", "line 1", "unknown field `desing`"],
    );
    has(refused("base = \"no-such.toml\"\n"), &["no-such.toml: "]);
    for (compare, why) in [
        ("speed_m_per_s", "from a distribution"),
        ("seed", "is not varied; varied are speed_m_per_s"),
    ] {
        let text = format!(
            "samples = 3\ncompare = \"{compare}\"\n[vary]\nspeed_m_per_s = {{ uniform = [50, 60] }}\n"
        );
        has(
            refused(&text),
            &["sweep.toml: ", &format!("compare = \"{compare}\""), why],
        );
    }
    has(
        refused(
            "design = \"saltelli\"\nsamples = 4\n[vary]\nspeed_m_per_s = [14]\nseed = { choice = [1, 2] }\n",
        ),
        &["saltelli"],
    );
    has(
        refused("window = [0, 9000]\n"),
        &["window to = 9000 m is outside 0 to 3350 m"],
    );
}
