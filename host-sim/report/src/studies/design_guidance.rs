//! What a design of guidance shows: the front to choose from, the sets to choose, what each costs on drives that the search has not seen.

use crate::document::{Block, Cell, Report, Section, Table};
use crate::plot::{Axis, Figure, Panel, Series};
use haptic_batch::design_guidance::{Bar, Choice, DesignResults, Figures, Gains, Member, SetRow, Stage};

/// The document of a design; `chosen` is the row of its choice, from 0.
pub fn report(results: &DesignResults, chosen: usize) -> Report {
    let choice = &results.choices[chosen];
    let own_line = results.stages[1]
        .drivers
        .iter()
        .any(|driver| driver.line_m != 0.0);
    let whose = if own_line {
        "the drivers with lines of their own"
    } else {
        "all drivers, as none has a line of its own"
    };
    let choose = vec![
        Block::figure(
            "front",
            figure(results, choice),
            "Sets that the search tried, on its own drives, over the paper's gains. On the front no other set is better in all three.",
        ),
        Block::Table(choices(
            results,
            "To choose from: held-out drives, over the paper's gains",
            |c| c.held_out,
        )),
        Block::Table(choices(results, "The same on the drives of the search", |c| {
            c.training.ratios
        })),
        Block::Text(format!(
            "Effort and conflict are those of {whose}. Loss x and Others x: how many times as far as its bars allow the search let a set go."
        )),
        Block::Text(what_holds(results, choice)),
    ];
    Report {
        title: format!("Guidance for its drivers: {}", results.name),
        summary: summary(results),
        sections: vec![
            Section::new("The front", choose),
            Section::new(
                format!("Row {}", chosen + 1),
                vec![
                    Block::Table(bars(results, choice)),
                    Block::Table(drivers(results, choice)).on_page(),
                ],
            ),
        ],
        ..Report::default()
    }
}

/// Whether a set that was tried holds all bars, and which bars the chosen row misses on the held-out drives.
fn what_holds(results: &DesignResults, choice: &Choice) -> String {
    let bars = &results.bars;
    let is_over = |(ratio, bar): (&f64, &Bar)| *ratio > bar.limit;
    let holding = results
        .sets
        .iter()
        .filter(|set| set.unstable == 0 && !set.ratios.iter().zip(bars).any(is_over));
    let missed: Vec<String> = choice
        .held_out
        .iter()
        .zip(bars)
        .filter(|&pair| is_over(pair))
        .map(|(ratio, bar)| format!("{} {ratio:.3} (at most {})", bar.label, bar.limit))
        .collect();
    let search = match holding.count() {
        0 => "The bars cannot be had together with any set that was tried".to_owned(),
        sets => format!("{sets} of the sets tried hold every bar on the drives of the search"),
    };
    let chosen = if missed.is_empty() {
        "holds every bar".into()
    } else {
        format!("misses {}", missed.join(", "))
    };
    format!("{search}. On the held-out drives the chosen row {chosen}.")
}

/// A scenario file with the gains of a row.
pub fn parameters(results: &DesignResults, chosen: usize) -> String {
    let [a_1, a_2, a_3, a_4] = results.choices[chosen].training.gains;
    let (name, row) = (&results.name, chosen + 1);
    format!(
        "# Row {row} of the design {name}: host-sim run and host-sim ecu parameters take it.\n[guidance]\na_1_per_m = {a_1}\na_2_s_per_m = {a_2}\na_3_per_rad = {a_3}\na_4_s_per_rad = {a_4}\n"
    )
}

fn summary(results: &DesignResults) -> String {
    let stage = |stage: &Stage| {
        let places = stage.places.iter();
        let places: Vec<String> = places
            .map(|(road, kmh)| format!("{road} at {kmh} km/h"))
            .collect();
        let lines = stage.drivers.iter().filter(|driver| driver.line_m != 0.0);
        format!(
            "{} drivers, {} of them with a line of their own, {}, seeds: {}, sudden losses in each drive: {}",
            stage.drivers.len(),
            lines.count(),
            places.join(", "),
            stage.seeds,
            stage.losses
        )
    };
    let [searched, judged] = &results.stages;
    format!(
        "{} sets of a_1' to a_4'. Search: {}. Held out: {}.",
        results.sets.len(),
        stage(searched),
        stage(judged)
    )
}

