//! What is shown of the estimator's validation: tables for terminal and report, a figure, and the files with them.

use serde::Serialize;

use super::{changes, random};
use haptic_batch::experiment::ExperimentPlan;
use haptic_evidence::estimates::{
    Changes, CorruptionLine, Corruptions, Held, METHODS, MethodLine, Methods, RandomDrives, Repeated,
    Repetitions, SoughtWheel,
};
use haptic_evidence::vehicle::VehicleCoverage;
use haptic_report::document::{Block, Cell, Report, Section, Table};
use haptic_report::plot::{Axis, Figure, Panel, Series};
use haptic_report::studies::place;

/// One of the seven questions that the validation asks, answered.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub(crate) enum Validation {
    /// Do the intervals hold the truth as often as they say?
    Coverage(Repetitions),
    /// Is anything wrong called identified on corrupted logs?
    Corruptions(Box<Corruptions>),
    /// Is a driver who changes seen, when, and is anybody called identified who was not there?
    Changes(Box<Changes>),
    /// What is each way to treat camera noise worth?
    Methods(Methods),
    /// What is identified from recordings like those of real people, and is anything of it wrong? Its corruptions are the
    /// ways of recording.
    Recordings(Box<Corruptions>),
    /// Do the intervals of vehicles hold the truth as often as they say?
    Vehicles(VehicleCoverage),
    /// Is anything wrong called identified, and an honest log accused, in drives that are composed by chance?
    Random(Box<RandomDrives>),
}

impl Validation {
    /// What was promised and is not kept.
    pub(crate) fn broken(&self) -> Vec<String> {
        match self {
            Self::Coverage(result) => off_coverage(result),
            Self::Corruptions(result) | Self::Recordings(result) => result.broken.clone(),
            Self::Changes(result) => result.broken.clone(),
            Self::Methods(_) => Vec::new(),
            Self::Random(result) => result.broken.clone(),
            Self::Vehicles(result) => super::vehicle::off_coverage(result),
        }
    }

    /// What it rests on, and what came out, in a sentence or two.
    fn summary(&self) -> String {
        let rests_on = |drives: u32, participants: &[u32], (probe_nm, seed): (f64, u64)| {
            let numbers: Vec<String> = participants.iter().map(u32::to_string).collect();
            format!(
                "Guided drives of each participant: {drives}, of participants {}; probe {probe_nm} N.m, seeds from {seed}",
                numbers.join(", ")
            )
        };
        let of_plan = |drives: u32, plan: &ExperimentPlan| {
            rests_on(drives, &plan.participants, (plan.probe_nm, plan.seed))
        };
        match self {
            Self::Coverage(r) => {
                let mut participants: Vec<u32> =
                    r.participants.iter().filter_map(|p| p.participant).collect();
                participants.dedup();
                format!(
                    "{}.",
                    rests_on(r.repetitions, &participants, (r.probe_nm, r.seed))
                )
            }
            Self::Corruptions(r) => format!(
                "{}. {} of {} identified values are false. Information bound of gain_1, gain_2, gain_3, t_p, K_hg on clean \
                 logs: {}.",
                of_plan(r.seeds, &r.plan),
                r.false_identifications,
                r.identified,
                r.bound.map(|b| format!("{b:.4}")).join(", ")
            ),
            Self::Changes(r) => format!("{}. {}", of_plan(r.drives, &r.plan), changes::summary(r)),
            Self::Methods(r) => format!("{}.", of_plan(r.seeds, &r.plan)),
            Self::Vehicles(r) => super::vehicle::coverage_summary(r),
            Self::Random(r) => random::summary(r),
            Self::Recordings(r) => format!(
                "{}. {} of {} identified values are false. Steps of 0.01 N.m and 1/16 deg; torsion bar: a wheel of 0.04 kg.m2 lies \
                 between it and the hands; each lane line has noise of 2 cm where nothing else is said. A wheel that is told wrongly or \
                 sought is in the table and not in these sums.",
                of_plan(r.seeds, &r.plan),
                r.false_identifications,
                r.identified,
            ),
        }
    }

