//! What a study of two adaptations shows: the maps of driver and law, their product, the closed loops over time.

use super::with_interval;
use crate::document::{Block, Cell, Report, Section, Table};
use crate::plot::{Axis, Band, Figure, Mark, Panel, Series, Shade};
use haptic_batch::adaptation::{AdaptationResults, Pair, SMALL_GAIN, Seen, SmallGain, swings};

/// How long trust's shares remember (`haptic_sim::drivers`), s.
const MEMORY_S: f64 = 5.0;
/// Times of trust and of the estimate in the map, s.
const TRUST_S: [f64; 6] = [10.0, 20.0, 30.0, 40.0, 50.0, 60.0];
const DELAYS_S: [f64; 6] = [5.0, 15.0, 25.0, 35.0, 45.0, 55.0];
/// Time constants of the further lags of a law: one that follows at once, and one that follows slowly, s.
const LAW_LAGS_S: [f64; 2] = [0.0, 30.0];

/// The document of a study.
pub fn report(results: &AdaptationResults) -> Report {
    let maps = format!(
        "Where K_hg settles at a fixed K_1, begun from a low and from a high K_hg, with {} % intervals; where K_1 settles under each law \
         at a K_hg that is held. The loop of both rests where the lines cross.",
        results.level
    );
    let over_time = "K_hg under each law; shaded: the torque is lost. The first seed.";
    let gains = "K_1 of the same drives.";
    let critical = format!(
        "The product of slopes, negative, at which a linear loop begins to swing, and how long a swing lasts: the driver's memory of {MEMORY_S} s, \
         the lag of trust, the delay of the estimate, and a law without and with a lag. Below 1 no such loop swings."
    );
    let small_gain = vec![
        Block::figure("maps", maps_figure(results), maps),
        Block::Table(products(results)),
        Block::Text(judgement(results)),
    ];
    let k_hg = series_figure(results, k_hg_axis(), |seen| seen.k_hg);
    let k_1 = series_figure(results, k_1_axis(), |seen| seen.k_1);
    let closed_loop = vec![
        Block::figure("k_hg", k_hg, over_time),
        Block::figure("k_1", k_1, gains),
        Block::Table(loops(results)),
    ];
    let swings = vec![
        Block::figure("swings", swings_figure(), critical.clone()),
        Block::Table(swings_table(critical)),
    ];
    let sections = vec![
        Section::new("Small gain", small_gain),
        Section::new("The closed loop", closed_loop),
        Section::new("Where loops swing", swings),
    ];
    let title = format!("Two adaptations: {}", results.name);
    Report::new(title, summary(results), sections).with_notes(notes(results))
}

fn summary(results: &AdaptationResults) -> String {
    let [lost_at_s, lost_for_s, settles_s, averages_s] = results.times_s;
    let (road, kmh) = &results.place;
    format!(
        "{} laws behind the shipping ECU, {} drivers whose K_hg follows trust, {road} at {kmh} km/h, {} seeds. Maps: {settles_s} s to settle, \
         {averages_s} s averaged. Loops: the torque is lost at {lost_at_s} s for {lost_for_s} s. Intervals are of {level} %, over the seeds.",
        results.laws.len(),
        results.drivers.len(),
        results.seeds,
        level = results.level,
    )
}

fn names<'r>(results: &'r AdaptationResults, pair: &Pair) -> [&'r str; 2] {
    [&results.laws[pair.law], &results.drivers[pair.driver]]
}

fn notes(results: &AdaptationResults) -> Vec<String> {
    let ended = results.pairs.iter().filter(|pair| pair.ended > 0);
    let ended: Vec<String> = ended
        .map(|pair| format!("{} ({})", names(results, pair).join(" with "), pair.ended))
        .collect();
    if ended.is_empty() {
        return Vec::new();
    }
    let what = "drives that left the road, or in which the ECU ended guidance by itself";
    vec![format!("{what}: {}", ended.join(", "))]
}

fn products(results: &AdaptationResults) -> Table {
    let row = |pair: &Pair| {
        let verdict = match pair.small_gain() {
            SmallGain::TwoEquilibria => "no: the driver has two equilibria",
            SmallGain::Holds => "yes",
            SmallGain::WithoutMargin => "without margin",
            SmallGain::Fails => "no",
            SmallGain::Untold => "not told",
        };
        let mean = |value: Option<&haptic_batch::Mean>| Cell::Text(with_interval(value));
        let [law, driver] = names(results, pair).map(Cell::text);
        [
            ("Law", law),
            ("Driver", driver),
            ("dK_1/dK_hg (N.m)", mean(Some(&pair.law_slope))),
            ("dK_hg/dK_1 (1/N.m)", mean(pair.driver_slope.as_ref())),
            ("Product", mean(pair.product.as_ref())),
            ("Small gain", Cell::text(verdict)),
        ]
    };
    let caption = format!(
        "The largest slopes of law and driver, in size, with the interval of each by itself; small gain holds up to a product of \
         {SMALL_GAIN}, without margin below 1; not told: the interval lies on both sides of a limit"
    );
    Table::of_rows(caption, results.pairs.iter().map(row))
}

/// The laws with which small gain holds for every driver.
fn judgement(results: &AdaptationResults) -> String {
    let all = |law: usize| {
        (results.pairs.iter()).all(|pair| pair.law != law || pair.small_gain() == SmallGain::Holds)
    };
    let laws = results.laws.iter().enumerate();
    let held: Vec<&str> = laws
        .filter(|(law, _)| all(*law))
        .map(|(_, name)| name.as_str())
        .collect();
    match held[..] {
        [] => "Small gain holds for every driver with no law.".into(),
        _ => format!("Small gain holds for every driver with: {}.", held.join(", ")),
    }
}

