//! What is shown of a fault campaign: a table, a figure, and runs told one by one.

use haptic_campaign::campaign::{Campaign, CaseResult};
use haptic_campaign::drivers::{Drivers, Limits};
use haptic_campaign::table::{self, Class, FaultCase};
use haptic_campaign::{OFF_ROAD_M, TrialOutcome};
use haptic_report::document::{Block, Cell, Report, Section, Table};
use haptic_report::plot::{Axis, Figure, Mark, Panel, Series};
use haptic_report::studies::place;

/// The document of a campaign, with what the ECU reported in these runs.
pub(crate) fn report(campaign: &Campaign, told: Vec<Section>) -> Report {
    let caption = format!(
        "Worst reaction and largest torque over all seeds of each fault, with the deadline and the bound that they must keep. A fault \
         without a mark on the left has no deadline. The deviation is that from the fault-free run, beside what it is if the torque \
         is dropped in the step in which the ECU leaves. Off road: runs that go more than {OFF_ROAD_M} m aside with the torque \
         dropped as well, or that are so far aside without the fault too when the ECU leaves; their excess is not judged. \
         Pushed: the distance from a vehicle whose torque is cut at the onset, for class C. A number with an arrow stands for \
         what is beyond the axis."
    );
    let mut blocks = vec![
        Block::figure("faults", figure(campaign), caption),
        Block::Table(fault_by_fault(campaign)),
        Block::Text(limits(campaign)),
    ];
    blocks.extend(campaign.has_bar.then(|| Block::Text(behind_a_bar())));
    blocks.extend(campaign.too_often().map(|row| Block::Text(left_too_often(row))));
    blocks.extend(campaign.failures().map(|f| Block::Text(failure(f))));
    let how_often = vec![Block::Table(shares(campaign)), Block::Text(SHARES.into())];
    let mut sections = vec![
        Section::new("Fault by fault", blocks),
        Section::new("How often, how soon, how far", how_often),
        Section::of_table("Class by class", by_class(campaign)),
    ];
    sections.extend(told);
    Report::new("Every fault by name", summary(campaign), sections)
}

/// What the ECU reported in a run.
pub(crate) fn report_of_run(case: &FaultCase, outcome: TrialOutcome) -> Section {
    let speed = match outcome.change {
        None => format!("{} km/h", outcome.speed_kmh),
        Some(change) => change.to_string(),
    };
    let onset_s = f64::from(outcome.onset_ms) * 1e-3;
    let (injected, driver) = (&case.injected, outcome.driver);
    let name = case.name;
    let text = format!("{name}: {injected}; {driver}, {speed}, fault at {onset_s:.3} s");
    Section::new(name, vec![Block::Text(text), Block::Events(outcome.reported)])
}

/// How much ran, and how much of it failed.
fn summary(campaign: &Campaign) -> String {
    let drivers = match campaign.drivers {
        Drivers::Paper => "with the paper's drivers",
        Drivers::Population => "with drivers who keep the lane in a real car",
        Drivers::Relying => "with drivers who keep the lane in a real car and rely on the guidance",
    };
    let world = match (campaign.world, campaign.drivers) {
        (None, Drivers::Paper) => String::new(),
        (None, _) => format!("; {drivers}"),
        (Some(name), _) => {
            format!(
                "; in the world {name}, {drivers}: a row fails by a broken rule or by where the vehicle goes"
            )
        }
    };
    let law = match campaign.law {
        "paper" => String::new(),
        law => format!("; guided by {law}, where the table's limits were chosen for the paper's law"),
    };
    format!(
        "{} rows, {} runs, {} cycles checked, {} failed{world}{law}",
        campaign.rows.len(),
        campaign.runs,
        campaign.cycles,
        campaign.failures().count()
    )
}