    /// Its tables.
    fn tables(&self) -> Vec<Table> {
        match self {
            Self::Coverage(result) => vec![repetitions_table(result)],
            Self::Corruptions(result) => vec![corruptions_table(result), held_table(result)],
            Self::Recordings(result) => {
                vec![
                    corruptions_table(result),
                    held_table(result),
                    wheels_table(result),
                ]
            }
            Self::Changes(result) => vec![changes::table(result)],
            Self::Methods(result) => vec![methods_table(&result.lines)],
            Self::Vehicles(result) => vec![super::vehicle::coverage_table(result)],
            Self::Random(result) => random::tables(result),
        }
    }

    /// The document of the answer. Every drive follows from the published drivers, the probe and the seeds.
    pub(crate) fn report(&self) -> Report {
        let (name, title, caption) = match self {
            Self::Coverage(_) => (
                "coverage",
                "Do the 95 % intervals hold the truth?",
                "Share of the drives whose 95 % interval holds the truth, for t_nms as it is in them. Between the lines is \
                 what is wanted of all participants together.",
            ),
            Self::Corruptions(_) => (
                "corruptions",
                "What is identified from corrupted logs?",
                "By corruption: how many of the values are called identified, and how many of their 95 % intervals hold the \
                 truth.",
            ),
            Self::Recordings(_) => (
                "recordings",
                "What is identified from recordings like those of real people?",
                "By way of recording: how many of the values are called identified, and how many of their 95 % intervals hold the \
                 truth. Lane lines tell one of the five values at most, K_hg: 20 % is all.",
            ),
            Self::Changes(_) => (
                "changes",
                "Is a driver who changes seen?",
                "By what changes: drives whose driver is said to have changed, and the 95 % intervals of identified values that hold \
                 the truth, in whole drives and in pieces.",
            ),
            Self::Methods(_) => (
                "methods",
                "What is each way to treat camera noise worth?",
                "RMS errors by noise on the lane signals, as multiples of the information bound: the least of an unbiased estimator \
                 from exact ones. Beyond 6 bounds only the table shows them.",
            ),
            Self::Vehicles(_) => (
                "vehicles",
                "Do the 95 % intervals of vehicles hold the truth?",
                "Share of the identified values whose 95 % interval holds the truth.",
            ),
            Self::Random(_) => (
                "random",
                "Is anything wrong in drives that are composed by chance?",
                "By condition, among whatever was beside it: wrong values of those that are called identified, and honest logs for \
                 which the model is refuted.",
            ),
        };
        let broken = self.broken().into_iter();
        let broken = broken.map(|line| Block::Text(format!("Not kept: {line}.")).on_page());
        let figure = Block::figure(name, self.figure(), caption);
        let tables = self.tables().into_iter().map(Block::Table);
        let blocks = broken.chain([figure]).chain(tables).collect();
        let sections = vec![Section::new("Truth and estimate", blocks)];
        Report::new(title, self.summary(), sections)
    }

    fn figure(&self) -> Figure {
        match self {
            Self::Coverage(result) => coverage_figure(result),
            Self::Corruptions(result) | Self::Recordings(result) => corruptions_figure(result),
            Self::Changes(result) => changes::figure(result),
            Self::Methods(result) => methods_figure(&result.lines),
            Self::Vehicles(result) => super::vehicle::coverage_figure(result),
            Self::Random(result) => random::figure(result),
        }
    }
}

/// So that dots of one row do not hide one another.
const ASIDE: f64 = 0.2;

fn coverage_figure(result: &Repetitions) -> Figure {
    let rows: Vec<&str> = result.pooled.iter().map(|p| p.parameter).collect();
    let dots = |label: &str, style, aside: f64, lines: &[Repeated]| {
        let point = |p: &Repeated| {
            let row = rows.iter().position(|name| *name == p.parameter)?;
            Some((place(row) + aside, 100.0 * p.coverage_at_t_nms))
        };
        Series::dots(label, style, lines.iter().filter_map(point).collect())
    };
    let wanted = [KEPT.start(), KEPT.end()].map(|share| {
        let ends = [0.5, rows.len() as f64 + 0.5];
        Series::line("wanted of all", 0, ends.map(|x| (x, 100.0 * share)).to_vec())
    });
    let mut series = wanted.to_vec();
    series.push(dots("each participant", 2, ASIDE, &result.participants));
    series.push(dots("all participants", 1, -ASIDE, &result.pooled));
    let panel = Axis::new("95 % intervals that hold the truth", "%").panel(series);
    Figure::of_rows(rows, [panel])
}

