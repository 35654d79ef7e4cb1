//! The tables of docs/files.md against the code: every field is there, its default is the code's, and a value
//! just outside its range is refused with the table's unit and range.

use std::collections::BTreeSet;
use std::path::Path;

use haptic_sim::input::InputError;
use haptic_sim::models::road::Course;
use haptic_sim::scenario::Scenario;

/// A row of a table.
#[derive(Debug, Clone)]
struct DocumentedField {
    /// Table of the field in the file; empty at the top.
    table: String,
    field: String,
    unit: String,
    range: String,
    /// None where the field has to be given.
    default: Option<String>,
}

impl DocumentedField {
    fn name(&self) -> String {
        match self.table.as_str() {
            "" => self.field.clone(),
            table => format!("{table}.{}", self.field),
        }
    }

    /// As an error names it: of a list, the value in the second place.
    fn refused(&self) -> String {
        let place = if self.table == "speed" { " (point 2)" } else { "" };
        self.name() + place
    }

    /// The ends of the range, if it is one of numbers.
    fn ends(&self) -> Option<[f64; 2]> {
        let (from, to) = self.range.split_once(" to ")?;
        Some([from.parse().ok()?, to.parse().ok()?])
    }
}

/// The rows below a heading of the document.
fn rows(heading: &str) -> Vec<DocumentedField> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/files.md");
    let text = std::fs::read_to_string(path).unwrap();
    let start = text.find(&format!("\n## {heading}\n")).unwrap() + 4;
    let section = text[start..].split("\n## ").next().unwrap();
    let bare = |cell: &str| cell.trim().trim_matches('`').to_owned();
    let row = |line: &str| {
        let cells: Vec<&str> = line.trim_matches('|').split('|').collect();
        let [name, unit, range, default, meaning] = cells[..] else {
            panic!("not five cells: {line}");
        };
        assert!(!meaning.trim().is_empty(), "{line}");
        let name = bare(name);
        let (table, field) = name.split_once('.').unwrap_or(("", &name));
        DocumentedField {
            table: table.into(),
            field: field.into(),
            unit: bare(unit),
            range: range.trim().into(),
            default: Some(bare(default)).filter(|default| default != "none"),
        }
    };
    section
        .lines()
        .filter(|line| line.starts_with("| `"))
        .map(row)
        .collect()
}

/// A scenario in which one field has a value.
fn scenario_text(row: &DocumentedField, value: &str) -> String {
    let set = |field: &str| format!("{field} = {value}\n");
    match row.table.as_str() {
        "" => set(&row.field),
        "speed" => match row.field.as_str() {
            "kmh" => format!("[speed]\ntime = [0, 1000]\nkmh = [60, {value}]\n"),
            axis => format!("[speed]\n{axis} = [0, {value}]\nkmh = [60, 60]\n"),
        },
        "driver_change" => {
            let others = [("time", "1"), ("K_d", "2"), ("K_hg", "0.25")];
            let line = |(field, other): (&str, &str)| {
                if field == row.field {
                    set(field)
                } else {
                    format!("{field} = {other}\n")
                }
            };
            others
                .into_iter()
                .map(line)
                .fold("[driver_change]\n".into(), |text, line| text + &line)
        }
        table => format!("[{table}]\n{}", set(&row.field)),
    }
}

fn scenario(text: &str) -> Result<Scenario, String> {
    Scenario::from_toml("s", text, |name, _| Err(InputError::new(name, "not there")))
        .map_err(|e| e.to_string())
}

/// The fields that the code knows of a table, as its refusal of an unknown one lists them. Spellings with and
/// without capitals and underscores are one field.
fn known(refusal: &str) -> BTreeSet<String> {
    let list = refusal.split_once(", expected ").expect(refusal).1;
    list.split('`').skip(1).step_by(2).map(spelling).collect()
}

fn spelling(field: &str) -> String {
    field.to_lowercase().replace('_', "")
}

#[test]
fn every_field_of_a_scenario_is_in_the_table_with_its_default() {
    let rows = rows("Scenario");
    let tables = [
        "driver",
        "vehicle",
        "guidance",
        "failure",
        "driver_change",
        "world",
        "sensor_errors",
        "tolerances",
    ];
    for table in std::iter::once("").chain(tables) {
        let probe = match table {
            "" => "no_such_field = 1".to_owned(),
            table => format!("[{table}]\nno_such_field = 1"),
        };
        let mut code = known(&scenario(&probe).unwrap_err());
        if table.is_empty() {
            for sub in tables {
                assert!(code.remove(&spelling(sub)), "{sub}");
            }
        }
        let document = rows
            .iter()
            .filter(|row| row.table == table)
            .map(|row| spelling(&row.field));
        assert_eq!(document.collect::<BTreeSet<_>>(), code, "table {table:?}");
    }
    // A number or a table: the refusal names the fields in words.
    let refusal = scenario("[speed]\nno_such_field = 1").unwrap_err();
    let code: BTreeSet<_> = refusal.split('`').skip(1).step_by(2).map(spelling).collect();
    let document = rows.iter().filter(|row| row.table == "speed");
    assert_eq!(
        document.map(|row| spelling(&row.field)).collect::<BTreeSet<_>>(),
        code
    );
    for row in &rows {
        match &row.default {
            Some(default) => {
                let text = scenario_text(row, default);
                assert_eq!(scenario(&text).as_ref(), Ok(&Scenario::default()), "{text}");
            }
            None => assert!(
                ["driver_change", "failure", "speed", "tolerances"].contains(&row.table.as_str())
                    || ["an id", "a list of ids"].contains(&row.range.as_str()),
                "{row:?}"
            ),
        }
    }
}

