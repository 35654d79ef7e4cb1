//! What a comparison of laws and drivers shows: a matrix for each metric, what each driver pays, and where a law does not help.
//!
//! Above 500 lines because it is one report: split, a reader could not see whether a figure, a table and a note say the same
//! thing.

use super::{listed, with_interval};
use crate::document::{Block, Cell, Report, Section, Table};
use crate::plot::{Axis, Figure, Panel, Series};
use haptic_batch::compare::{
    Cell as Pair, CompareResults, FrontPoint, Kinds, LawResult, Metric, Ratio, Unit,
};
use haptic_batch::{Confidence, Mean};
use haptic_sim::drivers::{DRIVERS, HABITS};
use haptic_sim::kind::{Kind, Origin};

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
        let is_first = metric.is_judged;
        [figure, if is_first { table } else { table.on_page() }]
    });
    let first = &results.laws[0].name;
    let verdicts = vec![Block::Text(judgement(results)), Block::Table(worse(results))];
    let others = Block::Table(ratios(results, false)).on_page();
    let mut of_all = vec![Block::Table(ratios(results, true)), others];
    if !results.adapted.is_empty() {
        of_all.push(Block::Table(adapted(results)));
    }
    let front = vec![
        Block::figure("front", front_figure(results), front_caption(results)),
        Block::Table(front_table(results)),
        Block::Text(front_judgement(results)),
    ];
    let sections = vec![
        Section::of_table("The laws", laws(results)),
        Section::new("What each law trades", front),
        Section::new("Laws by drivers", blocks.collect()),
        Section::new(format!("All drivers, over {first}"), of_all),
        Section::new(format!("Against {first}"), verdicts),
    ];
    let title = format!("Laws and drivers: {}", results.name);
    Report::new(title, summary(results), sections).with_notes(notes(results))
}

fn summary(results: &CompareResults) -> String {
    let [losses, silences] = results.instants;
    let (draws, [unit, over_all], level) = (results.draws, results.units, results.level);
    let places = match unit {
        Unit::Road => "roads and speeds drawn by chance".into(),
        _ => listed(&results.places),
    };
    let drivers = match over_all {
        Unit::Driver => "; of means over drivers over the drivers, which stand for others like them",
        _ => "; the drivers are those listed, and nothing is said of others",
    };
    format!(
        "{} laws behind the shipping ECU, {} drivers, {places}. In each drive {losses} instants of a sudden loss and {silences} of a silent \
         lane. Intervals are of {level} %, over {draws} {unit}, which are the same for all laws{drivers}. What is called clear is left of \
         Student's test of pairs after Holm's correction.",
        results.laws.len(),
        results.drivers.len(),
    )
}

/// The laws that a file may name.
pub fn law_kinds() -> Table {
    Table::of_texts("", KINDS, Kinds::default().laws.iter().map(kind))
}

/// The drivers that a file may name, and their habits.
pub fn driver_kinds() -> Table {
    Table::of_texts("", KINDS, DRIVERS.iter().chain(&HABITS).map(kind))
}

const KINDS: [&str; 3] = ["Kind", "Source", "Parameters"];

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
        kind.said_source(),
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
    let counts = all.into_iter().filter_map(counted);
    counts
        .chain(unsettled(results))
        .chain(by_hand(results))
        .chain(free(results))
        .chain(unsaid(results))
        .chain(missing(results))
        .collect()
}

/// Laws whose objective still moved when the budget was used up.
fn unsettled(results: &CompareResults) -> Option<String> {
    let open = results
        .laws
        .iter()
        .filter(|law| law.tuning.is_some_and(|tuning| !tuning.settled));
    let open: Vec<&str> = open.map(|law| law.name.as_str()).collect();
    (!open.is_empty()).then(|| {
        format!(
            "laws whose objective may still have moved when the budget of {} sets was used up: {}",
            results.budget,
            open.join(", ")
        )
    })
}