fn figure(results: &DesignResults, choice: &Choice) -> Figure {
    let panel = |quantity: &str, objective: usize| {
        let points = |sets: &mut dyn Iterator<Item = &SetRow>| -> Vec<(f64, f64)> {
            sets.map(|set| {
                let objectives = set.objectives();
                (objectives[1], objectives[objective])
            })
            .collect()
        };
        let sets = &results.sets;
        let series = [
            ("tried", 4, points(&mut sets.iter().filter(|set| !set.on_front))),
            ("front", 1, points(&mut sets.iter().filter(|set| set.on_front))),
            (
                "to choose",
                2,
                points(&mut results.choices.iter().map(|c| &c.training)),
            ),
            ("chosen", 3, points(&mut [&choice.training].into_iter())),
            ("the paper's", 0, points(&mut sets.iter().take(1))),
        ];
        let series = series
            .into_iter()
            .map(|(label, style, points)| Series::dots(label, style, points));
        Panel {
            y: Axis::new(quantity, "-"),
            series: series.collect(),
            ..Panel::default()
        }
    };
    Figure {
        x: Axis::new("Effort or conflict of drivers with a line", "-"),
        panels: vec![panel("Mean peak error", 0), panel("Mean loss", 2)],
        ..Figure::default()
    }
}

fn choices<const N: usize>(
    results: &DesignResults,
    caption: &str,
    ratios: impl Fn(&Choice) -> [f64; N],
) -> Table {
    let row = |(number, choice): (usize, &Choice)| {
        let stretch = choice
            .stretch
            .map(|stretch| stretch.map_or("any".into(), |stretch| stretch.to_string()));
        let [loss, others] = stretch.map(Cell::Text);
        let head = [
            Cell::Text((number + 1).to_string()),
            loss,
            others,
            Cell::Text(gains(&choice.training.gains)),
        ];
        let ratios = ratios(choice).map(|ratio| Cell::number(ratio, 3));
        head.into_iter().chain(ratios).collect()
    };
    let bars = results.bars.iter().map(|bar| bar.label);
    let columns = ["Row", "Loss x", "Others x", "a_1' to a_4'"]
        .into_iter()
        .chain(bars);
    Table::new(caption, columns, results.choices.iter().enumerate().map(row))
}

fn gains(gains: &Gains) -> String {
    gains.map(|gain| gain.to_string()).join(", ")
}

fn bars(results: &DesignResults, choice: &Choice) -> Table {
    let row = |(place, bar): (usize, &Bar)| {
        let (training, held_out) = (choice.training.ratios[place], choice.held_out[place]);
        vec![
            Cell::text(bar.label),
            Cell::number(bar.limit, 2),
            Cell::number(training, 3),
            Cell::number(held_out, 3),
            Cell::text(if held_out <= bar.limit { "yes" } else { "no" }),
        ]
    };
    let columns = ["Figure", "At most", "Search", "Held out", "Held"];
    Table::new(
        "What it is held to, over the paper's gains",
        columns,
        results.bars.iter().enumerate().map(row),
    )
}

fn drivers(results: &DesignResults, choice: &Choice) -> Table {
    let published = &results.published.drivers;
    let row = |((member, own), paper): ((&Member, &Figures), &Figures)| {
        let figures = paper.iter().zip(own);
        let figures = figures.map(|(paper, own)| Cell::Text(format!("{paper:.3} \u{2192} {own:.3}")));
        let head = [
            Cell::Text(member.participant.to_string()),
            Cell::number(member.line_m, 1),
        ];
        head.into_iter().chain(figures).collect()
    };
    let columns = [
        "Participant",
        "Line (m)",
        "Peak (m)",
        "Effort (N.m)",
        "Conflict (N.m)",
        "Worst loss (m)",
        "Noise (N.m)",
    ];
    let pairs = results.stages[1]
        .drivers
        .iter()
        .zip(&choice.drivers)
        .zip(published);
    Table::new(
        "Held-out drives, driver by driver: the paper's gains \u{2192} the row's",
        columns,
        pairs.map(row),
    )
}
