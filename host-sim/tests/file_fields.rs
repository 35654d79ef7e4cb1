//! What docs/files.md and examples/every-field.toml say of the fields, against the code: every field is there, its default is
//! the code's, and a value just outside its range is refused with the unit and the range that stand there.
//!
//! What is made of the lists of fields is compared with them, and written anew by `FIELDS=write cargo test -p host-sim
//! file_fields::`.

use std::collections::BTreeSet;
use std::path::Path;

use haptic_sim::fields::{Field, Range};
use haptic_sim::input::InputError;
use haptic_sim::models::road::{Course, SEGMENT_FIELDS};
use haptic_sim::scenario::{Scenario, TABLES};

/// The example that has every field with its unit, its range and its meaning.
const EXAMPLE: &str = "examples/every-field.toml";

/// A field as a document has it.
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

    /// The name that an error gives it: of a list, the value in the second place.
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
    let text = read("docs/files.md");
    let start = text.find(&format!("\n## {heading}\n")).unwrap() + 4;
    let section = text[start..].split("\n## ").next().unwrap();
    let bare = |cell: &str| cell.trim().trim_matches('`').to_owned();
    let row = |line: &str| {
        let cells: Vec<&str> = line.trim_matches('|').split('|').collect();
        let (name, [unit, range, default, meaning]) = match cells[..] {
            [name, unit, range, default, meaning] => (name, [unit, range, default, meaning]),
            [name, _symbol, unit, range, default, meaning] => (name, [unit, range, default, meaning]),
            _ => panic!("not five or six cells: {line}"),
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

fn read(file: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(file)).unwrap()
}

/// The fields of a scenario: those of the document's table, and those of the tables in the example.
fn fields_of_a_scenario() -> Vec<DocumentedField> {
    let mut all = rows("Scenario");
    let text = read(EXAMPLE);
    let mut table = "";
    for line in text.lines() {
        let bare = line.trim_start_matches("# ");
        if let Some(name) = bare.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
            table = name;
        } else if TABLES.iter().any(|(name, _)| *name == table) && bare.contains(" = ") {
            all.push(example_field(table, bare));
        }
    }
    all
}

/// A line of the example: `name = default # range unit: meaning`.
fn example_field(table: &str, line: &str) -> DocumentedField {
    let parts = |text: &'static str, line: &str| {
        let (left, right) = line
            .split_once(text)
            .unwrap_or_else(|| panic!("no {text:?}: {line}"));
        (left.to_owned(), right.to_owned())
    };
    let (field, rest) = parts(" = ", line);
    let (default, rest) = parts(" # ", &rest);
    let (range, meaning) = parts(": ", &rest);
    assert!(!meaning.trim().is_empty(), "{line}");
    // Behind the numbers of a range stands the unit.
    let words: Vec<&str> = range.split(' ').collect();
    let (range, unit) = match words[..] {
        [from, "to", to, unit] => (format!("{from} to {to}"), unit.to_owned()),
        _ => (range.clone(), String::new()),
    };
    let default = Some(default).filter(|default| default != "...");
    let table = table.to_owned();
    DocumentedField {
        table,
        field,
        unit,
        range,
        default,
    }
}