fn loops(results: &AdaptationResults) -> Table {
    let first = format!("Behind it, less {}", results.laws[0]);
    let row = |pair: &Pair| {
        let [law, driver] = names(results, pair).map(Cell::text);
        let [before, behind] = &pair.k_hg;
        let mean = |value| Cell::Text(with_interval(value));
        [
            ("Law", law),
            ("Driver", driver),
            ("K_hg before the loss", mean(before.as_ref())),
            ("Behind it", mean(behind.as_ref())),
            (first.as_str(), mean(pair.against_first.as_ref())),
            ("Deviation of K_1 (N.m)", mean(pair.swing_nm.as_ref())),
            ("Period (s)", Cell::number(pair.period_s, 0)),
        ]
    };
    let caption = "K_hg before the loss and settled behind it; how K_1 moves before the loss";
    Table::of_rows(caption, results.pairs.iter().map(row))
}

fn maps_figure(results: &AdaptationResults) -> Figure {
    let panel = |(number, name): (usize, &String)| {
        let map = &results.maps[number];
        let of_driver = |(end, label): (usize, &str)| {
            let found = map.iter().filter_map(|point| Some((point.k_1, point.k_hg[end]?)));
            let found = found.map(|(k_1, value)| ((k_1, value.mean), value.ends()));
            Series::whiskers(label, 6 * end, found).joined()
        };
        // A gain that does not move is an upright line.
        let pairs = results.pairs.iter();
        let pairs = pairs.filter(|pair| pair.driver == number && pair.law_slope.mean > 0.0);
        let of_law = |pair: &Pair| {
            let points = pair
                .map
                .iter()
                .filter_map(|point| Some((point.k_1?.mean, point.k_hg)));
            Series::line(&results.laws[pair.law], pair.law, points.collect())
        };
        let both = [(0, "driver, from low K_hg"), (1, "driver, from high K_hg")];
        let series = pairs.map(of_law).chain(both.into_iter().map(of_driver));
        Panel::new(name, k_hg_axis(), series)
    };
    k_1_axis().figure(results.drivers.iter().enumerate().map(panel))
}

fn k_hg_axis() -> Axis {
    Axis::new("K_hg", "-").within(0.0, 1.02)
}

fn k_1_axis() -> Axis {
    Axis::new("K_1", "N.m")
}

/// A panel for each driver, a line for each law.
fn series_figure(results: &AdaptationResults, axis: Axis, value: fn(&Seen) -> f64) -> Figure {
    let [lost_at_s, lost_for_s, ..] = results.times_s;
    let line = |pair: &Pair| {
        let points = (1..)
            .zip(&pair.series)
            .map(|(second, seen)| (f64::from(second), value(seen)));
        Series::line(&results.laws[pair.law], pair.law, points.collect())
    };
    let panel = |(number, name): (usize, &String)| {
        let pairs = results.pairs.iter().filter(|pair| pair.driver == number);
        Panel::new(name, axis.clone(), pairs.map(line))
    };
    let lost_s = [lost_at_s, lost_at_s + lost_for_s];
    Figure {
        bands: vec![Band::new("torque lost", lost_s, Shade::Light)],
        ..Axis::new("Time", "s").figure(results.drivers.iter().enumerate().map(panel))
    }
}

fn critical(trust_s: f64, delay_s: f64, law_s: f64) -> String {
    match swings(&[MEMORY_S, trust_s, law_s], delay_s) {
        Some([product, period_s]) => format!("{product:.1}, {period_s:.0} s"),
        None => "never".into(),
    }
}

/// A field for each time of trust and of the estimate.
fn swings_figure() -> Figure {
    let size = [TRUST_S[1] - TRUST_S[0], DELAYS_S[1] - DELAYS_S[0]];

    let panel = |law_s: f64| {
        let of_delay = |delay_s| TRUST_S.map(|trust_s| (trust_s, delay_s));
        let fields = || DELAYS_S.into_iter().flat_map(of_delay);
        // The nearer to 1 the product is, the stronger.
        let shown = fields().map(|(trust_s, delay_s)| {
            let found = swings(&[MEMORY_S, trust_s, law_s], delay_s);
            let strength = found.map_or(0.0, |[product, _]| 1.0 / product);
            (0.1 + 0.8 * strength, critical(trust_s, delay_s, law_s))
        });
        let mark = Mark::Fields {
            size,
            shown: shown.collect(),
        };
        let title = match law_s {
            0.0 => "a law that follows at once".into(),
            lag => format!("a law that follows with a lag of {lag} s"),
        };
        let y = Axis::new("Delay", "s").around(&DELAYS_S);
        Panel::new(title, y, [Series::with_mark("", 1, mark, fields().collect())])
    };
    Axis::new("Lag of trust", "s")
        .around(&TRUST_S)
        .figure(LAW_LAGS_S.map(panel))
}

fn swings_table(caption: String) -> Table {
    let rows = LAW_LAGS_S.into_iter().flat_map(|law_s| {
        DELAYS_S.into_iter().map(move |delay_s| {
            let cells = TRUST_S.map(|trust_s| Cell::Text(critical(trust_s, delay_s, law_s)));
            let head = [Cell::number(law_s, 0), Cell::number(delay_s, 0)];
            head.into_iter().chain(cells).collect()
        })
    });
    let columns = ["Lag of the law (s)".to_owned(), "Delay (s)".to_owned()]
        .into_iter()
        .chain(TRUST_S.map(|trust_s| format!("Trust {trust_s} s")));
    Table::new(caption, columns, rows)
}
