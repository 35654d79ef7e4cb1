//! What a study with participants leaves: a row for each session, metrics by condition.

mod figures;

use std::path::Path;

use crate::document::{Block, Cell, Report, Section, Table, WriteError, write_file};
use haptic_batch::Away;
use haptic_batch::statistics::{deviation, mean};
use haptic_batch::study::{
    Difference, Recorded, Repeated, Session, SessionResult, Source, StudyResults, Subject, of_participants,
};
use haptic_log::table::TableWriter;
use haptic_metrics::{DEFINITIONS, Definition};

/// The document of a study.
pub fn report(results: &StudyResults) -> Report {
    let mut each = vec![Block::Table(sessions(results))];
    let waits = |s: &&SessionResult| s.who == Subject::Person && s.recorded.is_none();
    let waiting: Vec<_> = results.sessions.iter().filter(waits).collect();
    if let Some(session) = waiting.first() {
        each.push(Block::Text(format!(
            "{} sessions wait for a person: --import {}=FILE.csv",
            waiting.len(),
            session.name()
        )));
    }
    let mut by_condition = vec![Block::Table(self::by_condition(results))];
    let mut differences = vec![Block::Table(self::differences(results))];
    if results.sessions.iter().any(|session| session.recorded.is_some()) {
        let each = "A line for each participant, with the mean of the own repetitions that stayed on the road; black, the mean over those who have \
                    a value.";
        by_condition.insert(0, Block::figure("conditions", figures::conditions(results), each));
    }
    if !results.differences.is_empty() {
        let paired = format!(
            "Mean differences within participants with {} % intervals (Student's t), each for itself: not corrected for their number.",
            results.level
        );
        differences.insert(
            0,
            Block::figure("differences", figures::differences(results), paired),
        );
    }
    if !results.repeated.is_empty() {
        differences.push(Block::Table(repeated(results)));
    }
    let sections = vec![
        Section::new("Sessions", each),
        Section::new("By condition", by_condition),
        Section::new("Differences between conditions", differences),
    ];
    Report::new(&results.study, "", sections).with_notes(results.notes.clone())
}

/// Writes the table of sessions and that of the differences between conditions (CSV).
///
/// # Errors
/// What could not be written.
pub fn write_tables(results: &StudyResults, directory: &Path) -> Result<(), WriteError> {
    write_file(&directory.join("sessions.csv"), |file| {
        let names = "participant,position,condition,repetition,who,seed,source,version,diverged,end_m";
        let metrics = DEFINITIONS.iter().map(|d| d.name);
        let names = names.split(',').chain(Away::NAMES).chain(metrics);
        let mut table = TableWriter::new(file, names)?;
        for session in &results.sessions {
            if let Some(recorded) = &session.recorded {
                table.row(row(session, recorded))?;
            }
        }
        table.finish()
    })?;
    write_file(&directory.join("differences.csv"), |file| {
        let names = format!(
            "from,to,metric,unit,participants,mean,from_{0},to_{0},effect_size_dz",
            results.level
        );
        let mut table = TableWriter::new(file, names.split(','))?;
        for d in &results.differences {
            let words = [&d.from, &d.to, d.metric, d.unit].map(String::from);
            let [low, high] = d.mean.interval.map_or([None; 2], |ends| ends.map(Some));
            let numbers = [Some(d.mean.mean), low, high, d.effect_size];
            let numbers = numbers.map(|x| x.map_or(String::new(), |x| x.to_string()));
            table.row(
                words
                    .into_iter()
                    .chain([d.participants.to_string()])
                    .chain(numbers),
            )?;
        }
        table.finish()
    })
}

/// A session as a line of the table. Names hold no commas.
fn row(session: &SessionResult, recorded: &Recorded) -> Vec<String> {
    let record = &recorded.record;
    let source = match recorded.source {
        Source::Simulated => "simulated",
        Source::Imported => "imported",
    };
    let mut fields = vec![
        session.participant.clone(),
        session.position.to_string(),
        session.condition.clone(),
        session.repetition.to_string(),
        who(session.who).into(),
        session.seed.to_string(),
        source.into(),
        recorded.version.clone(),
        record.diverged.to_string(),
        record.end_m.to_string(),
    ];
    fields.extend(record.away.texts());
    let metric = |d: &Definition| (d.value)(&record.metrics).map_or(String::new(), |value| value.to_string());
    fields.extend(DEFINITIONS.iter().map(metric));
    fields
}

fn who(who: Subject) -> &'static str {
    match who {
        Subject::Simulated => "simulated",
        Subject::Person => "person",
    }
}

/// Who drives what, in which order: a row for each participant.
pub fn plan(sessions: &[Session]) -> Table {
    let places = sessions.iter().map(|s| s.position).max().unwrap_or(0);
    let mut columns = vec!["Participant".to_owned(), "Who".to_owned()];
    columns.extend((1..=places).map(|place| place.to_string()));
    let rows = sessions.chunks(places.max(1)).map(|of_one| {
        let mut row = vec![Cell::text(&of_one[0].participant), Cell::text(who(of_one[0].who))];
        row.extend(of_one.iter().map(|session| Cell::text(&session.condition)));
        row
    });
    Table::new("", columns, rows)
}

