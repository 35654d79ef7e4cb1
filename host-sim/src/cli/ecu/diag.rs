//! `host-sim ecu diag COMMAND`: what a workshop's tester asks of an ECU on a bus, by UDS.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use haptic_pil::PilError;
use haptic_pil::diagnosis::{
    BENCH_KEY, Entry, Format, KEY_BYTES, Key, Reading, Tester, Trouble, codes, entries, named,
};
use haptic_report::document::Table;
use haptic_sim::input::{InputError, did_you_mean};
use serde_json::{Map, Value, json};

use super::super::{BadInput, Outcome, print, print_json, width};
use super::{Bus, failed, keys};

#[derive(Debug, Args)]
pub(in crate::cli) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// The faults that the ECU stored, with status, count, and what was so when each last appeared
    List(Bus),
    /// Forget the stored faults; one that is present comes back at once
    Clear(Bus),
    /// Versions, identity, live readings and parameters
    Read(Read),
    /// Have the ECU store new values of parameters, and start anew with them
    Write(Write),
    /// All that can be read and written, and every code of a fault; asks no ECU
    Describe(Describe),
}

#[derive(Debug, Args)]
struct Read {
    /// What to read, by the names of `ecu diag describe`; all without one
    #[arg(value_name = "NAME")]
    names: Vec<String>,
    #[command(flatten)]
    bus: Bus,
}

#[derive(Debug, Args)]
struct Write {
    /// A parameter and its new value, such as k_1=0.2
    #[arg(value_name = "NAME=VALUE", required = true)]
    values: Vec<String>,
    /// File with the ECU's key: 32 hexadecimal digits
    #[arg(
        long,
        value_name = "FILE",
        required_unless_present_any = ["bench_key", "keys"],
        conflicts_with_all = ["bench_key", "keys"]
    )]
    key: Option<PathBuf>,
    /// In its place: all keys of the ECU, of `cargo xtask keys`. An ECU with keys takes parameters at standstill only if the speeds are proven,
    /// which this command sends where nobody else does
    #[arg(long, value_name = "keys.toml", conflicts_with = "bench_key")]
    keys: Option<PathBuf>,
    /// The key of images for the bench, which everybody knows
    #[arg(long)]
    bench_key: bool,
    #[command(flatten)]
    bus: Bus,
}

#[derive(Debug, Args)]
struct Describe {
    /// Print it as one JSON object
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    match &arguments.command {
        Command::List(bus) => told(bus, Tester::troubles, |troubles| list(&troubles, bus.json)),
        Command::Clear(bus) => told(bus, Tester::clear, |()| {
            if bus.json {
                return print_json(&json!({ "cleared": true }));
            }
            print("the ECU has forgotten its stored faults")
        }),
        Command::Read(read) => {
            let entries = chosen(&read.names)?;
            let ask = |tester: &mut Tester| {
                let readings = entries.iter().map(|entry| Ok((*entry, tester.read(entry)?)));
                readings.collect::<Result<Vec<_>, _>>()
            };
            told(&read.bus, ask, |readings| show(&readings, read.bus.json))
        }
        Command::Write(write) => {
            let values = write.values.iter().map(|text| value(text));
            let values = values.collect::<Result<Vec<_>, InputError>>()?;
            let keys = write.keys.as_deref().map(keys::load).transpose()?;
            let (proofs, key) = match keys {
                Some((proofs, access)) => (Some(proofs), access),
                None => (None, key(write)?),
            };
            let ask = |tester: &mut Tester| {
                tester.prove(proofs.as_ref());
                let status = tester.write(&values, &key)?;
                let back = values.iter().map(|(entry, _)| Ok((*entry, tester.read(entry)?)));
                Ok((status.sequence, back.collect::<Result<Vec<_>, PilError>>()?))
            };
            told(&write.bus, ask, |(sequence, back)| {
                if !write.bus.json {
                    print(&format!("the ECU uses set {sequence} of its flash:\n"))?;
                }
                show(&back, write.bus.json)
            })
        }
        Command::Describe(describe) => description(describe.json).map(|()| Outcome::Good),
    }
}

/// Asks an ECU, and shows what it says.
fn told<T>(
    bus: &Bus,
    ask: impl FnOnce(&mut Tester) -> Result<T, PilError>,
    show: impl FnOnce(T) -> Result<(), BadInput>,
) -> Result<Outcome, BadInput> {
    match Tester::on(&bus.can).and_then(|mut tester| ask(&mut tester)) {
        Ok(answer) => show(answer).map(|()| Outcome::Good),
        Err(error) => failed(error),
    }
}

fn chosen(names: &[String]) -> Result<Vec<Entry>, InputError> {
    if names.is_empty() {
        return Ok(entries().collect());
    }
    names.iter().map(|name| entry(name)).collect()
}

