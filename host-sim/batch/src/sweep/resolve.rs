//! A sweep file as a text that needs no other file: what it names (scenario, tables, courses) stands in it.
//! Workers on other machines get this text, and results hold it.

use std::path::Path;

use haptic_sim::input::{InputError, parse_toml};
use haptic_sim::models::road::{Course, LaneChoice, PAPER_COURSE};
use haptic_sim::scenario::Scenario;
use toml::{Table, Value};

use super::file::SweepFile;
use super::value;
use crate::files::{self, Source, load_lane};

/// Reads a sweep file and all that it names.
pub(super) fn read(path: &Path) -> Result<String, InputError> {
    let (source, text) = Source::open(path)?;
    resolve(&source.name, &text, source.folder)
}

/// The text with what it names in `folder`.
pub(super) fn resolve(name: &str, text: &str, folder: &Path) -> Result<String, InputError> {
    let mut file = SweepFile::parse(name, text)?;
    let mut table: Table = parse_toml(name, text)?;
    let mut scenario = base(name, &file, folder)?;
    table.remove("base");
    for (i, of) in file.table.iter_mut().enumerate() {
        let Some(path) = of.file.take() else { continue };
        if of.columns.is_some() || of.rows.is_some() {
            return Err(InputError::new(
                name,
                format!("table {}: either file, or columns and rows", i + 1),
            ));
        }
        let csv = folder.join(&path);
        let (columns, rows) = value::read_csv(&csv.display().to_string(), &files::read(&csv)?)?;
        let mut whole = Table::new();
        whole.insert("choice".into(), Value::Boolean(of.choice));
        whole.insert(
            "columns".into(),
            Value::Array(columns.iter().cloned().map(Value::String).collect()),
        );
        whole.insert(
            "rows".into(),
            Value::Array(rows.iter().cloned().map(Value::Array).collect()),
        );
        if let Some(Value::Array(tables)) = table.get_mut("table") {
            tables[i] = Value::Table(whole);
        }
        (of.columns, of.rows) = (Some(columns), Some(rows));
    }
    let mut courses = file.courses.clone();
    let choice = LaneChoice {
        road: scenario
            .remove("road")
            .and_then(|road| road.as_str().map(String::from)),
        lane: scenario
            .remove("lane")
            .and_then(|lane| lane.as_integer())
            .and_then(|lane| i32::try_from(lane).ok()),
        turns: scenario
            .remove("turn")
            .and_then(|turns| turns.try_into().ok())
            .unwrap_or_default(),
    };
    for course in courses_of(name, &file, &scenario)? {
        if course != PAPER_COURSE && !courses.contains_key(&course) {
            let loaded = load_lane(&folder.join(&course), &choice)?;
            courses.insert(course.clone(), inline(name, &course, &loaded)?);
        }
    }
    table.insert("scenario".into(), Value::Table(scenario));
    if !courses.is_empty() {
        table.insert("courses".into(), Value::Table(courses));
    }
    toml::to_string(&table).map_err(|e| InputError::new(name, e))
}

/// The scenario that is varied, its course's path seen from the sweep file.
fn base(name: &str, file: &SweepFile, folder: &Path) -> Result<Table, InputError> {
    let path = match (&file.base, &file.scenario) {
        (Some(_), Some(_)) => return Err(InputError::new(name, "either base or [scenario]")),
        (None, scenario) => return Ok(scenario.clone().unwrap_or_default()),
        (Some(path), None) => Path::new(path),
    };
    let whole = folder.join(path);
    let mut scenario: Table = parse_toml(&whole.display().to_string(), &files::read(&whole)?)?;
    if let Some(Value::String(course)) = scenario.get_mut("course")
        && course != PAPER_COURSE
        && let Some(beside) = path.parent()
    {
        *course = beside.join(&*course).display().to_string();
    }
    Ok(scenario)
}

/// Every course that a drive may name.
fn courses_of(name: &str, file: &SweepFile, scenario: &Table) -> Result<Vec<String>, InputError> {
    let mut names: Vec<Value> = scenario.get("course").cloned().into_iter().collect();
    for axis in file.axes(name)? {
        let Some(at) = axis
            .columns
            .iter()
            .position(|column| column.paths.iter().any(|path| path == "course"))
        else {
            continue;
        };
        names.extend(axis.rows().into_iter().flatten().map(|row| row[at].clone()));
    }
    Ok(names
        .iter()
        .filter_map(|value| value.as_str().map(String::from))
        .collect())
}

/// A course as a scenario file holds it.
fn inline(file: &str, name: &str, course: &Course) -> Result<Value, InputError> {
    let scenario = Scenario::builder().course(course.clone()).speed_kmh(20.0).build();
    let text = scenario.map_err(|e| InputError::new(file, e))?.to_toml();
    let mut table: Table = parse_toml(file, &text)?;
    let mut course = table.remove("course").unwrap_or(Value::String(name.into()));
    if let Value::Table(course) = &mut course {
        // Where the file lay is no part of the result.
        course.insert("name".into(), Value::String(name.into()));
    }
    Ok(course)
}