#[test]
fn every_range_of_a_scenario_is_the_codes() {
    let mut numbers = 0;
    for row in rows("Scenario") {
        let refusal = |value: &str| scenario(&scenario_text(&row, value)).err();
        if let Some([from, to]) = row.ends() {
            numbers += 1;
            let unit = if row.unit.is_empty() {
                String::new()
            } else {
                format!(" {}", row.unit)
            };
            // Nothing is above a range without an upper end.
            let beyond = if to.is_finite() { 1e-3 * (to - from) } else { 1.0 };
            let outside = [from - beyond, to + beyond];
            for value in outside.into_iter().filter(|value| value.is_finite()) {
                let expected = format!(
                    "s: {} = {value}{unit} is outside {}{unit}",
                    row.refused(),
                    row.range
                );
                assert_eq!(refusal(&value.to_string()), Some(expected));
            }
            for value in [from, to] {
                // Another field may have to follow; this one is not refused.
                let refusal = refusal(&value.to_string()).unwrap_or_default();
                let outside = format!("{} = {value}{unit} is outside", row.refused());
                assert!(!refusal.contains(&outside), "{refusal}");
            }
        } else if row.range.starts_with('`') {
            for value in row.range.split(", ") {
                let value = value.trim_matches('`');
                assert_eq!(refusal(value), None, "{}", row.name());
            }
            let refusal = refusal("\"no such choice\"").unwrap();
            assert!(refusal.contains("no such choice"), "{refusal}");
        } else {
            assert!(
                ["a file", "an id", "a list of ids", "whole numbers from 0"].contains(&row.range.as_str()),
                "{row:?}"
            );
        }
    }
    assert_eq!(numbers, 94, "fields with a range of numbers");
}

#[test]
fn the_example_with_every_field_has_every_field() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/every-field.toml");
    let text = std::fs::read_to_string(path).unwrap();
    let mut table = String::new();
    let mut found = BTreeSet::new();
    for line in text.lines() {
        // A field that another one decides is there as a comment.
        let line = line.trim_start_matches("# ");
        if let Some(name) = line.strip_prefix('[').and_then(|rest| rest.split(']').next()) {
            table = format!("{name}.");
        } else if let Some((field, _)) = line.split_once(" = ") {
            found.insert(format!("{table}{field}"));
        }
    }
    let document: BTreeSet<_> = rows("Scenario").iter().map(DocumentedField::name).collect();
    assert_eq!(found, document);
}

#[test]
fn the_table_of_a_course_is_the_codes() {
    let course = |text: &str| Course::from_toml("c", text).map_err(|e| e.to_string());
    let rows = rows("Course");
    let fields = |table: &str| {
        let rows = rows.iter().filter(|row| row.table == table);
        rows.map(|row| spelling(&row.field)).collect::<BTreeSet<_>>()
    };
    let mut top = known(
        &course("no_such_field = 1")
            .unwrap_err()
            .replace("expected `", "expected one of `"),
    );
    assert!(top.remove("segment"));
    assert_eq!(fields(""), top);
    assert_eq!(
        fields("segment"),
        known(&course("[[segment]]\nlength = 9\nno_such_field = 1").unwrap_err())
    );
    for row in &rows {
        let text = |value: &str| match row.field.as_str() {
            "lane_width" => format!("lane_width = {value}\n[[segment]]\nlength = 9"),
            "length" => format!("[[segment]]\nlength = {value}"),
            pair if pair.ends_with("_start") => {
                let other = pair.replace("_start", "_end");
                format!("[[segment]]\nlength = 9\n{pair} = {value}\n{other} = 0")
            }
            pair if pair.ends_with("_end") => {
                let other = pair.replace("_end", "_start");
                format!("[[segment]]\nlength = 9\n{other} = 0\n{pair} = {value}")
            }
            field => format!("[[segment]]\nlength = 9\n{field} = {value}"),
        };
        if let Some(default) = &row.default {
            assert_eq!(
                course(&text(default)),
                course("[[segment]]\nlength = 9"),
                "{row:?}"
            );
        }
        let [from, to] = row.ends().unwrap();
        let place = if row.table.is_empty() { "" } else { "segment 1: " };
        for value in [from - 1e-3 * (to - from), to + 1e-3 * (to - from)] {
            let (field, unit, range) = (&row.field, &row.unit, &row.range);
            let unit = if unit.is_empty() {
                String::new()
            } else {
                format!(" {unit}")
            };
            let expected = format!("c: {place}{field} = {value}{unit} is outside {range}{unit}");
            assert_eq!(course(&text(&value.to_string())), Err(expected));
        }
        for value in [from, to] {
            assert!(course(&text(&value.to_string())).is_ok(), "{row:?}");
        }
    }
}