fn entry(name: &str) -> Result<Entry, InputError> {
    let unknown = || {
        let near = did_you_mean(name, entries().map(|entry| entry.name));
        InputError::new(
            "ecu diag",
            format!("there is no '{name}'{near}; `ecu diag describe` lists the names"),
        )
    };
    named(name).ok_or_else(unknown)
}

/// `NAME=VALUE`, of something that can be written.
fn value(text: &str) -> Result<(Entry, Reading), InputError> {
    let wrong = |what: String| InputError::new("ecu diag write", what);
    let (name, number) = text
        .split_once('=')
        .ok_or_else(|| wrong(format!("'{text}' is not NAME=VALUE, such as k_1=0.2")))?;
    let entry = entry(name)?;
    if !entry.is_written {
        return Err(wrong(format!("{name} can only be read")));
    }
    let range = entry.range.map_or(String::new(), |[min, max]| {
        format!(" from {min} to {max} {}", entry.unit)
    });
    let bad = || wrong(format!("{name} = {number} is no number{range}"));
    let is_within = |number: f64| entry.range.is_none_or(|[min, max]| (min..=max).contains(&number));
    let parsed: f64 = number
        .parse()
        .ok()
        .filter(|number| is_within(*number))
        .ok_or_else(bad)?;
    let reading = match entry.format {
        Format::Float => Reading::Number(Some(parsed as f32)),
        _ => Reading::Whole(number.parse().map_err(|_| bad())?),
    };
    Ok((entry, reading))
}

fn key(write: &Write) -> Result<Key, InputError> {
    let Some(path) = &write.key else {
        return Ok(BENCH_KEY);
    };
    let wrong = |what: String| InputError::new(path.display().to_string(), what);
    let text = std::fs::read_to_string(path).map_err(|e| wrong(e.to_string()))?;
    let digits: String = text.split_whitespace().collect();
    keys::from_digits(&digits).ok_or_else(|| wrong(format!("a key is {} hexadecimal digits", 2 * KEY_BYTES)))
}

/// A code as workshops write it: C1111.
fn code(trouble: u32) -> String {
    // The upper two bits of three bytes are the letter, the next 14 the digits; the last byte is no part of the name.
    let letter = ["P", "C", "B", "U"][(trouble >> 22 & 3) as usize];
    format!("{letter}{:04X}", trouble >> 8 & 0x3FFF)
}

fn list(troubles: &[Trouble], json: bool) -> Result<(), BadInput> {
    let name = |trouble: &Trouble| {
        trouble
            .fault
            .map_or("unknown".into(), |fault| format!("{fault:?}"))
    };
    if json {
        let line = |trouble: &Trouble| {
            let snapshot = trouble.snapshot.iter();
            let snapshot = snapshot.map(|(entry, reading)| (entry.name.to_owned(), as_json(Some(reading))));
            json!({
                "code": code(trouble.code),
                "fault": name(trouble),
                "present": trouble.status & 0x01 != 0,
                "since_start": trouble.status & 0x02 != 0,
                "count": trouble.count,
                "snapshot": snapshot.collect::<Map<_, _>>(),
            })
        };
        return print_json(&json!({ "faults": troubles.iter().map(line).collect::<Vec<_>>() }));
    }
    if troubles.is_empty() {
        return print("the ECU has stored no fault");
    }
    let row = |trouble: &Trouble| {
        let of = |name: &str| {
            let found = trouble.snapshot.iter().find(|(entry, _)| entry.name == name);
            found.map_or("-".into(), |(_, reading)| text(Some(reading)))
        };
        let is = |bit: u8| if trouble.status & bit != 0 { "yes" } else { "no" };
        [
            code(trouble.code),
            name(trouble),
            is(0x01).into(),
            is(0x02).into(),
            trouble.count.map_or("-".into(), |count| count.to_string()),
            of("uptime"),
            of("mode"),
            of("guidance_torque"),
            of("driver_torque"),
            of("speed"),
        ]
    };
    let head = [
        "code",
        "fault",
        "present",
        "since start",
        "count",
        "at ms",
        "mode",
        "T_h N.m",
        "T_d N.m",
        "speed m/s",
    ];
    print(&Table::of_texts("", head, troubles.iter().map(row)).to_text(width()))
}

fn show(readings: &[(Entry, Option<Reading>)], json: bool) -> Result<(), BadInput> {
    if json {
        let lines = readings.iter();
        let lines = lines.map(|(entry, reading)| (entry.name.to_owned(), as_json(reading.as_ref())));
        return print_json(&lines.collect::<Map<_, _>>());
    }
    let row = |(entry, reading): &(Entry, Option<Reading>)| {
        [
            entry.name.to_owned(),
            text(reading.as_ref()),
            entry.unit.to_owned(),
            entry.meaning.trim().to_owned(),
        ]
    };
    let head = ["name", "value", "unit", "meaning"];
    print(&Table::of_texts("", head, readings.iter().map(row)).to_text(width()))
}