fn corruptions_figure(result: &Corruptions) -> Figure {
    let panel = |what: &str, share: fn(&CorruptionLine) -> Option<f64>| {
        let lines = result.lines.iter().enumerate();
        let points = lines.filter_map(|(row, line)| Some((place(row), 100.0 * share(line)?)));
        let y = Axis::new(what, "%").within(-2.0, 102.0);
        y.panel([Series::dots("", 1, points.collect())])
    };
    let identified =
        |l: &CorruptionLine| Some(l.identified as f64 / (l.intervals.len() * l.drives).max(1) as f64);
    let panels = [
        panel("Values identified", identified),
        panel("Their 95 % intervals that hold", |l| l.coverage),
    ];
    Figure::of_rows(result.lines.iter().map(|l| l.corrupted_by), panels)
}

/// Most that the figure shows of an error, in information bounds.
const SHOWN: f64 = 6.0;

fn methods_figure(lines: &[MethodLine]) -> Figure {
    let mut noises: Vec<&str> = lines.iter().map(|l| l.noise).collect();
    noises.dedup();
    let series = |line: &MethodLine| {
        let style = METHODS.iter().position(|m| *m == line.method).unwrap_or(0);
        let aside = ASIDE * (style as f64 - 1.5) / 1.5;
        let errors = line.rms.iter().zip(&line.bound).enumerate();
        let points = errors.map(|(row, (rms, bound))| (place(row) + aside, rms / bound));
        Series::dots(line.method, style + 1, points.collect())
    };
    let panel = |noise: &&str| {
        let of_noise = lines.iter().filter(|l| l.noise == *noise);
        let y = Axis::new("RMS error / bound", "-").within(0.0, SHOWN);
        Panel::new(noise.trim_start_matches("lane noise "), y, of_noise.map(series))
    };
    Figure::of_rows(PARAMETERS, noises.iter().map(panel))
}

/// Names of the values, in their order.
const PARAMETERS: [&str; 5] = ["gain_1", "gain_2", "gain_3", "t_p", "K_hg"];

/// A column of errors for each parameter.
fn of_parameters(errors: &[f64; 5]) -> impl Iterator<Item = (&'static str, Cell)> {
    let names = ["RMS gain_1"].into_iter().chain(PARAMETERS.into_iter().skip(1));
    names.zip(errors.map(|x| Cell::number(x, 4)))
}

/// What was made of each corruption.
fn corruptions_table(result: &Corruptions) -> Table {
    let row = |l: &CorruptionLine| {
        let mut cells = vec![
            ("Corrupted by", Cell::text(l.corrupted_by)),
            ("Drives", Cell::count(l.drives)),
            ("Refuted", Cell::count(l.refuted)),
            ("Identified", Cell::count(l.identified)),
            ("False", Cell::count(l.false_identifications)),
            ("Coverage of 95 %", Cell::number(l.coverage, 3)),
        ];
        cells.extend(of_parameters(&l.rms));
        let cause = l.cause.as_ref().map(|(cause, n)| format!("{n}: {cause}"));
        cells.push(("K_hg read", Cell::count(l.k_hg_read)));
        cells.push(("Cause named most", Cell::Text(cause.unwrap_or_default())));
        cells
    };
    Table::of_rows(
        "False: called identified, and more than 4 standard errors and 10 % (15 ms of t_p, 0.05 of K_hg) off. RMS \
         errors are those of all drives, refuted or not.",
        result.lines.iter().map(row),
    )
}