/// Every session, with what two of its metrics are.
fn sessions(results: &StudyResults) -> Table {
    let row = |session: &SessionResult| {
        let recorded = session.recorded.as_ref();
        let metric = |name: &str| {
            let found = DEFINITIONS.iter().find(|d| d.name == name);
            let value = recorded.zip(found);
            Cell::number(value.and_then(|(r, d)| (d.value)(&r.record.metrics)), 3)
        };
        let left = recorded.map(|r| r.record.away).filter(Away::is_by_itself);
        let state = match (recorded, session.who) {
            (Some(recorded), _) if recorded.record.diverged => "left the road".into(),
            (Some(_), _) => left
                .and_then(|away| away.when_and_why())
                .map_or("recorded".into(), |left| format!("guidance ended {left}")),
            (None, Subject::Person) => "waits for a person".into(),
            (None, Subject::Simulated) => "not driven".to_owned(),
        };
        [
            ("Participant", Cell::text(&session.participant)),
            ("Place", Cell::text(session.position.to_string())),
            ("Condition", Cell::text(&session.condition)),
            ("State", Cell::text(state)),
            ("Peak lateral error (m)", metric("peak_lateral_error_m")),
            ("RMS driver torque (N.m)", metric("rms_driver_torque_nm")),
        ]
    };
    Table::of_rows("", results.sessions.iter().map(row))
}

/// Metrics whose differences a terminal shows; the files have all.
const SHOWN: [&str; 4] = [
    "peak_lateral_error_m",
    "sdlp_m",
    "rms_driver_torque_nm",
    "conflict_time_share",
];

/// How much the conditions differ in some metrics, participant by participant.
fn differences(results: &StudyResults) -> Table {
    let from = format!("{} % from", results.level);
    let row = |d: &Difference| {
        let label = DEFINITIONS.iter().find(|own| own.name == d.metric);
        let [low, high] = Cell::ends(d.mean.interval, 4);
        [
            ("Conditions", Cell::text(format!("{} - {}", d.to, d.from))),
            ("Metric", Cell::text(label.map_or(d.metric, |own| own.label))),
            ("Unit", Cell::text(d.unit)),
            ("Difference", Cell::number(d.mean.mean, 4)),
            (from.as_str(), low),
            ("to", high),
            ("d_z", Cell::number(d.effect_size, 2)),
            ("n", Cell::count(d.participants)),
        ]
    };
    let shown = results.differences.iter().filter(|d| SHOWN.contains(&d.metric));
    Table::of_rows(
        format!(
            "Differences within participants, each with its own {} % interval (not corrected for their number); d_z is the \
             mean over the standard deviation of the differences. differences.csv has every metric.",
            results.level
        ),
        shown.map(row),
    )
}

/// Whether the conditions differ at all, metric by metric.
fn repeated(results: &StudyResults) -> Table {
    let row = |r: &Repeated| {
        let label = DEFINITIONS.iter().find(|own| own.name == r.metric);
        let [of_conditions, of_participants] = r.test.freedom;
        [
            ("Metric", Cell::text(label.map_or(r.metric, |own| own.label))),
            ("F", Cell::number(r.test.f, 2)),
            ("df", Cell::number(of_conditions, 2)),
            ("df of the rest", Cell::number(of_participants, 2)),
            ("epsilon", Cell::number(r.test.epsilon, 3)),
            ("p", Cell::number(r.test.p, 4)),
            ("p (Holm)", Cell::number(r.p_holm, 4)),
            ("n", Cell::count(r.participants)),
        ]
    };
    Table::of_rows(
        format!(
            "All {} conditions together: analysis of variance within participants, its degrees of freedom times Greenhouse and \
             Geisser's epsilon; p (Holm) is corrected for the {} metrics.",
            results.conditions.len(),
            results.repeated.len()
        ),
        results.repeated.iter().map(row),
    )
}

/// Each metric by condition: mean and standard deviation over the participants' own means of the sessions that did not leave
/// the road, guided throughout or not; the study's notes say which were not.
fn by_condition(results: &StudyResults) -> Table {
    let mut columns = vec!["Metric".to_owned(), "Unit".to_owned()];
    for condition in &results.conditions {
        columns.extend([condition.clone(), "SD".into(), "n".into()]);
    }
    let row = |d: &Definition| {
        let mut cells = vec![Cell::text(d.label), Cell::text(d.unit)];
        for condition in &results.conditions {
            let each = of_participants(&results.sessions, condition, d);
            let values: Vec<f64> = each.into_iter().flatten().collect();
            let mean = mean(values.iter().copied());
            let deviation = mean.and_then(|mean| deviation(&values, mean));
            cells.extend([
                Cell::number(mean, 4),
                Cell::number(deviation, 4),
                Cell::count(values.len()),
            ]);
        }
        cells
    };
    Table::new(
        "Mean and standard deviation over n participants, each with the mean of the own repetitions; no session that left the road.",
        columns,
        DEFINITIONS.iter().map(row),
    )
}