/// Which gains the drivers have without guidance.
fn by_hand(results: &CompareResults) -> Option<String> {
    let none = results.laws.iter().find(|law| law.kind == "none")?;
    let drivers = results.drivers.iter().zip(&results.by_hand);
    let told = drivers.map(|([name, _], table)| {
        let gains = table.map_or("as with guidance, none are published".into(), |table| {
            format!("{table} of Wang et al. 2022")
        });
        format!("{name} ({gains})")
    });
    let told: Vec<String> = told.collect();
    Some(format!(
        "the drivers' gains by hand, under {}: {}",
        none.name,
        told.join(", ")
    ))
}

/// Drivers whom it costs nothing to resist.
fn free(results: &CompareResults) -> Option<String> {
    let drivers = results.drivers.iter().zip(&results.k_hg);
    let free = drivers.filter(|(_, k_hg)| k_hg.is_none_or(|k_hg| k_hg == 0.0));
    let free: Vec<&str> = free.map(|([name, _], _)| name.as_str()).collect();
    (!free.is_empty()).then(|| {
        format!(
            "drivers without a K_hg, or with 0, whose model lets resistance be free (T_d is what is left after T_h): {}",
            free.join(", ")
        )
    })
}

/// Means that have no interval, and are not shown.
fn unsaid(results: &CompareResults) -> Option<String> {
    let values = results.cells.iter().flat_map(|pair| &pair.values).flatten();
    let count = values.filter(|mean| mean.interval.is_none()).count();
    let why = match results.draws {
        1 => "there is a single draw",
        _ => "nothing in them was drawn by chance, or they are the same in every draw",
    };
    (count > 0).then(|| format!("{count} means have no interval, and are not shown: {why}"))
}

/// Drives that a mean of some of its drives passes over.
fn missing(results: &CompareResults) -> Option<String> {
    let places = 0..results.metrics.len();
    let of_pair = |pair: &Pair| {
        let told = places
            .clone()
            .filter(|place| pair.missing[*place] > 0)
            .map(|place| {
                let (law, driver) = (&results.laws[pair.law].name, &results.drivers[pair.driver][0]);
                let label = results.metrics[place].label;
                format!(
                    "{label} of {law} with {driver} ({} of {})",
                    pair.missing[place], pair.drives
                )
            });
        told.collect::<Vec<String>>()
    };
    let told: Vec<String> = results.cells.iter().flat_map(of_pair).collect();
    (!told.is_empty()).then(|| {
        format!(
            "drives without a value, which the means leave out: {}",
            told.join(", ")
        )
    })
}

/// A mean with half its interval; a dash for one without.
fn said(value: Option<&Mean>) -> String {
    with_interval(value.filter(|mean| mean.interval.is_some()))
}

fn laws(results: &CompareResults) -> Table {
    let row = |law: &LawResult| {
        let value = |(name, value): &(&str, f64)| format!("{name} {}", rounded(*value));
        let values: Vec<String> = law.values.iter().map(value).collect();
        let tuning = law.tuning.as_ref();
        let objective = |end: usize| Cell::Text(said(tuning.map(|tuning| &tuning.objective[end])));
        let found = match law.oracle && law.tuning.is_some() {
            true => "for each driver by itself".into(),
            false => values.join(", "),
        };
        [
            ("Law", Cell::text(&law.name)),
            ("Kind", Cell::text(&law.kind)),
            ("Source", Cell::text(&law.source)),
            (
                "Sets",
                Cell::number(tuning.map(|tuning| f64::from(tuning.sets)), 0),
            ),
            ("Objective untuned", objective(0)),
            ("Tuned", objective(1)),
            (
                "Last moved by",
                Cell::Text(said(tuning.map(|tuning| &tuning.moved))),
            ),
            ("Parameters", Cell::Text(found)),
        ]
    };
    let caption = match results.budget {
        0 => "Laws as they were judged",
        _ => {
            "Laws as they were judged: tuned until two rounds of sets no longer lowered the objective on the training drives"
        }
    };
    Table::of_rows(caption, results.laws.iter().map(row))
}