/// What of the table and of its limits a column with a bar does not have.
fn behind_a_bar() -> String {
    let left_out = table::rows().filter_map(|row| Some((row.name, row.left_out(true)?)));
    let named: Vec<String> = left_out.map(|(name, why)| format!("{name} ({why})")).collect();
    format!(
        "Left out: {}. The limits of distance, share and torque were chosen on the paper's column, and are not meant for a bar. A row of \
         an ECU that is told wrong is compared with one that is told right.",
        named.join(", ")
    )
}

/// The absolute limits of these drivers.
fn limits(campaign: &Campaign) -> String {
    let Limits {
        deviation_m,
        left_lane,
        pushed_m,
    } = campaign.limits;
    let share = match left_lane {
        Some(share) => format!("{:.0} % of a row's runs may leave the lane", 100.0 * share),
        None => "how many leave the lane is stated and not judged".into(),
    };
    let push = pushed_m.map_or(String::new(), |most_m| {
        format!("; a false torque may push the vehicle by {most_m} m")
    });
    format!(
        "Limits with these drivers: a deviation of {deviation_m} m; {share}{push}. Lies that little contradicts have a limit of their own. A \
         motor that ignores the ECU and a driver who pulls the other way are not judged. Seeds from {} on.",
        campaign.first_seed
    )
}

fn left_too_often(row: &CaseResult) -> String {
    let [low, high] = row.left_lane_interval.map(|share| 100.0 * share);
    format!("{}: {low:.1} to {high:.1} % leave the lane", row.name)
}

const SHARES: &str = "Noticed: the ECU reported a fault after the onset, or left. Intervals of shares are Wilson's, 95 %; times count from \
                      the onset, over the runs in which something was noticed; deviations are of all runs.";

fn time(ms: Option<u32>) -> Cell {
    Cell::number(ms.map(f64::from), 0)
}

fn percent(count: u64, runs: u64) -> Cell {
    Cell::number(100.0 * count as f64 / runs as f64, 1)
}

/// How often each fault is noticed, how soon, and how far the vehicle goes.
fn shares(campaign: &Campaign) -> Table {
    let interval = |of: [f64; 2]| {
        let [low, high] = of.map(|share| 100.0 * share);
        Cell::Text(format!("{low:.1} to {high:.1}"))
    };
    let row = |row: &CaseResult| {
        let [median, most] = row.noticed_after_ms;
        [
            ("Fault", Cell::text(row.name)),
            ("Runs", Cell::count(row.runs)),
            ("Noticed (%)", percent(row.noticed, row.runs)),
            ("of (%)", interval(row.noticed_interval)),
            ("Median (ms)", time(median)),
            ("95 % (ms)", time(most)),
            ("Dev. 95 % (m)", Cell::number(row.deviation_95_m, 2)),
            ("Worst (m)", Cell::number(row.deviation_m, 2)),
            ("Left lane (%)", percent(row.left_lane, row.runs)),
            ("of it (%)", interval(row.left_lane_interval)),
        ]
    };
    Table::of_rows("", campaign.rows.iter().map(row))
}

/// Sums of the rows of each class that the limits judge ([`CaseResult::is_limited`]).
fn by_class(campaign: &Campaign) -> Table {
    let limited = || campaign.rows.iter().filter(|row| row.is_limited);
    let row = |class: Class| {
        let rows: Vec<&CaseResult> = limited().filter(|row| row.class == class).collect();
        let sum = |of: fn(&CaseResult) -> u64| rows.iter().map(|row| of(row)).sum::<u64>();
        let most =
            |of: fn(&CaseResult) -> Option<f64>| rows.iter().filter_map(|row| of(row)).reduce(f64::max);
        let (runs, worst_m) = (sum(|row| row.runs), most(|row| Some(row.deviation_m)));
        [
            ("Class", Cell::Text(class.to_string())),
            ("Rows", Cell::count(rows.len())),
            ("Runs", Cell::count(runs)),
            ("Left lane (%)", percent(sum(|row| row.left_lane), runs)),
            ("Worst deviation (m)", Cell::number(worst_m, 2)),
            ("Excess (m)", Cell::number(most(|row| row.excess_m), 2)),
            ("Pushed (m)", Cell::number(most(|row| row.pushed_m), 2)),
        ]
    };
    let there = |class: &Class| limited().any(|row| row.class == *class);
    Table::of_rows(
        "Rows that the limits judge",
        Class::ALL.into_iter().filter(there).map(row),
    )
}