/// A scenario in which one field has a value.
fn scenario_text(row: &DocumentedField, value: &str) -> String {
    let set = |field: &str| format!("{field} = {value}\n");
    match row.table.as_str() {
        "" => set(&row.field),
        "speed" => match row.field.as_str() {
            "speed_m_per_s" => format!("[speed]\ntime_s = [0, 1000]\nspeed_m_per_s = [16, {value}]\n"),
            axis => format!("[speed]\n{axis} = [0, {value}]\nspeed_m_per_s = [16, 16]\n"),
        },
        "driver_change" => {
            let others = [("time_s", "1"), ("k_d_nm_per_rad", "2"), ("k_hg", "0.25")];
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

/// A scenario in which one field has a value, and a bar if the field is of one.
fn usable_text(row: &DocumentedField, value: &str) -> String {
    const KIND: &str = "[column]\nkind = \"torsion-bar\"\n";
    let text = scenario_text(row, value);
    match (row.table.as_str(), row.field.as_str()) {
        ("column", "kind") => text,
        ("column", _) => text.replace("[column]\n", KIND),
        ("assist", "inject") => format!("{KIND}{text}curve = \"light\"\n"),
        ("assist", _) => format!("{KIND}{text}"),
        _ => text,
    }
}

fn scenario(text: &str) -> Result<Scenario, String> {
    Scenario::from_toml("s", text, |name, _| Err(InputError::new(name, "not there")))
        .map_err(|e| e.to_string())
}

/// The fields that the code knows of a table, as its refusal of an unknown one lists them.
fn known(refusal: &str) -> BTreeSet<String> {
    let list = refusal.split_once(", expected ").expect(refusal).1;
    list.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

/// The default of a field as a file has it; none where a file has to give every field of the table. The first word is the default where there are words.
fn default_of(table: &str, field: &Field) -> Option<String> {
    match (field.range, field.default) {
        _ if table == "driver_change" => None,
        (_, Some(number)) => Some(number.to_string()),
        (Range::OneOf(words), _) => Some(format!("{:?}", words[0])),
        (Range::Flag, _) => Some("false".into()),
        _ => None,
    }
}

/// A field in the example that has every field; what has no default is a comment.
fn exemplified(table: &str, field: &Field) -> String {
    let either = |words: &[&str]| {
        let words: Vec<_> = words.iter().map(|word| format!("{word:?}")).collect();
        words.join(" or ")
    };
    let range = match field.range {
        Range::Between(from, to) if field.unit.is_empty() => format!("{from} to {to}"),
        Range::Between(from, to) => format!("{from} to {to} {}", field.unit),
        Range::OneOf(words) => either(words),
        Range::Whole => "whole numbers from 0".into(),
        Range::Flag => "true or false".into(),
    };
    let letters = |text: &str| text.replace(['_', '\''], "");
    let meaning = field.meaning.trim();
    let meaning = match field.symbol {
        symbol if letters(meaning).starts_with(&letters(symbol)) => meaning.to_owned(),
        symbol => format!("{symbol}, {meaning}"),
    };
    match default_of(table, field) {
        Some(default) => format!("{} = {default} # {range}: {meaning}\n", field.name),
        None => format!("# {} = ... # {range}: {meaning}\n", field.name),
    }
}

/// A field in the stub for Python.
fn typed(_table: &str, field: &Field) -> String {
    let kind = match field.range {
        Range::Between(..) => "float".into(),
        Range::OneOf(words) => {
            let words: Vec<_> = words.iter().map(|word| format!("{word:?}")).collect();
            let words = format!("Literal[{}]", words.join(", "));
            match field.name {
                // By points too.
                "curve" => format!("Union[{words}, CurveTable]"),
                _ => words,
            }
        }
        Range::Whole => "int".into(),
        Range::Flag => "bool".into(),
    };
    format!("    {}: {kind}\n", field.name)
}

/// A file whose lines behind `start(table)` are one for each field of the table.
fn made_of_the_lists(file: &str, start: impl Fn(&str) -> String, line: impl Fn(&str, &Field) -> String) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(file);
    let text = std::fs::read_to_string(&path).unwrap();
    let mut made = text.clone();
    for (table, fields) in TABLES {
        let start = start(table);
        let at = made
            .find(&start)
            .unwrap_or_else(|| panic!("{file}: no {start:?}"))
            + start.len();
        let rest = &made[at..];
        let is_field = |line: &&str| !line.trim().is_empty() && !line.starts_with("# [");
        let old: usize = rest
            .split_inclusive('\n')
            .take_while(is_field)
            .map(str::len)
            .sum();
        let lines: String = fields().iter().map(|field| line(table, field)).collect();
        made.replace_range(at..at + old, &lines);
    }
    if std::env::var("FIELDS").is_ok_and(|what| what == "write") {
        std::fs::write(&path, made).unwrap();
    } else {
        assert!(
            text == made,
            "{file} is not what the lists of fields make: FIELDS=write cargo test -p host-sim file_fields::"
        );
    }
}

#[test]
fn example_and_stub_are_made_of_the_lists() {
    let section = |table: &str| match table {
        "driver_change" => "\n# [driver_change]\n".into(),
        table => format!("\n[{table}]\n"),
    };
    made_of_the_lists(EXAMPLE, section, exemplified);
    let class = |table: &str| {
        let words = table.split('_').map(|word| word[..1].to_uppercase() + &word[1..]);
        let total = if table == "driver_change" {
            ""
        } else {
            ", total=False"
        };
        format!("\nclass {}Table(TypedDict{total}):\n", words.collect::<String>())
    };
    made_of_the_lists("bindings/python/python/haptic_guidance/_native.pyi", class, typed);
}

#[test]
fn every_default_of_a_scenario_is_the_codes() {
    for row in &fields_of_a_scenario() {
        if let Some(default) = &row.default {
            let text = scenario_text(row, default);
            assert_eq!(scenario(&text).as_ref(), Ok(&Scenario::default()), "{text}");
        }
    }
}

/// What is no list: the fields beside the tables, and the points of a speed.
#[test]
fn the_other_fields_of_a_scenario_are_in_the_table() {
    let documented = |table: &str| {
        let rows = rows("Scenario").into_iter().filter(|row| row.table == table);
        rows.map(|row| row.field).collect::<BTreeSet<_>>()
    };
    let mut top = known(&scenario("no_such_field = 1").unwrap_err());
    for table in TABLES.map(|(table, _)| table).iter().chain(&["speed"]) {
        assert!(top.remove(*table), "{table}");
    }
    // Named in the row of the speed that it stands in for.
    assert!(top.remove("speed_kmh"));
    assert_eq!(documented(""), top);
    // The refusal names the fields in words.
    let refusal = scenario("[speed]\nno_such_field = 1").unwrap_err();
    let speed = refusal.split('`').skip(1).step_by(2).map(str::to_owned);
    let speed = speed.filter(|field| field != "speed_kmh" && field != "no_such_field");
    assert_eq!(documented("speed"), speed.collect());
}

#[test]
fn every_range_of_a_scenario_is_the_codes() {
    let mut numbers = 0;
    for row in fields_of_a_scenario() {
        let refusal = |value: &str| scenario(&usable_text(&row, value)).err();
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
                let expected = if ["guidance.law", "guidance.torque_sensor"].contains(&row.refused().as_str())
                {
                    format!(
                        "s: {} = {value} is not a whole number from {from} to {to}",
                        row.refused()
                    )
                } else {
                    format!(
                        "s: {} = {value}{unit} is outside {}{unit}",
                        row.refused(),
                        row.range
                    )
                };
                assert_eq!(refusal(&value.to_string()), Some(expected));
            }
            for value in [from, to] {
                // Another field may have to follow; this one is not refused.
                let refusal = refusal(&value.to_string()).unwrap_or_default();
                let outside = format!("{} = {value}{unit} is outside", row.refused());
                assert!(!refusal.contains(&outside), "{refusal}");
            }
        } else if row.range.starts_with(['`', '"']) || row.range == "true or false" {
            for value in row.range.replace(" or ", ", ").split(", ") {
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
    let fields = TABLES.iter().flat_map(|(_, fields)| fields());
    let listed = fields
        .filter(|field| matches!(field.range, Range::Between(..)))
        .count();
    // Beside the lists: one speed, and the times, places and speeds of one that changes.
    assert_eq!(numbers, listed + 4, "fields with a range of numbers");
    assert!(numbers >= 94, "{numbers}");
}

/// Read with its comments it is a scenario of defaults too.
#[test]
fn the_example_with_every_field_is_a_scenario_of_defaults() {
    assert_eq!(scenario(&read(EXAMPLE)).as_ref(), Ok(&Scenario::default()));
}

#[test]
fn the_table_of_a_course_is_the_codes() {
    let course = |text: &str| Course::from_toml("c", text).map_err(|e| e.to_string());
    let rows = rows("Course");
    let fields = |table: &str| {
        let rows = rows.iter().filter(|row| row.table == table);
        rows.map(|row| row.field.clone()).collect::<BTreeSet<_>>()
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
        known(&course("[[segment]]\nlength_m = 9\nno_such_field = 1").unwrap_err())
    );
    let listed = SEGMENT_FIELDS.iter().map(|field| field.name.to_owned());
    assert_eq!(fields("segment"), listed.collect());
    for row in &rows {
        let text = |value: &str| match row.field.as_str() {
            "lane_width_m" => format!("lane_width_m = {value}\n[[segment]]\nlength_m = 9"),
            "length_m" => format!("[[segment]]\nlength_m = {value}"),
            pair if pair.contains("_start") => {
                let other = pair.replace("_start", "_end");
                format!("[[segment]]\nlength_m = 9\n{pair} = {value}\n{other} = 0")
            }
            pair if pair.contains("_end") => {
                let other = pair.replace("_end", "_start");
                format!("[[segment]]\nlength_m = 9\n{other} = 0\n{pair} = {value}")
            }
            field => format!("[[segment]]\nlength_m = 9\n{field} = {value}"),
        };
        if let Some(default) = &row.default {
            assert_eq!(
                course(&text(default)),
                course("[[segment]]\nlength_m = 9"),
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