/// How many of the 95 % intervals of identified values hold the truth, by corruption and parameter.
fn held_table(result: &Corruptions) -> Table {
    let row = |name: &str, held: &[Held; 5]| {
        let all = held.iter().fold(Held::default(), |sum, &h| sum + h);
        let cell = |h: Held| {
            let text = h.share().map(|x| format!("{x:.3} of {}", h.identified));
            Cell::Text(text.unwrap_or("-".into()))
        };
        let cells = held.iter().copied().chain([all]).map(cell);
        let named = PARAMETERS.into_iter().chain(["All"]).zip(cells);
        let head = std::iter::once(("Corrupted by", Cell::text(name)));
        head.chain(named).collect::<Vec<_>>()
    };
    let lines = result.lines.iter().filter(|l| l.identified > 0);
    let all = [
        row("all, t_nms as assumed", &result.intervals_at_t_nms),
        row("all", &result.intervals),
    ];
    Table::of_rows(
        "Share of the 95 % intervals of identified values that hold the truth. Corruptions with which nothing is identified are \
         left out.",
        lines.map(|l| row(l.corrupted_by, &l.intervals)).chain(all),
    )
}

/// What was made of wheels whose inertia was sought.
fn wheels_table(result: &Corruptions) -> Table {
    let row = |w: &SoughtWheel| {
        [
            ("Recorded by", Cell::text(w.recorded)),
            ("Identified", Cell::count(w.intervals.identified)),
            ("Coverage of 95 %", Cell::number(w.intervals.share(), 3)),
            ("RMS error (kg.m2)", Cell::number(w.rms, 4)),
            ("Standard error", Cell::number(w.standard_error, 4)),
        ]
    };
    Table::of_rows(
        "The wheel's inertia, where it was sought.",
        result.wheels.iter().map(row),
    )
}

/// Shares of the truth that 95 % intervals have to hold.
const KEPT: std::ops::RangeInclusive<f64> = 0.93..=0.97;

/// The parameters whose intervals, for t_nms as it is in these drives, hold the truth too seldom or too often, in words.
fn off_coverage(result: &Repetitions) -> Vec<String> {
    let off = result
        .pooled
        .iter()
        .filter(|p| !KEPT.contains(&p.coverage_at_t_nms));
    let told = off.map(|p| {
        let (name, held) = (p.parameter, 100.0 * p.coverage_at_t_nms);
        format!("{name}: the 95 % intervals hold the truth in {held:.1} % of the drives, 93 to 97 are wanted")
    });
    told.collect()
}

/// What each way to treat camera noise is worth.
fn methods_table(lines: &[MethodLine]) -> Table {
    let cells = |noise, method, drives, errors: &[f64; 5], coverage| {
        let head = [
            ("Noise", Cell::text(noise)),
            ("Method", Cell::text(method)),
            ("Drives", drives),
        ];
        let cells = head
            .into_iter()
            .chain(of_parameters(errors))
            .chain([("Coverage", coverage)]);
        cells.collect::<Vec<_>>()
    };
    let row = |l: &MethodLine| {
        cells(
            l.noise,
            l.method,
            Cell::count(l.drives),
            &l.rms,
            Cell::number(l.coverage, 3),
        )
    };
    let nothing = || Cell::text("-");
    let bound = lines
        .first()
        .map(|l| cells("none", "information bound", nothing(), &l.bound, nothing()));
    Table::of_rows(
        "RMS errors by noise on the lane signals and way to treat it, and the share of 95 % intervals that hold.",
        lines.iter().map(row).chain(bound),
    )
}

/// Estimates of repeated drives against the truth.
fn repetitions_table(result: &Repetitions) -> Table {
    let row = |line: &Repeated| {
        let participant = line.participant.map_or("all".into(), |n| n.to_string());
        [
            ("Participant", Cell::Text(participant)),
            ("Parameter", Cell::text(line.parameter)),
            ("Drives", Cell::count(line.drives)),
            ("Identified", Cell::number(line.identified, 3)),
            ("Coverage of 95 %", Cell::number(line.coverage, 3)),
            ("same, t_nms known", Cell::number(line.coverage_at_t_nms, 3)),
            ("Bias", Cell::number(line.bias, 4)),
            ("RMS error", Cell::number(line.rms, 4)),
            ("Largest error", Cell::number(line.largest, 4)),
            ("Mean standard error", Cell::number(line.standard_error, 4)),
            ("Information bound", Cell::number(line.bound, 4)),
        ]
    };
    Table::of_rows("", result.participants.iter().chain(&result.pooled).map(row))
}