/// Every law in every world over the first law, in the metrics that laws are judged by or in the others: the mean over the drivers, and who
/// has the most.
fn ratios(results: &CompareResults, judged: bool) -> Table {
    let shown: Vec<usize> = (0..results.metrics.len())
        .filter(|place| results.metrics[*place].is_judged == judged && has_values(results, *place))
        .collect();
    let pairs =
        (1..results.laws.len()).flat_map(|law| (0..results.worlds.len()).map(move |world| (law, world)));
    let row = |(law, world): (usize, usize)| {
        let cell = |metric: &usize| {
            let is_it = |ratio: &&Ratio| (ratio.law, ratio.world, ratio.metric) == (law, world, *metric);
            let found = results.ratios.iter().find(is_it);
            let found = found.filter(|ratio| ratio.mean.interval.is_some());
            let clear = found
                .and_then(|ratio| ratio.p_holm)
                .is_some_and(|p| is_clear(results, p));
            let largest = found.filter(|ratio| ratio.largest.0.interval.is_some());
            let largest = largest.map_or(String::new(), |ratio| {
                format!(" ({} {})", results.drivers[ratio.largest.1][0], ratio.largest.0)
            });
            Cell::Text(
                with_interval(found.map(|ratio| &ratio.mean)) + if clear { "*" } else { "" } + &largest,
            )
        };
        let head = [&results.laws[law].name, &results.worlds[world]].map(Cell::text);
        head.into_iter().chain(shown.iter().map(cell)).collect()
    };
    let labels = shown.iter().map(|place| results.metrics[*place].label);
    let columns = ["Law", "World"].into_iter().chain(labels);
    let caption = format!(
        "Over {}, means over {}{}. In brackets the driver with the largest, with an interval over {} that counts how many drivers he was \
         chosen from",
        results.laws[0].name,
        results.units[1],
        if judged {
            "; * clearly not 1"
        } else {
            "; nothing is called clear"
        },
        results.units[0]
    );
    Table::new(caption, columns, pairs.map(row))
}

/// Where drivers who adapt stand behind their days.
fn adapted(results: &CompareResults) -> Table {
    let pairs =
        (0..results.laws.len()).flat_map(|law| (0..results.worlds.len()).map(move |world| (law, world)));
    let row = |(law, world): (usize, usize)| {
        let own = results
            .adapted
            .iter()
            .filter(|own| (own.law, own.world) == (law, world));
        let shares: Vec<f64> = own.map(|own| own.share).collect();
        let end = |end: fn(f64, f64) -> f64| Cell::number(shares.iter().copied().reduce(end), 3);
        let head = [&results.laws[law].name, &results.worlds[world]].map(Cell::text);
        (!shares.is_empty()).then(|| head.into_iter().chain([end(f64::min), end(f64::max)]).collect())
    };
    let caption = "Drivers who adapt: the share of their guided gains behind their days, 1 with those of table 6, 0 with those of table 5";
    Table::new(
        caption,
        ["Law", "World", "Least", "Largest"],
        pairs.filter_map(row),
    )
}

/// Whether a probability, corrected, is below what the level leaves.
fn is_clear(results: &CompareResults, p: f64) -> bool {
    p < 1.0 - results.level.share()
}

/// Conflict and effort over peak: each law's front, joined; laws with one set are points with their intervals.
fn front_figure(results: &CompareResults) -> Figure {
    let of_law = |law: usize| results.front.iter().filter(move |point| point.law == law);
    let (fronts, single): (Vec<usize>, Vec<usize>) =
        (0..results.laws.len()).partition(|law| of_law(*law).count() > 1);
    let panel = |quantity: &str, traded: usize| {
        let at = |ratios: [Mean; 3]| (ratios[0].mean, ratios[traded].mean);
        let line = |(number, law): (usize, &usize)| {
            let points = of_law(*law).filter_map(|point| point.ratios.map(at)).collect();
            Series::dots(&results.laws[*law].name, number + 1, points).joined()
        };
        let alone = single
            .iter()
            .flat_map(|law| of_law(*law))
            .filter_map(|point| point.ratios);
        let alone = alone.map(|ratios| (at(ratios), ratios[traded].ends()));
        let alone = Series::whiskers("laws of one set", 0, alone);
        Axis::new(quantity, "-").panel([alone].into_iter().chain(fronts.iter().enumerate().map(line)))
    };
    Axis::new("Peak lateral error", "-").figure([panel("Conflict", 2), panel("Effort", 1)])
}

