//! A study file, checked: every session's scenario is built before anything is driven.

use haptic_sim::input::{InputError, RangeError, parse_toml};
use haptic_sim::participants::participant;
use haptic_sim::scenario::{FailureKind, Scenario};
use haptic_sim::seeds::named;
use serde::Deserialize;
use toml::{Table, Value};

use super::{Order, Session, Study, Subject};
use crate::files::{Source, check_names, merge, one};
use crate::paper::{REMNANT_GUIDED_NM, REMNANT_MANUAL_NM};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StudyFile {
    name: String,
    #[serde(default = "one")]
    seed: u64,
    #[serde(default)]
    order: Order,
    #[serde(default = "one")]
    repetitions: u64,
    #[serde(default)]
    scenario: Table,
    condition: Vec<ConditionFile>,
    participant: Vec<ParticipantFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ConditionFile {
    name: String,
    #[serde(default)]
    scenario: Table,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ParticipantFile {
    name: String,
    published: Option<u32>,
    driver: Option<Table>,
    #[serde(default)]
    person: bool,
}

/// Most times that a participant drives under each condition.
const MOST_REPETITIONS: f64 = 100.0;

pub(super) fn from_text(source: &Source, text: &str) -> Result<Study, InputError> {
    let file: StudyFile = parse_toml(&source.name, text)?;
    check_names(source, "study", [&file.name])?;
    check_names(source, "condition", file.condition.iter().map(|c| &c.name))?;
    check_names(source, "participant", file.participant.iter().map(|p| &p.name))?;
    let repetitions = source.count("repetitions", file.repetitions, 1.0, MOST_REPETITIONS)?;
    let rows = file.order.rows(file.condition.len());
    let mut sessions = Vec::new();
    for (number, participant) in file.participant.iter().enumerate() {
        // Each repetition is a block with every condition once, in the next order.
        for block in 0..repetitions as usize {
            let order = &rows[(number + block) % rows.len()];
            for (place, condition) in order.iter().enumerate() {
                let condition = &file.condition[*condition];
                let session = session(source, &file, participant, condition, block + 1)?;
                sessions.push(Session {
                    position: block * order.len() + place + 1,
                    ..session
                });
            }
        }
    }
    let mut notes = Vec::new();
    if !file.participant.len().is_multiple_of(rows.len()) {
        notes.push(format!(
            "{} participants share {} orders: some orders come once more than others",
            file.participant.len(),
            rows.len()
        ));
    }
    Ok(Study {
        name: file.name,
        conditions: file.condition.into_iter().map(|c| c.name).collect(),
        sessions,
        notes,
    })
}

/// The session of a participant under a condition, in the first place.
fn session(
    source: &Source,
    file: &StudyFile,
    participant: &ParticipantFile,
    condition: &ConditionFile,
    repetition: usize,
) -> Result<Session, InputError> {
    let here = format!(
        "{}: participant {}, condition {}",
        source.name, participant.name, condition.name
    );
    let bad = |message: String| InputError::new(&here, message);
    let mut fields = file.scenario.clone();
    merge(&mut fields, &condition.scenario);
    if fields.contains_key("seed") {
        return Err(bad(
            "seed: every session has its own, from the study's seed".into()
        ));
    }
    let manual = fields.get("condition").and_then(Value::as_str) == Some("manual");
    let mut put_driver = |driver| {
        let driver = Table::from_iter([("driver".into(), Value::Table(driver))]);
        merge(&mut fields, &driver);
    };
    let who = match (participant.published, &participant.driver, participant.person) {
        (None, None, true) => Subject::Person,
        (Some(number), None, false) => {
            put_driver(of_published(number, manual).map_err(|e| bad(e.to_string()))?);
            Subject::Simulated
        }
        (None, Some(given), false) => {
            let mut given = given.clone();
            if manual {
                // There is nothing to resist.
                given.remove("k_hg");
            }
            put_driver(given);
            Subject::Simulated
        }
        _ => return Err(bad("one of published, driver and person = true is wanted".into())),
    };
    // 53 bits, which every reader of a number takes whole.
    let first = named(named(file.seed, &participant.name), &condition.name);
    let seed = match repetition {
        1 => first,
        later => named(first, &later.to_string()),
    } >> 11;
    fields.insert("seed".into(), Value::Integer(seed as i64));
    let scenario = Scenario::from_toml(&here, &fields.to_string(), |course, lane| {
        source.course(course, lane)
    })?;
    scenario.check_times().map_err(|e| bad(e.to_string()))?;
    if who == Subject::Person && scenario.failure().kind != FailureKind::None {
        return Err(bad(
            "failure: a person's recording does not say when it came; only simulated \
                        participants can have one"
                .into(),
        ));
    }
    Ok(Session {
        participant: participant.name.clone(),
        condition: condition.name.clone(),
        position: 1,
        repetition,
        who,
        scenario,
    })
}

/// The driver of table 5 or 6, with the remnant that belongs to it.
fn of_published(number: u32, manual: bool) -> Result<Table, RangeError> {
    let found = participant("published", number)?;
    let (driver, remnant_nm) = if manual {
        (found.manual, REMNANT_MANUAL_NM)
    } else {
        (found.guided, REMNANT_GUIDED_NM)
    };
    let mut fields = Table::new();
    for (name, value) in [
        ("a_1_rad_per_m", Some(driver.a_1)),
        ("a_2_rad_per_m_s", Some(driver.a_2)),
        ("a_3", Some(driver.a_3)),
        ("t_p_s", Some(driver.t_p)),
        ("k_d_nm_per_rad", Some(driver.k_d)),
        ("k_hg", driver.k_hg),
        ("remnant_sd_nm", Some(remnant_nm)),
    ] {
        if let Some(value) = value {
            fields.insert(name.into(), Value::Float(value));
        }
    }
    Ok(fields)
}