/// A reading; what the ECU does not know is a dash.
fn text(reading: Option<&Reading>) -> String {
    match reading {
        Some(Reading::Text(text)) => text.clone(),
        Some(Reading::Whole(number)) => number.to_string(),
        Some(Reading::Number(Some(number))) => number.to_string(),
        Some(Reading::Number(None)) | None => "-".into(),
    }
}

fn as_json(reading: Option<&Reading>) -> Value {
    match reading {
        Some(Reading::Text(text)) => text.as_str().into(),
        Some(Reading::Whole(number)) => (*number).into(),
        // Of the doubles that a binary32 stands for, the one with the fewest digits.
        Some(Reading::Number(Some(number))) => number.to_string().parse::<f64>().ok().into(),
        Some(Reading::Number(None)) | None => Value::Null,
    }
}

/// Format, in a word.
fn format_of(entry: &Entry) -> String {
    match entry.format {
        Format::Text => "text".into(),
        Format::Unsigned(bytes) => format!("u{}", 8 * u32::from(bytes)),
        _ => "f32".into(),
    }
}

fn description(json: bool) -> Result<(), BadInput> {
    let range = |entry: &Entry| entry.range.map_or(Value::Null, |[min, max]| json!([min, max]));
    if json {
        let data = entries().map(|entry| {
            json!({
                "id": entry.id,
                "name": entry.name,
                "format": format_of(&entry),
                "unit": entry.unit,
                "meaning": entry.meaning.trim(),
                "writable": entry.is_written,
                "range": range(&entry),
            })
        });
        let codes = codes().map(
            |(number, fault)| json!({ "dtc": number, "code": code(number), "fault": format!("{fault:?}") }),
        );
        return print_json(&json!({ "data": data.collect::<Vec<_>>(), "codes": codes.collect::<Vec<_>>() }));
    }
    let row = |entry: Entry| {
        [
            format!("{:04X}", entry.id),
            entry.name.to_owned(),
            format_of(&entry),
            entry.unit.to_owned(),
            if entry.is_written { "yes" } else { "no" }.into(),
            entry.meaning.trim().to_owned(),
        ]
    };
    let data = Table::of_texts(
        "",
        ["id", "name", "format", "unit", "written", "meaning"],
        entries().map(row),
    );
    let line = |(number, fault)| [code(number), format!("{number:06X}"), format!("{fault:?}")];
    let codes = Table::of_texts("", ["code", "DTC", "fault"], codes().map(line));
    print(&format!(
        "{}\n\n{}",
        data.to_text(width()),
        codes.to_text(width())
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_of_something_that_can_be_written_and_within_its_range() {
        let (entry, reading) = value("torque_limit_nm=3.5").unwrap();
        assert_eq!(
            (entry.name, reading),
            ("torque_limit_nm", Reading::Number(Some(3.5)))
        );
        assert_eq!(value("vehicle_number=7").unwrap().1, Reading::Whole(7));
        for (text, expected) in [
            ("torque_limit_nm", "NAME=VALUE"),
            ("torque_limit_nm=5.5", "to 5 N.m"),
            ("torque_limit_nm=soft", "no number"),
            ("vehicle_number=1.5", "no number"),
            ("mode=1", "only be read"),
            ("torque_limit=1", "torque_limit_nm"),
        ] {
            let error = value(text).unwrap_err().to_string();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }

    /// ISO 15031-6: two bits of system, two of the first digit, three digits.
    #[test]
    fn a_code_is_written_as_workshops_do() {
        assert_eq!(code(0x51_1100), "C1111");
        assert_eq!(code(0xC1_0000), "U0100");
        assert_eq!(code(0x04_2000), "P0420");
    }

    #[test]
    fn a_key_is_thirty_two_digits() {
        let file = |text: &str| {
            let path = std::env::temp_dir().join(format!("key-{}-{}", std::process::id(), text.len()));
            std::fs::write(&path, text).unwrap();
            let write = Write {
                values: vec![],
                key: Some(path.clone()),
                keys: None,
                bench_key: false,
                bus: Bus {
                    can: String::new(),
                    json: false,
                },
            };
            let key = key(&write);
            std::fs::remove_file(path).unwrap();
            key
        };
        assert_eq!(file("2b7e1516 28aed2a6 ABF71588 09cf4f3c\n").unwrap(), BENCH_KEY);
        for wrong in [
            "",
            "2b7e",
            "2b7e151628aed2a6abf7158809cf4f3",
            "2b7e151628aed2a6abf7158809cf4f3c0",
            "zb7e151628aed2a6abf7158809cf4f3cx1",
        ] {
            assert!(
                file(wrong).unwrap_err().to_string().contains("32 hexadecimal"),
                "{wrong}"
            );
        }
    }
}
