//! What a comparison of laws and drivers shows: a matrix for each metric, what each driver pays, and where a law does not help.

use super::{listed, with_interval};
use crate::document::{Block, Cell, Report, Section, Table};
use crate::plot::{Axis, Figure, Mark, Panel, Series};
use haptic_batch::compare::{Cell as Pair, CompareResults, LawResult, Metric, Ratio};
use haptic_batch::{Confidence, Mean};
use haptic_sim::drivers::{DRIVERS, HABITS};
use haptic_sim::kind::{Kind, Origin};
use haptic_sim::laws::LAWS;

/// Metrics of the terminal's matrices, and of the list of what a law makes worse.
const FIRST: [&str; 4] = [
    "peak_lateral_error_m",
    "mean_abs_driver_torque_nm",
    "conflict_torque_nm",
    "worst_peak_after_loss_m",
];

/// The document of a comparison.
pub fn report(results: &CompareResults) -> Report {
    let matrices = results
        .metrics
        .iter()
        .enumerate()
        .filter(|(place, _)| has_values(results, *place));
    let blocks = matrices.flat_map(|(place, metric)| {
        let name = format!("matrix-{}", metric.name);
        let figure = Block::figure(
            name,
            figure(results, place, metric),
            caption(metric, results.level),
        );
        let table = Block::Table(matrix(results, place, metric));
        let is_first = FIRST.contains(&metric.name);
        [figure, if is_first { table } else { table.on_page() }]
    });
    let first = &results.laws[0].name;
    let verdicts = vec![Block::Text(judgement(results)), Block::Table(worse(results))];
    let of_all = vec![Block::Table(ratios(results))];
    let sections = vec![
        Section::new("The laws", vec![Block::Table(laws(results))]),
        Section::new("Laws by drivers", blocks.collect()),
        Section::new(format!("All drivers, over {first}"), of_all),
        Section::new(format!("Against {first}"), verdicts),
    ];
    let title = format!("Laws and drivers: {}", results.name);
    Report {
        notes: notes(results),
        ..Report::new(title, summary(results), sections)
    }
}

fn summary(results: &CompareResults) -> String {
    let [losses, silences] = results.instants;

    format!(
        "{} laws behind the shipping ECU, {} drivers, {}, {} seeds each. In each drive {losses} instants of a sudden loss and {silences} of \
         a silent lane. Intervals are of {level} %, over the seeds.",
        results.laws.len(),
        results.drivers.len(),
        listed(&results.places),
        results.seeds,
        level = results.level,
    )
}

/// The laws that a file may name.
pub fn law_kinds() -> Table {
    kinds(LAWS.iter().map(kind))
}

/// The drivers that a file may name, and their habits.
pub fn driver_kinds() -> Table {
    kinds(DRIVERS.iter().chain(&HABITS).map(kind))
}

fn kinds(rows: impl Iterator<Item = [String; 3]>) -> Table {
    let row = |row: [String; 3]| row.map(Cell::Text).to_vec();
    Table::new("", ["Kind", "Source", "Parameters"], rows.map(row))
}

/// Name, source, and each parameter with its default, a star where that was chosen here, its range, and what tuning varies.
fn kind<P: ?Sized>(kind: &Kind<P>) -> [String; 3] {
    let parameters = kind.parameters.iter().map(|p| {
        let star = if p.origin == Origin::Ours { "*" } else { "" };
        let tuned = p
            .tuned
            .map_or(String::new(), |[low, high]| format!("; tuned {low} to {high}"));
        format!(
            "`{}` {}{star} ({} to {}{tuned})",
            p.name, p.default, p.range[0], p.range[1]
        )
    });
    let parameters: Vec<String> = parameters.collect();
    [
        format!("`{}`", kind.name),
        kind.source.into(),
        parameters.join(", "),
    ]
}

type Count = fn(&Pair) -> usize;

/// Drives of which the means know little.
fn notes(results: &CompareResults) -> Vec<String> {
    let counted = |(what, count): (&str, Count)| {
        let found = results.cells.iter().filter(|pair| count(pair) > 0).map(|pair| {
            let (law, driver) = (&results.laws[pair.law].name, &results.drivers[pair.driver][0]);
            format!("{law} with {driver} ({})", count(pair))
        });
        let found: Vec<String> = found.collect();
        (!found.is_empty()).then(|| format!("{what}: {}", found.join(", ")))
    };
    let all: [(&str, Count); 3] = [
        (
            "drives that left the road, which count as a peak of 10 m",
            |pair| pair.off_road,
        ),
        ("failed drives that left the road, likewise", |pair| {
            pair.failed_off_road as usize
        }),
        ("drives in which the ECU ended guidance by itself", |pair| {
            pair.left_by_itself
        }),
    ];
    all.into_iter().filter_map(counted).collect()
}

fn laws(results: &CompareResults) -> Table {
    let row = |law: &LawResult| {
        let value = |(name, value): &(&str, f64)| format!("{name} {}", rounded(*value));
        let values: Vec<String> = law.values.iter().map(value).collect();
        let [before, after] = Cell::ends(law.objective, 4);
        let found = match law.oracle && law.objective.is_some() {
            true => "for each driver by itself".into(),
            false => values.join(", "),
        };
        [
            ("Law", Cell::text(&law.name)),
            ("Kind", Cell::text(&law.kind)),
            ("Source", Cell::text(law.source)),
            ("Objective untuned", before),
            ("Tuned", after),
            ("Parameters", Cell::Text(found)),
        ]
    };
    let caption = match results.budget {
        0 => "Laws as they were judged".into(),
        budget => format!(
            "Laws as they were judged: the best of {budget} sets each, by the objective on the training drives"
        ),
    };
    Table::of_rows(caption, results.laws.iter().map(row))
}