fn front_caption(results: &CompareResults) -> String {
    format!(
        "What each law trades: driver torque against the guidance, and driver torque, over the peak lateral error; means over the drivers as \
         shares of those of {}. Less of each is better. The points of laws with one set are told apart by the table.",
        results.laws[0].name
    )
}

fn front_table(results: &CompareResults) -> Table {
    let row = |point: &FrontPoint| {
        let value = |(name, value): &(&str, f64)| format!("{name} {}", rounded(*value));
        let values: Vec<String> = point.values.iter().map(value).collect();
        let ratio = |traded: usize| Cell::Text(said(point.ratios.as_ref().map(|ratios| &ratios[traded])));
        let by = point.beaten_by.map(|(law, _)| &results.laws[law].name);
        [
            ("Law", Cell::text(&results.laws[point.law].name)),
            ("Parameters", Cell::Text(values.join(", "))),
            ("Judged", Cell::text(if point.is_judged { "yes" } else { "" })),
            ("Peak", ratio(0)),
            ("Effort", ratio(1)),
            ("Conflict", ratio(2)),
            ("Beaten by", Cell::text(by.map_or("", String::as_str))),
        ]
    };
    let caption = format!(
        "Sets of each law's front on the judged drives, over {}; beaten by: a set of this law has clearly less of all three",
        results.laws[0].name
    );
    let others = results
        .front
        .iter()
        .filter(|point| point.law > 0 || !point.is_judged);
    Table::of_rows(caption, others.map(row))
}

fn front_judgement(results: &CompareResults) -> String {
    let told = results.laws.iter().enumerate().skip(1).map(|(number, law)| {
        let own = || results.front.iter().filter(|point| point.law == number);
        let judged = own().filter(|point| point.ratios.is_some()).count();
        let beaten = own().filter(|point| point.beaten_by.is_some()).count();
        let left = own().count() - judged;
        let left = if left > 0 {
            format!(", {left} not judged: a drive left the road")
        } else {
            String::new()
        };
        format!("{}: {beaten} of {judged} beaten{left}", law.name)
    });
    let told: Vec<String> = told.collect();
    format!(
        "Sets that another law clearly beats in peak, effort and conflict together (corrected for all pairs of sets). {}.",
        told.join("; ")
    )
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
        let values = cells.map(|pair| Cell::Text(said(pair.values[place].as_ref())));
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
        let found = cells.filter_map(|pair| {
            let value = pair.values[place]?;
            Some(((super::place(pair.law), value.mean), value.interval?))
        });
        Panel::new(
            name,
            Axis::new(metric.label, metric.unit),
            [Series::whiskers("", 0, found)],
        )
    };
    let laws = results.laws.iter().map(|law| &law.name);
    Figure {
        same_y: true,
        ..Figure::of_rows(laws, results.drivers.iter().enumerate().map(panel))
    }
}

/// Differences to the first law that are clear: with whether the law is better there.
fn clear(results: &CompareResults) -> impl Iterator<Item = (&Pair, &Metric, Mean, bool)> {
    results.cells.iter().flat_map(move |pair| {
        let metrics = results
            .metrics
            .iter()
            .zip(pair.against_first.iter().zip(&pair.p_holm));
        metrics.filter_map(move |(metric, (difference, p))| {
            let difference = difference.filter(|_| p.is_some_and(|p| is_clear(results, p)))?;
            Some((
                pair,
                metric,
                difference,
                (difference.mean < 0.0) != metric.more_is_better,
            ))
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
        "Clear differences in peak error, effort, torque in conflict and the worst peak after a loss, driver by driver: Student's test of pairs \
         over {} {}, {} % after Holm's correction for all laws, drivers and these metrics. {}.",
        results.draws,
        results.units[0],
        results.level,
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
