//! `host-sim convert IN [OUT]`.

use std::path::PathBuf;

use clap::Args;
use haptic_log::formats::dbc::Signals;
use haptic_log::formats::{self, BusLog, Contents, Format};
use haptic_log::notes::Notes;
use haptic_log::recording::{Line, Recording, RecordingError};
use haptic_report::document::{Cell, Table};
use serde::Serialize;

use super::recording::ReadingArguments;
use super::{BadInput, Outcome, in_file, output, print, print_json, print_notes, progress, width};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Recording to read; its extension says the format: .csv, .parquet, .mat, .mf4, .log (candump), .asc, .blf
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// File to write, in the format of its extension, one of those. Without it the channels are listed
    #[arg(value_name = "OUT")]
    output: Option<PathBuf>,
    #[command(flatten)]
    reading: ReadingArguments,
    /// Put all channels on an even grid of so many rows a second: whole numbers as held, others on the line between
    /// neighbours. Without it every instant of every channel is a row
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Print the channels as JSON instead of a table
    #[arg(long, conflicts_with = "output")]
    json: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Listed<'a> {
    channels: Vec<Line>,
    /// What was left out, merged, cut, mended, guessed or converted.
    notes: &'a Notes,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    if let Some(rate_hz) = arguments.rate.filter(|rate| !(0.1..=1e5).contains(rate)) {
        return Err(format!("--rate {rate_hz}: 0.1 to 100000 Hz is wanted").into());
    }
    if let Some(output) = &arguments.output
        && output.exists()
        && !output::is_forced()
    {
        return Err(in_file(output)(
            "the file is there already; --force writes over it",
        ));
    }
    let target = arguments.output.as_deref().map(Format::from_path).transpose()?;
    let recording = match arguments.reading.read(&arguments.input)? {
        Contents::Channels(recording) => on_grid(arguments, recording)?,
        Contents::Frames(log) => {
            let (log, bar) = progress::of_log(log);
            let read = of_bus(arguments, &log, target);
            bar.finish_and_clear();
            match read? {
                Some(recording) => recording,
                None => return Ok(Outcome::Good),
            }
        }
    };
    let Some(output) = &arguments.output else {
        list(recording.table(), &recording.notes, arguments.json)?;
        return Ok(Outcome::Good);
    };
    let count = recording.table().len();
    print_notes(recording.notes.iter());
    formats::write(output, recording)?;
    eprintln!("{}: {count} channels", output.display());
    Ok(Outcome::Good)
}

/// The channels on the grid that is asked for.
fn on_grid(arguments: &Arguments, mut recording: Recording) -> Result<Recording, BadInput> {
    if let Some(rate_hz) = arguments.rate {
        let even = recording.resampled(rate_hz, arguments.reading.max_gap()?);
        recording.groups = vec![even.map_err(in_file(&arguments.input))?];
    }
    Ok(recording)
}

/// What a log of frames becomes, where that needs its whole table; all else is done here, frame by frame.
fn of_bus(
    arguments: &Arguments,
    log: &BusLog,
    target: Option<Format>,
) -> Result<Option<Recording>, BadInput> {
    let named = in_file::<RecordingError>(&arguments.input);
    if let (Some(output), Some(true)) = (&arguments.output, target.map(Format::holds_frames)) {
        if arguments.rate.is_some() {
            return Err("--rate is for channels, not for frames".into());
        }
        let (count, notes) = formats::write_frames(output, log)?;
        print_notes(notes.iter());
        eprintln!("{}: {count} frames", output.display());
        return Ok(None);
    }
    let is_table = target.is_some_and(|format| format != Format::Csv) && arguments.rate.is_none();
    if is_table || arguments.reading.renames() {
        let recording = arguments.reading.channels(&arguments.input, log)?;
        return on_grid(arguments, recording).map(Some);
    }
    let signals = Signals::of(log, &arguments.reading.dbc()?).map_err(&named)?;
    if let Some(rate_hz) = arguments.rate {
        let even = signals.resampled(rate_hz, arguments.reading.max_gap()?);
        let mut recording = Recording::of(even.map_err(named)?);
        recording.notes = signals.notes;
        return Ok(Some(recording));
    }
    let table = signals.table();
    let Some(output) = &arguments.output else {
        list(table, &signals.notes, arguments.json)?;
        return Ok(None);
    };
    print_notes(signals.notes.iter());
    signals.write_table(output)?;
    eprintln!("{}: {} channels", output.display(), table.len());
    Ok(None)
}

/// Prints the channels, and below them what was left out.
fn list(channels: Vec<Line>, notes: &Notes, json: bool) -> Result<(), BadInput> {
    if json {
        return print_json(&Listed { channels, notes });
    }
    let said: String = notes.iter().map(|note| format!("\n{note}")).collect();
    let space = if said.is_empty() { "" } else { "\n" };
    let table = listed(channels).to_text(width());
    print(&format!("{}{space}{said}", table.trim_end()))
}

fn listed(table: Vec<Line>) -> Table {
    let row = |line: Line| {
        [
            ("Channel", Cell::Text(line.name)),
            ("Unit", Cell::Text(line.unit)),
            ("Source", Cell::Text(line.source)),
            ("Rate (Hz)", Cell::number(line.sample_rate_hz, 3)),
            ("Values", Cell::Text(line.samples.to_string())),
        ]
    };
    Table::of_rows("", table.into_iter().map(row))
}