/// Every law in every world over the first law: the mean over the drivers, and who is worst off.
fn ratios(results: &CompareResults) -> Table {
    let shown: Vec<usize> = (0..results.metrics.len())
        .filter(|place| FIRST.contains(&results.metrics[*place].name))
        .collect();
    let pairs =
        (1..results.laws.len()).flat_map(|law| (0..results.worlds.len()).map(move |world| (law, world)));
    let row = |(law, world): (usize, usize)| {
        let cell = |metric: &usize| {
            let is_it = |ratio: &&Ratio| (ratio.law, ratio.world, ratio.metric) == (law, world, *metric);
            let found = results.ratios.iter().find(is_it);
            let largest = found.map(|ratio| (ratio.largest.0, &results.drivers[ratio.largest.1][0]));
            let largest = largest.map_or(String::new(), |(share, name)| format!(" ({share:.3} {name})"));
            Cell::Text(with_interval(found.map(|ratio| &ratio.mean)) + &largest)
        };
        let head = [&results.laws[law].name, &results.worlds[world]].map(Cell::text);
        head.into_iter().chain(shown.iter().map(cell)).collect()
    };
    let labels = shown.iter().map(|place| results.metrics[*place].label);
    let columns = ["Law", "World"].into_iter().chain(labels);
    let caption = format!(
        "Means over drivers and places as shares of those of {}, with intervals over the seeds, and the largest share of a driver",
        results.laws[0].name
    );
    Table::new(caption, columns, pairs.map(row))
}

/// Four digits, which tell a set again.
fn rounded(value: f64) -> String {
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').into()
}

fn caption(metric: &Metric, level: Confidence) -> String {
    let better = if metric.more_is_better { "More" } else { "Less" };
    format!(
        "{} ({}) by law, a panel for each driver, with {level} % intervals. {better} is better.",
        metric.label, metric.unit
    )
}

fn has_values(results: &CompareResults, metric: usize) -> bool {
    results.cells.iter().any(|pair| pair.values[metric].is_some())
}

fn matrix(results: &CompareResults, place: usize, metric: &Metric) -> Table {
    let of_law = |(number, law): (usize, &LawResult)| {
        let cells = results.cells.iter().filter(|pair| pair.law == number);
        let values = cells.map(|pair| Cell::Text(with_interval(pair.values[place].as_ref())));
        [Cell::text(&law.name)].into_iter().chain(values).collect()
    };
    let columns = ["Law"]
        .into_iter()
        .chain(results.drivers.iter().map(|[name, _]| name.as_str()));
    let caption = format!("{} ({})", metric.label, metric.unit);
    Table::new(caption, columns, results.laws.iter().enumerate().map(of_law))
}

fn figure(results: &CompareResults, place: usize, metric: &Metric) -> Figure {
    let panel = |(number, [name, _]): (usize, &[String; 2])| {
        let cells = results.cells.iter().filter(|pair| pair.driver == number);
        let found = cells.filter_map(|pair| Some((super::place(pair.law), pair.values[place]?)));
        let (points, ends) = found
            .map(|(x, value)| ((x, value.mean), value.interval.unwrap_or([value.mean; 2])))
            .unzip();
        let series = Series::with_mark("", 0, Mark::Whiskers(ends), points);
        Panel::new(name, Axis::new(metric.label, metric.unit), [series])
    };
    let laws = results.laws.iter().map(|law| &law.name);
    Figure {
        same_y: true,
        ..Figure::of_rows(laws, results.drivers.iter().enumerate().map(panel))
    }
}

/// Differences to the first law whose interval does not hold zero: with + if the law is better there.
fn clear(results: &CompareResults) -> impl Iterator<Item = (&Pair, &Metric, Mean, bool)> {
    let pairs = results.cells.iter().filter(|pair| pair.law > 0);
    pairs.flat_map(|pair| {
        let metrics = results.metrics.iter().zip(&pair.against_first);
        let metrics = metrics.filter(|(metric, _)| FIRST.contains(&metric.name));
        metrics.filter_map(move |(metric, difference)| {
            let difference = (*difference)?;
            let [low, high] = difference.interval?;
            let is_less = high < 0.0;
            (is_less || low > 0.0).then_some((pair, metric, difference, is_less != metric.more_is_better))
        })
    })
}

/// How often each law is clearly better and worse than the first, over drivers and the first metrics.
fn judgement(results: &CompareResults) -> String {
    let told = results.laws.iter().enumerate().skip(1).map(|(number, law)| {
        let clear = || clear(results).filter(|(pair, ..)| pair.law == number);
        let count = |better: bool| clear().filter(|(.., is)| *is == better).count();
        format!("{}: better {}, worse {}", law.name, count(true), count(false))
    });
    let told: Vec<String> = told.collect();
    if told.is_empty() {
        return "There is no other law.".into();
    }
    format!(
        "Clear differences (the interval over the seeds, drive by drive, does not hold zero) in peak error, effort, torque in conflict and the \
         worst peak after a loss, over the drivers. {}.",
        told.join("; ")
    )
}

/// Where a law does not help.
fn worse(results: &CompareResults) -> Table {
    let rows = clear(results)
        .filter(|(.., better)| !better)
        .map(|(pair, metric, difference, _)| {
            vec![
                Cell::text(&results.laws[pair.law].name),
                Cell::text(&results.drivers[pair.driver][0]),
                Cell::text(metric.label),
                Cell::Text(with_interval(Some(&difference))),
            ]
        });
    let caption = format!("Where a law is clearly worse than {}", results.laws[0].name);
    Table::new(caption, ["Law", "Driver", "Metric", "Difference"], rows)
}
