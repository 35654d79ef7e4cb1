//! `host-sim convert IN [OUT]`.

use std::path::{Path, PathBuf};

use clap::Args;
use haptic_log::formats::{self, Contents, Format};
use haptic_log::notes::Notes;
use haptic_log::recording::{Recording, RecordingError};
use haptic_report::document::{Cell, Table};
use serde::Serialize;

use super::recording::ReadingArguments;
use super::{BadInput, Outcome, in_file, output, print, print_json, width};

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
    channels: Vec<Channel>,
    /// What was left out, merged, cut, mended, guessed or converted.
    notes: &'a Notes,
}

#[derive(Serialize)]
struct Channel {
    name: String,
    unit: String,
    source: String,
    sample_rate_hz: f64,
    samples: usize,
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
    let wants_frames = target.is_some_and(Format::holds_frames);
    let mut recording = match arguments.reading.read(&arguments.input, wants_frames)? {
        Contents::Channels(recording) => recording,
        Contents::Frames(frames, notes) => {
            if arguments.rate.is_some() {
                return Err("--rate is for channels, not for frames".into());
            }
            let output = arguments.output.as_deref().unwrap_or(Path::new(""));
            formats::write_frames(output, &frames)?;
            print_reading(&notes);
            eprintln!("{}: {} frames", output.display(), frames.len());
            return Ok(Outcome::Good);
        }
    };
    let named = in_file::<RecordingError>(&arguments.input);
    if let Some(rate_hz) = arguments.rate {
        let even = recording
            .resampled(rate_hz, arguments.reading.max_gap()?)
            .map_err(&named)?;
        recording.groups = vec![even];
    }
    let table = recording.table();
    let Some(output) = &arguments.output else {
        if arguments.json {
            let channels = table.into_iter().map(|line| Channel {
                name: line.name,
                unit: line.unit,
                source: line.source,
                sample_rate_hz: line.sample_rate_hz,
                samples: line.samples,
            });
            print_json(&Listed {
                channels: channels.collect(),
                notes: &recording.notes,
            })?;
        } else {
            let notes: String = recording.notes.iter().map(|note| format!("\n{note}")).collect();
            let space = if notes.is_empty() { "" } else { "\n" };
            let table = listed(&recording).to_text(width());
            print(&format!("{}{space}{notes}", table.trim_end()))?;
        }
        return Ok(Outcome::Good);
    };
    print_reading(&recording.notes);
    formats::write(output, recording)?;
    eprintln!("{}: {} channels", output.display(), table.len());
    Ok(Outcome::Good)
}

/// What the file that is written does not hold as the other did, on stderr.
pub(super) fn print_reading(notes: &Notes) {
    for note in notes.iter() {
        eprintln!("note: {note}");
    }
}

fn listed(recording: &Recording) -> Table {
    let row = |line: haptic_log::recording::Line| {
        [
            ("Channel", Cell::Text(line.name)),
            ("Unit", Cell::Text(line.unit)),
            ("Source", Cell::Text(line.source)),
            ("Rate (Hz)", Cell::number(line.sample_rate_hz, 3)),
            ("Values", Cell::Text(line.samples.to_string())),
        ]
    };
    Table::of_rows("", recording.table().into_iter().map(row))
}