/// A run that failed, and how to run it again.
fn failure(f: &haptic_campaign::campaign::FailedTrial) -> String {
    format!(
        "{} seed {}, cycle {}: {}: {}",
        f.row, f.seed, f.cycle, f.what, f.replay
    )
}

/// Fault by fault.
fn fault_by_fault(campaign: &Campaign) -> Table {
    let row = |row: &CaseResult| {
        let verdict = match row.failures.len() {
            0 if row.leaves_too_often => "FAIL".into(),
            0 => "pass".into(),
            n => format!("FAIL in {n}"),
        };
        [
            ("Fault", Cell::text(row.name)),
            ("Class", Cell::Text(row.class.to_string())),
            ("Verdict", Cell::Text(verdict)),
            ("Runs", Cell::count(row.runs)),
            ("Seen", Cell::count(row.seen)),
            ("Cycles", Cell::count(row.cycles)),
            ("Reaction (ms)", time(row.deadline_ms.and(row.worst_reaction_ms))),
            ("Deadline (ms)", time(row.deadline_ms)),
            ("Peak torque (N.m)", Cell::number(row.peak_torque_nm, 3)),
            ("Bound (N.m)", Cell::number(row.torque_bound_nm, 1)),
            ("ECU left", Cell::count(row.left)),
            ("After (ms)", time(row.left_after_ms.map(|[median, _]| median))),
            ("Deviation (m)", Cell::number(row.deviation_m, 2)),
            ("Dropped (m)", Cell::number(row.dropped_m, 2)),
            ("Excess (m)", Cell::number(row.excess_m, 2)),
            ("Pushed (m)", Cell::number(row.pushed_m, 2)),
            ("Left lane", Cell::count(row.left_lane)),
            ("Off road", Cell::count(row.off_road)),
        ]
    };
    Table::of_rows("", campaign.rows.iter().map(row))
}

/// Reaction beside deadline, torque beside bound. Deadlines span 1 ms to seconds, so the reaction is a share of its
/// own.
fn figure(campaign: &Campaign) -> Figure {
    let of = |value: &dyn Fn(&CaseResult) -> Option<f64>| -> Vec<(f64, f64)> {
        let rows = campaign.rows.iter().enumerate();
        rows.filter_map(|(i, row)| Some((place(i), value(row)?)))
            .collect()
    };
    let worst = |points| Series::with_mark("worst seen", 1, Mark::Stems, points);
    let reaction = of(&|row| {
        let deadline_ms = row.deadline_ms.filter(|ms| *ms > 0)?;
        Some(100.0 * f64::from(row.worst_reaction_ms?) / f64::from(deadline_ms))
    });
    let names = 1.0..=campaign.rows.len() as f64;
    let bound = vec![(names.start() - 0.5, 100.0), (names.end() + 0.5, 100.0)];
    let reactions = [Series::line("deadline", 3, bound), worst(reaction)];
    let torques = [
        worst(of(&|row| Some(row.peak_torque_nm))),
        Series::dots("bound of the torque", 3, of(&|row| Some(row.torque_bound_nm))),
    ];
    let deviations = [
        worst(of(&|row| Some(row.deviation_m))),
        Series::dots("torque dropped", 4, of(&|row| row.dropped_m)),
    ];
    // What goes further is off the road.
    let on_the_road = Axis::new("Deviation", "m").within(0.0, OFF_ROAD_M);
    let panels = [
        Panel::new(
            "Worst reaction",
            Axis::new("Share of the deadline", "%"),
            reactions,
        ),
        Panel::new("Largest torque", Axis::new("Torque", "N.m"), torques),
        Panel::new("Largest deviation", on_the_road, deviations),
    ];
    Figure::of_rows(campaign.rows.iter().map(|row| row.name), panels)
}
