//! What a design of guidance shows: the front to choose from, the sets to choose, what each costs on drives that the search has not seen.

use super::{listed, with_interval};
use crate::document::{Block, Cell, Report, Section, Table};
use crate::plot::{Axis, Figure, Series};
use haptic_batch::Mean;
use haptic_batch::design_guidance::{Bar, Choice, DesignResults, Figures, Gains, Member, SetRow, Stage};

/// The document of a design; `chosen` is the row of its choice, from 0.
pub fn report(results: &DesignResults, chosen: usize) -> Report {
    let choice = &results.choices[chosen];
    let own_line = |driver: &Member| driver.line_m != 0.0;
    let whose = match results.stages[1].drivers.iter().any(own_line) {
        true => "the drivers with lines of their own",
        false => "all drivers, as none has a line of its own",
    };
    let judged = match results.level.is_usual() {
        true => "",
        false => " Whether a bar is held is judged by intervals of 95 %.",
    };
    let choose = vec![
        Block::figure(
            "front",
            figure(results, choice),
            "Sets that the search tried, on its own drives, over the paper's gains. On the front no other set is better in all three.",
        ),
        Block::Table(choices(results)),
        Block::Text(format!(
            "Intervals of {} % are over {} draws of the noise: the road, the speed and the drivers are those of the file. Effort and conflict are \
             those of {whose}. Loss x and Others x: how many times as far as its bars allow the search let a set go.{judged}",
            results.level, results.stages[1].seeds
        )),
    ];
    let row = vec![
        Block::Table(bars(results, choice)),
        Block::Table(drivers(results, choice)).on_page(),
    ];
    let sections = vec![
        Section::new("The front", choose),
        Section::new(format!("Row {}", chosen + 1), row),
    ];
    let title = format!("Guidance for its drivers: {}", results.name);
    let summary = format!("{} {}", what_holds(results, choice), summary(results));
    Report::new(title, summary, sections)
}

/// Whether a set that was tried holds all bars, and which bars the chosen row misses on the held-out drives.
fn what_holds(results: &DesignResults, choice: &Choice) -> String {
    let bars = &results.bars;
    let is_over = |(ratio, bar): (&f64, &Bar)| *ratio > bar.limit;
    let holding = results
        .sets
        .iter()
        .filter(|set| set.unstable == 0 && !set.ratios.iter().zip(bars).any(is_over));
    let which = |held: Option<bool>| -> Vec<String> {
        let is = |(place, bar): &(usize, &Bar)| is_held(&choice.judged[*place], bar) == held;
        let said = |(place, bar): (usize, &Bar)| {
            format!("{} {} (at most {})", bar.label, choice.held_out[place], bar.limit)
        };
        bars.iter().enumerate().filter(is).map(said).collect()
    };
    let [missed, open] = [Some(false), None].map(which);
    let search = match holding.count() {
        0 => "The bars cannot be had together with any set that was tried".to_owned(),
        sets => format!("{sets} of the sets tried hold every bar on the drives of the search"),
    };
    let mut chosen = if missed.is_empty() {
        "is not seen to miss a bar".into()
    } else {
        format!("misses {}", missed.join(", "))
    };
    if !open.is_empty() {
        chosen += &format!("; its draws do not tell whether it holds {}", open.join(", "));
    }
    format!("On the held-out drives the chosen row {chosen}. {search}.")
}

/// Whether a ratio is within its bar; none where its interval does not tell, or where it has none.
fn is_held(ratio: &Mean, bar: &Bar) -> Option<bool> {
    let [low, high] = ratio.interval?;
    match () {
        () if high <= bar.limit => Some(true),
        () if low > bar.limit => Some(false),
        () => None,
    }
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
        let lines = stage.drivers.iter().filter(|driver| driver.line_m != 0.0);
        format!(
            "{} drivers, {} of them with a line of their own, {}, seeds: {}, sudden losses in each drive: {}",
            stage.drivers.len(),
            lines.count(),
            listed(&stage.places),
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
        let dots = |label: &str, style, sets: &mut dyn Iterator<Item = &SetRow>| {
            let objectives = sets.map(SetRow::objectives);
            let points = objectives.map(|objectives| (objectives[1], objectives[objective]));
            Series::dots(label, style, points.collect())
        };
        let sets = || results.sets.iter();
        Axis::new(quantity, "-").panel([
            dots("tried", 4, &mut sets().filter(|set| !set.on_front)),
            dots("front", 1, &mut sets().filter(|set| set.on_front)),
            dots("to choose", 2, &mut results.choices.iter().map(|c| &c.training)),
            dots("chosen", 3, &mut [&choice.training].into_iter()),
            dots("the paper's", 0, &mut sets().take(1)),
        ])
    };
    let x = Axis::new("Effort or conflict of drivers with a line", "-");
    x.figure([panel("Mean peak error", 0), panel("Mean loss", 2)])
}

fn choices(results: &DesignResults) -> Table {
    let row = |(number, choice): (usize, &Choice)| {
        let stretch =
            |place: usize| choice.stretch[place].map_or("any".into(), |stretch| stretch.to_string());
        let gains = gains(&choice.training.gains);
        let head = [(number + 1).to_string(), stretch(0), stretch(1), gains].map(Cell::Text);
        let ratios = choice.held_out.iter().map(said);
        head.into_iter().chain(ratios).collect()
    };
    let bars = results.bars.iter().map(|bar| bar.label);
    let columns = ["Row", "Loss x", "Others x", "a_1' to a_4'"]
        .into_iter()
        .chain(bars);
    let caption = "To choose from: held-out drives, over the paper's gains";
    Table::new(caption, columns, results.choices.iter().enumerate().map(row))
}

/// A ratio with its interval; a dash without one.
fn said(ratio: &Mean) -> Cell {
    Cell::Text(with_interval(
        Some(ratio).filter(|ratio| ratio.interval.is_some()),
    ))
}

fn gains(gains: &Gains) -> String {
    gains.map(|gain| gain.to_string()).join(", ")
}

fn bars(results: &DesignResults, choice: &Choice) -> Table {
    let row = |(place, bar): (usize, &Bar)| {
        let is_held =
            is_held(&choice.judged[place], bar).map_or("not told", |is| if is { "yes" } else { "no" });
        [
            ("Figure", Cell::text(bar.label)),
            ("At most", Cell::number(bar.limit, 2)),
            ("Held out", said(&choice.held_out[place])),
            ("Held", Cell::text(is_held)),
        ]
    };
    let caption = "What it is held to, over the paper's gains";
    Table::of_rows(caption, results.bars.iter().enumerate().map(row))
}

fn drivers(results: &DesignResults, choice: &Choice) -> Table {
    let published = &results.published.drivers;
    let names = [
        "Peak (m)",
        "Effort (N.m)",
        "Conflict (N.m)",
        "Worst loss (m)",
        "Noise (N.m)",
    ];
    let row = |((member, own), paper): ((&Member, &Figures), &Figures)| {
        let figures = paper.iter().zip(own);
        let figures = figures.map(|(paper, own)| Cell::Text(format!("{paper:.3} \u{2192} {own:.3}")));
        let participant = ("Participant", Cell::Text(member.participant.to_string()));
        let line = ("Line (m)", Cell::number(member.line_m, 1));
        let head = [participant, line].into_iter();
        head.chain(names.into_iter().zip(figures)).collect::<Vec<_>>()
    };
    let caption = "Held-out drives, driver by driver: the paper's gains \u{2192} the row's";
    let drivers = results.stages[1].drivers.iter().zip(&choice.drivers);
    Table::of_rows(caption, drivers.zip(published).map(row))
}
